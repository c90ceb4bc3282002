# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Messages of the GPS.

Source: AP_GPS/AP_GPS.cpp, AP_GPS/AP_GPS_MAV.cpp.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from ap_core.cint import i32, int_of_float, u16, u32, u64
from ap_core.fmath import atan2f, degrees, f32, norm3, wrap_360
from ekf_stub.inputs.measurements import GpsSample
from mav_handlers.channel import Channel
from mav_handlers.senders.builder import quiet_overflow
from mav_handlers.wire.messages import GPS2_RAW, GPS_RAW_INT

if TYPE_CHECKING:
    from viso.vehicle.vehicle import Vehicle

UNKNOWN_DOP: Final = 65535
YAW_NORTH_CDEG: Final = 36000
_HUNDRED: Final = f32(100)
_THOUSAND: Final = f32(1000)

_Measured = tuple[int, int, int, int, int, int, int, int, int, int]


def ground_speed_ms(sample: GpsSample | None) -> np.float32:
    """Return the speed over ground, 0 without a GPS."""
    return f32(0) if sample is None else norm3(f32(0), sample.vel_ned.x, sample.vel_ned.y)


def _course_deg(sample: GpsSample) -> np.float32:
    return wrap_360(degrees(atan2f(sample.vel_ned.y, sample.vel_ned.x)))


def _mm(metres: float | None) -> int:
    return 0 if metres is None else u32(int_of_float(float(f32(metres) * _THOUSAND)))


def _yaw_cdeg(sample: GpsSample) -> int:
    """Return the GPS yaw in cdeg, 0 if there is none; north is 36000 (AP_GPS::gps_yaw_cdeg)."""
    if sample.yaw_deg is None:
        return 0
    return int_of_float(float(f32(sample.yaw_deg) * _HUNDRED)) % YAW_NORTH_CDEG or YAW_NORTH_CDEG


@quiet_overflow
def gps_raw_int(vehicle: Vehicle, _channel: Channel, _now_us: int) -> GPS_RAW_INT | None:
    """The first GPS's newest solution; without a GPS fix 0, dilutions unknown, all else 0.

    Source: AP_GPS::send_mavlink_gps_raw.

    A release may send none for GPS1_TYPE 0 (``EndpointRelease.sends_disabled_gps``).
    """
    if vehicle.params.get_int("GPS1_TYPE") == 0 and not vehicle.release.sends_disabled_gps:
        return None
    sample = vehicle.gps.all[0].sample()
    return GPS_RAW_INT(*_measured(sample), **_accuracies(sample))


@quiet_overflow
def gps2_raw(vehicle: Vehicle, _channel: Channel, _now_us: int) -> GPS2_RAW | None:
    """The same of the second GPS; none for GPS2_TYPE 0 (AP_GPS::send_mavlink_gps2_raw)."""
    if vehicle.params.get_int("GPS2_TYPE") == 0:
        return None
    sample = vehicle.gps.all[1].sample()
    without_corrections = 0, 0
    return GPS2_RAW(*_measured(sample), *without_corrections, **_accuracies(sample))


def _measured(sample: GpsSample | None) -> _Measured:
    """Return time, fix, place, dilutions, speed, course and satellites as the messages have them."""
    if sample is None:
        return 0, 0, 0, 0, 0, UNKNOWN_DOP, UNKNOWN_DOP, 0, 0, 0
    return (
        u64(sample.last_fix_ms * 1000),
        sample.fix_type,
        sample.location.lat,
        sample.location.lng,
        i32(sample.location.alt_cm * 10),
        sample.hdop,
        sample.vdop,
        u16(int_of_float(float(ground_speed_ms(sample) * _HUNDRED))),
        u16(int_of_float(float(_course_deg(sample) * _HUNDRED))),
        sample.num_sats,
    )


def _accuracies(sample: GpsSample | None) -> dict[str, int]:
    """Return accuracies and yaw as the messages have them."""
    if sample is None:
        return {}
    return {
        "h_acc": _mm(sample.horizontal_accuracy),
        "v_acc": _mm(sample.vertical_accuracy),
        "vel_acc": _mm(sample.speed_accuracy),
        "yaw": _yaw_cdeg(sample),
    }
