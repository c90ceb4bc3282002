# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A recorded engine, which reports a trajectory as the odometry that recorded it would have, as a MAVLink component."""

from dataclasses import dataclass, field, replace
from typing import Final, NamedTuple

import numpy as np

from mav_handlers.wire.codec import Received
from mav_handlers.wire.messages import STATUSTEXT, Message
from viso.companion.sender import (
    COMPANION_HEARTBEAT,
    MavlinkSender,
    OffsetClock,
)
from viso.companion.vio.config import CovarianceEncoding
from viso.geometry.trajectory import Trajectory
from viso.streams.messages import FORMS, Form, Report

CHUNK_LENGTH: Final = 50
MAX_CHUNKS: Final = 6


@dataclass(frozen=True)
class Playback:
    """How to play.

    Attributes:
        speed: seconds of the recording in one of the vehicle's; velocities follow.
        loop: start again at the end, as after a reset.
        start_us: when the first record is taken, since the start.
        latency_us: from taking a record to sending it.
        clock: what stamps are taken from.
        quality: of every report, -1 to 100.
    """

    form: Form = FORMS["odometry"]
    speed: float = 1.0
    loop: bool = False
    start_us: int = 0
    latency_us: int = 0
    clock: OffsetClock = field(default_factory=OffsetClock)
    quality: int = 100
    encoding: CovarianceEncoding = CovarianceEncoding.VARIANCE


class RecordedEngine:
    """Plays a trajectory of the vehicle (FRD body, NED or FRD world) record by record, at the rate that it has."""

    def __init__(self, trajectory: Trajectory, playback: Playback) -> None:
        self._trajectory = trajectory
        self._playback = playback
        since_start_ns = trajectory.times_ns - trajectory.times_ns[0]
        self._taken_us = np.rint(since_start_ns / (1e3 * playback.speed)).astype(np.int64)
        # A lap ends where the next record would be.
        self._lap_us = int(self._taken_us[-1] + self._taken_us[-1] // max(len(trajectory) - 1, 1) + 1)
        self._lap_resets = trajectory.pose(len(trajectory) - 1).resets + 1
        self._lap = self._next = 0
        self._previous: Report | None = None

    def _next_taken_us(self) -> int:
        return self._playback.start_us + self._lap * self._lap_us + int(self._taken_us[self._next])

    def next_due_us(self) -> int | None:
        """Return when the next report is to be sent, in us since the start; None after the last."""
        if self._next >= len(self._trajectory):
            return None
        return self._next_taken_us() + self._playback.latency_us

    def report(self) -> tuple[Message, ...]:
        """Return the messages of the next record, and go on to the one after it. Raises IndexError if there is none."""
        playback, pose = self._playback, self._trajectory.pose(self._next)
        resets = self._lap * self._lap_resets + pose.resets
        pose = replace(pose, velocity=pose.velocity * playback.speed, resets=resets)
        before = self._previous if self._previous and self._previous.pose.resets == resets else None
        time_us = playback.clock.time_us(self._next_taken_us())
        report = Report(time_us, pose, before, resets % 256, playback.quality, playback.encoding)
        self._previous = replace(report, previous=None)  # no chain through the whole flight
        self._next += 1
        if self._next == len(self._trajectory) and playback.loop:
            self._next, self._lap = 0, self._lap + 1
        return playback.form.encode(report)


class Frame(NamedTuple):
    """A frame, and when it is to be sent, in us since the start."""

    due_us: int
    data: bytes


class Text(NamedTuple):
    """What the vehicle said: MAV_SEVERITY, and the text without control characters."""

    severity: int
    text: str


class TextPieces:
    """Long texts, which come in chunks."""

    def __init__(self) -> None:
        self._open_id = 0
        self._pieces: list[str] = []

    def take(self, chunk: STATUSTEXT) -> list[Text]:
        """Return the text that a chunk ends; nothing while more is to come."""
        clean = "".join(character if character.isprintable() else "?" for character in chunk.text)
        if chunk.id == 0:
            return [Text(chunk.severity, clean)]
        if chunk.chunk_seq == 0 or chunk.id != self._open_id:
            self._open_id, self._pieces = chunk.id, []  # what a lost chunk has left open is forgotten
        self._pieces.append(clean)
        if len(clean) == CHUNK_LENGTH and len(self._pieces) < MAX_CHUNKS:
            return []
        text, self._pieces = "".join(self._pieces), []
        return [Text(chunk.severity, text)]


class Player:
    """Sends a heartbeat once a second and what the engine reports, counts both, and listens to texts.

    It has ``heard`` the vehicle when a whole frame has come in.
    """

    def __init__(self, engine: RecordedEngine) -> None:
        self._engine = engine
        self._mavlink = MavlinkSender()
        self._texts = TextPieces()
        self.sent = self._mavlink.sent
        self.heard = False

    def next_due_us(self) -> int | None:
        """Return when the next frame is due; None when the trajectory has been played."""
        due_us = self._engine.next_due_us()
        return None if due_us is None else min(due_us, self._mavlink.heartbeat_us)

    def next_frames(self) -> list[Frame]:
        """Return the frames that are due next, all at one time; none when the trajectory has been played."""
        due_us = self.next_due_us()
        if due_us is None:
            return []
        messages = self._mavlink.heartbeats(due_us) or self._engine.report()
        return [Frame(due_us, self._mavlink.encode(message)) for message in messages]

    def skip_heartbeats(self, until_us: int) -> None:
        """Leave out the heartbeats of ``next_frames`` before a time in us since the start."""
        self._mavlink.skip_heartbeats(until_us)

    def heartbeat(self) -> bytes:
        """Return a heartbeat to be sent now, beside those of ``next_frames``."""
        return self._mavlink.encode(COMPANION_HEARTBEAT)

    def receive_bytes(self, data: bytes) -> list[Text]:
        """Take in bytes from the vehicle and return the texts that are whole."""
        texts = []
        for received in self._mavlink.received(data):
            self.heard |= isinstance(received, Received)
            if isinstance(received, Received) and isinstance(received.message, STATUSTEXT):
                texts += self._texts.take(received.message)
        return texts
