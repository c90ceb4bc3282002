# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Placeholders: the reference simulator's parked vehicle."""

from typing import TYPE_CHECKING

from mav_handlers.senders.parked import (
    battery_status,
    hwstatus,
    meminfo,
    power_status,
    rc_channels,
    rc_channels_raw,
    servo_output_raw,
)
from mav_handlers.senders.sys_status import sys_status
from mav_handlers.wire.messages import (
    HWSTATUS,
    MEMINFO,
    POWER_STATUS,
    RC_CHANNELS,
    RC_CHANNELS_RAW,
    SERVO_OUTPUT_RAW,
)

if TYPE_CHECKING:
    from tests.unit.mav_handlers.conftest import MakeBench
    from tests.unit.mav_handlers.senders.conftest import Desk

STICKS = (1500, 1500, 1000, 1500, 1800, 1000, 1000, 1800)


def test_board_has_five_volts(desk: "Desk") -> None:
    assert desk.ask(power_status) == POWER_STATUS(5000, 0, 0)
    assert desk.ask(hwstatus) == HWSTATUS(5000, 0)


def test_power_is_withheld_until_initialised(make_bench: "MakeBench") -> None:
    bare = make_bench(until_ms=0)
    assert power_status(bare.vehicle, bare.client.channel, 0) is None


def test_free_memory_is_told_in_full_in_the_extension_only(desk: "Desk") -> None:
    assert desk.ask(meminfo) == MEMINFO(0, 65535, 524_288)


def test_battery_is_full_and_shows_its_voltage_in_the_first_cell(desk: "Desk") -> None:
    now = desk.ask(battery_status)
    assert now.voltages == (12600, *[65535] * 9)
    assert (now.current_battery, now.current_consumed, now.energy_consumed) == (0, 0, 0)
    assert (now.battery_remaining, now.charge_state, now.temperature) == (100, 1, 32767)


def test_battery_is_the_same_in_sys_status(desk: "Desk") -> None:
    battery, status = desk.ask(battery_status), desk.ask(sys_status)
    assert status.voltage_battery == battery.voltages[0]
    assert (status.current_battery, status.battery_remaining) == (battery.current_battery, battery.battery_remaining)


def test_four_motors_rest(desk: "Desk") -> None:
    assert desk.ask(servo_output_raw) == SERVO_OUTPUT_RAW(42_500_999, 0, 1000, 1000, 1000, 1000, 0, 0, 0, 0)


def test_servo_time_wraps_in_32_bits(desk: "Desk") -> None:
    assert desk.ask(servo_output_raw, (1 << 32) + 9).time_usec == 9


def test_throttle_is_down(desk: "Desk") -> None:
    assert desk.ask(rc_channels) == RC_CHANNELS(42_500, 16, *STICKS, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, rssi=255)


def test_raw_channels_are_for_mavlink_1_alone(desk: "Desk") -> None:
    assert desk.has_nothing(rc_channels_raw)
    desk.channel.codec.version = 1
    assert desk.ask(rc_channels_raw) == RC_CHANNELS_RAW(42_500, 0, *STICKS, 255)
