# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Handlers of guided targets and of the pilot's stick overrides.

Source: ArduCopter/GCS_MAVLink_Copter.cpp (handle_message_set_position_target_local_ned and _global_int),
GCS_Common.cpp (handle_rc_channels_override).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

from ap_core.location import Location
from ap_core.verdict import Verdict
from mav_handlers.channel import Context
from mav_handlers.handlers.commands.flight import GUIDED, GuidedTarget
from mav_handlers.handlers.commands.home import above_the_sea, altitude_cm
from mav_handlers.verdicts import HANDLED, NO_FLIGHT, NOT_GUIDED, TARGET_REFUSED
from mav_handlers.wire.messages import (
    SET_POSITION_TARGET_GLOBAL_INT,
    SET_POSITION_TARGET_LOCAL_NED,
)

if TYPE_CHECKING:
    from viso.vehicle.copter.flying.flight_control import FlightControl

POS_IGNORE: Final = 0b111
VEL_IGNORE: Final = 0b111 << 3
ACC_IGNORE: Final = 0b111 << 6
FORCE_SET: Final = 1 << 9
YAW_IGNORE: Final = 1 << 10
YAW_RATE_IGNORE: Final = 1 << 11
LOCAL_NED: Final = 1
LOCAL_OFFSET_NED: Final = 7
BODY_FRAMES: Final = frozenset({8, 9})
MOST_SANE: Final = 1000.0

_Three = tuple[float, float, float]


def _flight_in_guided(ctx: Context, type_mask: int) -> FlightControl | Verdict:
    """Return the flight controller, or the verdict that says why a target has no effect."""
    flight = ctx.vehicle.copter.flight
    if flight is None:
        return NO_FLIGHT
    if ctx.vehicle.copter.custom_mode() != GUIDED:
        return NOT_GUIDED
    is_force = type_mask & FORCE_SET and not type_mask & ACC_IGNORE
    return TARGET_REFUSED if is_force and not ctx.vehicle.release.stops_at_forces else flight


def handle_set_position_target_local_ned(ctx: Context, message: SET_POSITION_TARGET_LOCAL_NED) -> Verdict:
    """Fly to a position, or at a velocity or acceleration; an unsupported combination makes the vehicle hold."""
    flight = _flight_in_guided(ctx, message.type_mask)
    if isinstance(flight, Verdict):
        return flight
    frame = message.coordinate_frame
    is_known = frame in (LOCAL_NED, LOCAL_OFFSET_NED) or frame in BODY_FRAMES
    pos: _Three = message.x, message.y, message.z
    vel: _Three = message.vx, message.vy, message.vz
    acc: _Three = message.afx, message.afy, message.afz
    if frame in BODY_FRAMES:
        yaw = float(ctx.vehicle.ahrs.get_yaw_rad())
        pos, vel, acc = (_turned(vector, yaw) for vector in (pos, vel, acc))
    if frame != LOCAL_NED and not message.type_mask & POS_IGNORE:
        here = ctx.vehicle.ahrs.get_relative_position_NED_origin_float()
        is_known = is_known and here is not None
        if here is not None:
            pos = pos[0] + float(here.x), pos[1] + float(here.y), pos[2] + float(here.z)
    place = None if message.type_mask & POS_IGNORE else pos
    target = _target(message, place, vel, acc, is_relative=frame in BODY_FRAMES) if is_known else None
    return _obey(flight, target)


def handle_set_position_target_global_int(ctx: Context, message: SET_POSITION_TARGET_GLOBAL_INT) -> Verdict:
    """Fly to a global position, or at a velocity or acceleration; there is no terrain data."""
    flight = _flight_in_guided(ctx, message.type_mask)
    if isinstance(flight, Verdict):
        return flight
    place = None
    is_known = True
    if not message.type_mask & POS_IGNORE:
        place = _place_ned(ctx, flight, message)
        is_known = place is not None
    vel, acc = (message.vx, message.vy, message.vz), (message.afx, message.afy, message.afz)
    return _obey(flight, _target(message, place, vel, acc, is_relative=False) if is_known else None)


def _place_ned(ctx: Context, flight: FlightControl, message: SET_POSITION_TARGET_GLOBAL_INT) -> _Three | None:
    if not math.isfinite(message.alt):
        return None
    wanted = Location(message.lat_int, message.lon_int, altitude_cm(message.alt))
    place = above_the_sea(ctx, wanted, message.coordinate_frame)
    return flight.place_ned(place) if place is not None and place.is_valid() else None


def _target(
    message: SET_POSITION_TARGET_LOCAL_NED | SET_POSITION_TARGET_GLOBAL_INT,
    pos: _Three | None,
    vel: _Three,
    acc: _Three,
    *,
    is_relative: bool,
) -> GuidedTarget | None:
    """Return the requested target, or None for a combination that the firmware does not support."""
    mask = message.type_mask
    has_vel, has_acc = not mask & VEL_IGNORE, not mask & ACC_IGNORE
    is_unknown = (has_acc and mask & FORCE_SET) or not (pos or has_vel or has_acc)
    is_place_with_acceleration = pos is not None and has_acc and not has_vel
    used = (*(pos or ()), *(vel if has_vel else ()), *(acc if has_acc else ()))
    is_absurd = not all(map(math.isfinite, used)) or (has_vel and max(map(abs, vel)) > MOST_SANE)
    if is_unknown or is_place_with_acceleration or is_absurd:
        return None
    return GuidedTarget(
        pos_ned_m=pos,
        vel_ned_m_s=vel if has_vel else None,
        acc_ned_m_s2=acc if has_acc and not has_vel else None,
        yaw_rad=None if mask & YAW_IGNORE or not math.isfinite(message.yaw) else message.yaw,
        yaw_rate_rad_s=None if mask & YAW_RATE_IGNORE or not math.isfinite(message.yaw_rate) else message.yaw_rate,
        is_yaw_relative=is_relative,
    )


def _turned(vector: _Three, yaw_rad: float) -> _Three:
    ahead, right, down = vector
    cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
    return cos * ahead - sin * right, sin * ahead + cos * right, down


def _obey(flight: FlightControl, target: GuidedTarget | None) -> Verdict:
    flight.guide(target)
    return TARGET_REFUSED if target is None else HANDLED
