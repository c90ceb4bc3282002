# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Commands to a vehicle in flight (ArduCopter/GCS_MAVLink_Copter.cpp); without motors they are not supported."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from ap_core.cint import int_of_float
from ap_core.fmath import f32, is_zero
from ap_core.param_info import is_equal
from mav_handlers.channel import Context
from mav_handlers.handlers.commands.home import absolute_place, location_problem
from mav_handlers.handlers.commands.results import MavResult
from mav_handlers.wire.messages import COMMAND_INT

if TYPE_CHECKING:
    from viso.vehicle.copter.flying.flight_control import FlightControl

GUIDED: Final = 4
CHANGE_MODE: Final = 1
SPEED_TYPES: Final = range(4)
"""Airspeed, ground speed, climb rate, descent rate."""
FULL_TURN_DEG: Final = 360.0


@dataclass(frozen=True, slots=True)
class GuidedTarget:
    """A target for a vehicle in GUIDED; None for what the companion leaves open.

    Attributes:
        pos_ned_m: a position relative to the EKF origin.
        vel_ned_m_s: a velocity; with a position, that of the moving target.
        acc_ned_m_s2: an acceleration.
        yaw_rad: the heading, or the angle to turn by if ``is_yaw_relative``.
        yaw_rate_rad_s: the turn rate.
    """

    pos_ned_m: tuple[float, float, float] | None = None
    vel_ned_m_s: tuple[float, float, float] | None = None
    acc_ned_m_s2: tuple[float, float, float] | None = None
    yaw_rad: float | None = None
    yaw_rate_rad_s: float | None = None
    is_yaw_relative: bool = False


def condition_yaw(ctx: Context, command: COMMAND_INT) -> MavResult:
    """Turn to param1 degrees at param2 degrees per second, param3 -1 to the left; relative if param4 is 1."""
    flight = ctx.vehicle.copter.flight
    if flight is None:
        return MavResult.UNSUPPORTED
    is_relative = is_equal(f32(command.param4), f32(1))
    if not 0.0 <= command.param1 <= FULL_TURN_DEG or not (is_relative or is_zero(f32(command.param4))):
        return MavResult.FAILED
    slew_rad_s = math.radians(command.param2) if command.param2 > 0 else 0.0
    direction = (command.param3 > 0) - (command.param3 < 0)
    flight.turn_to(math.radians(command.param1), slew_rad_s, direction, is_relative=is_relative)
    return MavResult.ACCEPTED


def do_change_speed(ctx: Context, command: COMMAND_INT) -> MavResult:
    """Set the speed towards targets, or with param1 of 2 or 3 the climb or descent rate, to param2 m/s."""
    flight = ctx.vehicle.copter.flight
    if flight is None:
        return MavResult.UNSUPPORTED
    if not 0.0 < command.param2 < math.inf:
        return MavResult.DENIED if ctx.vehicle.release.refuses_speed_of_0 else MavResult.FAILED
    kind = int_of_float(command.param1)
    if kind not in SPEED_TYPES:
        return MavResult.FAILED
    flight.change_speed(kind, command.param2)
    return MavResult.ACCEPTED


def do_reposition(ctx: Context, command: COMMAND_INT) -> MavResult:
    """Fly to a location in GUIDED; bit 0 of param2 allows the change to GUIDED (handle_command_int_do_reposition)."""
    copter = ctx.vehicle.copter
    flight = copter.flight
    if flight is None:
        return MavResult.UNSUPPORTED
    changes_mode = int_of_float(command.param2) & CHANGE_MODE
    if copter.custom_mode() != GUIDED and not changes_mode:
        return MavResult.DENIED
    if location_problem(ctx, command):
        return MavResult.DENIED
    target = _target(ctx, flight, command)
    if target is None:
        return MavResult.DENIED
    if copter.custom_mode() != GUIDED and not copter.set_mode(GUIDED):
        return MavResult.FAILED
    flight.guide(target)
    return MavResult.ACCEPTED


def _target(ctx: Context, flight: FlightControl, command: COMMAND_INT) -> GuidedTarget | None:
    place = absolute_place(ctx, command)
    if place is None or not place.is_valid() or not (place.lat or place.lng):
        return None
    pos_ned = flight.place_ned(place)
    return None if pos_ned is None else GuidedTarget(pos_ned_m=pos_ned)
