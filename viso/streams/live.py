# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Poses that come one by one, told at once as external navigation: nothing of what is to come is known."""

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np

from mav_handlers.wire.messages import Message
from viso.companion.vio.config import CovarianceEncoding
from viso.geometry.rotation import Array, so3_log
from viso.geometry.trajectory import Pose, Trajectory
from viso.geometry.trajectory_files import DAY_NS, FAR_OFF, NOT_LATER, TooFewRecords, TrajectoryError, usable
from viso.streams.bag_formats import PoseMessage, collect
from viso.streams.messages import FORMS, Form, Report

RESET_JUMP_M: Final = 0.5
NO_TIME: Final = "a stamp that is no time"
NO_VELOCITY: Final = "no velocity, and no pose just before to take one from"
SECOND_NS: Final = 1_000_000_000
_JUMP_RAD: Final = math.radians(10)
# A vehicle does not change its motion by more.
_ACCELERATION: Final = 20.0
_TURN_ACCELERATION: Final = 17.0
_LONGEST_S, _LONGEST_TURN_S = 2.0, 0.5


@dataclass(frozen=True, slots=True)
class LiveOptions:
    """How to tell of poses.

    Attributes:
        adapt: makes trajectories those of the vehicle: FRD body, NED or FRD world.
        quality: of every report, -1 to 100.
        reset_jump_m: count a reset where a position is further from where the motion before leads.
        from_zero: let the first position be the origin.
    """

    adapt: Callable[[Trajectory], Trajectory]
    form: Form = FORMS["odometry"]
    quality: int = 100
    encoding: CovarianceEncoding = CovarianceEncoding.VARIANCE
    reset_jump_m: float = RESET_JUMP_M
    from_zero: bool = False


class Told(NamedTuple):
    """What a pose is told as, and when it was by its own stamp."""

    time_ns: int
    messages: tuple[Message, ...]


class _Last(NamedTuple):
    """The pose before; ``turn_rate`` in rad/s about the vertical."""

    report: Report
    time_ns: int
    rotation: Array
    turn_rate: float


class LivePoses:
    """Makes each pose a report as it comes; what cannot be used is left out, and counted.

    The reset counter counts what the autopilot must not take for movement: a position or a heading that is not where
    the motion before leads, stamps that begin again, a sender that does. Poses without a velocity get that since the
    pose before; the first one, and the first after a reset, has none, and is not told where a velocity is.
    """

    def __init__(self, options: LiveOptions) -> None:
        self._options = options
        self._last: _Last | None = None
        self._stray_ns: int | None = None
        self._origin: Array | None = None
        self._velocity_told = False
        self.left_out: Counter[str] = Counter()
        self.resets = 0

    def begin_anew(self) -> None:
        """Have the next pose be in a frame that may be another, as after a restart of who sends them."""
        self.resets += self._last is not None
        self._last = self._stray_ns = None

    def take(self, message: PoseMessage) -> Told | None:
        """Return what a pose is told as; None if it cannot be used. Never raises for what it holds."""
        try:
            with np.errstate(all="ignore"):
                recorded = self._recorded(message)
        except TooFewRecords as error:
            self.left_out.update(error.left_out)
            return None
        except TrajectoryError:
            self.left_out[NO_TIME] += 1
            return None
        self.left_out.update(recorded.left_out)
        trajectory = self._options.adapt(recorded)
        time_ns = int(trajectory.times_ns[0])
        return self._tell(trajectory, time_ns) if self._is_in_time(time_ns) else None

    def _recorded(self, message: PoseMessage) -> Trajectory:
        """Return a trajectory of one record, with a velocity as far as it is told."""
        records = collect("live", (message,))
        origin = self._origin
        if self._options.from_zero and origin is not None:
            records = replace(records, positions=np.array(records.positions) - origin)
        recorded = usable(records, from_anywhere=self._options.from_zero, fewest=1)
        if self._options.from_zero and origin is None:
            self._origin = recorded.positions[0]
            recorded = replace(recorded, positions=np.zeros((1, 3)))
        # Programs that do not know the velocity tell zeros, but so do those that do, at rest.
        if recorded.velocities is not None:
            self._velocity_told = True
        elif records.velocities is not None and (self._velocity_told or self._last is None):
            told = np.array(records.velocities, dtype=np.float64)
            return recorded if np.isnan(told).any() else replace(recorded, velocities=told)
        return recorded

    def _is_in_time(self, time_ns: int) -> bool:
        """Return whether a stamp goes on from the one before; two that go on from each other elsewhere restart."""
        last, stray_ns = self._last, self._stray_ns
        if last is None or 0 < time_ns - last.time_ns <= DAY_NS:
            self._stray_ns = None
            return True
        if stray_ns is not None and 0 < time_ns - stray_ns <= SECOND_NS < abs(time_ns - last.time_ns):
            self.begin_anew()
            return True
        self._stray_ns = time_ns
        self.left_out[NOT_LATER if time_ns <= last.time_ns else FAR_OFF] += 1
        return False

    def _tell(self, trajectory: Trajectory, time_ns: int) -> Told | None:
        options, last, pose = self._options, self._last, trajectory.pose(0)
        rotation = Report(0, pose).rotation
        turn_rate = 0.0
        known = trajectory.velocities is not None
        if last is not None:
            elapsed_s = (time_ns - last.time_ns) * 1e-9
            turn = float(so3_log(rotation @ last.rotation.T)[2])
            if self._leapt(last, pose, turn, elapsed_s):
                self.begin_anew()
                last = None
            else:
                turn_rate = turn / elapsed_s
                if not known and elapsed_s <= 1.0:
                    velocity, known = (pose.position - last.report.pose.position) / elapsed_s, True
                    pose = replace(pose, velocity=velocity)
        previous = None if last is None else replace(last.report, previous=None)  # no chain through the whole flight
        pose = replace(pose, resets=self.resets)
        report = Report(time_ns // 1000, pose, previous, self.resets % 256, options.quality, options.encoding)
        self._last = _Last(report, time_ns, rotation, turn_rate)
        if options.form.tells_velocity and not known:
            self.left_out[NO_VELOCITY] += 1
            return None
        return Told(time_ns, options.form.encode(report))

    def _leapt(self, last: _Last, pose: Pose, turn_rad: float, elapsed_s: float) -> bool:
        """Return whether a pose is neither near the one before nor where its motion leads."""
        before = last.report.pose
        step = pose.position - before.position
        off_m = min(float(np.linalg.norm(step)), float(np.linalg.norm(step - before.velocity * elapsed_s)))
        off_rad = min(abs(turn_rad), abs(turn_rad - last.turn_rate * elapsed_s))
        return (
            off_m > self._options.reset_jump_m + 0.5 * _ACCELERATION * min(elapsed_s, _LONGEST_S) ** 2
            or off_rad > _JUMP_RAD + 0.5 * _TURN_ACCELERATION * min(elapsed_s, _LONGEST_TURN_S) ** 2
        )
