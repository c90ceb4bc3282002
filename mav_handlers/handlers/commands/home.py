# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Commands about home and the EKF's origin."""

import math
from enum import Enum
from typing import Final

import numpy as np

from ap_core.cint import i32, int_of_float
from ap_core.fmath import f32, is_zero
from ap_core.location import Location
from ap_core.param_info import is_equal
from mav_handlers.channel import Context
from mav_handlers.handlers.commands.results import MavResult, accepted_if, u32_of_float, u64_of_float
from mav_handlers.senders import gps_global_origin, home_position
from mav_handlers.wire.messages import COMMAND_INT

MAX_LAT: Final = 900_000_000
MAX_LNG: Final = 1_800_000_000
LOCATION_ALT_MAX_M: Final = 83_000
# Above home, above terrain and absolute, each also in its "INT" form.
LOCATION_FRAMES: Final = frozenset({0, 3, 5, 6, 10, 11})
ABSOLUTE_FRAMES: Final = frozenset({0, 5})
RELATIVE_FRAMES: Final = frozenset({3, 6})

_ONE: Final = f32(1)
_US_PER_S: Final = f32(1e6)
_MS_PER_S: Final = f32(1e3)
_MAV_SEVERITY_INFO: Final = 6


class OriginResult(Enum):
    """Outcome of a request to set the EKF origin."""

    SET = "set"
    INVALID = "invalid"
    FAILED = "failed"


def get_home_position(ctx: Context, _command: COMMAND_INT) -> MavResult:
    """Send home and origin before the acknowledgement."""
    home = home_position(ctx.vehicle, ctx.channel, ctx.now_us)
    if home is None:
        return MavResult.FAILED
    ctx.channel.send(home)
    origin = gps_global_origin(ctx.vehicle, ctx.channel, ctx.now_us)
    if origin is not None:
        ctx.channel.send(origin)
    return MavResult.ACCEPTED


_ORIGIN_RESULTS: Final = {
    OriginResult.SET: MavResult.ACCEPTED,
    OriginResult.INVALID: MavResult.DENIED,
    OriginResult.FAILED: MavResult.FAILED,
}


def location_problem(ctx: Context, command: COMMAND_INT) -> bool:
    # GCS_MAVLINK::location_from_command_t
    if math.isnan(command.z) or abs(command.z) > LOCATION_ALT_MAX_M:
        return True
    if command.frame in LOCATION_FRAMES:
        return False
    ctx.vehicle.texts.send_text(_MAV_SEVERITY_INFO, f"Unknown mavlink coordinate frame {command.frame}")
    return True


def altitude_cm(altitude_m: float) -> int:
    """Return an altitude in whole centimetres, truncated as in the firmware."""
    return int_of_float(float(np.float32(altitude_m) * np.float32(100)))


def _location(command: COMMAND_INT) -> Location:
    return Location(command.x, command.y, altitude_cm(command.z))


def set_ekf_origin(ctx: Context, location: Location) -> OriginResult:
    """Set the EKF origin and announce it as the release does (``sends_origin_at_once``).

    Source: GCS_MAVLINK::set_ekf_origin.
    """
    if abs(location.lat) > MAX_LAT or abs(location.lng) > MAX_LNG:
        return OriginResult.INVALID
    is_zero_place = location.lat == 0 and location.lng == 0 and location.alt_cm == 0
    if is_zero_place and ctx.vehicle.release.refuses_zero_origin:
        return OriginResult.INVALID
    if not ctx.vehicle.set_origin(location):
        return OriginResult.FAILED
    endpoint = ctx.vehicle.endpoint
    if ctx.vehicle.release.sends_origin_at_once:
        endpoint.send_origin(ctx.channel, ctx.now_us)
    else:
        endpoint.request_message_everywhere("GPS_GLOBAL_ORIGIN")
    endpoint.send_texts_first()
    return OriginResult.SET


def do_set_global_origin(ctx: Context, command: COMMAND_INT) -> MavResult:
    """Set the EKF origin: degE7 and metres."""
    if location_problem(ctx, command):
        return MavResult.DENIED
    return _ORIGIN_RESULTS[set_ekf_origin(ctx, _location(command))]


def do_set_home(ctx: Context, command: COMMAND_INT) -> MavResult:
    """Set home and lock it: to the vehicle's location, or to degE7 and metres (handle_command_do_set_home)."""
    home = ctx.vehicle.copter.home
    if is_equal(f32(command.param1), _ONE) or (command.x == 0 and command.y == 0):
        return accepted_if(home.set_here(lock=True))
    if not is_zero(f32(command.param1)):
        return MavResult.FAILED
    if location_problem(ctx, command):
        return MavResult.DENIED
    place = absolute_place(ctx, command)
    return accepted_if(place is not None and home.set(place, lock=True))


def absolute_place(ctx: Context, command: COMMAND_INT) -> Location | None:
    """Return a command's location with its altitude above mean sea level, or None if that is unknown."""
    return above_the_sea(ctx, _location(command), command.frame)


def above_the_sea(ctx: Context, place: Location, frame: int) -> Location | None:
    """Return a location with its altitude above mean sea level, or None if that is unknown.

    An altitude above home needs a home; there is no terrain data (Location::change_alt_frame).
    """
    home = ctx.vehicle.copter.home.place
    if frame in ABSOLUTE_FRAMES:
        return place
    if frame not in RELATIVE_FRAMES or home is None:
        return None
    return Location(place.lat, place.lng, i32(place.alt_cm + home.alt_cm))


def external_position_estimate(ctx: Context, command: COMMAND_INT) -> MavResult:
    """Give the EKF a horizontal position: param1 time in s, param2 delay in s, param3 accuracy in m.

    Source: GCS_MAVLINK::handle_command_int_external_position_estimate.
    """
    if command.frame not in ABSOLUTE_FRAMES or not math.isnan(command.z):
        return MavResult.DENIED
    sent_us = u64_of_float(float(f32(command.param1) * _US_PER_S))
    delay_ms = u32_of_float(float(f32(command.param2) * _MS_PER_S))
    time_ms = ctx.correct_time_ms(COMMAND_INT, sent_us)
    if time_ms > delay_ms:
        time_ms -= delay_ms
    place = Location(command.x, command.y, 0)
    return accepted_if(ctx.vehicle.ahrs.handle_external_position_estimate(place, f32(command.param3), time_ms))


def external_wind_estimate(_ctx: Context, command: COMMAND_INT) -> MavResult:
    """Accept a wind in m/s and degrees; only DCM would use it (handle_command_int_external_wind_estimate)."""
    in_range = not command.param1 < 0 and not command.param3 < 0 and not command.param3 > 360
    return MavResult.ACCEPTED if in_range else MavResult.DENIED
