# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The autopilot on a UDP port: real datagrams, virtual time."""

import contextlib
import socket
import threading
from collections.abc import Iterator

import pytest
from pymavlink import mavutil

from mav_handlers.wire.codec import Codec
from mav_handlers.wire.messages import HEARTBEAT
from tests.unit.viso.testing.sample_odometry import odometry
from viso.testing import UdpAutopilot

GREETING = HEARTBEAT(18, 8, 0, 0, 4, 3)


@pytest.fixture
def autopilot() -> Iterator[UdpAutopilot]:
    made = UdpAutopilot()
    yield made
    made.close()


@pytest.fixture
def port(autopilot: UdpAutopilot) -> Iterator[socket.socket]:
    with socket.socket(type=socket.SOCK_DGRAM) as made:
        made.connect(autopilot.address)
        made.setblocking(False)
        yield made


def test_datagrams_are_handled_before_anything_is_seen(autopilot: UdpAutopilot, port: socket.socket) -> None:
    codec = Codec(1, 197)
    for count in range(200):
        port.send(codec.encode(odometry(count)))
        assert len(autopilot.verdicts) == count + 1
    assert {verdict.time_us for verdict in autopilot.verdicts} == {6_500_000}


def test_datagrams_are_handled_before_time_goes_on(autopilot: UdpAutopilot, port: socket.socket) -> None:
    codec = Codec(1, 197)
    for count in range(3):
        port.send(codec.encode(odometry(count)))
        autopilot.advance(ms=20)
    assert [verdict.time_us for verdict in autopilot.verdicts] == [6_500_000, 6_520_000, 6_540_000]


def test_datagrams_come_before_what_the_test_sends_later(autopilot: UdpAutopilot, port: socket.socket) -> None:
    port.send(Codec(1, 197).encode(odometry(1)))
    (verdict,) = autopilot.send(odometry(2))
    assert autopilot.verdicts[-1] == verdict
    assert [record["RTimeUS"] for record in autopilot.records_of("VISP")] == [1, 2]


def test_more_than_the_system_keeps_stops_nothing(autopilot: UdpAutopilot, port: socket.socket) -> None:
    for _ in range(3000):
        port.send(b"\x00" * 1000)
    port.send(b"")
    autopilot.advance(ms=10)
    assert {verdict.name for verdict in autopilot.verdicts} == {"BAD_DATA"}
    port.send(Codec(1, 197).encode(odometry()))
    autopilot.assert_accepted(count=1)


def test_sender_that_never_stops_stops_nothing(autopilot: UdpAutopilot, port: socket.socket) -> None:
    stop = threading.Event()

    def flood() -> None:
        while not stop.is_set():
            with contextlib.suppress(BlockingIOError):
                port.send(b"\x00")

    thread = threading.Thread(target=flood)
    thread.start()
    autopilot.advance(ms=5)
    stop.set()
    thread.join()
    assert autopilot.now_us == 6_505_000


def test_autopilot_answers_those_it_has_heard(autopilot: UdpAutopilot, port: socket.socket) -> None:
    autopilot.advance(s=1)
    with pytest.raises(BlockingIOError):
        port.recv(1000)
    port.send(Codec(1, 197).encode(GREETING))
    autopilot.advance(s=1)
    codec = Codec(255, 190)
    codec.feed(port.recv(1000))
    received = codec.next_received()
    assert isinstance(getattr(received, "message", None), HEARTBEAT)


def test_pymavlink_connects_by_the_string(autopilot: UdpAutopilot) -> None:
    link = mavutil.mavlink_connection(autopilot.connection_string, source_system=1, source_component=197)
    link.mav.vision_position_estimate_send(1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    link.close()
    autopilot.assert_accepted(count=1, message="VISION_POSITION_ESTIMATE")


def test_two_autopilots_have_two_ports(autopilot: UdpAutopilot) -> None:
    other = UdpAutopilot()
    assert other.address != autopilot.address
    other.close()


def test_closed_port_is_free_again(autopilot: UdpAutopilot) -> None:
    autopilot.close()
    with socket.socket(type=socket.SOCK_DGRAM) as other:
        other.bind(autopilot.address)


# Time that goes on by itself


def _join() -> None:
    """Wait until the vehicle's thread has ended."""
    for thread in threading.enumerate():
        if thread.name == "autopilot":
            thread.join()


def test_code_that_waits_for_the_autopilot_hears_it(autopilot: UdpAutopilot, port: socket.socket) -> None:
    port.settimeout(30)
    with autopilot.running(speedup=100):
        port.send(Codec(1, 197).encode(GREETING))
        codec = Codec(255, 190)
        codec.feed(port.recv(1000))
    assert isinstance(getattr(codec.next_received(), "message", None), HEARTBEAT)
    after_us = autopilot.now_us
    assert after_us > 6_500_000
    assert [verdict.name for verdict in autopilot.verdicts] == ["HEARTBEAT"]
    assert autopilot.now_us == after_us


def test_what_runs_by_itself_is_not_to_be_touched(autopilot: UdpAutopilot) -> None:
    with autopilot.running():
        for touch in (
            lambda: autopilot.advance(ms=1),
            lambda: autopilot.send(odometry()),
            autopilot.read,
            autopilot.clear,
        ):
            with pytest.raises(RuntimeError, match="the autopilot runs by itself"):
                touch()
        with pytest.raises(RuntimeError, match="the autopilot runs by itself"), autopilot.running():
            pass
        assert autopilot.verdicts == []
    autopilot.advance(ms=1)


def test_what_is_no_speed_is_refused(autopilot: UdpAutopilot) -> None:
    for speedup in (0, -1, 1001, float("nan")):
        with pytest.raises(ValueError, match=r"speedup .*: not between 0 and 1000"), autopilot.running(speedup=speedup):
            pass


def test_failure_of_the_vehicle_reaches_the_test(autopilot: UdpAutopilot, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_times_us: range) -> int:
        raise ZeroDivisionError

    monkeypatch.setattr(autopilot.vehicle, "advance", fail)
    with pytest.raises(ZeroDivisionError), autopilot.running(speedup=100):
        _join()


def test_failure_of_the_test_ends_the_run(autopilot: UdpAutopilot) -> None:
    with pytest.raises(KeyError), autopilot.running():
        raise KeyError
    assert all(thread.name != "autopilot" for thread in threading.enumerate())
