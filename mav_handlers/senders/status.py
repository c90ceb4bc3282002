# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Messages of the vehicle's identity and state: heartbeat, version, modes, time, landed state.

Source: GCS_MAVLink/GCS_Common.cpp, ArduCopter/GCS_MAVLink_Copter.cpp.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from ap_core.cint import int_of_float, u8, u64
from mav_handlers.channel import Channel, ModesRequest
from mav_handlers.senders.builder import boot_ms
from mav_handlers.wire.messages import (
    AUTOPILOT_VERSION,
    AVAILABLE_MODES,
    AVAILABLE_MODES_MONITOR,
    EXTENDED_SYS_STATE,
    HEARTBEAT,
    SYSTEM_TIME,
)

if TYPE_CHECKING:
    from viso.vehicle.vehicle import Vehicle

MAV_TYPE_QUADROTOR: Final = 2
MAV_AUTOPILOT_ARDUPILOTMEGA: Final = 3
MODE_FLAGS: Final = 1 | 16 | 64  # custom mode enabled, stabilised, manual input
MODE_FLAG_GUIDED: Final = 8
MODE_FLAG_ARMED: Final = 128
MAV_STATE_BOOT: Final = 1
MAV_STATE_STANDBY: Final = 3
MAV_STATE_ACTIVE: Final = 4
MAV_STATE_CRITICAL: Final = 5
MAV_VTOL_STATE_MC: Final = 3
MAV_LANDED_STATE_ON_GROUND: Final = 1
MAV_LANDED_STATE_IN_AIR: Final = 2
MAV_LANDED_STATE_TAKEOFF: Final = 3
MAV_LANDED_STATE_LANDING: Final = 4
MAVLINK_VERSION: Final = 3

CAPABILITY_MAVLINK2: Final = 8192
CAPABILITIES: Final = (
    1  # MISSION_FLOAT
    | 2  # PARAM_FLOAT
    | 4  # MISSION_INT
    | 8  # COMMAND_INT
    | 32  # FTP
    | 128  # SET_POSITION_TARGET_LOCAL_NED
    | 256  # SET_POSITION_TARGET_GLOBAL_INT
    | 2048  # FLIGHT_TERMINATION
    | CAPABILITY_MAVLINK2
    | 16384  # MISSION_FENCE
    | 32768  # MISSION_RALLY
)
"""FIRMWARE PARITY: it has SET_ATTITUDE_TARGET, TERRAIN and COMPASS_CALIBRATION, too; nothing here does these."""
UID2_BYTES: Final = 18
SYSTEM_TEXT_DIGITS: Final = 32
MONITOR_INTERVAL_MS: Final = 5000
_NAME: Final = b"viso"
# It changes when a script adds a mode.
_SEQUENCE: Final = 0


def heartbeat(vehicle: Vehicle, _channel: Channel, _now_us: int) -> HEARTBEAT:
    """Presence and state: STANDBY on the ground even when armed, CRITICAL in a failsafe and after any internal error.

    Source: GCS_MAVLINK_Copter::base_mode, GCS_MAVLINK_Copter::vehicle_system_status, GCS_MAVLINK::system_status.
    """
    return HEARTBEAT(
        MAV_TYPE_QUADROTOR,
        MAV_AUTOPILOT_ARDUPILOTMEGA,
        _base_mode(vehicle),
        vehicle.copter.custom_mode(),
        _system_status(vehicle),
        MAVLINK_VERSION,
    )


def _base_mode(vehicle: Vehicle) -> int:
    armed = MODE_FLAG_ARMED if vehicle.copter.is_armed() else 0
    return MODE_FLAGS | armed | (MODE_FLAG_GUIDED if vehicle.copter.is_holding_position() else 0)


def _system_status(vehicle: Vehicle) -> int:
    if not vehicle.copter.has_booted:
        return MAV_STATE_BOOT
    if vehicle.copter.is_in_failsafe() or vehicle.internal_errors.mask:
        return MAV_STATE_CRITICAL
    return MAV_STATE_STANDBY if vehicle.copter.is_landed() else MAV_STATE_ACTIVE


def extended_sys_state(vehicle: Vehicle, _channel: Channel, _now_us: int) -> EXTENDED_SYS_STATE:
    """A multicopter: on the ground, taking off, in the air, or landing (GCS_MAVLINK_Copter::landed_state)."""
    if vehicle.copter.is_landed():
        landed_state = MAV_LANDED_STATE_ON_GROUND
    elif vehicle.copter.is_landing():
        landed_state = MAV_LANDED_STATE_LANDING
    elif vehicle.copter.is_taking_off():
        landed_state = MAV_LANDED_STATE_TAKEOFF
    else:
        landed_state = MAV_LANDED_STATE_IN_AIR
    return EXTENDED_SYS_STATE(MAV_VTOL_STATE_MC, landed_state)


def system_time(vehicle: Vehicle, _channel: Channel, now_us: int) -> SYSTEM_TIME:
    """Time of day, 0 while unknown, and time since boot."""
    return SYSTEM_TIME(u64(vehicle.rtc.utc_us()), boot_ms(now_us))


def autopilot_version(vehicle: Vehicle, channel: Channel, _now_us: int) -> AUTOPILOT_VERSION:
    """Capabilities and version; middleware and operating system are zero, as in simulation; uid2 is the vehicle's.

    Source: GCS_MAVLINK::send_autopilot_version.
    """
    capabilities = CAPABILITIES if channel.codec.version == 2 else CAPABILITIES & ~CAPABILITY_MAVLINK2
    firmware = vehicle.firmware
    custom = tuple(firmware.source_hash.encode("ascii")[:8].ljust(8, b"\0"))
    zeros = (0,) * 8
    return AUTOPILOT_VERSION(capabilities, firmware.sw_version, 0, 0, 0, custom, zeros, zeros, 0, 0, 0, _uid2(vehicle))


def system_text(system_id: int) -> str:
    """Return the vehicle's system id text: 32 hex digits, like the machine id of the simulator's host.

    FIRMWARE PARITY: here they are derived from the vehicle's system id.
    """
    return f"{system_id & 0xFFFF:04x}{_NAME.hex()}".ljust(SYSTEM_TEXT_DIGITS, "0")


def _uid2(vehicle: Vehicle) -> tuple[int, ...]:
    name = system_text(vehicle.params.get_int(vehicle.release.params.system_id))
    return tuple(name.encode("ascii")[:UID2_BYTES])


def request_modes(channel: Channel, index: float) -> None:
    """Request the mode with an index (from 1), or with 0 all modes, one at every turn of the message."""
    channel.modes_request = ModesRequest(u8(int_of_float(index)), next_index=1)


def available_modes(vehicle: Vehicle, channel: Channel, _now_us: int) -> AVAILABLE_MODES | None:
    """The requested mode, or the next of all; not sent without a request or if there is no such mode."""
    request = channel.modes_request
    if request is None:
        return None
    modes = vehicle.copter.available_modes()
    index = request.index or request.next_index
    if request.index == 0 and index < len(modes):
        request.next_index += 1
    else:
        channel.modes_request = None
    if index > len(modes):
        return None
    mode = modes[index - 1]
    return AVAILABLE_MODES(len(modes), index, mode.standard_mode, mode.custom_mode, mode.properties, mode.name)


def available_modes_monitor(_vehicle: Vehicle, _channel: Channel, _now_us: int) -> AVAILABLE_MODES_MONITOR:
    """A number that changes with the list."""
    return AVAILABLE_MODES_MONITOR(_SEQUENCE)
