# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What flight modes steer with, and how fast they may."""

import math
from dataclasses import dataclass
from typing import Final, NamedTuple

from ap_core.param import ParamTable
from viso.parameters.flying import FlyingParameters
from viso.vehicle.copter.flying.heading import Heading
from viso.vehicle.copter.flying.position_control import Estimate, Pace, PositionControl
from viso.vehicle.copter.receiver import CENTRED, Sticks
from viso.vehicle.sensors.vectors import ZERO, Three

PERIOD_S: Final = 0.02
"""How often the controller decides."""

LEAST_RADIUS_M: Final = 0.05


class Lean(NamedTuple):
    """Lean angles in rad, and the vertical part of the thrust in m/s/s; None for what holds the height or climb."""

    roll: float
    pitch: float
    lift_m_s2: float | None = None


LEVEL: Final = Lean(0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits in m, m/s, m/s/s, rad, rad/s and s, named after their parameters.

    Source: AC_WPNav, AC_Loiter, ArduCopter/Parameters.cpp.
    """

    wpnav_speed: float
    wpnav_speed_up: float
    wpnav_speed_dn: float
    wpnav_accel: float
    wpnav_accel_z: float
    wpnav_radius: float
    loit_speed: float
    loit_acc_max: float
    pilot_speed_up: float
    pilot_speed_dn: float
    land_speed: float
    land_speed_high: float
    land_alt_low: float
    rtl_alt: float
    rtl_climb_min: float
    rtl_cone_slope: float
    rtl_loit_time: float
    angle_max: float
    atc_slew_yaw: float
    guid_timeout: float
    wp_yaw_behavior: int

    @classmethod
    def of(cls, params: ParamTable, flying: FlyingParameters) -> "Limits":
        """Return the limits of the parameters; speeds and accelerations are above 0."""

        def value(name: str) -> float:
            here, factor = flying.sources[name]
            return factor * params.get_number(here)

        def rate(name: str, fallback: float = 0.01) -> float:
            return abs(value(name)) or fallback

        up, down = rate("PILOT_SPEED_UP"), rate("WPNAV_SPEED_DN")
        return cls(
            wpnav_speed=rate("WPNAV_SPEED"),
            wpnav_speed_up=rate("WPNAV_SPEED_UP"),
            wpnav_speed_dn=down,
            wpnav_accel=rate("WPNAV_ACCEL"),
            wpnav_accel_z=rate("WPNAV_ACCEL_Z"),
            wpnav_radius=max(value("WPNAV_RADIUS"), LEAST_RADIUS_M),
            loit_speed=rate("LOIT_SPEED"),
            loit_acc_max=rate("LOIT_ACC_MAX"),
            pilot_speed_up=up,
            pilot_speed_dn=rate("PILOT_SPEED_DN", up),
            land_speed=rate("LAND_SPEED"),
            land_speed_high=rate("LAND_SPEED_HIGH", down),
            land_alt_low=max(value("LAND_ALT_LOW"), 1.0),
            rtl_alt=value("RTL_ALT"),
            rtl_climb_min=max(value("RTL_CLIMB_MIN"), 0.0),
            rtl_cone_slope=params.get_number("RTL_CONE_SLOPE"),
            rtl_loit_time=1e-3 * params.get_number("RTL_LOIT_TIME"),
            angle_max=math.radians(min(max(value("ANGLE_MAX"), 10.0), 80.0)),
            atc_slew_yaw=math.radians(rate("ATC_SLEW_YAW")),
            guid_timeout=max(params.get_number("GUID_TIMEOUT"), 0.1),
            wp_yaw_behavior=params.get_int("WP_YAW_BEHAVIOR"),
        )


class Steering:
    """The way, the heading, and what both are chosen from.

    Attributes:
        way, heading: what a mode moves on.
        limits, estimate, sticks: as they are now.
        now_us: time since boot.
        speed, speed_up, speed_down: what DO_CHANGE_SPEED asked for in place of WPNAV_SPEED, WPNAV_SPEED_UP and
            WPNAV_SPEED_DN, m/s; None before.
        destination: where it is going, m from the origin; None if nowhere.
    """

    def __init__(self, limits: Limits) -> None:
        self.way = PositionControl()
        self.heading = Heading()
        self.limits = limits
        self.estimate = Estimate(None, ZERO, 0.0)
        self.sticks: Sticks = CENTRED
        self.now_us = 0
        self.forget_speeds()
        self.destination: Three | None = None

    def forget_speeds(self) -> None:
        """Fly as fast as the parameters say."""
        self.speed: float | None = None
        self.speed_up: float | None = None
        self.speed_down: float | None = None

    def restart(self) -> None:
        """Begin where the vehicle is."""
        self.way.restart(self.estimate)
        self.heading.restart(self.estimate.yaw_rad)

    def travel_pace(self) -> Pace:
        """Return the pace on the way to a target."""
        limits = self.limits
        speed = self.speed or limits.wpnav_speed
        up, down = self.speed_up or limits.wpnav_speed_up, self.speed_down or limits.wpnav_speed_dn
        return Pace(speed, limits.wpnav_accel, up, down, limits.wpnav_accel_z)
