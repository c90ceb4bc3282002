# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a player hands out, and what it makes of what it hears."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from mav_handlers.statustext import chunk_text
from mav_handlers.wire.codec import Codec, Received
from mav_handlers.wire.messages import HEARTBEAT, ODOMETRY, STATUSTEXT, VISION_POSITION_DELTA
from tests.unit.viso.trajectories import make_trajectory
from viso.companion.sender import OffsetClock
from viso.streams.messages import FORMS
from viso.streams.player import Frame, Playback, Player, RecordedEngine, Text

LONG = "PreArm: " + "x" * 120


@pytest.fixture
def make() -> Callable[..., Player]:
    """Return a function that makes a player of some records at 10 Hz."""

    def build(count: int = 3, form: str = "odometry") -> Player:
        return Player(RecordedEngine(make_trajectory(count), Playback(FORMS[form])))

    return build


@pytest.fixture
def player(make: Callable[..., Player]) -> Player:
    return make()


def decoded(frame: Frame) -> Received:
    codec = Codec(1, 1)
    codec.feed(frame.data)
    received = codec.next_received()
    assert isinstance(received, Received)
    return received


def all_frames(player: Player) -> list[Frame]:
    found: list[Frame] = []
    while frames := player.next_frames():
        found += frames
    return found


def hear(player: Player, *messages: STATUSTEXT) -> list[Text]:
    codec = Codec(1, 1)
    return player.receive_bytes(b"".join(map(codec.encode, messages)))


def test_heartbeat_goes_ahead_of_the_records(player: Player) -> None:
    frames = all_frames(player)
    assert [(frame.due_us, decoded(frame).header.name) for frame in frames] == [
        (0, "HEARTBEAT"),
        (0, "ODOMETRY"),
        (100_000, "ODOMETRY"),
        (200_000, "ODOMETRY"),
    ]


def test_heartbeat_comes_every_second_until_the_end(make: Callable[..., Player]) -> None:
    beats = [frame.due_us for frame in all_frames(make(25)) if decoded(frame).header.name == "HEARTBEAT"]
    assert beats == [0, 1_000_000, 2_000_000]


def test_frames_are_those_of_a_companion_computer(make: Callable[..., Player]) -> None:
    received = decoded(make().next_frames()[0])
    assert (received.header.system_id, received.header.component_id) == (1, 197)
    assert isinstance(received.message, HEARTBEAT)
    assert (received.message.type, received.message.autopilot) == (18, 8)


def test_messages_of_one_record_are_due_together(make: Callable[..., Player]) -> None:
    player = make(form="vision+speed")
    player.next_frames()
    assert [decoded(frame).header.name for frame in player.next_frames()] == [
        "VISION_POSITION_ESTIMATE",
        "VISION_SPEED_ESTIMATE",
    ]


def test_next_due_is_that_of_the_next_frames(player: Player) -> None:
    due_us = []
    while (next_us := player.next_due_us()) is not None:
        due_us.append(next_us)
        assert {frame.due_us for frame in player.next_frames()} == {next_us}
    assert due_us == [0, 0, 100_000, 200_000]


def test_record_without_a_message_is_passed_over(make: Callable[..., Player]) -> None:
    player = make(form="delta")
    player.next_frames()
    assert player.next_frames() == []
    assert player.next_due_us() == 100_000


def test_what_was_sent_is_counted(player: Player) -> None:
    all_frames(player)
    player.heartbeat()
    assert player.sent == {"HEARTBEAT": 2, "ODOMETRY": 3}


def test_texts_of_the_vehicle_are_told(player: Player) -> None:
    assert hear(player, STATUSTEXT(6, "ArduPilot Ready")) == [Text(6, "ArduPilot Ready")]
    assert player.heard


def test_nothing_is_heard_in_noise(player: Player) -> None:
    assert player.receive_bytes(b"\x00noise\xfd\xff") == []
    assert not player.heard


@pytest.mark.parametrize("length", [50, 51, 100, 128, 256])
def test_chunks_of_a_long_text_become_one(player: Player, length: int) -> None:
    text = ("0123456789" * 26)[:length]
    assert hear(player, *chunk_text(4, text, 9)) == [Text(4, text)]


def test_text_that_lacks_a_chunk_is_forgotten_with_the_next(player: Player) -> None:
    assert hear(player, chunk_text(4, LONG, 9)[0]) == []
    assert hear(player, *chunk_text(4, LONG, 10)) == [Text(4, LONG)]


def test_chunks_without_an_end_stay_few(player: Player) -> None:
    endless = [STATUSTEXT(6, "x" * 50, 5, number) for number in range(1, 200)]
    assert all(len(text.text) <= 300 for text in hear(player, *endless))


def test_control_characters_do_not_reach_the_terminal(player: Player) -> None:
    assert hear(player, STATUSTEXT(6, "a\x1b[2Jb")) == [Text(6, "a?[2Jb")]


# The engine


def played(engine: RecordedEngine, count: int = 99) -> list[tuple[int, Any]]:
    """Return when each of the next messages is due, and the message."""
    found: list[tuple[int, Any]] = []
    while (due_us := engine.next_due_us()) is not None and len(found) < count:
        found += [(due_us, message) for message in engine.report()]
    return found


def test_records_come_at_their_times() -> None:
    reports = played(RecordedEngine(make_trajectory(), Playback()))
    assert [due_us for due_us, _ in reports] == [0, 100_000, 200_000, 300_000, 400_000]
    assert [message.time_usec for _, message in reports] == [0, 100_000, 200_000, 300_000, 400_000]
    assert [message.x for _, message in reports] == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.4])
    assert all(isinstance(message, ODOMETRY) for _, message in reports)


def test_after_the_last_record_there_is_nothing() -> None:
    engine = RecordedEngine(make_trajectory(2), Playback())
    played(engine)
    assert engine.next_due_us() is None
    with pytest.raises(IndexError):
        engine.report()


def test_latency_moves_the_sending_and_not_the_stamp() -> None:
    reports = played(RecordedEngine(make_trajectory(2), Playback(start_us=1_000_000, latency_us=40_000)))
    assert [(due_us, message.time_usec) for due_us, message in reports] == [
        (1_040_000, 1_000_000),
        (1_140_000, 1_100_000),
    ]


def test_stamps_are_those_of_the_senders_clock() -> None:
    reports = played(RecordedEngine(make_trajectory(2), Playback(clock=OffsetClock(7_000_000))))
    assert [(due_us, message.time_usec) for due_us, message in reports] == [(0, 7_000_000), (100_000, 7_100_000)]


def test_speed_counts_for_times_and_velocities() -> None:
    reports = played(RecordedEngine(make_trajectory(3), Playback(speed=2.0)))
    assert [due_us for due_us, _ in reports] == [0, 50_000, 100_000]
    assert [message.vx for _, message in reports] == pytest.approx([2.0, 2.0, 2.0])
    assert reports[-1][1].x == pytest.approx(0.2)


def test_loop_starts_again_a_period_after_the_last_record_as_after_a_reset() -> None:
    reports = played(RecordedEngine(make_trajectory(3), Playback(loop=True)), 6)
    assert [due_us for due_us, _ in reports] == pytest.approx([0, 100_000, 200_000, 300_000, 400_000, 500_000], abs=1)
    assert [message.reset_counter for _, message in reports] == [0, 0, 0, 1, 1, 1]
    assert reports[3][1].x == 0.0


def test_resets_of_the_recording_go_on_counting_over_laps() -> None:
    trajectory = make_trajectory(3, resets=np.array([0, 1, 1]))
    reports = played(RecordedEngine(trajectory, Playback(loop=True)), 7)
    assert [message.reset_counter for _, message in reports] == [0, 1, 1, 2, 3, 3, 4]


def test_reset_counter_wraps_at_256() -> None:
    reports = played(RecordedEngine(make_trajectory(2, resets=np.array([255, 256])), Playback()))
    assert [message.reset_counter for _, message in reports] == [255, 0]


def test_changes_start_with_the_second_record_and_not_across_a_reset() -> None:
    trajectory = make_trajectory(5, resets=np.array([0, 0, 0, 1, 1]))
    reports = played(RecordedEngine(trajectory, Playback(FORMS["delta"])))
    assert [due_us for due_us, _ in reports] == [100_000, 200_000, 400_000]
    assert all(isinstance(message, VISION_POSITION_DELTA) for _, message in reports)
    assert [message.position_delta[0] for _, message in reports] == pytest.approx([0.1] * 3)


def test_quality_is_that_of_the_playback() -> None:
    ((_, message), *_) = played(RecordedEngine(make_trajectory(), Playback(quality=55)))
    assert message.quality == 55


def test_same_playback_twice_says_the_same() -> None:
    first, second = (played(RecordedEngine(make_trajectory(), Playback())) for _ in range(2))
    assert repr(first) == repr(second)
