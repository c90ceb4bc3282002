# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Modes in which a pilot flies, or the vehicle stays (mode_loiter.cpp, mode_althold.cpp, mode_brake.cpp)."""

import math
from typing import Final

from ekf_stub.core.inertial import GRAVITY_MSS
from viso.vehicle.copter.flying.position_control import Estimate, approach_speed
from viso.vehicle.copter.flying.steering import PERIOD_S, Lean, Steering
from viso.vehicle.sensors.vectors import yawed

TURN_RAD_S: Final = math.radians(202.5)
"""PILOT_Y_RATE's default."""
HOVER_THROTTLE: Final = 0.39
"""MOT_THST_HOVER of the simulator's multicopter."""
BRAKE_M_S2: Final = 7.5
CLIMB_M_S2: Final = 2.5
"""PILOT_ACCEL_Z's default."""
SLOWEST_LOITER_M_S: Final = 0.2
BACK_DOWN_M_S: Final = 0.75
"""AVOID_BACKZ_SPD's default."""
SOFT_M_S2: Final = 1.0


def limited_climb(rate_m_s: float, estimate: Estimate) -> float:
    """Return a climb rate that ends at the height to which the estimator sees well, and leads back to it from above.

    Source: AC_Avoid::adjust_velocity_z.
    """
    if estimate.limits.up_m is None or estimate.pos is None or not rate_m_s:
        return rate_m_s
    below_m = estimate.limits.up_m + estimate.pos[2]
    if below_m <= 0:
        return min(rate_m_s, -min(approach_speed(-below_m, SOFT_M_S2), BACK_DOWN_M_S))
    return min(rate_m_s, approach_speed(below_m, SOFT_M_S2))


def _climb_and_turn(steering: Steering) -> None:
    limits, sticks = steering.limits, steering.sticks
    up = limits.pilot_speed_up if sticks.throttle > 0 else limits.pilot_speed_dn
    pace = steering.travel_pace()._replace(
        speed_up=limits.pilot_speed_up, speed_down=limits.pilot_speed_dn, accel_z=CLIMB_M_S2
    )
    steering.way.climb(limited_climb(up * sticks.throttle, steering.estimate), pace, PERIOD_S)
    _turn(steering)


def _turn(steering: Steering) -> None:
    sticks = steering.sticks
    if sticks.yaw:
        steering.heading.turn_at(TURN_RAD_S * sticks.yaw)
    else:
        steering.heading.stop_turning()


class _FromHere:
    """A mode that begins with the vehicle's heading as it is."""

    def __init__(self, steering: Steering) -> None:
        self._steering = steering

    def enter(self) -> None:
        """Begin where the vehicle is."""
        self._steering.heading.hold()


class Loiter(_FromHere):
    """Sticks ask for a velocity; centred, the vehicle stays. Other modes that hold a position do the same here."""

    def run(self) -> Lean | None:
        """Go on for a period; sticks ask for no more than the estimator does (AC_Loiter::calc_desired_velocity)."""
        steering, limits, sticks = self._steering, self._steering.limits, self._steering.sticks
        speed = max(min(limits.loit_speed, steering.estimate.limits.speed_m_s), SLOWEST_LOITER_M_S)
        north, east, _ = yawed((-speed * sticks.pitch, speed * sticks.roll, 0.0), steering.estimate.yaw_rad)
        pace = steering.travel_pace()._replace(speed=speed, accel=limits.loit_acc_max)
        steering.way.at_velocity(north, east, pace, PERIOD_S)
        _climb_and_turn(steering)
        return None


class HoldHeight(_FromHere):
    """Sticks ask for lean angles and a climb rate."""

    def run(self) -> Lean | None:
        """Go on for a period."""
        _climb_and_turn(self._steering)
        most = self._steering.limits.angle_max
        return Lean(most * self._steering.sticks.roll, most * self._steering.sticks.pitch)


class Manual(_FromHere):
    """Sticks ask for lean angles and a thrust; with the throttle at its middle the vehicle neither climbs nor sinks.

    Source: ArduCopter/mode_stabilize.cpp, Mode::get_pilot_desired_throttle.
    """

    def run(self) -> Lean | None:
        """Go on for a period."""
        steering, sticks = self._steering, self._steering.sticks
        steering.way.restart(steering.estimate)  # so that the next mode begins with the motion that there is
        _turn(steering)
        most = steering.limits.angle_max
        return Lean(most * sticks.roll, most * sticks.pitch, GRAVITY_MSS * _throttle(sticks.lever) / HOVER_THROTTLE)


def _throttle(lever: float) -> float:
    """Return the throttle of a stick, both 0..1, curved so that the stick's middle hovers."""
    expo = min(max((0.5 - HOVER_THROTTLE) / 0.375, -0.5), 1.0)
    return lever * (1.0 - expo) + expo * lever**3


class Brake(_FromHere):
    """Stops as fast as it can, and stays."""

    def run(self) -> Lean | None:
        """Go on for a period."""
        pace = self._steering.travel_pace()._replace(accel=BRAKE_M_S2, accel_z=BRAKE_M_S2)
        self._steering.way.at_velocity(0.0, 0.0, pace, PERIOD_S)
        self._steering.way.climb(0.0, pace, PERIOD_S)
        return None
