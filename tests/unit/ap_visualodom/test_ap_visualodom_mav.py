# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The MAVLink backend passes samples on: scaled, clamped, gated on quality, and otherwise as they are."""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import pytest

from ap_core.fmath import f32
from ap_core.internal_error import InternalError
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ap_visualodom.verdicts import CONSUMED, QUALITY_BELOW_MIN

if TYPE_CHECKING:
    from tests.conftest import MakeRig, Rig

Yawed = Callable[[float], Quaternion]

TILTED = Quaternion.from_euler(f32(0.1), f32(-0.2), f32(0.3))
GATE = [(0, 0), (0, 1), (50, 50), (50, 51), (-1, -1), (-1, 0), (100, 100), (-1, 100)]
BELOW_GATE = [(0, -1), (50, 49), (50, 0), (50, -1), (100, 99), (-1, -2), (1, 0)]


@pytest.fixture
def rig(make_rig: "MakeRig") -> "Rig":
    return make_rig(TYPE=1)


# Pose


def test_pose_is_handed_to_the_ahrs_as_it_is(rig: "Rig") -> None:
    rig.set(DELAY_MS=35)
    rig.pose(Vector3f(1, 2, 3), TILTED, time_ms=9_876)
    [call] = rig.extnav
    assert (call.pos, call.quat) == (Vector3f(1, 2, 3), TILTED)
    assert (call.timeStamp_ms, call.delay_ms) == (9_876, 35)


def test_position_is_scaled(rig: "Rig") -> None:
    rig.set(SCALE=1.1)
    rig.pose(Vector3f(1, 2, 3))
    assert rig.extnav[0].pos == Vector3f(1, 2, 3) * f32(1.1)


def test_orientation_offset_and_ahrs_yaw_are_not_applied(rig: "Rig") -> None:
    rig.set(ORIENT=4, POS=Vector3f(1, 2, 3))
    rig.align_ready(1.5)
    rig.visual_odom.request_align_yaw_to_ahrs()
    rig.pose(Vector3f(4, 5, 6), TILTED)
    assert (rig.extnav[0].pos, rig.extnav[0].quat) == (Vector3f(4, 5, 6), TILTED)
    assert rig.texts == []


def test_position_alignment_is_not_done(rig: "Rig") -> None:
    rig.ahrs.pos = Vector3f(7, 8, 9)
    rig.visual_odom.align_position_to_ahrs(True, True)
    rig.pose(Vector3f(1, 2, 3))
    assert rig.extnav[0].pos == Vector3f(1, 2, 3)


@pytest.mark.parametrize(
    ("given", "clamped"), [(-1, 0.3), (0, 0.3), (0.4, 0.4), (100, 100), (100.5, 100), (math.inf, 100), (-math.inf, 0.3)]
)
def test_position_error_is_clamped_from_the_noise_parameter_to_100_m(rig: "Rig", given: float, clamped: float) -> None:
    rig.set(POS_M_NSE=0.3)
    rig.pose(pos_err=given)
    assert rig.extnav[0].posErr == f32(clamped)


@pytest.mark.parametrize(
    ("given", "clamped"), [(-1, 0.3), (0, 0.3), (0.4, 0.4), (1.5, 1.5), (1.6, 1.5), (math.inf, 1.5)]
)
def test_angle_error_is_clamped_from_the_noise_parameter_to_one_and_a_half(
    rig: "Rig", given: float, clamped: float
) -> None:
    rig.set(YAW_M_NSE=0.3)
    rig.pose(ang_err=given)
    assert rig.extnav[0].angErr == f32(clamped)


def test_error_that_is_nan_becomes_the_midpoint_with_an_internal_error(rig: "Rig") -> None:
    rig.set(POS_M_NSE=1, YAW_M_NSE=0.5)
    rig.pose(pos_err=math.nan, ang_err=math.nan)
    assert (rig.extnav[0].posErr, rig.extnav[0].angErr) == (f32(50.5), f32(1.0))
    assert (rig.errors.count, rig.errors.last) == (2, InternalError.CONSTRAINING_NAN)


@pytest.mark.parametrize(("given", "clamped"), [(0, 200), (150, 200), (200, 100), (300, 100)])
def test_noise_parameter_above_the_limit_comes_first(rig: "Rig", given: float, clamped: float) -> None:
    rig.set(POS_M_NSE=200)
    rig.pose(pos_err=given)
    assert rig.extnav[0].posErr == f32(clamped)


@pytest.mark.parametrize(("minimum", "quality"), GATE)
def test_pose_of_sufficient_quality_is_consumed(rig: "Rig", minimum: int, quality: int) -> None:
    rig.set(QUAL_MIN=minimum)
    assert rig.pose(quality=quality) is CONSUMED
    assert len(rig.extnav) == 1
    assert rig.logged("VISP")[0]["Ign"] == 0


@pytest.mark.parametrize(("minimum", "quality"), BELOW_GATE)
def test_pose_of_low_quality_is_withheld(rig: "Rig", minimum: int, quality: int) -> None:
    rig.set(QUAL_MIN=minimum)
    assert rig.pose(quality=quality) is QUALITY_BELOW_MIN
    assert rig.extnav == []
    assert rig.logged("VISP")[0]["Ign"] == 1


def test_withheld_pose_still_counts_for_health(rig: "Rig") -> None:
    rig.set(QUAL_MIN=50)
    rig.pose(quality=0)
    rig.at_ms(10_299)
    assert rig.visual_odom.healthy()


def test_quality_of_a_withheld_pose_is_reported(rig: "Rig") -> None:
    rig.set(QUAL_MIN=50)
    rig.pose(quality=7)
    assert rig.visual_odom.quality() == 7


def test_reset_time_goes_with_the_pose(rig: "Rig") -> None:
    rig.pose(counter=0)
    rig.at_ms(10_500)
    rig.pose(counter=1)
    rig.at_ms(11_000)
    rig.pose(counter=1)
    assert [call.resetTime_ms for call in rig.extnav] == [0, 10_500, 10_500]


def test_reset_time_is_noted_only_when_a_pose_is_consumed(rig: "Rig") -> None:
    rig.set(QUAL_MIN=50)
    rig.pose(counter=1, quality=0)
    rig.at_ms(10_500)
    rig.pose(counter=1, quality=50)
    assert rig.extnav[0].resetTime_ms == 10_500


def test_withheld_pose_of_another_counter_leaves_the_reset_time(rig: "Rig") -> None:
    rig.set(QUAL_MIN=50)
    rig.pose(counter=1)
    rig.at_ms(10_500)
    rig.pose(counter=2, quality=0)
    rig.pose(counter=1)
    assert [call.resetTime_ms for call in rig.extnav] == [10_000, 10_000]


def test_pose_is_not_ignored_after_a_reset(rig: "Rig") -> None:
    rig.pose(counter=0)
    assert rig.pose(counter=1) is CONSUMED


def test_pose_is_logged(rig: "Rig") -> None:
    rig.set(SCALE=2)
    rig.pose(Vector3f(1, 2, 3), remote_us=1 << 63, time_ms=9_876, pos_err=0.5, ang_err=0.75, counter=200, quality=9)
    assert rig.records == [
        (
            "VISP",
            {
                "TimeUS": 10_000_000,
                "RTimeUS": 1 << 63,
                "CTimeMS": 9_876,
                "PX": 2,
                "PY": 4,
                "PZ": 6,
                "R": 0,
                "P": 0,
                "Y": 0,
                "PErr": 0.5,
                "AErr": 0.75,
                "Rst": 200,
                "Ign": 0,
                "Q": 9,
            },
        )
    ]


def test_clamped_errors_are_logged(rig: "Rig") -> None:
    rig.pose(pos_err=0, ang_err=9)
    [fields] = rig.logged("VISP")
    assert (fields["PErr"], fields["AErr"]) == (f32(0.2), f32(1.5))


def test_attitude_is_logged_in_degrees(rig: "Rig") -> None:
    rig.pose(attitude=TILTED)
    [fields] = rig.logged("VISP")
    angles = [math.degrees(angle) for angle in (0.1, -0.2, 0.3)]
    assert [fields["R"], fields["P"], fields["Y"]] == pytest.approx(angles, abs=1e-4)


def test_logged_yaw_is_not_wrapped(rig: "Rig", yawed: Yawed) -> None:
    rig.pose(attitude=yawed(-1.5))
    assert rig.logged("VISP")[0]["Y"] == pytest.approx(-85.9437, abs=1e-3)


# Speed


def test_speed_is_handed_to_the_ahrs_as_it_is(rig: "Rig") -> None:
    rig.set(DELAY_MS=35, SCALE=2, ORIENT=4, VEL_M_NSE=0.3)
    rig.speed(Vector3f(1, 2, 3), time_ms=9_876)
    [call] = rig.extvel
    assert (call.vel, call.err) == (Vector3f(1, 2, 3), f32(0.3))
    assert (call.timeStamp_ms, call.delay_ms) == (9_876, 35)


@pytest.mark.parametrize("noise", [-1, 0, 0.001, 5, 1e6])
def test_velocity_noise_is_not_clamped(rig: "Rig", noise: float) -> None:
    rig.set(VEL_M_NSE=noise)
    rig.speed()
    assert rig.extvel[0].err == f32(noise)
    assert rig.logged("VISV")[0]["VErr"] == f32(noise)


@pytest.mark.parametrize(("minimum", "quality"), GATE)
def test_speed_of_sufficient_quality_is_consumed(rig: "Rig", minimum: int, quality: int) -> None:
    rig.set(QUAL_MIN=minimum)
    assert rig.speed(quality=quality) is CONSUMED
    assert len(rig.extvel) == 1
    assert rig.logged("VISV")[0]["Ign"] == 0


@pytest.mark.parametrize(("minimum", "quality"), BELOW_GATE)
def test_speed_of_low_quality_is_withheld(rig: "Rig", minimum: int, quality: int) -> None:
    rig.set(QUAL_MIN=minimum)
    assert rig.speed(quality=quality) is QUALITY_BELOW_MIN
    assert rig.extvel == []
    assert rig.logged("VISV")[0]["Ign"] == 1


def test_withheld_speed_still_counts_for_health(rig: "Rig") -> None:
    rig.set(QUAL_MIN=50)
    rig.speed(quality=0)
    rig.at_ms(10_299)
    assert rig.visual_odom.healthy()


def test_speed_does_not_note_a_reset(rig: "Rig") -> None:
    rig.speed(counter=3)
    rig.at_ms(10_500)
    rig.pose(counter=3)
    assert rig.extnav[0].resetTime_ms == 10_500


def test_speed_is_logged(rig: "Rig") -> None:
    rig.set(VEL_M_NSE=0.25)
    rig.speed(Vector3f(1, 2, 3), remote_us=1 << 63, time_ms=9_876, counter=200, quality=-1)
    assert rig.records == [
        (
            "VISV",
            {
                "TimeUS": 10_000_000,
                "RTimeUS": 1 << 63,
                "CTimeMS": 9_876,
                "VX": 1,
                "VY": 2,
                "VZ": 3,
                "VErr": 0.25,
                "Rst": 200,
                "Ign": 1,
                "Q": -1,
            },
        )
    ]


# Arming


def test_arming_needs_messages_only(rig: "Rig") -> None:
    rig.pose(attitude=TILTED)
    assert rig.visual_odom.pre_arm_check() is None


def test_silence_fails_arming(rig: "Rig") -> None:
    assert rig.visual_odom.pre_arm_check() == "not healthy"
