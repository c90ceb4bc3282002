# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""From targets to accelerations: a way to the target that keeps the limits, and corrections that keep to the way.

Source: AC_AttitudeControl/AC_PosControl.cpp in outline. There a limit of jerk smooths the way too.
"""

import math
from typing import Final, NamedTuple

from ekf_stub.reports import NO_LIMITS, ControlLimits
from viso.vehicle.sensors.vectors import ZERO, Three

POSITION_GAIN: Final = 1.0
VELOCITY_GAIN: Final = (2.0, 2.0, 4.0)
INTEGRAL_GAIN: Final = 0.5
MOST_INTEGRAL_M_S2: Final = 3.0
_DOWN: Final = 2
JUMP_M: Final = 0.25
"""An estimate that moves so much more than its velocity says was reset: the way moves along with it."""


class Estimate(NamedTuple):
    """The estimate: m and m/s (NED), yaw in rad; None for what is unknown; and what the estimator asks for."""

    pos: Three | None
    vel: Three
    yaw_rad: float
    limits: ControlLimits = NO_LIMITS


class Pace(NamedTuple):
    """Speeds and accelerations of a way, m/s and m/s/s."""

    speed: float
    accel: float
    speed_up: float
    speed_down: float
    accel_z: float


def approach_speed(distance_m: float, accel: float) -> float:
    """Return the speed with which to approach a target: in proportion near it, to be braked in time far from it.

    Source: AP_Math/control.cpp, sqrt_controller.
    """
    linear_m = accel / POSITION_GAIN**2
    if distance_m <= linear_m:
        return POSITION_GAIN * distance_m
    return math.sqrt(2.0 * accel * (distance_m - 0.5 * linear_m))


def _toward(value: tuple[float, ...], target: tuple[float, ...], most: float) -> tuple[float, ...]:
    """Return a vector that is changed towards another one, by a length at most."""
    change = tuple(to - at for at, to in zip(value, target, strict=True))
    length = math.hypot(*change)
    scale = 1.0 if length <= most else most / length
    return tuple(at + scale * part for at, part in zip(value, change, strict=True))


class PositionControl:
    """Steers along a way of its own making, which begins where the vehicle is."""

    def __init__(self) -> None:
        self.restart(Estimate(None, ZERO, 0.0))

    def restart(self, estimate: Estimate) -> None:
        """Begin a new way at an estimate."""
        self.pos: Three = estimate.pos or ZERO
        self.vel: Three = estimate.vel
        self._acc: Three = ZERO
        self._integral: Three = ZERO
        self._last: Estimate = estimate

    def heed_reset(self, estimate: Estimate, dt_s: float) -> None:
        """Move the way along with an estimate that has jumped (AC_PosControl::NE_handle_ekf_reset)."""
        last = self._last
        if estimate.pos is not None and last.pos is not None:
            north, east, down = (
                now - before - dt_s * speed for now, before, speed in zip(estimate.pos, last.pos, last.vel, strict=True)
            )
            if math.hypot(north, east, down) > JUMP_M:
                self.pos = self.pos[0] + north, self.pos[1] + east, self.pos[2] + down
        elif estimate.pos is not None:
            self.pos = estimate.pos
        self._last = estimate

    def to_place(self, north_m: float, east_m: float, pace: Pace, dt_s: float) -> None:
        """Go on towards a place."""
        ahead = north_m - self.pos[0], east_m - self.pos[1]
        distance = math.hypot(*ahead)
        speed = min(approach_speed(distance, pace.accel), pace.speed)
        scale = speed / distance if distance else 0.0
        self.at_velocity(scale * ahead[0], scale * ahead[1], pace, dt_s)

    def at_velocity(self, north_m_s: float, east_m_s: float, pace: Pace, dt_s: float) -> None:
        """Go on with a horizontal velocity, which is reached with the pace's acceleration."""
        speed = math.hypot(north_m_s, east_m_s)
        scale = 1.0 if speed <= pace.speed else pace.speed / speed
        north, east = _toward(self.vel[:2], (scale * north_m_s, scale * east_m_s), pace.accel * dt_s)
        self._go(0, north, dt_s)
        self._go(1, east, dt_s)

    def to_height(self, down_m: float, pace: Pace, dt_s: float) -> None:
        """Go on towards a height, m below the origin."""
        ahead = down_m - self.pos[2]
        self.climb(-math.copysign(approach_speed(abs(ahead), pace.accel_z), ahead), pace, dt_s)

    def climb(self, rate_m_s: float, pace: Pace, dt_s: float) -> None:
        """Go on with a climb rate, which is reached with the pace's vertical acceleration."""
        down = -min(max(rate_m_s, -pace.speed_down), pace.speed_up)
        (speed,) = _toward(self.vel[2:], (down,), pace.accel_z * dt_s)
        self._go(2, speed, dt_s)

    def _go(self, axis: int, vel: float, dt_s: float) -> None:
        def changed(vector: Three, value: float) -> Three:
            parts = [*vector]
            parts[axis] = value
            return parts[0], parts[1], parts[2]

        self._acc = changed(self._acc, (vel - self.vel[axis]) / dt_s)
        self.pos = changed(self.pos, self.pos[axis] + 0.5 * (vel + self.vel[axis]) * dt_s)
        self.vel = changed(self.vel, vel)

    def acceleration(self, estimate: Estimate, dt_s: float) -> Three:
        """Return what brings the vehicle onto the way and along it, m/s/s NED; by velocity alone without a position."""
        wanted = []
        integral = []
        for axis in range(3):
            off_m = 0.0 if estimate.pos is None else self.pos[axis] - estimate.pos[axis]
            gain = 1.0 if axis == _DOWN else estimate.limits.gain
            error = self.vel[axis] + gain * POSITION_GAIN * off_m - estimate.vel[axis]
            summed = self._integral[axis] + INTEGRAL_GAIN * error * dt_s
            integral.append(min(max(summed, -MOST_INTEGRAL_M_S2), MOST_INTEGRAL_M_S2))
            wanted.append(self._acc[axis] + gain * (VELOCITY_GAIN[axis] * error + integral[axis]))
        self._integral = integral[0], integral[1], integral[2]
        return wanted[0], wanted[1], wanted[2]
