# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""When the companion sends what, and that it listens."""

from collections.abc import Callable

import pytest

from mav_handlers.links.pair import PairLink, make_pair
from mav_handlers.wire.codec import Codec, Received
from mav_handlers.wire.messages import COMMAND_LONG, HEARTBEAT, STATUSTEXT, VISION_SPEED_ESTIMATE, Message
from viso.companion.sender import MAV_COMP_ID_VISUAL_INERTIAL_ODOMETRY, Companion, MavlinkSender, command_long


def speed_at(time_us: int) -> Message:
    return VISION_SPEED_ESTIMATE(time_us, 0.0, 0.0, 0.0, (0.0,) * 9, 0)


class Wire:
    """The autopilot's end: what has arrived there."""

    def __init__(self, link: PairLink) -> None:
        self._link = link
        self._codec = Codec(1, 1)

    def frames(self) -> list[Received]:
        self._codec.feed(self._link.receive())
        found = []
        while (received := self._codec.next_received()) is not None:
            assert isinstance(received, Received)
            found.append(received)
        return found

    def messages(self) -> list[Message]:
        return [frame.message for frame in self.frames() if frame.message is not None]

    def stamps_us(self) -> list[int]:
        return [message.usec for message in self.messages() if isinstance(message, VISION_SPEED_ESTIMATE)]

    def send(self, message: Message) -> None:
        self._link.send(self._codec.encode(message))


Make = Callable[..., tuple[Companion, Wire]]


@pytest.fixture
def make() -> Make:
    """Return a function that makes a companion, asked for an estimate as given, and the other end of its wire."""

    def build(estimate: Callable[[int], Message | None] = speed_at, **options: float) -> tuple[Companion, Wire]:
        vehicle_end, companion_end = make_pair()
        return Companion(companion_end, estimate, **options), Wire(vehicle_end)  # type: ignore[arg-type]

    return build


def run_to(companion: Companion, end_us: int, step_us: int = 2500) -> None:
    for now_us in range(0, end_us + 1, step_us):
        companion.run(now_us)


def test_heartbeat_comes_at_once_and_then_every_second(make: Make) -> None:
    companion, wire = make(lambda _time_us: None)
    run_to(companion, 3_100_000)
    assert len(wire.messages()) == 4


def test_heartbeat_is_that_of_a_companion_computer(make: Make) -> None:
    companion, wire = make(lambda _time_us: None, system_id=7)
    companion.run(0)
    (frame,) = wire.frames()
    assert (frame.header.system_id, frame.header.component_id) == (7, MAV_COMP_ID_VISUAL_INERTIAL_ODOMETRY)
    assert isinstance(frame.message, HEARTBEAT)
    assert (frame.message.type, frame.message.autopilot) == (18, 8)


def test_estimates_come_at_their_rate(make: Make) -> None:
    companion, wire = make(rate_hz=30.0)
    run_to(companion, 1_000_000)
    stamps = wire.stamps_us()
    assert stamps == [number * 33_333 for number in range(31)]


def test_estimate_is_sent_a_latency_after_its_frame(make: Make) -> None:
    companion, wire = make(rate_hz=10.0, latency_us=40_000)
    companion.run(39_999)
    assert wire.stamps_us() == []
    companion.run(40_000)
    assert wire.stamps_us() == [0]


def test_frames_missed_by_a_late_call_are_made_up_for(make: Make) -> None:
    companion, wire = make(rate_hz=10.0)
    companion.run(350_000)
    assert wire.stamps_us() == [0, 100_000, 200_000, 300_000]


def test_nothing_is_sent_before_the_companion_is_up(make: Make) -> None:
    companion, wire = make(start_us=5_000_000)
    companion.run(4_999_999)
    assert wire.messages() == []
    companion.run(5_000_000)
    assert len(wire.messages()) == 2


def test_frame_without_an_estimate_is_passed_over(make: Make) -> None:
    companion, wire = make(lambda time_us: speed_at(time_us) if time_us != 100_000 else None, rate_hz=10.0)
    companion.run(200_000)
    assert wire.stamps_us() == [0, 200_000]


def test_next_due_is_a_frame_or_a_heartbeat(make: Make) -> None:
    companion, _ = make(rate_hz=0.75, latency_us=40_000)
    assert companion.next_due_us() == 0
    companion.run(50_000)
    assert companion.next_due_us() == 1_000_000
    companion.run(1_000_000)
    assert companion.next_due_us() == 1_333_333 + 40_000


def test_command_goes_to_the_autopilot(make: Make) -> None:
    companion, wire = make()
    companion.command(400, 1)
    (message,) = wire.messages()
    assert message == COMMAND_LONG(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0)


def test_what_the_autopilot_says_is_taken_in(make: Make) -> None:
    companion, wire = make()
    wire.send(STATUSTEXT(6, "ArduPilot Ready"))
    companion.run(0)
    assert companion.received == [STATUSTEXT(6, "ArduPilot Ready")]


def test_noise_on_the_wire_is_passed_over() -> None:
    vehicle_end, companion_end = make_pair()
    companion = Companion(companion_end, speed_at)
    vehicle_end.send(b"\x00noise" + Codec(1, 1).encode(STATUSTEXT(6, "here")))
    companion.run(0)
    assert companion.received == [STATUSTEXT(6, "here")]


def test_heartbeat_is_due_once_a_second_and_what_was_missed_is_left_out() -> None:
    sender = MavlinkSender(start_us=500_000)
    times_us = (0, 499_999, 500_000, 600_000, 1_500_000, 3_700_000, 4_499_999)
    due = [now_us for now_us in times_us if sender.heartbeats(now_us)]
    assert due == [500_000, 1_500_000, 3_700_000]
    assert sender.heartbeat_us == 4_500_000


@pytest.mark.parametrize(
    ("until_us", "next_us"), [(0, 0), (1, 1_000_000), (1_000_000, 1_000_000), (1_000_001, 2_000_000)]
)
def test_heartbeats_are_left_out_up_to_a_time(until_us: int, next_us: int) -> None:
    sender = MavlinkSender()
    sender.skip_heartbeats(until_us)
    assert sender.heartbeat_us == next_us


def test_messages_are_counted_as_they_are_encoded() -> None:
    sender = MavlinkSender()
    for message in (*sender.heartbeats(0), command_long(400, 1.0), command_long(400, 0.0)):
        sender.encode(message)
    assert sender.sent == {"HEARTBEAT": 1, "COMMAND_LONG": 2}
