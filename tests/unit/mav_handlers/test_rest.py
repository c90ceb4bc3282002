# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Polls that the endpoint returns from at once, because nothing can be due: they would have sent nothing.

Two copies of a vehicle go through the same; one of them looks at everything in every poll.
"""

from collections.abc import Callable, Iterable
from itertools import chain
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from ap_core.fmath import f32
from ap_core.location import Location
from ap_core.param import ParamEcho
from mav_handlers.senders.intervals import set_interval
from mav_handlers.wire.messages import (
    COMMAND_LONG,
    FILE_TRANSFER_PROTOCOL,
    HEARTBEAT,
    LOG_REQUEST_LIST,
    ODOMETRY,
    PARAM_REQUEST_LIST,
    PARAM_REQUEST_READ,
    PARAM_SET,
    RADIO_STATUS,
    REQUEST_DATA_STREAM,
    SET_GPS_GLOBAL_ORIGIN,
    SETUP_SIGNING,
    SYSTEM_TIME,
    TIMESYNC,
    Message,
)
from viso.vehicle.vehicle import Vehicle, VehicleConfig

if TYPE_CHECKING:
    from tests.unit.mav_handlers.conftest import Bench, MakeBench

SET_MESSAGE_INTERVAL, REQUEST_MESSAGE = 511, 512
LINKS = 3
PASS_US = 2500
WRAP_US = (1 << 32) * 1000
LONG_TEXT = "a text of several chunks " * 5
_ZEROS = (0.0,) * 21


def odometry(quality: int) -> ODOMETRY:
    still = (0.0,) * 6
    return ODOMETRY(1, 20, 12, 1.0, 2.0, 3.0, (1.0, 0.0, 0.0, 0.0), *still, _ZEROS, _ZEROS, 0, 0, quality)


def ftp(opcode: int, data: bytes = b"", seq: int = 0, size: int | None = None) -> FILE_TRANSFER_PROTOCOL:
    header = bytes([seq & 0xFF, seq >> 8, 0, opcode, len(data) if size is None else size, 0, 0, 0, 0, 0, 0, 0])
    return FILE_TRANSFER_PROTOCOL(0, 1, 1, tuple((header + data).ljust(251, b"\0")))


def command(number: int, *params: float) -> COMMAND_LONG:
    return COMMAND_LONG(1, 1, number, 0, *params, *(0.0,) * (7 - len(params)))


PARAMETERS = b"@PARAM/param.pck"
BEAT = HEARTBEAT(6, 8, 0, 0, 4, 3)
NAMES = st.sampled_from(["MAV_OPTIONS", "MAV1_OPTIONS", "MAV2_OPTIONS", "MAV3_OPTIONS", "VISO_TYPE", "MAV2_EXTRA1"])
NUMBERS = st.integers(0, 9).map(float)
MESSAGES: st.SearchStrategy[Message] = st.one_of(
    st.integers(-1, 100).map(odometry),
    st.builds(HEARTBEAT, st.integers(0, 30), *map(st.just, (8, 0, 0, 4, 3))),
    st.builds(PARAM_REQUEST_READ, st.just(1), st.just(1), NAMES | st.just("NOTHING"), st.integers(-1, 40)),
    st.just(PARAM_REQUEST_LIST(1, 1)),
    st.builds(PARAM_SET, st.just(1), st.just(1), NAMES, NUMBERS, st.just(9)),
    st.builds(REQUEST_DATA_STREAM, st.just(1), st.just(1), st.integers(0, 12), st.integers(0, 60), st.integers(0, 1)),
    st.builds(
        lambda number, interval_us: command(SET_MESSAGE_INTERVAL, number, interval_us),
        st.sampled_from([0.0, 1.0, 2.0, 22.0, 30.0, 32.0, 435.0]),
        st.sampled_from([-1.0, 0.0, 3000.0, 20_000.0, 333_000.0, 60e6]),
    ),
    st.sampled_from([0.0, 30.0, 148.0, 242.0, 435.0]).map(lambda number: command(REQUEST_MESSAGE, number)),
    st.builds(RADIO_STATUS, *map(st.just, (0, 0)), st.sampled_from([10, 40, 60, 96]), *map(st.just, (0, 0, 0, 0))),
    st.builds(TIMESYNC, st.integers(0, 1), st.integers(0, 1 << 50)),
    st.sampled_from([0, 1_600_000_000_000_000]).map(lambda utc_us: SYSTEM_TIME(utc_us, 0)),
    st.builds(ftp, st.sampled_from([0, 1, 4, 14, 15]), st.just(PARAMETERS), st.integers(0, 999)),
    st.just(LOG_REQUEST_LIST(1, 1, 0, 65535)),
    st.just(SET_GPS_GLOBAL_ORIGIN(1, 470_000_000, 80_000_000, 400_000)),
    st.just(SETUP_SIGNING(1, 1, tuple(range(32)), 1 << 30)),
)

Step = Callable[["Bench"], object]
"""Does something to a vehicle."""

LINK = st.integers(0, LINKS - 1)


def pass_at(bench: "Bench", now_us: int) -> None:
    bench.vehicle.clock.set_us(max(now_us, 0))
    bench.endpoint.poll(max(now_us, 0))


def polls(count: int, step_us: int = PASS_US) -> list[Step]:
    return [lambda bench: pass_at(bench, bench.now_us + step_us)] * count


def loop(bench: "Bench") -> None:
    time_us = bench.now_us + PASS_US
    bench.vehicle.advance(range(time_us, time_us + 1))


def loops(count: int) -> list[Step]:
    """Return what runs the main loop, all of which may send texts."""
    return [loop] * count


def hears(link: int, message: Message) -> list[Step]:
    return [lambda bench: bench.clients[link].tell(message), *polls(3)]


def reads(link: int) -> list[Step]:
    return [lambda bench: bench.clients[link].channel.take_output(), *polls(3)]


def fills(link: int) -> list[Step]:
    """Return what leaves a link no room, as a peer does that does not read."""

    def fill(bench: "Bench") -> None:
        while bench.clients[link].channel.send(BEAT):
            pass

    return [fill, *polls(3)]


def sets(name: str, value: float) -> list[Step]:
    """Return what changes a parameter on the vehicle's side."""
    return [lambda bench: bench.vehicle.params.set(name, value), *polls(3)]


def echoes(name: str, value: float) -> list[Step]:
    """Return what changes a parameter and tells everybody."""

    def echo(bench: "Bench") -> None:
        bench.endpoint.echo_parameters(bench.vehicle.params.set_from_mavlink(name, value).echoes)

    return [echo, *polls(3)]


def tells(text: str) -> list[Step]:
    return [lambda bench: bench.vehicle.texts.send_text(6, text), *polls(3)]


def moves_home() -> list[Step]:
    return [
        lambda bench: bench.vehicle.copter.home.set(Location(470_000_000, 80_000_000, 40_000), lock=True),
        *polls(3),
    ]


def asks_for(link: int, name: str) -> list[Step]:
    return [lambda bench: bench.endpoint.request_message(bench.clients[link].channel, name), *polls(3)]


def starts(link: int, name: str, interval_ms: int | None) -> list[Step]:
    """Return what gives a message an interval without a request."""
    return [lambda bench: set_interval(bench.clients[link].channel, name, interval_ms, bench.now_us), *polls(3)]


def jumps(to_us: int) -> list[Step]:
    return [lambda bench: pass_at(bench, to_us)]


STEPS: st.SearchStrategy[list[Step]] = st.one_of(
    st.builds(polls, st.integers(1, 60), st.sampled_from([PASS_US, 1000, 10_000])),
    st.builds(polls, st.integers(1, 8), st.sampled_from([100_000, 990_000, 65_000_000, -1000, -3_000_000])),
    st.builds(loops, st.integers(1, 8)),
    st.builds(hears, LINK, MESSAGES),
    st.builds(reads, LINK),
    st.builds(fills, LINK),
    st.builds(sets, NAMES, NUMBERS) | st.integers(1, 2).map(lambda system_id: sets("MAV_SYSID", system_id)),
    st.builds(echoes, NAMES, NUMBERS),
    st.sampled_from(["short", LONG_TEXT]).map(tells),
    st.builds(moves_home),
    st.builds(asks_for, LINK, st.sampled_from(["ATTITUDE", "HOME_POSITION", "AUTOPILOT_VERSION"])),
    st.builds(starts, LINK, st.sampled_from(["ATTITUDE", "HEARTBEAT", "PARAM_VALUE"]), st.none() | st.integers(1, 300)),
    st.just(jumps(WRAP_US - 2_000_000)),
)


def look_every_time(bench: "Bench") -> None:
    """Have a vehicle's endpoint look at everything in every poll."""
    poll = bench.endpoint.poll

    def look(now_us: int) -> None:
        bench.client.channel.rest.end()
        poll(now_us)

    bench.endpoint.poll = look  # type: ignore[method-assign]


def state(bench: "Bench") -> list[Any]:
    """Return what can be seen of the links, with all that waits to be sent on them."""
    own = [bench.vehicle.signing_store.load(), bench.vehicle.texts.pending(), bench.endpoint.param_reads.waiting]
    links = [
        (
            bytes(channel._output),
            channel.intervals_ms,
            channel.requested,
            channel.timesync_sent_us,
            channel.times_full,
            channel.codec.frames_sent,
            channel.codec.system_id,
            channel.ftp_is_busy,
        )
        for channel in bench.endpoint.channels
    ]
    return [*own, *links]


def compare(make_bench: "MakeBench", steps: Iterable[Step]) -> None:
    """Have two vehicles take the same steps, of which one looks at everything every time."""
    one, other = (make_bench(bauds=(None, 57600, None), MAV2_EXTRA1=4, MAV3_POSITION=10) for _ in range(2))
    look_every_time(other)
    for step in steps:
        step(one)
        step(other)
        assert state(one) == state(other)
    assert one.records == other.records


@pytest.mark.slow
@given(parts=st.lists(STEPS, min_size=1, max_size=15))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow])
def test_poll_that_returns_at_once_would_have_sent_nothing(make_bench: "MakeBench", parts: list[list[Step]]) -> None:
    compare(make_bench, chain.from_iterable(parts))


def calm(bench: "Bench") -> None:
    """Stop everything that is sent at an interval but parameters, which cannot be."""
    for client in bench.clients:
        for name in client.channel.intervals_ms:
            set_interval(client.channel, name, 1000 if name == "PARAM_VALUE" else None, bench.now_us)
        client.channel.take_output()


CALM: list[Step] = [*polls(20, 101_000), calm, *polls(10)]
WELL_BEFORE_WRAP = [*jumps(WRAP_US - 20_000_000), *polls(200, 100_000)]
PRIVATE = [step for link in (1, 2, 3) for step in sets(f"MAV{link}_OPTIONS", 2)]
READS = [lambda bench: bench.clients[2].tell(*[PARAM_REQUEST_READ(1, 1, "VISO_TYPE", -1)] * 9), *polls(9)]
ORIGIN = SET_GPS_GLOBAL_ORIGIN(1, 470_000_000, 80_000_000, 0)
ECHO = ParamEcho("VISO_TYPE", f32(1), 2)


@pytest.mark.parametrize(
    "steps",
    [
        pytest.param(READS, id="parameters are read"),
        pytest.param(hears(2, PARAM_REQUEST_LIST(1, 1)) + polls(300), id="parameters are listed"),
        pytest.param(hears(2, command(REQUEST_MESSAGE, 30)), id="a message is requested"),
        pytest.param(hears(1, ftp(4, PARAMETERS)) + hears(1, ftp(15, seq=1, size=239)) + polls(500), id="a burst"),
        pytest.param(fills(2) + hears(2, LOG_REQUEST_LIST(1, 1, 0, 65535)) + reads(2), id="logs are listed"),
        pytest.param(PRIVATE + hears(0, SETUP_SIGNING(1, 1, (1,) * 32, 1 << 30)) + polls(2600, 12_500), id="signing"),
        pytest.param([*hears(0, BEAT), lambda bench: bench.endpoint.echo_parameters([ECHO]), *polls(3)], id="an echo"),
        pytest.param(sets("MAV_SYSID", 2), id="another system id"),
        pytest.param(sets("MAV1_OPTIONS", 2) + polls(30, 1_000_000) + sets("MAV1_OPTIONS", 0), id="no longer private"),
        pytest.param(tells(LONG_TEXT), id="a text"),
        pytest.param(fills(0) + fills(1) + tells(LONG_TEXT) + polls(30) + reads(0), id="a text without room"),
        pytest.param(fills(0) + asks_for(0, "ATTITUDE") + polls(30) + reads(0), id="a message without room"),
        pytest.param(hears(0, ORIGIN) + loops(9) + polls(400) + moves_home(), id="home"),
        pytest.param(starts(2, "ATTITUDE", 7) + polls(20), id="an interval"),
        pytest.param(starts(2, "HEARTBEAT", 7) + polls(20), id="an interval of a timer"),
        pytest.param(polls(9, -1_000_000) + polls(30, 40_000), id="time goes back"),
        pytest.param(polls(9, 65_530_000) + polls(30, 40_000), id="time jumps"),
        pytest.param(polls(5000), id="time is asked for"),
        pytest.param([*hears(2, ftp(0)), *hears(2, ftp(1)), *WELL_BEFORE_WRAP, *polls(2000)], id="time wraps"),
        pytest.param(hears(2, ftp(0)) + polls(1100, 1000), id="slow for a second"),
    ],
)
def test_poll_sends_what_has_come_up_while_nothing_was_due(make_bench: "MakeBench", steps: list[Step]) -> None:
    compare(make_bench, CALM + steps)


def test_texts_that_are_to_go_first_do_not_stay_so(make_bench: "MakeBench") -> None:
    steps = [
        *hears(0, BEAT),
        lambda bench: bench.endpoint.send_texts_first(),
        *polls(3),
        lambda bench: bench.vehicle.texts.send_text(6, "later"),
        lambda bench: bench.client.tell(TIMESYNC(1, 0)),
    ]
    compare(make_bench, CALM + steps)


def test_link_that_is_opened_is_seen_by_the_next_poll() -> None:
    vehicle = Vehicle(VehicleConfig(links=2, defaults={"VISO_TYPE": 1}))
    vehicle.endpoint.open_channel("link")
    for now_us in range(0, 1_000_000, PASS_US):
        vehicle.endpoint.poll(now_us)
    late = vehicle.endpoint.open_channel("late", now_us=1_000_000)
    vehicle.endpoint.poll(1_000_000)
    assert late.codec.frames_sent == 1
