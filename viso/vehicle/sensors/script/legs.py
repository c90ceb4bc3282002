# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A scripted trajectory, and its legs, each from rest to rest and smooth to the third derivative within."""

import math
from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import accumulate
from typing import Final, NamedTuple, Protocol

from ekf_stub.core.inertial import GRAVITY_MSS
from ekf_stub.core.vectors import quat_of_euler, scaled
from viso.vehicle.sensors.motion import State
from viso.vehicle.sensors.vectors import ZERO, Three, added

TURN: Final = 2.0 * math.pi


class Motion(NamedTuple):
    """Position, velocity and acceleration in m and s, NED, and roll, pitch and yaw in rad (3-2-1)."""

    pos: Three
    vel: Three
    acc: Three
    rpy: Three


class Leg(Protocol):
    """A part of a trajectory; ``at`` is asked for 0..``duration_s``, which may be infinite."""

    @property
    def duration_s(self) -> float:
        """How long it takes."""

    def at(self, t: float) -> Motion:
        """Return the motion t seconds after its start."""


def min_jerk(x: float) -> Three:
    """Return the way from 0 to 1 with the least jerk, its first and its second derivative, for a time x of 0..1."""
    rest = 1.0 - x
    return x * x * x * (10.0 - 15.0 * x + 6.0 * x * x), 30.0 * (x * rest) ** 2, 60.0 * x * rest * (rest - x)


def _to_earth(bearing_rad: float, plane: tuple[float, float]) -> tuple[float, float]:
    """Return north and east of what is ahead and to the right of a direction."""
    cos, sin = math.cos(bearing_rad), math.sin(bearing_rad)
    return cos * plane[0] - sin * plane[1], sin * plane[0] + cos * plane[1]


@dataclass(frozen=True)
class PointLeg:
    """Straight to a point, and to an attitude, as smoothly as can be."""

    start: Three
    end: Three
    start_rpy: Three
    end_rpy: Three
    duration_s: float

    def at(self, t: float) -> Motion:
        """Return the motion t seconds after the start."""
        way, speed, accel = min_jerk(t / self.duration_s)
        distance, turn = added(self.end, self.start, -1.0), added(self.end_rpy, self.start_rpy, -1.0)
        return Motion(
            added(self.start, distance, way),
            scaled(distance, speed / self.duration_s),
            scaled(distance, accel / self.duration_s**2),
            added(self.start_rpy, turn, way),
        )


class Curve(NamedTuple):
    """A closed curve in the plane at a phase in rad: place, and its first and second derivative by the phase.

    x is ahead and y to the right of the direction in which the curve lies; ``turned`` is by how much the direction of
    travel has turned since phase 0, in rad.
    """

    place: tuple[float, float]
    first: tuple[float, float]
    second: tuple[float, float]
    turned: float


CurveAt = Callable[[float], Curve]


def line(length_m: float) -> CurveAt:
    """Return a straight line ahead and back again."""
    half = 0.5 * length_m

    def at(phase: float) -> Curve:
        sin, cos = math.sin(phase), math.cos(phase)
        return Curve((half - half * cos, 0.0), (half * sin, 0.0), (half * cos, 0.0), 0.0)

    return at


def circle(radius_m: float) -> CurveAt:
    """Return a circle that begins ahead and turns to the right."""

    def at(phase: float) -> Curve:
        x, y = radius_m * math.sin(phase), radius_m * math.cos(phase)
        return Curve((x, radius_m - y), (y, x), (-x, y), phase)

    return at


def figure_eight(length_m: float, width_m: float) -> CurveAt:
    """Return a lying eight (lemniscate of Gerono) that begins at its crossing, ahead and to the right."""
    half_length, half_width = 0.5 * length_m, 0.5 * width_m

    def direction(first: tuple[float, float]) -> float:
        # It sweeps over less than a full turn, and never over straight right.
        angle = math.atan2(first[1], first[0])
        return angle if angle < 0.5 * math.pi else angle - TURN

    begin = direction((half_length, width_m))

    def at(phase: float) -> Curve:
        sin, cos, sin2, cos2 = math.sin(phase), math.cos(phase), math.sin(2 * phase), math.cos(2 * phase)
        first = half_length * cos, width_m * cos2
        second = -half_length * sin, -2.0 * width_m * sin2
        return Curve((half_length * sin, half_width * sin2), first, second, direction(first) - begin)

    return at


@dataclass(frozen=True)
class CurveLeg:
    """Laps of a closed curve; the first and the last begin and end at rest.

    Attributes:
        curve: the curve.
        start, start_rpy: where it begins.
        bearing_rad: the direction in which the curve lies.
        period_s: time of a lap at full speed.
        ramp_s: how long it takes to reach full speed, and to lose it, at most a period.
        laps: how many; infinite for ever.
        turns: whether yaw turns with the direction of travel.
    """

    curve: CurveAt
    start: Three
    start_rpy: Three
    bearing_rad: float
    period_s: float
    ramp_s: float
    laps: float = math.inf
    turns: bool = False

    @property
    def duration_s(self) -> float:
        """How long it takes: half of each ramp is lost."""
        return self.laps * self.period_s + self.ramp_s

    def at(self, t: float) -> Motion:
        """Return the motion t seconds after the start."""
        phase, rate, rate_change = self._phase(t)
        curve = self.curve(phase)
        roll, pitch, yaw = self.start_rpy
        north, east, down = self.start
        to_north, to_east = _to_earth(self.bearing_rad, curve.place)
        first, second = _to_earth(self.bearing_rad, curve.first), _to_earth(self.bearing_rad, curve.second)
        squared = rate * rate
        return Motion(
            (north + to_north, east + to_east, down),
            (rate * first[0], rate * first[1], 0.0),
            (squared * second[0] + rate_change * first[0], squared * second[1] + rate_change * first[1], 0.0),
            (roll, pitch, yaw + curve.turned if self.turns else yaw),
        )

    def _phase(self, t: float) -> Three:
        """Return the phase, its rate and the change of that, in rad and s."""
        full_rate, ramp = TURN / self.period_s, self.ramp_s
        left = self.duration_s - t
        if ramp <= t <= self.duration_s - ramp:
            return full_rate * (t - 0.5 * ramp), full_rate, 0.0
        x = min(t, left) / ramp
        speed, change, _ = min_jerk(x)
        gone = full_rate * ramp * x**4 * (2.5 - 3.0 * x + x * x)
        if t <= left:
            return gone, full_rate * speed, full_rate * change / ramp
        return TURN * self.laps - gone, full_rate * speed, -full_rate * change / ramp


@dataclass(frozen=True)
class SquareLeg:
    """Laps of a square to the right, at rest in its corners."""

    start: Three
    start_rpy: Three
    bearing_rad: float
    side_m: float
    period_s: float
    laps: float = math.inf

    @property
    def duration_s(self) -> float:
        """How long it takes."""
        return self.laps * self.period_s

    def at(self, t: float) -> Motion:
        """Return the motion t seconds after the start."""
        side_s = 0.25 * self.period_s
        side = min(int(t / side_s), 4 * self.laps - 1)
        corner, next_corner = self._corner(int(side) % 4), self._corner(int(side + 1) % 4)
        leg = PointLeg(corner, next_corner, self.start_rpy, self.start_rpy, side_s)
        return leg.at(min(t - side * side_s, side_s))

    def _corner(self, number: int) -> Three:
        ahead, right = ((0, 0), (1, 0), (1, 1), (0, 1))[number]
        to_north, to_east = _to_earth(self.bearing_rad, (self.side_m * ahead, self.side_m * right))
        north, east, down = self.start
        return north + to_north, east + to_east, down


def tilt_of(motion: Motion) -> tuple[float, float]:
    """Return roll and pitch in rad of a multirotor that accelerates so: its thrust is along its vertical axis."""
    north, east, down = motion.acc
    cos, sin = math.cos(motion.rpy[2]), math.sin(motion.rpy[2])
    ahead, right, up = cos * north + sin * east, cos * east - sin * north, GRAVITY_MSS - down
    return math.asin(right / math.hypot(ahead, right, up)), math.atan2(-ahead, up)


class ScriptedPath:
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
        return State(motion.pos, motion.vel, quat_of_euler(roll, pitch, yaw), yaw)

    def _at_rest(self, motion: Motion) -> State:
        return self._state(motion._replace(vel=ZERO, acc=ZERO))
