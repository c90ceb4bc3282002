# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""When periodic messages are due."""

from typing import TYPE_CHECKING

import pytest

from mav_handlers.channel import Channel, ParamListState
from mav_handlers.intervals import default_interval_ms, due_messages, set_interval, stream_interval_ms
from mav_handlers.senders import SENDERS
from mav_handlers.wire.codec import Codec

if TYPE_CHECKING:
    from tests.unit.mav_handlers.conftest import MakeBench


@pytest.fixture
def channel() -> Channel:
    return Channel(0, "link", Codec(1, 1))


def due_times_ms(channel: Channel, until_ms: int, step_ms: int = 1) -> list[int]:
    return [now_ms for now_ms in range(0, until_ms + 1, step_ms) if due_messages(channel, now_ms * 1000)]


def downloading(channel: Channel) -> None:
    channel.param_list = ParamListState(0, 100, 0)


@pytest.mark.parametrize(
    ("rate_hz", "interval_ms"),
    [
        (0, None),
        (1, 1000),
        (3, 333),
        (4, 250),
        (50, 20),
        (333, 3),
        (400, 3),
        (1000, 3),
        (1001, None),
        (32767, None),
        (-1, 60_000),
        (-1000, 60_000),
        (-1001, None),
    ],
)
def test_interval_of_a_rate(rate_hz: int, interval_ms: int | None) -> None:
    assert stream_interval_ms(rate_hz) == interval_ms


@pytest.mark.parametrize(
    ("name", "interval_ms"), [("HEARTBEAT", 1000), ("ATTITUDE", 100), ("SYS_STATUS", None), ("HOME_POSITION", None)]
)
def test_default_interval(make_bench: "MakeBench", name: str, interval_ms: int | None) -> None:
    bench = make_bench(MAV1_EXTRA1=10, MAV1_POSITION=5)
    assert default_interval_ms(bench.vehicle, bench.client.channel, name) == interval_ms


def test_message_is_due_at_every_interval(channel: Channel) -> None:
    set_interval(channel, "ATTITUDE", 100, 0)
    assert due_times_ms(channel, 350) == [100, 200, 300]


def test_message_keeps_its_phase_when_the_loop_is_late(channel: Channel) -> None:
    set_interval(channel, "ATTITUDE", 100, 0)
    assert due_times_ms(channel, 500, step_ms=70) == [140, 210, 350, 420]


def test_missed_turns_are_not_made_up_for(channel: Channel) -> None:
    set_interval(channel, "ATTITUDE", 100, 0)
    assert due_messages(channel, 350_000) == ["ATTITUDE"]
    assert due_messages(channel, 449_000) == []
    assert due_messages(channel, 450_000) == ["ATTITUDE"]


def test_stopped_message_is_never_due(channel: Channel) -> None:
    set_interval(channel, "ATTITUDE", 100, 0)
    set_interval(channel, "ATTITUDE", None, 0)
    assert due_messages(channel, 10_000_000) == []


def test_messages_of_a_burst_come_in_the_firmware_s_order(channel: Channel) -> None:
    for name in reversed(list(SENDERS)):
        set_interval(channel, name, 100, 0)
    assert due_messages(channel, 100_000) == list(SENDERS)


def test_everything_is_four_times_slower_during_a_parameter_list(channel: Channel) -> None:
    set_interval(channel, "ATTITUDE", 250, 0)
    downloading(channel)
    assert due_times_ms(channel, 2000) == [1000, 2000]


def test_heartbeat_is_not_slowed(channel: Channel) -> None:
    set_interval(channel, "HEARTBEAT", 1000, 0)
    downloading(channel)
    assert due_times_ms(channel, 2000) == [1000, 2000]


def test_slowed_interval_is_limited_to_a_minute(channel: Channel) -> None:
    set_interval(channel, "ATTITUDE", 60_000, 0)
    downloading(channel)
    assert due_messages(channel, 60_000_000) == ["ATTITUDE"]


def test_full_rate_comes_back_after_the_list(channel: Channel) -> None:
    set_interval(channel, "ATTITUDE", 250, 0)
    downloading(channel)
    assert due_times_ms(channel, 999) == []
    channel.param_list = None
    assert due_messages(channel, 1_000_000) == ["ATTITUDE"]
