# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Attitude, and the status of the estimators.

Source: GCS_MAVLink/GCS_Common.cpp, AP_NavEKF3/AP_NavEKF3_Outputs.cpp.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ap_core.fmath import f32
from ap_core.vector3 import Vector3f
from ekf_stub.inputs.measurements import FIX_3D
from ekf_stub.reports import NO_ESTIMATOR
from mav_handlers.channel import Channel
from mav_handlers.senders.builder import boot_ms, floats, quiet_overflow
from mav_handlers.wire.messages import AHRS, AHRS2, ATTITUDE, ATTITUDE_QUATERNION, EKF_STATUS_REPORT

if TYPE_CHECKING:
    from viso.vehicle.vehicle import Vehicle


def euler_rad(vehicle: Vehicle) -> Vector3f:
    """Return roll, pitch, yaw in rad, -pi..pi; zeros before there is an attitude."""
    quat = vehicle.ahrs.get_quaternion()
    if quat is None:
        return Vector3f()
    return Vector3f(quat.get_euler_roll(), quat.get_euler_pitch(), vehicle.ahrs.get_yaw_rad())


def attitude(vehicle: Vehicle, _channel: Channel, now_us: int) -> ATTITUDE:
    """Attitude in rad and body rates in rad/s, zeros before there is an attitude (GCS_MAVLINK::send_attitude)."""
    return ATTITUDE(boot_ms(now_us), *floats(euler_rad(vehicle)), *floats(vehicle.ahrs.get_gyro()))


def attitude_quaternion(vehicle: Vehicle, _channel: Channel, now_us: int) -> ATTITUDE_QUATERNION | None:
    """Attitude as w, x, y, z and body rates in rad/s; not sent without (GCS_MAVLINK::send_attitude_quaternion)."""
    quat = vehicle.ahrs.get_quaternion()
    if quat is None:
        return None
    w, x, y, z = map(float, quat.to_wxyz())
    return ATTITUDE_QUATERNION(boot_ms(now_us), w, x, y, z, *floats(vehicle.ahrs.get_gyro()))


def ahrs(vehicle: Vehicle, _channel: Channel, _now_us: int) -> AHRS:
    """Gyro bias in rad/s; the errors are those of DCM, always zero here (GCS_MAVLINK::send_ahrs)."""
    return AHRS(*floats(vehicle.ahrs.get_gyro_drift()), 0.0, 0.0, 0.0, 0.0)


def ahrs2(vehicle: Vehicle, _channel: Channel, _now_us: int) -> AHRS2 | None:
    """The second estimator, DCM: its attitude equals the first's, its position is the GPS's at home's altitude.

    Source: GCS_MAVLINK::send_ahrs2, AP_AHRS_DCM::get_location.
    """
    if vehicle.ahrs.get_quaternion() is None:
        return None
    home = vehicle.copter.home.place
    altitude_m = 0.0 if home is None else float(f32(home.alt_cm) * f32(0.01))
    sample = vehicle.gps.sample()
    lat, lng = (0, 0) if sample is None or sample.fix_type < FIX_3D else (sample.location.lat, sample.location.lng)
    return AHRS2(*floats(euler_rad(vehicle)), altitude_m, lat, lng)


@quiet_overflow
def ekf_status_report(vehicle: Vehicle, _channel: Channel, _now_us: int) -> EKF_STATUS_REPORT | None:
    """Flags and variances (1.0 is at the gate) of the primary core, while it runs.

    Source: NavEKF3_core::send_status_report.
    """
    status = vehicle.ahrs.get_filter_status()
    if status is None or status is NO_ESTIMATOR:
        return None
    return EKF_STATUS_REPORT(
        int(status.flags),
        float(f32(status.velocity_variance)),
        float(f32(status.pos_horiz_variance)),
        float(f32(status.pos_vert_variance)),
        float(f32(status.compass_variance)),
        float(f32(status.terrain_alt_variance)),
        float(f32(status.airspeed_variance)),
    )
