# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""SYS_STATUS: the sensors present, enabled and healthy, and the state of the vehicle.

Source: GCS_MAVLink/GCS.cpp and ArduCopter/GCS_Copter.cpp, update_sensor_status_flags and its vehicle part.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Final

from ap_core.cint import u16
from ekf_stub.inputs.measurements import FIX_3D
from mav_handlers.channel import Channel
from mav_handlers.senders.parked import BATTERY_MV, BATTERY_REMAINING_PCT
from mav_handlers.wire.messages import SYS_STATUS

if TYPE_CHECKING:
    from viso.vehicle.vehicle import Vehicle

SENSOR_3D_GYRO: Final = 0x1
SENSOR_3D_ACCEL: Final = 0x2
SENSOR_3D_MAG: Final = 0x4
SENSOR_ABSOLUTE_PRESSURE: Final = 0x8
SENSOR_GPS: Final = 0x20
SENSOR_OPTICAL_FLOW: Final = 0x40
SENSOR_VISION_POSITION: Final = 0x80
SENSOR_LASER_POSITION: Final = 0x100
SENSOR_ANGULAR_RATE_CONTROL: Final = 0x400
SENSOR_ATTITUDE_STABILIZATION: Final = 0x800
SENSOR_YAW_POSITION: Final = 0x1000
SENSOR_Z_ALTITUDE_CONTROL: Final = 0x2000
SENSOR_XY_POSITION_CONTROL: Final = 0x4000
SENSOR_MOTOR_OUTPUTS: Final = 0x8000
SENSOR_RC_RECEIVER: Final = 0x10000
SENSOR_GEOFENCE: Final = 0x100000
SENSOR_AHRS: Final = 0x200000
SENSOR_TERRAIN: Final = 0x400000
SENSOR_LOGGING: Final = 0x1000000
SENSOR_BATTERY: Final = 0x2000000
SENSOR_PROXIMITY: Final = 0x4000000
SENSOR_PREARM_CHECK: Final = 0x10000000
SENSOR_PROPULSION: Final = 0x40000000

_ALWAYS_HEALTHY: Final = (
    SENSOR_3D_GYRO
    | SENSOR_3D_ACCEL
    | SENSOR_ABSOLUTE_PRESSURE
    | SENSOR_ANGULAR_RATE_CONTROL
    | SENSOR_ATTITUDE_STABILIZATION
    | SENSOR_YAW_POSITION
    | SENSOR_RC_RECEIVER
    | SENSOR_TERRAIN
    | SENSOR_PROPULSION
)
# A fence that is not breached, and no proximity sensor that has failed, because there is none.
_HEALTHY_ANYWAY: Final = SENSOR_GEOFENCE | SENSOR_PROXIMITY

Bits = tuple[bool, bool, bool]
"""Whether a sensor is present, enabled, healthy."""

_NO_CURRENT: Final = 0
_BENCH_LOAD: Final = 0


def _changing(vehicle: Vehicle) -> Mapping[int, Bits]:
    copter, ranges, flow, camera = vehicle.copter, vehicle.ranges, vehicle.flow, vehicle.visual_odom
    holds_height, holds_position = copter.is_holding_height(), copter.is_holding_position()
    settled = vehicle.ahrs.initialised()
    has_compass = vehicle.params.get_int("COMPASS_ENABLE") != 0
    sample = vehicle.gps.sample()
    has_gps = sample is not None and sample.fix_type > 0
    gps_works = sample is not None and sample.fix_type >= FIX_3D and sample.is_healthy
    monitor = vehicle.battery_monitor
    checks = copter.arming.enabled_checks() != 0
    return {
        SENSOR_Z_ALTITUDE_CONTROL: (True, holds_height, holds_height),
        SENSOR_XY_POSITION_CONTROL: (True, holds_position, holds_position),
        SENSOR_AHRS: (True, settled, settled and vehicle.ahrs.healthy()),
        SENSOR_3D_MAG: (has_compass, has_compass, has_compass),
        SENSOR_GPS: (has_gps, has_gps, gps_works),
        SENSOR_OPTICAL_FLOW: (flow.enabled(), flow.enabled(), flow.healthy()),
        SENSOR_LASER_POSITION: (ranges.is_present(), ranges.is_enabled, ranges.is_enabled and ranges.has_data()),
        SENSOR_BATTERY: (True, monitor != 0, monitor in (0, vehicle.params.get_int("BATT_MONITOR"))),
        SENSOR_LOGGING: (True, vehicle.is_time_to_log(), not vehicle.log.failed()),
        SENSOR_MOTOR_OUTPUTS: (True, not copter.safety_on, True),
        SENSOR_VISION_POSITION: (camera.enabled(), camera.enabled(), camera.enabled() and camera.healthy()),
        SENSOR_PREARM_CHECK: (True, checks, checks and (copter.is_armed() or copter.arming.passed)),
    }


def sensor_bits(vehicle: Vehicle) -> tuple[int, int, int]:
    """Return the masks of sensors present, enabled and healthy (GCS::update_sensor_status_flags)."""
    present, enabled, healthy = _ALWAYS_HEALTHY | SENSOR_GEOFENCE, _ALWAYS_HEALTHY, _ALWAYS_HEALTHY | _HEALTHY_ANYWAY
    for sensor, (is_present, is_enabled, is_healthy) in _changing(vehicle).items():
        present |= sensor * is_present
        enabled |= sensor * is_enabled
        healthy |= sensor * is_healthy
    return present, enabled, healthy


def sys_status(vehicle: Vehicle, channel: Channel, _now_us: int) -> SYS_STATUS | None:
    """Sensor masks and error counts, once the vehicle is initialised; load and battery are placeholders.

    Source: GCS_MAVLINK::send_sys_status.
    """
    if not vehicle.copter.has_booted:
        return None
    errors, counts = vehicle.internal_errors, vehicle.release.counts_drops
    return SYS_STATUS(
        *sensor_bits(vehicle),
        load=_BENCH_LOAD,
        voltage_battery=BATTERY_MV,
        current_battery=_NO_CURRENT,
        battery_remaining=BATTERY_REMAINING_PCT,
        drop_rate_comm=0,
        errors_comm=u16(channel.packets_dropped) if counts else 0,
        errors_count1=errors.mask & 0xFFFF,
        errors_count2=errors.mask >> 16 & 0xFFFF,
        errors_count3=u16(vehicle.log.dropped()) if counts else 0,
        errors_count4=u16(errors.count),
    )
