# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Messages of IMUs, compasses and barometers, for a vehicle at rest with its present attitude.

There is no noise. Magnetic field, pressure and temperature are those of the reference simulator two minutes after boot.
Source: GCS_MAVLink/GCS_Common.cpp.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from ap_core.fmath import f32
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from mav_handlers.channel import Channel
from mav_handlers.senders.builder import boot_ms, floats, i16_of
from mav_handlers.wire.messages import (
    HIGHRES_IMU,
    RAW_IMU,
    SCALED_IMU,
    SCALED_IMU2,
    SCALED_IMU3,
    SCALED_PRESSURE,
    SCALED_PRESSURE2,
    VIBRATION,
)

if TYPE_CHECKING:
    from viso.vehicle.vehicle import Vehicle

GRAVITY_MSS: Final = f32(9.80665)
ACCEL_AT_REST_NED: Final = Vector3f(0, 0, -GRAVITY_MSS)
MAG_FIELD_NED: Final = Vector3f(232.2, 52.7, -528.9)
"""Milligauss."""

PRESSURE_HPA: Final = float(f32(945.02828125))
TEMPERATURE_CDEG: Final = 3100
# Fields of HIGHRES_IMU: accelerometers and gyros, magnetometers, barometer and temperature.
_ACCEL_AND_GYRO_UPDATED: Final = 0x3F
_BARO_UPDATED: Final = 0x1E00
_THOUSAND: Final = f32(1000)


def _to_body(vehicle: Vehicle, ned: Vector3f) -> Vector3f:
    return (vehicle.ahrs.get_quaternion() or Quaternion()).inverse().rotate_vector(ned)


def accel_mss(vehicle: Vehicle) -> Vector3f:
    """Return the specific force at rest, m/s/s in the body frame."""
    return _to_body(vehicle, ACCEL_AT_REST_NED)


def _has_compass(vehicle: Vehicle) -> bool:
    return vehicle.params.get_int("COMPASS_ENABLE") != 0


def _field_mgauss(vehicle: Vehicle) -> Vector3f:
    return _to_body(vehicle, MAG_FIELD_NED) if _has_compass(vehicle) else Vector3f()


def _whole(vector: Vector3f) -> tuple[int, int, int]:
    return i16_of(vector.x), i16_of(vector.y), i16_of(vector.z)


def _motion(vehicle: Vehicle) -> tuple[int, int, int, int, int, int, int, int, int]:
    """Return acceleration in mG, rates in mrad/s and field in mgauss, in whole numbers."""
    accel, rates = accel_mss(vehicle) * _THOUSAND / GRAVITY_MSS, vehicle.ahrs.get_gyro() * _THOUSAND
    return *_whole(accel), *_whole(rates), *_whole(_field_mgauss(vehicle))


def raw_imu(vehicle: Vehicle, _channel: Channel, now_us: int) -> RAW_IMU:
    """The first IMU and compass: mG, mrad/s, mgauss (GCS_MAVLINK::send_raw_imu)."""
    return RAW_IMU(now_us, *_motion(vehicle), id=0, temperature=TEMPERATURE_CDEG)


def scaled_imu(vehicle: Vehicle, _channel: Channel, now_us: int) -> SCALED_IMU:
    """The same as RAW_IMU, with the time in ms (GCS_MAVLINK::send_scaled_imu)."""
    return SCALED_IMU(boot_ms(now_us), *_motion(vehicle), temperature=TEMPERATURE_CDEG)


def scaled_imu2(vehicle: Vehicle, _channel: Channel, now_us: int) -> SCALED_IMU2:
    """The second IMU and compass, which agree with the first."""
    return SCALED_IMU2(boot_ms(now_us), *_motion(vehicle), temperature=TEMPERATURE_CDEG)


def scaled_imu3(vehicle: Vehicle, _channel: Channel, now_us: int) -> SCALED_IMU3 | None:
    """The third compass, with zeros for the absent third IMU; not sent without compasses."""
    if not _has_compass(vehicle):
        return None
    return SCALED_IMU3(boot_ms(now_us), 0, 0, 0, 0, 0, 0, *_whole(_field_mgauss(vehicle)))


def highres_imu(vehicle: Vehicle, _channel: Channel, now_us: int) -> HIGHRES_IMU:
    """Acceleration in m/s/s, rates in rad/s, magnetic field, pressure in hPa, temperature in degC.

    The field is in Gauss or in thousandths of a milligauss, as the release has it, whatever the message's definition
    says. Source: GCS_MAVLINK::send_highres_imu.
    """
    updated = vehicle.release.all_sensors_updated if _has_compass(vehicle) else _ACCEL_AND_GYRO_UPDATED | _BARO_UPDATED
    return HIGHRES_IMU(
        now_us,
        *floats(accel_mss(vehicle)),
        *floats(vehicle.ahrs.get_gyro()),
        *floats(_field_mgauss(vehicle) * vehicle.release.highres_field_scale),
        abs_pressure=PRESSURE_HPA,
        diff_pressure=0.0,
        pressure_alt=0.0,
        temperature=TEMPERATURE_CDEG / 100,
        fields_updated=updated,
    )


def scaled_pressure(_vehicle: Vehicle, _channel: Channel, now_us: int) -> SCALED_PRESSURE:
    """The first barometer, in hPa (GCS_MAVLINK::send_scaled_pressure_instance)."""
    return SCALED_PRESSURE(boot_ms(now_us), PRESSURE_HPA, 0.0, TEMPERATURE_CDEG)


def scaled_pressure2(_vehicle: Vehicle, _channel: Channel, now_us: int) -> SCALED_PRESSURE2:
    """The second barometer, which agrees with the first."""
    return SCALED_PRESSURE2(boot_ms(now_us), PRESSURE_HPA, 0.0, TEMPERATURE_CDEG)


def vibration(_vehicle: Vehicle, _channel: Channel, now_us: int) -> VIBRATION:
    """No vibration and no clipping: the motors do not run (GCS_MAVLINK::send_vibration)."""
    return VIBRATION(now_us, 0.0, 0.0, 0.0, 0, 0, 0)
