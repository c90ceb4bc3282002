# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The messages that the vehicle can send, in the firmware's order, and what each says.

A builder returns None when there is nothing to report; the message is then left out.
Source: GCS_MAVLink/ap_message.h for the order, GCS_MAVLink/GCS_Common.cpp and ArduCopter/GCS_MAVLink_Copter.cpp.
"""

import math
from collections.abc import Callable, Mapping
from typing import Final

from ap_core.cint import i32, u16, u32, u64
from mav_handlers.channel import Channel
from mav_handlers.ports import Location, VehiclePort
from mav_handlers.wire.messages import (
    ATTITUDE,
    AUTOPILOT_VERSION,
    GPS_GLOBAL_ORIGIN,
    HEARTBEAT,
    HOME_POSITION,
    SYS_STATUS,
    SYSTEM_TIME,
    Message,
)

Builder = Callable[[VehiclePort, Channel, int], Message | None]

MAV_TYPE_QUADROTOR: Final = 2
MAV_AUTOPILOT_ARDUPILOTMEGA: Final = 3
MODE_FLAGS: Final = 1 | 16 | 64  # custom mode enabled, stabilised, manual input
MODE_FLAG_ARMED: Final = 128
MAV_STATE_BOOT: Final = 1
MAV_STATE_STANDBY: Final = 3
MAV_STATE_CRITICAL: Final = 5
MAVLINK_VERSION: Final = 3

SENSOR_3D_GYRO: Final = 1
SENSOR_3D_ACCEL: Final = 2
SENSOR_ABSOLUTE_PRESSURE: Final = 8
SENSOR_VISION_POSITION: Final = 128
SENSOR_AHRS: Final = 0x200000
SENSOR_LOGGING: Final = 0x1000000
SENSOR_PREARM_CHECK: Final = 0x10000000
_ALWAYS_HEALTHY: Final = SENSOR_3D_GYRO | SENSOR_3D_ACCEL | SENSOR_ABSOLUTE_PRESSURE | SENSOR_AHRS | SENSOR_LOGGING

# MISSION_FLOAT, PARAM_FLOAT, MISSION_INT, COMMAND_INT, FTP, attitude and position targets, TERRAIN, TERMINATION,
# COMPASS_CALIBRATION, MAVLINK2, FENCE, RALLY: what the reference build says of itself.
CAPABILITIES: Final = 64495
CAPABILITY_MAVLINK2: Final = 8192


def heartbeat(vehicle: VehiclePort, _channel: Channel, _now_us: int) -> HEARTBEAT:
    """Presence and state: STANDBY on the ground even when armed, CRITICAL after any internal error."""
    base_mode = MODE_FLAGS | (MODE_FLAG_ARMED if vehicle.is_armed() else 0)
    return HEARTBEAT(
        MAV_TYPE_QUADROTOR,
        MAV_AUTOPILOT_ARDUPILOTMEGA,
        base_mode,
        vehicle.custom_mode(),
        _system_status(vehicle),
        MAVLINK_VERSION,
    )


def _system_status(vehicle: VehiclePort) -> int:
    if not vehicle.is_initialised():
        return MAV_STATE_BOOT
    return MAV_STATE_CRITICAL if vehicle.internal_errors.mask else MAV_STATE_STANDBY


def attitude(vehicle: VehiclePort, _channel: Channel, now_us: int) -> ATTITUDE:
    """Attitude in rad, zeros before there is one."""
    now = vehicle.attitude()
    time_boot_ms = u32(now_us // 1000)
    if now is None:
        return ATTITUDE(time_boot_ms, 0, 0, 0, 0, 0, 0)
    return ATTITUDE(time_boot_ms, float(now.roll), float(now.pitch), float(now.yaw), *map(float, now.rates))


def sensor_bits(vehicle: VehiclePort) -> tuple[int, int, int]:
    """Return the masks of sensors present, enabled and healthy (GCS.cpp, update_sensor_status_flags)."""
    present = enabled = healthy = _ALWAYS_HEALTHY
    if vehicle.visual_odom.enabled():
        present |= SENSOR_VISION_POSITION
        enabled |= SENSOR_VISION_POSITION
        if vehicle.visual_odom.healthy():
            healthy |= SENSOR_VISION_POSITION
    present |= SENSOR_PREARM_CHECK
    if vehicle.checks_enabled():
        enabled |= SENSOR_PREARM_CHECK
        if vehicle.is_armed() or vehicle.prearm_passed():
            healthy |= SENSOR_PREARM_CHECK
    return present, enabled, healthy


def sys_status(vehicle: VehiclePort, _channel: Channel, _now_us: int) -> SYS_STATUS | None:
    """Sensor masks and error counts; load and battery are placeholders (0, unknown)."""
    if not vehicle.is_initialised():
        return None
    errors = vehicle.internal_errors
    return SYS_STATUS(
        *sensor_bits(vehicle),
        load=0,
        voltage_battery=65535,
        current_battery=-1,
        battery_remaining=-1,
        drop_rate_comm=0,
        errors_comm=0,
        errors_count1=errors.mask & 0xFFFF,
        errors_count2=errors.mask >> 16 & 0xFFFF,
        errors_count3=u16(vehicle.log.dropped()),
        errors_count4=u16(errors.count),
    )


def system_time(vehicle: VehiclePort, _channel: Channel, now_us: int) -> SYSTEM_TIME:
    """Time of day, 0 while unknown, and time since boot."""
    return SYSTEM_TIME(u64(vehicle.utc_us()), u32(now_us // 1000))


def gps_global_origin(vehicle: VehiclePort, _channel: Channel, now_us: int) -> GPS_GLOBAL_ORIGIN | None:
    """The EKF origin; nothing while unset."""
    origin = vehicle.origin()
    if origin is None:
        return None
    return GPS_GLOBAL_ORIGIN(origin.lat, origin.lng, i32(origin.alt_cm * 10), now_us)


def home_position(vehicle: VehiclePort, _channel: Channel, now_us: int) -> HOME_POSITION | None:
    """Home; nothing while unset. Relative to the origin only its height is kept, as home is where that is."""
    home, origin = vehicle.home(), vehicle.origin()
    if home is None:
        return None
    x, y, z = _from_origin(home, origin)
    nan = math.nan
    return HOME_POSITION(home.lat, home.lng, i32(home.alt_cm * 10), x, y, z, (nan,) * 4, 0, 0, 0, now_us)


def _from_origin(home: Location, origin: Location | None) -> tuple[float, float, float]:
    if origin is None:
        return math.nan, math.nan, math.nan
    return 0.0, 0.0, (origin.alt_cm - home.alt_cm) * 0.01


def autopilot_version(vehicle: VehiclePort, channel: Channel, _now_us: int) -> AUTOPILOT_VERSION:
    """Capabilities and version; middleware and operating system are zero, as in simulation."""
    capabilities = CAPABILITIES if channel.codec.version == 2 else CAPABILITIES & ~CAPABILITY_MAVLINK2
    version, _, source_hash = vehicle.firmware_version()
    custom = tuple(source_hash.encode("ascii")[:8].ljust(8, b"\0"))
    zeros = (0,) * 8
    return AUTOPILOT_VERSION(capabilities, version, 0, 0, 0, custom, zeros, zeros, 0, 0, 0)


SENDERS: Final[Mapping[str, Builder]] = {
    "ATTITUDE": attitude,
    "HEARTBEAT": heartbeat,
    "HOME_POSITION": home_position,
    "GPS_GLOBAL_ORIGIN": gps_global_origin,
    "SYS_STATUS": sys_status,
    "SYSTEM_TIME": system_time,
    "AUTOPILOT_VERSION": autopilot_version,
}

# Messages of each stream group, by the id that REQUEST_DATA_STREAM uses and the parameter that holds its rate.
STREAM_GROUPS: Final[Mapping[int, tuple[str, tuple[str, ...]]]] = {
    1: ("_RAW_SENS", ()),
    2: ("_EXT_STAT", ("SYS_STATUS",)),
    3: ("_RC_CHAN", ()),
    4: ("_RAW_CTRL", ()),
    6: ("_POSITION", ()),
    10: ("_EXTRA1", ("ATTITUDE",)),
    11: ("_EXTRA2", ()),
    12: ("_EXTRA3", ("SYSTEM_TIME",)),
}
