# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a player hands out, and what it makes of what it hears."""

from collections.abc import Callable

import pytest

from mav_handlers.statustext import chunk_text
from mav_handlers.wire.codec import Codec, Received
from mav_handlers.wire.messages import HEARTBEAT, STATUSTEXT
from tests.unit.viso.companion.recorded.conftest import MakeTrajectory
from viso.companion.recorded.engine import Playback, RecordedEngine
from viso.companion.recorded.messages import FORMS
from viso.companion.recorded.player import Frame, Player, Text

LONG = "PreArm: " + "x" * 120


@pytest.fixture
def make(make_trajectory: MakeTrajectory) -> Callable[..., Player]:
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
