# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Makes of a stream of poses, with all its jumps and gaps, a movement for the vehicle to follow."""

import math
from typing import Final

from ekf_stub.core.vectors import scaled, turned
from viso.vehicle.sensors.stream.frame import Pose, StreamFrame
from viso.vehicle.sensors.stream.imagined_vehicle import Movement
from viso.vehicle.sensors.stream.tracker import MAX_RATE, MAX_SPEED, StreamTracker
from viso.vehicle.sensors.vectors import ZERO, added, rotation_between

LONGEST_INTERVAL_S: Final = 0.3
"""An interval as long as this explains as much of a difference as any longer one."""


class StreamFollower:
    """The target of the vehicle by the stream, from its first pose on."""

    def __init__(self, first: Pose, vehicle: Movement) -> None:
        self.frame = StreamFrame(first, vehicle)
        self.begin_again(first, vehicle, is_reset=False)

    @property
    def time_s(self) -> float:
        """When the newest pose was observed, s since boot."""
        return self._last.time_s

    def target(self, time_s: float) -> Movement:
        """Return the movement to follow at a time."""
        return self._tracker.at(time_s)

    def begin_again(self, pose: Pose, vehicle: Movement, *, is_reset: bool) -> bool:
        """Take a pose after a gap, in which the vehicle went its own way; return whether it says where that is."""
        has_jumped = self.frame.settle_jump(pose, vehicle, LONGEST_INTERVAL_S, is_reset=is_reset)
        shown = self.frame.apply(pose)
        start = vehicle._replace(pos=shown.pos, acc=ZERO, quat=shown.quat, rate=ZERO)
        self._tracker = StreamTracker(pose.time_s, start)
        self._last = pose
        self._before_last: Pose | None = None
        return not has_jumped

    def go_on(self, pose: Pose, *, is_reset: bool) -> bool:
        """Take a pose, later than the last; return whether it says where the vehicle is, and not that of a jump."""
        interval_s = min(pose.time_s - self.time_s, LONGEST_INTERVAL_S)
        expected, steady = self._tracker.at(pose.time_s), self._steady(pose.time_s)
        has_jumped = self.frame.settle_jump(pose, expected, interval_s, steady=steady, is_reset=is_reset)
        self._tracker.take(*self.frame.apply(pose))
        self._last, self._before_last = pose, self._last
        return not has_jumped

    def _steady(self, time_s: float) -> Pose | None:
        # The tracker is slow to learn of a sudden movement, two poses tell at once; but a jump looks like great speed.
        last, before = self._last, self._before_last
        if before is None:
            return None
        per_interval = 1.0 / (last.time_s - before.time_s)
        vel = scaled(added(last.pos, before.pos, -1.0), per_interval)
        rate = scaled(rotation_between(before.quat, last.quat), per_interval)
        if math.hypot(*vel) > MAX_SPEED or math.hypot(*rate) > MAX_RATE:
            return None
        ahead_s = time_s - last.time_s
        return Pose(time_s, added(last.pos, vel, ahead_s), turned(last.quat, scaled(rate, ahead_s)))
