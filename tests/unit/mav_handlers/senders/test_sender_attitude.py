# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Attitude, gyro bias and the estimators' own reports."""

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest

from ap_core.location import Location
from ap_core.vector3 import Vector3f
from ekf_stub.inputs.measurements import GpsSample
from ekf_stub.reports import FilterFlag, FilterStatus
from mav_handlers.senders.attitude import ahrs, ahrs2, attitude, attitude_quaternion, ekf_status_report
from mav_handlers.wire.messages import AHRS, AHRS2, ATTITUDE, EKF_STATUS_REPORT

if TYPE_CHECKING:
    from tests.unit.mav_handlers.conftest import MakeBench
    from tests.unit.mav_handlers.senders.conftest import Desk

TURNED = (0.1, -0.2, -3.0)
RATES = Vector3f(0.5, -0.25, 2.0)
HERE = Location(473_977_420, 85_455_940, 48_800)


def test_attitude_is_roll_pitch_yaw_and_rates(desk: "Desk") -> None:
    desk.ahrs.face(*TURNED)
    desk.ahrs.gyro = RATES
    now = desk.ask(attitude)
    assert (now.roll, now.pitch, now.yaw) == pytest.approx(TURNED, abs=1e-6)
    assert (now.rollspeed, now.pitchspeed, now.yawspeed) == (0.5, -0.25, 2.0)
    assert now.time_boot_ms == 42_500


def test_attitude_is_zero_before_there_is_one(desk: "Desk") -> None:
    desk.ahrs.quat = None
    assert desk.ask(attitude) == ATTITUDE(42_500, 0, 0, 0, 0, 0, 0)


def test_attitude_of_a_bare_vehicle_is_zero(make_bench: "MakeBench") -> None:
    bare = make_bench(until_ms=0)
    assert attitude(bare.vehicle, bare.client.channel, 1_234_567) == ATTITUDE(1234, 0, 0, 0, 0, 0, 0)


def test_boot_time_wraps_in_32_bits(desk: "Desk") -> None:
    assert desk.ask(attitude, ((1 << 32) + 7) * 1000).time_boot_ms == 7


def test_quaternion_is_scalar_first(desk: "Desk") -> None:
    desk.ahrs.face(0, 0, math.pi / 2)
    desk.ahrs.gyro = RATES
    now = desk.ask(attitude_quaternion)
    assert (now.q1, now.q2, now.q3, now.q4) == pytest.approx((math.sqrt(0.5), 0, 0, math.sqrt(0.5)), abs=1e-6)
    assert (now.rollspeed, now.pitchspeed, now.yawspeed) == (0.5, -0.25, 2.0)
    assert now.repr_offset_q == (0, 0, 0, 0)
    assert now.time_boot_ms == 42_500


def test_quaternion_is_not_told_before_there_is_one(desk: "Desk") -> None:
    desk.ahrs.quat = None
    assert desk.has_nothing(attitude_quaternion)


def test_ahrs_tells_the_gyro_bias_and_no_error(desk: "Desk") -> None:
    desk.ahrs.drift = RATES
    assert desk.ask(ahrs) == AHRS(0.5, -0.25, 2.0, 0, 0, 0, 0)


def test_second_estimator_agrees_on_the_attitude_and_knows_no_place(desk: "Desk") -> None:
    desk.ahrs.face(*TURNED)
    now, first = desk.ask(ahrs2), desk.ask(attitude)
    assert now == AHRS2(first.roll, first.pitch, first.yaw, 0, 0, 0)


def test_second_estimator_is_at_home_s_height(desk: "Desk") -> None:
    desk.home = HERE
    assert desk.ask(ahrs2) == AHRS2(0, 0, 0, 488, 0, 0)


@pytest.mark.parametrize(("fix_type", "place"), [(2, (0, 0)), (3, (473_977_420, 85_455_940))])
def test_second_estimator_is_where_a_gps_with_a_3d_fix_is(desk: "Desk", fix_type: int, place: tuple[int, int]) -> None:
    desk.gps = GpsSample(1000, fix_type, HERE, Vector3f(), 9)
    now = desk.ask(ahrs2)
    assert (now.lat, now.lng) == place


def test_second_estimator_says_nothing_before_there_is_an_attitude(desk: "Desk") -> None:
    desk.ahrs.quat = None
    assert desk.has_nothing(ahrs2)


def test_ekf_tells_its_flags_and_each_variance_in_its_field(desk: "Desk") -> None:
    flags = FilterFlag.ATTITUDE | FilterFlag.CONST_POS_MODE | FilterFlag.GPS_GLITCHING
    desk.ahrs.status = FilterStatus(
        flags,
        velocity_variance=0.125,
        pos_horiz_variance=0.25,
        pos_vert_variance=0.375,
        compass_variance=0.5,
        terrain_alt_variance=0.625,
        airspeed_variance=0.75,
    )
    assert desk.ask(ekf_status_report) == EKF_STATUS_REPORT(
        1 + 128 + 32768,
        velocity_variance=0.125,
        pos_horiz_variance=0.25,
        pos_vert_variance=0.375,
        compass_variance=0.5,
        terrain_alt_variance=0.625,
        airspeed_variance=0.75,
    )


def test_variance_beyond_float32_is_infinite(desk: "Desk") -> None:
    desk.ahrs.status = FilterStatus(FilterFlag.ATTITUDE, velocity_variance=1e39)
    with np.errstate(over="raise"):
        now = desk.ask(ekf_status_report)
    assert now.velocity_variance == math.inf
    assert desk.channel.send(now)


def test_ekf_that_does_not_run_reports_nothing(desk: "Desk") -> None:
    assert desk.has_nothing(ekf_status_report)
