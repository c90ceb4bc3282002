# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Playing on a link in step with a clock that moves only when the player waits, and into a telemetry log."""

from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np
import pytest

from mav_handlers.links import read_tlog
from mav_handlers.links.base import Link
from mav_handlers.links.pair import make_pair
from mav_handlers.links.tlog import YEAR_2000_US
from mav_handlers.wire.codec import Codec, Received
from mav_handlers.wire.messages import HEARTBEAT, STATUSTEXT, Message
from viso.errors import InputError
from viso.geometry.trajectory import Trajectory
from viso.running import playing
from viso.running.playing import LinkPlay, write_telemetry_log
from viso.streams.player import Playback, Player, RecordedEngine, Text

PERIOD_NS = 250_000_000


def make_player(count: int = 5, *, loop: bool = False) -> Player:
    trajectory = Trajectory(
        np.arange(count) * PERIOD_NS, np.zeros((count, 3)), np.tile([1.0, 0.0, 0.0, 0.0], (count, 1))
    )
    return Player(RecordedEngine(trajectory, Playback(loop=loop)))


class Rig:
    """A player on a wire with a clock; ``arrived`` holds the clock and the name of every message at the other end."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, player: Player, speedup: float = 1.0) -> None:
        self.now_s = 1000.0
        self.waits: list[float] = []
        self.stopped = False
        self.texts: list[Text] = []
        self.arrived: list[tuple[float, str]] = []
        self.on_wait: Callable[[], None] = lambda: None
        self._link, self._vehicle = make_pair()
        self._codec = Codec(1, 1)
        monkeypatch.setattr(playing, "wait_readable", self._wait)
        self.play = LinkPlay(
            self._link,
            player,
            on_text=self.texts.append,
            stop=lambda: self.stopped,
            speedup=speedup,
            now_s=lambda: self.now_s,
        )

    def _wait(self, _links: Iterable[Link], timeout_s: float) -> list[Link]:
        self._look()
        self.waits.append(timeout_s)
        self.now_s += max(timeout_s, 1e-6)
        self.on_wait()
        return []

    def _look(self) -> None:
        self._codec.feed(self._vehicle.receive())
        while (received := self._codec.next_received()) is not None:
            assert isinstance(received, Received)
            self.arrived.append((self.now_s, received.header.name))

    def say(self, message: Message) -> None:
        """Let the vehicle say something."""
        self._vehicle.send(self._codec.encode(message))

    def times_s(self, name: str) -> list[float]:
        return [time_s - 1000.0 for time_s, what in self.arrived if what == name]


@pytest.fixture
def rig(monkeypatch: pytest.MonkeyPatch) -> Rig:
    return Rig(monkeypatch, make_player())


def test_records_go_out_at_their_times(rig: Rig) -> None:
    rig.play.run()
    assert rig.times_s("ODOMETRY") == pytest.approx([0.0, 0.25, 0.5, 0.75, 1.0], abs=1e-3)
    assert rig.times_s("HEARTBEAT") == pytest.approx([0.0, 1.0], abs=1e-3)


def test_speedup_counts_for_all(monkeypatch: pytest.MonkeyPatch) -> None:
    rig = Rig(monkeypatch, make_player(), speedup=10.0)
    rig.play.run()
    assert rig.times_s("ODOMETRY") == pytest.approx([0.0, 0.025, 0.05, 0.075, 0.1], abs=1e-3)


def test_waits_are_short_enough_to_heed_a_signal(rig: Rig) -> None:
    rig.play.run()
    assert max(rig.waits) <= playing.LONGEST_WAIT_S


def test_playing_ends_when_told(rig: Rig) -> None:
    rig.on_wait = lambda: setattr(rig, "stopped", rig.now_s > 1000.3)
    rig.play.run()
    assert len(rig.times_s("ODOMETRY")) == 2


def test_playing_ends_at_its_time(rig: Rig) -> None:
    rig.play.run(until_us=500_000)
    assert len(rig.times_s("ODOMETRY")) == 3


def test_texts_are_told_while_playing(rig: Rig) -> None:
    rig.say(STATUSTEXT(6, "ArduPilot Ready"))
    rig.play.run()
    assert rig.texts == [Text(6, "ArduPilot Ready")]


def test_vehicle_is_waited_for_with_heartbeats(rig: Rig) -> None:
    def answer() -> None:
        if rig.now_s > 1001.15:
            rig.say(HEARTBEAT(2, 3, 0, 0, 4, 3))

    rig.on_wait = answer
    assert rig.play.wait_for_vehicle(5.0)
    assert rig.times_s("HEARTBEAT") == pytest.approx([0.0, 1.0], abs=0.11)
    assert rig.now_s < 1001.5


def test_patience_ends(rig: Rig) -> None:
    assert not rig.play.wait_for_vehicle(2.0)
    assert rig.now_s == pytest.approx(1002.0, abs=0.2)


def test_waiting_ends_when_told(rig: Rig) -> None:
    rig.stopped = True
    assert not rig.play.wait_for_vehicle(2.0)
    assert rig.waits == []


def test_log_has_every_frame_at_its_time(tmp_path: Path) -> None:
    write_telemetry_log(tmp_path / "flight.tlog", make_player(3), 0, None)
    entries = list(read_tlog(tmp_path / "flight.tlog"))
    assert [entry.time_us - YEAR_2000_US for entry in entries] == [0, 0, 250_000, 500_000]


def test_log_begins_at_the_time_of_day_of_the_recording(tmp_path: Path) -> None:
    write_telemetry_log(tmp_path / "flight.tlog", make_player(3), 1_403_636_583_763_560_000, None)
    assert next(read_tlog(tmp_path / "flight.tlog")).time_us == 1_403_636_583_763_560


def test_log_of_a_loop_ends_at_its_time(tmp_path: Path) -> None:
    write_telemetry_log(tmp_path / "flight.tlog", make_player(3, loop=True), 0, 2_000_000)
    assert list(read_tlog(tmp_path / "flight.tlog"))[-1].time_us == pytest.approx(YEAR_2000_US + 2_000_000, abs=2)


@pytest.mark.parametrize("name", ["none/flight.tlog", "/dev/full"])
def test_log_that_cannot_be_written_is_one_line(tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError, match=r"No such file|No space left"):
        write_telemetry_log(tmp_path / name, make_player(), 0, None)
