# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Messages of the vehicle's position, the EKF origin and home.

Source: GCS_MAVLink/GCS_Common.cpp.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

from ap_core.cint import i32, int_of_float, u16
from ap_core.fmath import degrees, f32, norm3, wrap_360
from ap_core.location import Location
from ap_core.vector3 import Vector3f
from mav_handlers.channel import Channel
from mav_handlers.senders.attitude import euler_rad
from mav_handlers.senders.builder import boot_ms, floats, i16_of, quiet_overflow
from mav_handlers.senders.gps import ground_speed_ms
from mav_handlers.wire.messages import (
    GLOBAL_POSITION_INT,
    GPS_GLOBAL_ORIGIN,
    HOME_POSITION,
    LOCAL_POSITION_NED,
    VFR_HUD,
)

if TYPE_CHECKING:
    from viso.vehicle.vehicle import Vehicle

NOWHERE: Final = Location(0, 0, 0)
"""The reported location before the first estimate."""

_FULL_TURN_CDEG: Final = 36000
_CENTI: Final = f32(0.01)
_HUNDRED: Final = f32(100)


def local_position_ned(vehicle: Vehicle, _channel: Channel, now_us: int) -> LOCAL_POSITION_NED | None:
    """Position in m from the EKF origin and velocity in m/s, NED, while both are known.

    Source: GCS_MAVLINK::send_local_position.
    """
    position = vehicle.ahrs.get_relative_position_NED_origin_float()
    velocity = vehicle.ahrs.get_velocity_NED()
    if position is None or velocity is None:
        return None
    return LOCAL_POSITION_NED(boot_ms(now_us), *floats(position), *floats(velocity))


@quiet_overflow
def global_position_int(vehicle: Vehicle, _channel: Channel, now_us: int) -> GLOBAL_POSITION_INT:
    """The last known location, zeros before the first; velocity in cm/s, 0 while unknown; heading 0..359.99 deg.

    Source: GCS_MAVLINK::send_global_position_int.
    """
    place = vehicle.last_location() or NOWHERE
    velocity = vehicle.ahrs.get_velocity_NED() or Vector3f()
    vx, vy, vz = map(i16_of, (velocity * _HUNDRED).to_tuple())
    return GLOBAL_POSITION_INT(
        boot_ms(now_us),
        place.lat,
        place.lng,
        i32(place.alt_cm * 10),
        _relative_alt_mm(vehicle),
        vx,
        vy,
        vz,
        _heading_cdeg(vehicle),
    )


def _relative_alt_mm(vehicle: Vehicle) -> int:
    """Return the height above home; without home or position the barometer's.

    Source: AP_AHRS::get_relative_position_D_home.
    """
    position = vehicle.ahrs.get_relative_position_NED_origin_float()
    home, origin = vehicle.copter.home.place, vehicle.ahrs.origin()
    if position is None or home is None or origin is None:
        return int_of_float(1000.0 * vehicle.ahrs.baro_height_m())
    down_m = f32(position.z - f32(origin.alt_cm - home.alt_cm) * _CENTI)
    return int_of_float(float(down_m * f32(-1000)))


def _heading_cdeg(vehicle: Vehicle) -> int:
    heading = int_of_float(float(degrees(euler_rad(vehicle).z) * _HUNDRED))
    return u16(heading + _FULL_TURN_CDEG if heading < 0 else heading)


@quiet_overflow
def vfr_hud(vehicle: Vehicle, _channel: Channel, _now_us: int) -> VFR_HUD:
    """Speeds in m/s, heading in whole degrees, altitude above sea level, climb; airspeed is the GPS's speed.

    Source: GCS_MAVLINK::send_vfr_hud, GCS_MAVLINK_Copter::vfr_hud_airspeed.
    """
    velocity = vehicle.ahrs.get_velocity_NED() or Vector3f()
    place = vehicle.last_location() or NOWHERE
    return VFR_HUD(
        airspeed=float(ground_speed_ms(vehicle.gps.sample())),
        groundspeed=float(norm3(velocity.x, velocity.y, f32(0))),
        heading=i16_of(wrap_360(degrees(euler_rad(vehicle).z))),
        throttle=0,
        alt=float(f32(place.alt_cm) * _CENTI),
        climb=float(-velocity.z),
    )


def gps_global_origin(vehicle: Vehicle, _channel: Channel, now_us: int) -> GPS_GLOBAL_ORIGIN | None:
    """The EKF origin; not sent while unset (GCS_MAVLINK::send_gps_global_origin)."""
    origin = vehicle.ahrs.origin()
    if origin is None:
        return None
    return GPS_GLOBAL_ORIGIN(origin.lat, origin.lng, i32(origin.alt_cm * 10), now_us)


def home_position(vehicle: Vehicle, _channel: Channel, now_us: int) -> HOME_POSITION | None:
    """Home, also in m NED from the EKF origin; not sent while unset (GCS_MAVLINK::send_home_position)."""
    home, origin = vehicle.copter.home.place, vehicle.ahrs.origin()
    if home is None:
        return None
    x, y, z = (math.nan,) * 3 if origin is None else floats(origin.distance_ned(home))
    no_attitude = (math.nan,) * 4
    return HOME_POSITION(home.lat, home.lng, i32(home.alt_cm * 10), x, y, z, no_attitude, 0, 0, 0, now_us)
