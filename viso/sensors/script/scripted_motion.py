# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a vehicle on a script is, how fast it moves and how it is turned."""

import math
from bisect import bisect_right
from collections.abc import Sequence
from itertools import accumulate
from typing import NamedTuple

from ekf_stub.filter import quaternions as quaternion
from ekf_stub.filter.inertial import GRAVITY_MSS
from viso.sensors.attitude import quat_of_rpy
from viso.sensors.script.legs import Leg, Motion
from viso.sensors.vectors import Three

_STILL: Three = (0.0, 0.0, 0.0)


class State(NamedTuple):
    """Position and velocity in m and m/s, NED, attitude (body to earth), and yaw in rad, full turns counted."""

    pos: Three
    vel: Three
    quat: quaternion.quaternion
    yaw_rad: float


def tilt_of(motion: Motion) -> tuple[float, float]:
    """Return roll and pitch in rad of a multirotor that accelerates so: its thrust is along its vertical axis."""
    north, east, down = motion.acc
    cos, sin = math.cos(motion.rpy[2]), math.sin(motion.rpy[2])
    ahead, right, up = cos * north + sin * east, cos * east - sin * north, GRAVITY_MSS - down
    return math.asin(right / math.hypot(ahead, right, up)), math.atan2(-ahead, up)


class Trajectory:
    """Legs one after the other, at rest before the first and after the last.

    Args:
        legs: at least one; each begins where the one before ends.
        tilts: whether roll and pitch follow from the acceleration, as a multirotor's do.
    """

    def __init__(self, legs: Sequence[Leg], *, tilts: bool) -> None:
        self._legs = legs
        self._tilts = tilts
        self._starts_s = list(accumulate((leg.duration_s for leg in legs), initial=0.0))
        self.duration_s = self._starts_s.pop()
        self._first = self._at_rest(legs[0].at(0.0))
        self._last = self._first if math.isinf(self.duration_s) else self._at_rest(legs[-1].at(legs[-1].duration_s))

    def at(self, t: float) -> State:
        """Return the state t seconds after the start; negative before it."""
        if t <= 0.0:
            return self._first
        if t >= self.duration_s:
            return self._last
        number = bisect_right(self._starts_s, t) - 1
        leg = self._legs[number]
        return self._state(leg.at(min(t - self._starts_s[number], leg.duration_s)))

    def _state(self, motion: Motion) -> State:
        roll, pitch, yaw = motion.rpy
        if self._tilts:
            roll, pitch = tilt_of(motion)
        return State(motion.pos, motion.vel, quat_of_rpy(roll, pitch, yaw), yaw)

    def _at_rest(self, motion: Motion) -> State:
        return self._state(motion._replace(vel=_STILL, acc=_STILL))
