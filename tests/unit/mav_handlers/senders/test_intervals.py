# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""At which interval each message is sent."""

from typing import TYPE_CHECKING

import pytest

from mav_handlers.channel import Channel
from mav_handlers.schedule import NEXT_PARAM
from mav_handlers.senders import STREAM_GROUPS
from mav_handlers.senders.intervals import default_interval_ms, set_defaults, set_interval, stream_interval_ms
from mav_handlers.wire.codec import Codec
from viso.vehicle.vehicle import Vehicle, VehicleConfig

if TYPE_CHECKING:
    from tests.unit.mav_handlers.conftest import MakeBench


@pytest.fixture
def channel() -> Channel:
    return Channel(0, "link", Codec(1, 1))


@pytest.mark.parametrize(
    ("rate_hz", "interval_ms"),
    [
        (0, None),
        (1, 1000),
        (3, 333),
        (4, 250),
        (50, 20),
        (333, 3),
        (400, 2),
        (1000, 1),
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
    ("name", "interval_ms"),
    [
        ("HEARTBEAT", 1000),
        ("HIGH_LATENCY2", 5000),
        ("ATTITUDE", 100),
        ("AVAILABLE_MODES", 500),
        (NEXT_PARAM, 500),
        ("ADSB_VEHICLE", 1000),
        ("SYS_STATUS", None),
        ("HOME_POSITION", None),
    ],
)
def test_default_interval(make_bench: "MakeBench", name: str, interval_ms: int | None) -> None:
    bench = make_bench(MAV1_EXTRA1=10, MAV1_POSITION=5, MAV1_PARAMS=2, MAV1_ADSB=1)
    assert default_interval_ms(bench.vehicle, bench.client.channel, name) == interval_ms


def test_intervals_from_the_card_come_before_rates(make_bench: "MakeBench") -> None:
    bench = make_bench(MAV1_EXTRA1=10, MAV1_POSITION=5)
    channel = bench.client.channel
    channel.card_intervals_ms = {"ATTITUDE": 40, "GLOBAL_POSITION_INT": 0, "HOME_POSITION": 7000}
    assert default_interval_ms(bench.vehicle, channel, "ATTITUDE") == 40
    assert default_interval_ms(bench.vehicle, channel, "GLOBAL_POSITION_INT") is None
    set_defaults(bench.vehicle, channel, bench.now_us)
    assert {name: ms for name, ms in channel.intervals_ms.items() if name in channel.card_intervals_ms} == {
        "ATTITUDE": 40,
        "HOME_POSITION": 7000,
    }


def test_intervals_are_given_by_id_and_link() -> None:
    config = VehicleConfig(links=2, message_intervals={1: {30: 40, 0: 0, 22: 50, 9: 100, 70_000: 100}})
    endpoint = Vehicle(config).endpoint
    channels = [endpoint.open_channel(f"link{index}") for index in range(2)]
    assert channels[0].intervals_ms == {"HEARTBEAT": 1000, NEXT_PARAM: 100}
    assert channels[1].intervals_ms == {"ATTITUDE": 40, NEXT_PARAM: 50}


@pytest.mark.parametrize(("interval_ms", "given_ms"), [(1, 3), (2, 3), (3, 3), (4, 4), (60_000, 60_000)])
def test_interval_is_at_least_3_ms(channel: Channel, interval_ms: int, given_ms: int) -> None:
    set_interval(channel, "ATTITUDE", interval_ms, 0)
    assert channel.intervals_ms == {"ATTITUDE": given_ms}


def test_message_is_stopped_with_none(channel: Channel) -> None:
    set_interval(channel, "ATTITUDE", 100, 0)
    set_interval(channel, "HEARTBEAT", 100, 0)
    for name in ("ATTITUDE", "HEARTBEAT"):
        set_interval(channel, name, None, 0)
    assert channel.intervals_ms == {}


@pytest.mark.parametrize(("interval_ms", "given_ms"), [(None, 100), (20, 20), (1, 3), (1000, 1000), (1001, 1000)])
def test_parameter_pump_never_stops(channel: Channel, interval_ms: int | None, given_ms: int) -> None:
    set_interval(channel, NEXT_PARAM, interval_ms, 0)
    assert channel.intervals_ms == {NEXT_PARAM: given_ms}


def test_rates_hold_from_boot(make_bench: "MakeBench") -> None:
    rates = {f"MAV1{suffix}": stream_id for stream_id, (suffix, _) in STREAM_GROUPS.items()}
    channel = make_bench(until_ms=0, **rates).client.channel
    assert channel.intervals_ms == {"HEARTBEAT": 1000, NEXT_PARAM: 100} | {
        name: 1000 // stream_id for stream_id, (_, names) in STREAM_GROUPS.items() for name in names
    }


def test_link_says_a_heartbeat_and_pumps_parameters_by_default(make_bench: "MakeBench") -> None:
    channel = make_bench().client.channel
    assert channel.intervals_ms == {"HEARTBEAT": 1000, NEXT_PARAM: 100}
    assert not channel.streaming
