# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A recorded engine: reports a trajectory as the odometry that recorded it would have, in time."""

from dataclasses import dataclass, field, replace

import numpy as np

from mav_handlers.wire.messages import Message
from viso.companion.odometry.encoding import CovarianceEncoding
from viso.companion.recorded.messages import FORMS, Form, Report
from viso.companion.recorded.recorded_trajectory import RecordedTrajectory
from viso.companion.sender import OffsetClock


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

    def __init__(self, trajectory: RecordedTrajectory, playback: Playback) -> None:
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
