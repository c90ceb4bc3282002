# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Placeholders for subsystems that are not emulated: the values of a vehicle parked in the reference simulator.

Source: GCS_MAVLink/GCS_Common.cpp, ArduCopter/GCS_MAVLink_Copter.cpp.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from ap_core.cint import u32
from mav_handlers.channel import Channel
from mav_handlers.senders.builder import boot_ms
from mav_handlers.wire.messages import (
    BATTERY_STATUS,
    HWSTATUS,
    MEMINFO,
    POWER_STATUS,
    RC_CHANNELS,
    RC_CHANNELS_RAW,
    SERVO_OUTPUT_RAW,
)

if TYPE_CHECKING:
    from viso.vehicle.vehicle import Vehicle

# FIRMWARE PARITY: the firmware measures all of these.
BATTERY_MV: Final = 12600
BATTERY_REMAINING_PCT: Final = 100
BOARD_MV: Final = 5000
FREE_MEMORY: Final = 512 * 1024
# Sticks centred, throttle down, mode switch on its sixth position (STABILIZE); eight of 16 channels in use.
RC_CHANNEL_COUNT: Final = 16
MOTOR_PWM_US: Final = (1000,) * 4

_RSSI_UNKNOWN: Final = 255
_NO_CELL: Final = 65535
_TEMPERATURE_UNKNOWN: Final = 32767
_CHARGE_STATE_OK: Final = 1


def power_status(vehicle: Vehicle, _channel: Channel, _now_us: int) -> POWER_STATUS | None:
    """5 V for the board, none for servos, once the vehicle is initialised (GCS_MAVLINK::send_power_status)."""
    return POWER_STATUS(BOARD_MV, 0, 0) if vehicle.copter.has_booted else None


def hwstatus(_vehicle: Vehicle, _channel: Channel, _now_us: int) -> HWSTATUS:
    """5 V for the board (GCS_MAVLINK::send_hwstatus)."""
    return HWSTATUS(BOARD_MV, 0)


def meminfo(_vehicle: Vehicle, _channel: Channel, _now_us: int) -> MEMINFO:
    """Half a megabyte of free memory (GCS_MAVLINK::send_meminfo)."""
    return MEMINFO(0, min(FREE_MEMORY, 0xFFFF), FREE_MEMORY)


def battery_status(_vehicle: Vehicle, _channel: Channel, _now_us: int) -> BATTERY_STATUS:
    """A full battery without current, its voltage in the first cell (GCS_MAVLINK::send_battery_status)."""
    return BATTERY_STATUS(
        id=0,
        battery_function=0,
        type=0,
        temperature=_TEMPERATURE_UNKNOWN,
        voltages=(BATTERY_MV, *(_NO_CELL,) * 9),
        current_battery=0,
        current_consumed=0,
        energy_consumed=0,
        battery_remaining=BATTERY_REMAINING_PCT,
        charge_state=_CHARGE_STATE_OK,
    )


def servo_output_raw(_vehicle: Vehicle, _channel: Channel, now_us: int) -> SERVO_OUTPUT_RAW:
    """Four motors at rest, in us (GCS_MAVLINK::send_servo_output_raw)."""
    # FIRMWARE PARITY: a second message, with port 1, carries outputs 17 to 32.
    return SERVO_OUTPUT_RAW(u32(now_us), 0, *MOTOR_PWM_US, *(0,) * 4)


def rc_channels(vehicle: Vehicle, _channel: Channel, now_us: int) -> RC_CHANNELS:
    """The radio's channels, in us; sticks centred and throttle down if nobody moves them.

    Source: GCS_MAVLINK::send_rc_channels.
    """
    pwm_us = vehicle.copter.receiver.channels_us()
    return RC_CHANNELS(*(boot_ms(now_us), RC_CHANNEL_COUNT, *pwm_us, 0, 0, _RSSI_UNKNOWN))


def rc_channels_raw(vehicle: Vehicle, channel: Channel, now_us: int) -> RC_CHANNELS_RAW | None:
    """The same for MAVLink 1; nothing on a MAVLink 2 link (GCS_MAVLINK::send_rc_channels_raw)."""
    if channel.codec.version == 2:
        return None
    return RC_CHANNELS_RAW(*(boot_ms(now_us), 0, *vehicle.copter.receiver.channels_us()[:8], _RSSI_UNKNOWN))
