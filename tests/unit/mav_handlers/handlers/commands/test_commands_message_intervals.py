# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Commands that set and tell intervals: what the ten buckets and the timers make of them."""

from typing import TYPE_CHECKING

import pytest

from mav_handlers.wire.codec import message_id
from mav_handlers.wire.messages import COMMAND_ACK, COMMAND_LONG, HEARTBEAT, MESSAGE_INTERVAL

if TYPE_CHECKING:
    from tests.unit.mav_handlers.conftest import Bench, Client, MakeBench

ACCEPTED, TEMPORARILY_REJECTED, DENIED = 0, 1, 2
GET, SET = 510, 511
ATTITUDE, PARAM_VALUE = 30, 22
TEN = (
    "AHRS",
    "AHRS2",
    "VFR_HUD",
    "SYS_STATUS",
    "POWER_STATUS",
    "MEMINFO",
    "RAW_IMU",
    "SYSTEM_TIME",
    "VIBRATION",
    "HOME_POSITION",
)


@pytest.fixture
def filter_starts() -> bool:
    return False


def interval_us(client: "Client", number: int) -> int:
    client.tell(COMMAND_LONG(1, 1, GET, 0, number, *(0.0,) * 6))
    interval, ack = client.read()
    assert isinstance(interval, MESSAGE_INTERVAL)
    assert isinstance(ack, COMMAND_ACK)
    assert (interval.message_id, ack.result) == (number, ACCEPTED)
    return interval.interval_us


def test_interval_that_finds_no_bucket_is_told_as_the_nearest(client: "Client") -> None:
    for number, name in enumerate(TEN, start=1):
        assert client.command(SET, message_id(name), number * 100_000) == ACCEPTED
    assert client.command(SET, ATTITUDE, 330_000) == ACCEPTED
    assert interval_us(client, ATTITUDE) == 300_000


def test_heartbeat_needs_no_bucket(client: "Client") -> None:
    for number, name in enumerate(TEN, start=1):
        client.command(SET, message_id(name), number * 100_000)
    assert client.command(SET, message_id("HEARTBEAT"), 330_000) == ACCEPTED
    assert interval_us(client, message_id("HEARTBEAT")) == 330_000


@pytest.mark.parametrize(
    ("wanted_us", "told_us"), [(0, 100_000), (-1, 100_000), (20_000, 20_000), (5_000_000, 1_000_000)]
)
def test_parameter_pump_has_an_interval_and_cannot_be_stopped(client: "Client", wanted_us: int, told_us: int) -> None:
    assert client.command(SET, PARAM_VALUE, wanted_us) == ACCEPTED
    assert interval_us(client, PARAM_VALUE) == told_us


def test_default_that_is_too_fast_is_refused(make_bench: "MakeBench") -> None:
    bench = make_bench(MAV1_EXTRA1=500)
    assert interval_us(bench.client, ATTITUDE) == 3000
    assert bench.client.command(SET, ATTITUDE, 0) == DENIED


def test_interval_is_not_told_without_room_for_it_and_the_answer(client: "Client") -> None:
    while client.channel.txspace() >= 22:
        client.channel.send(HEARTBEAT(6, 8, 0, 0, 4, 3))
    before = client.channel.codec.frames_sent
    client.tell(COMMAND_LONG(1, 1, GET, 0, ATTITUDE, *(0.0,) * 6))
    assert client.channel.codec.frames_sent == before + 1
    assert client.acknowledged() == TEMPORARILY_REJECTED


def test_message_on_its_own_starts_after_its_interval(bench: "Bench", client: "Client") -> None:
    client.command(SET, ATTITUDE, 500_000)
    bench.run_ms(497)
    assert ATTITUDE not in {frame.header.message_id for frame in client.read_received()}
    bench.run_ms(3)
    assert ATTITUDE in {frame.header.message_id for frame in client.read_received()}
