# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the sensors of a vehicle at rest measure."""

import math
from typing import TYPE_CHECKING

import pytest

from ap_core.vector3 import Vector3f
from mav_handlers.senders.inertial import (
    highres_imu,
    raw_imu,
    scaled_imu,
    scaled_imu2,
    scaled_imu3,
    scaled_pressure,
    scaled_pressure2,
    vibration,
)
from mav_handlers.wire.messages import (
    RAW_IMU,
    SCALED_IMU,
    SCALED_IMU2,
    SCALED_IMU3,
    SCALED_PRESSURE,
    SCALED_PRESSURE2,
    VIBRATION,
)

if TYPE_CHECKING:
    from tests.unit.mav_handlers.senders.conftest import Desk

LEVEL = (0, 0, -1000)
STILL = (0, 0, 0)
FIELD_FACING_NORTH = (232, 52, -528)


def accel(message: RAW_IMU | SCALED_IMU) -> tuple[int, int, int]:
    return message.xacc, message.yacc, message.zacc


def field(message: RAW_IMU | SCALED_IMU) -> tuple[int, int, int]:
    return message.xmag, message.ymag, message.zmag


def test_level_vehicle_feels_gravity_upwards(desk: "Desk") -> None:
    assert desk.ask(raw_imu) == RAW_IMU(42_500_999, *LEVEL, *STILL, *FIELD_FACING_NORTH, id=0, temperature=3100)


def test_vehicle_without_an_attitude_counts_as_level(desk: "Desk") -> None:
    desk.ahrs.quat = None
    assert accel(desk.ask(raw_imu)) == LEVEL


@pytest.mark.parametrize(
    ("roll_deg", "pitch_deg", "expected"),
    [(90, 0, (0, -1000, 0)), (0, 90, (1000, 0, 0)), (180, 0, (0, 0, 1000)), (0, -30, (-500, 0, -866))],
)
def test_gravity_turns_with_the_attitude(
    desk: "Desk", roll_deg: float, pitch_deg: float, expected: tuple[int, int, int]
) -> None:
    desk.ahrs.face(math.radians(roll_deg), math.radians(pitch_deg), 1.0)
    assert accel(desk.ask(raw_imu)) == pytest.approx(expected, abs=1)


def test_field_turns_with_the_heading(desk: "Desk") -> None:
    desk.ahrs.face(0, 0, math.pi / 2)
    assert field(desk.ask(raw_imu)) == pytest.approx((52, -232, -528), abs=1)


def test_rates_are_told_in_milliradians_truncated(desk: "Desk") -> None:
    desk.ahrs.gyro = Vector3f(0.0019, -0.0019, 2.0)
    now = desk.ask(raw_imu)
    assert (now.xgyro, now.ygyro, now.zgyro) == (1, -1, 2000)


def test_first_and_second_imu_agree(desk: "Desk") -> None:
    desk.ahrs.face(0.1, 0.2, 0.3)
    desk.ahrs.gyro = Vector3f(1, 2, 3)
    raw = desk.ask(raw_imu)
    measured = (*accel(raw), raw.xgyro, raw.ygyro, raw.zgyro, *field(raw))
    assert desk.ask(scaled_imu) == SCALED_IMU(42_500, *measured, temperature=3100)
    assert desk.ask(scaled_imu2) == SCALED_IMU2(42_500, *measured, temperature=3100)


def test_third_imu_is_a_compass_alone(desk: "Desk") -> None:
    desk.ahrs.gyro = Vector3f(1, 2, 3)
    assert desk.ask(scaled_imu3) == SCALED_IMU3(42_500, *STILL, *STILL, *FIELD_FACING_NORTH, temperature=0)


def test_without_compasses_there_is_no_field_and_no_third_imu(desk: "Desk") -> None:
    desk.vehicle.params.set("COMPASS_ENABLE", 0)
    assert field(desk.ask(raw_imu)) == (0, 0, 0)
    assert desk.has_nothing(scaled_imu3)


def test_high_resolution_imu_tells_si_units_and_all_fields_new(desk: "Desk") -> None:
    desk.ahrs.gyro = Vector3f(0.5, 1, 2)
    now = desk.ask(highres_imu)
    assert (now.xacc, now.yacc, now.zacc) == pytest.approx((0, 0, -9.80665))
    assert (now.xgyro, now.ygyro, now.zgyro) == (0.5, 1, 2)
    assert (now.xmag, now.ymag, now.zmag) == pytest.approx((232_200, 52_700, -528_900))
    assert (now.abs_pressure, now.diff_pressure, now.pressure_alt) == pytest.approx((945.028, 0, 0))
    assert now.temperature == pytest.approx(31)
    assert now.fields_updated == 0x1FFF
    assert now.time_usec == 42_500_999


def test_high_resolution_imu_without_compasses_has_no_new_field(desk: "Desk") -> None:
    desk.vehicle.params.set("COMPASS_ENABLE", 0)
    now = desk.ask(highres_imu)
    assert now.fields_updated == 0x1E3F
    assert (now.xmag, now.ymag, now.zmag) == (0, 0, 0)


def test_barometers_agree(desk: "Desk") -> None:
    first = desk.ask(scaled_pressure)
    assert first.press_abs == pytest.approx(945.028)
    assert first == SCALED_PRESSURE(42_500, first.press_abs, 0, 3100)
    assert desk.ask(scaled_pressure2) == SCALED_PRESSURE2(42_500, first.press_abs, 0, 3100)


def test_parked_vehicle_does_not_vibrate(desk: "Desk") -> None:
    assert desk.ask(vibration) == VIBRATION(42_500_999, 0, 0, 0, 0, 0, 0)
