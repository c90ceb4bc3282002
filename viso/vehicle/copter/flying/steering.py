# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What flight modes steer with."""

from typing import Final, NamedTuple

from viso.sensors.vectors import ZERO
from viso.vehicle.copter.flying.heading import Heading
from viso.vehicle.copter.flying.limits import Limits
from viso.vehicle.copter.flying.position_control import Estimate, Pace, PositionControl
from viso.vehicle.copter.flying.sticks import CENTRED, Sticks

PERIOD_S: Final = 0.02
"""How often the controller decides."""


class Lean(NamedTuple):
    """Lean angles in rad."""

    roll: float
    pitch: float


LEVEL: Final = Lean(0.0, 0.0)


class Steering:
    """The way, the heading, and what both are chosen from.

    Attributes:
        way, heading: what a mode moves on.
        limits, estimate, sticks: as they are now.
        now_us: time since boot.
        speed: what DO_CHANGE_SPEED asked for in place of WPNAV_SPEED, m/s; None before.
    """

    def __init__(self, limits: Limits) -> None:
        self.way = PositionControl()
        self.heading = Heading()
        self.limits = limits
        self.estimate = Estimate(None, ZERO, 0.0)
        self.sticks: Sticks = CENTRED
        self.now_us = 0
        self.speed: float | None = None

    def restart(self) -> None:
        """Begin where the vehicle is."""
        self.way.restart(self.estimate)
        self.heading.restart(self.estimate.yaw_rad)

    def travel_pace(self) -> Pace:
        """Return the pace on the way to a target."""
        limits = self.limits
        speed = self.speed or limits.wpnav_speed
        return Pace(speed, limits.wpnav_accel, limits.wpnav_speed_up, limits.wpnav_speed_dn, limits.wpnav_accel_z)
