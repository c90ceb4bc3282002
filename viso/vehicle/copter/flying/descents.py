# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""LAND and RTL (ArduCopter/mode_land.cpp, ArduCopter/mode_rtl.cpp)."""

import math
from collections.abc import Callable
from enum import Enum
from typing import Final

from viso.vehicle.copter.flying.position_control import approach_speed
from viso.vehicle.copter.flying.steering import LEVEL, PERIOD_S, Lean, Steering
from viso.vehicle.sensors.vectors import Three

PAUSE_US: Final = 4_000_000
"""How long a vehicle that a failsafe makes land stays before it descends (LAND_WITH_DELAY_MS)."""
LOWEST_RETURN_M: Final = 0.3
LEAST_CONE_SLOPE: Final = 0.5
ARRIVED_M: Final = 0.5


class Land:
    """Descends where it is, and without a position level wherever the air takes it.

    Args:
        steering: what it steers with.
        knows_position: says whether the position counts.
        height_m: returns the height above home, which stands for that above the ground.

    Attributes:
        holds_position: it controls the horizontal position.
    """

    def __init__(self, steering: Steering, knows_position: Callable[[], bool], height_m: Callable[[], float]) -> None:
        self._steering = steering
        self._knows_position = knows_position
        self._height_m = height_m
        self._until_us = 0
        self.holds_position = False

    def enter(self) -> None:
        """Begin to descend."""
        self._until_us = 0
        self.holds_position = self._knows_position()
        self._steering.heading.hold()

    def pause(self) -> None:
        """Stay for a while first (ModeLand::set_land_pause)."""
        self._until_us = self._steering.now_us + PAUSE_US

    def run(self) -> Lean | None:
        """Go on for a period (Mode::land_run_vertical_control)."""
        steering, limits = self._steering, self._steering.limits
        pace = steering.travel_pace()._replace(speed_down=max(limits.wpnav_speed_dn, limits.land_speed_high))
        rate = 0.0
        if steering.now_us >= self._until_us:
            above_m = self._height_m() - limits.land_alt_low
            fast = approach_speed(above_m, pace.accel_z) if above_m > 0 else 0.0
            rate = max(min(fast, max(limits.land_speed_high, limits.land_speed)), limits.land_speed)
        steering.way.climb(-rate, pace, PERIOD_S)
        if not self.holds_position:
            return Lean(limits.angle_max * steering.sticks.roll, limits.angle_max * steering.sticks.pitch)
        steering.way.at_velocity(0.0, 0.0, pace, PERIOD_S)
        return None


class _Stage(Enum):
    CLIMB = "climb"
    RETURN = "return"
    WAIT = "wait"
    LAND = "land"


class ReturnHome:
    """Climbs, returns, waits and lands; ``home_ned`` returns where home is, m from the origin."""

    def __init__(self, steering: Steering, land: Land, home_ned: Callable[[], Three | None]) -> None:
        self._steering = steering
        self._land = land
        self._home_ned = home_ned
        self._stage = _Stage.CLIMB
        self._home: Three = (0.0, 0.0, 0.0)
        self._down_m = 0.0
        self._since_us = 0

    def is_landing(self) -> bool:
        """Return whether it has come to its end."""
        return self._stage is _Stage.LAND

    def enter(self) -> None:
        """Choose a height at which to return (ModeRTL::compute_return_target)."""
        steering, limits = self._steering, self._steering.limits
        pos = steering.way.pos
        self._home = self._home_ned() or pos
        height_m = self._home[2] - pos[2]
        least_m = max(LOWEST_RETURN_M, height_m + limits.rtl_climb_min)
        target_m = max(limits.rtl_alt, least_m)
        if limits.rtl_cone_slope >= LEAST_CONE_SLOPE:
            way_m = math.hypot(pos[0] - self._home[0], pos[1] - self._home[1])
            target_m = min(target_m, max(way_m * limits.rtl_cone_slope, least_m))
        self._down_m = self._home[2] - max(target_m, height_m)
        self._stage = _Stage.CLIMB
        steering.destination = self._home
        steering.heading.hold()

    def run(self) -> Lean | None:
        """Go on for a period."""
        steering = self._steering
        way, pace = steering.way, steering.travel_pace()
        if self._stage is _Stage.LAND:
            return self._land.run()
        if steering.estimate.pos is None:
            way.climb(0.0, pace, PERIOD_S)
            return LEVEL
        way.to_height(self._down_m, pace, PERIOD_S)
        if self._stage is _Stage.CLIMB:
            way.at_velocity(0.0, 0.0, pace, PERIOD_S)
            if way.pos[2] - self._down_m < 0.1:
                self._stage = _Stage.RETURN
            return None
        way.to_place(self._home[0], self._home[1], pace, PERIOD_S)
        is_there = math.hypot(way.pos[0] - self._home[0], way.pos[1] - self._home[1]) < ARRIVED_M
        if self._stage is _Stage.RETURN and is_there:
            self._stage, self._since_us = _Stage.WAIT, steering.now_us
        waited_s = 1e-6 * (steering.now_us - self._since_us)
        if self._stage is _Stage.WAIT and waited_s >= steering.limits.rtl_loit_time:
            self._stage = _Stage.LAND
            self._land.enter()
        return None
