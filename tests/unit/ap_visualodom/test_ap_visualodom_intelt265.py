# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The T265 backend: alignment with the vehicle, the second after a reset, and what samples become."""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import pytest

from ap_core.fmath import f32
from ap_core.internal_error import InternalError
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ap_visualodom.ap_visualodom_intelt265 import AP_VisualOdom_IntelT265
from ap_visualodom.release import JULY_2025
from ap_visualodom.verdicts import CONSUMED, QUALITY_BELOW_MIN, RESET_SETTLING

if TYPE_CHECKING:
    from tests.conftest import MakeRig, Rig

Yawed = Callable[[float], Quaternion]

INFO = 6
WRAP_MS = 1 << 32
TILTED = Quaternion.from_euler(f32(0.1), f32(-0.2), f32(0.3))


@pytest.fixture
def rig(make_rig: "MakeRig") -> "Rig":
    rig = make_rig(TYPE=2)
    rig.visual_odom.release = JULY_2025  # the last that aligns position
    return rig


def close(v: Vector3f, x: float, y: float, z: float) -> bool:
    return float((v - Vector3f(x, y, z)).length()) < 2e-6


def same_attitude(a: Quaternion, b: Quaternion) -> bool:
    """Return whether two quaternions are the same rotation, whatever their sign."""
    pairs = [(float(x), float(y)) for x, y in zip(a.to_wxyz(), b.to_wxyz(), strict=True)]
    return any(all(abs(x - sign * y) < 1e-6 for x, y in pairs) for sign in (1, -1))


# Before any alignment


def test_pose_is_handed_over_as_it_is_before_alignment(rig: "Rig") -> None:
    rig.set(DELAY_MS=35)
    rig.pose(Vector3f(1, 2, 3), TILTED, time_ms=9_876)
    [call] = rig.extnav
    assert (call.pos, call.quat) == (Vector3f(1, 2, 3), TILTED)
    assert (call.timeStamp_ms, call.delay_ms, call.resetTime_ms) == (9_876, 35, 0)


def test_position_is_scaled(rig: "Rig") -> None:
    rig.set(SCALE=1.1)
    rig.pose(Vector3f(1, 2, 3))
    assert rig.extnav[0].pos == Vector3f(1, 2, 3) * f32(1.1)


def test_orientation_is_not_applied_before_alignment(rig: "Rig") -> None:
    rig.set(ORIENT=4)
    rig.pose(attitude=TILTED)
    assert rig.extnav[0].quat == TILTED


def test_camera_offset_is_not_applied(rig: "Rig") -> None:
    rig.set(POS=Vector3f(1, 2, 3))
    rig.pose(Vector3f(4, 5, 6))
    assert rig.extnav[0].pos == Vector3f(4, 5, 6)


# Yaw alignment


def test_first_pose_aligns_yaw(rig: "Rig", yawed: Yawed) -> None:
    rig.align_ready(1.5)
    rig.pose(attitude=yawed(0.25))
    assert same_attitude(rig.extnav[0].quat, yawed(1.5))


@pytest.mark.parametrize(
    ("ahrs_yaw", "camera_yaw", "text"),
    [
        (1.5, 0.0, "VisOdom: yaw shifted 85 to 85 deg"),
        (1.5, 0.75, "VisOdom: yaw shifted 42 to 85 deg"),
        (-1.0, 0.0, "VisOdom: yaw shifted 302 to 302 deg"),
        (0.0, 1.0, "VisOdom: yaw shifted 302 to 0 deg"),
        (0.0, 0.0, "VisOdom: yaw shifted 0 to 0 deg"),
    ],
)
def test_yaw_alignment_is_announced_in_whole_degrees(
    rig: "Rig", yawed: Yawed, ahrs_yaw: float, camera_yaw: float, text: str
) -> None:
    rig.align_ready(ahrs_yaw)
    rig.pose(attitude=yawed(camera_yaw))
    assert rig.texts == [(INFO, text)]


def test_announced_shift_is_relative_to_the_previous_one(rig: "Rig") -> None:
    rig.align_ready(1.5)
    rig.pose()
    rig.align_ready(1.0)
    rig.visual_odom.request_align_yaw_to_ahrs()
    rig.pose()
    assert rig.texts[1] == (INFO, "VisOdom: yaw shifted -28 to 57 deg")


def test_shift_of_a_yaw_that_is_nan_is_announced_as_the_least_integer(rig: "Rig") -> None:
    rig.align_ready(math.nan)
    rig.pose()
    assert rig.texts == [(INFO, "VisOdom: yaw shifted -2147483648 to -2147483648 deg")]


def test_yaw_is_aligned_once(rig: "Rig", yawed: Yawed) -> None:
    rig.align_ready(1.5)
    rig.pose()
    rig.align_ready(2.5)
    rig.pose()
    assert len(rig.texts) == 1
    assert same_attitude(rig.extnav[1].quat, yawed(1.5))


def test_yaw_is_aligned_again_on_request(rig: "Rig", yawed: Yawed) -> None:
    rig.align_ready(1.5)
    rig.pose()
    rig.align_ready(2.5)
    rig.visual_odom.request_align_yaw_to_ahrs()
    rig.pose()
    assert same_attitude(rig.extnav[1].quat, yawed(2.5))


@pytest.mark.parametrize(
    ("obstacle", "value"),
    [("is_using_extnav_for_yaw", True), ("is_initialised", False), ("is_dcm_yaw_initialised", False)],
)
def test_yaw_alignment_is_refused_and_retried_at_the_next_pose(
    rig: "Rig", yawed: Yawed, obstacle: str, value: bool
) -> None:
    rig.align_ready(1.5)
    setattr(rig.ahrs, obstacle, value)
    rig.pose()
    assert rig.texts == []
    assert rig.extnav[0].quat == Quaternion()
    setattr(rig.ahrs, obstacle, not value)
    rig.pose()
    assert same_attitude(rig.extnav[1].quat, yawed(1.5))


def test_speed_does_not_align_yaw(rig: "Rig") -> None:
    rig.align_ready(1.5)
    rig.speed(Vector3f(1, 0, 0))
    assert rig.texts == []
    assert rig.extvel[0].vel == Vector3f(1, 0, 0)


def test_pose_of_low_quality_aligns_yaw(rig: "Rig") -> None:
    rig.align_ready(1.5)
    rig.set(QUAL_MIN=50)
    rig.pose(quality=0)
    assert len(rig.texts) == 1


def test_position_does_not_jump_at_yaw_alignment(rig: "Rig") -> None:
    rig.align_ready(1.5)
    rig.pose(Vector3f(1, 2, 3))
    assert close(rig.extnav[0].pos, 1, 2, 3)


def test_position_does_not_jump_at_a_second_yaw_alignment(rig: "Rig") -> None:
    rig.align_ready(1.5)
    rig.pose(Vector3f(1, 2, 3))
    rig.pose(Vector3f(2, 2, 3))
    rig.align_ready(0.5)
    rig.visual_odom.request_align_yaw_to_ahrs()
    rig.pose(Vector3f(2, 2, 3))
    before, after = rig.extnav[1].pos, rig.extnav[2].pos
    assert float((after - before).length()) < 2e-6


def test_movement_is_turned_by_the_shift(rig: "Rig") -> None:
    rig.align_ready(1.5)
    rig.pose(Vector3f(1, 2, 3))
    rig.pose(Vector3f(2, 2, 3))
    moved = rig.extnav[1].pos - rig.extnav[0].pos
    assert close(moved, math.cos(1.5), math.sin(1.5), 0)


def test_shift_of_zero_leaves_attitude_and_position_as_they_are(rig: "Rig") -> None:
    rig.align_ready(float(TILTED.get_euler_yaw()))
    rig.pose(Vector3f(1, 2, 3), TILTED)
    [call] = rig.extnav
    assert (call.pos, call.quat) == (Vector3f(1, 2, 3), TILTED)


def test_shift_back_to_zero_ends_the_rotation(rig: "Rig") -> None:
    rig.align_ready(1.5)
    rig.pose(Vector3f(1, 2, 3))
    rig.align_ready(0.0)
    rig.visual_odom.request_align_yaw_to_ahrs()
    rig.pose(Vector3f(1, 2, 3))
    rig.speed(Vector3f(1, 0, 0))
    assert close(rig.extnav[1].pos, 1, 2, 3)
    assert rig.extnav[1].quat == Quaternion()
    assert rig.extvel[0].vel == Vector3f(1, 0, 0)


@pytest.mark.parametrize(("orientation", "mounted_yaw"), [(2, math.pi / 2), (4, math.pi), (6, -math.pi / 2)])
def test_orientation_is_taken_off_the_attitude(rig: "Rig", yawed: Yawed, orientation: int, mounted_yaw: float) -> None:
    rig.set(ORIENT=orientation)
    rig.align_ready(0.5)
    body = Quaternion.from_euler(f32(0.1), f32(-0.2), f32(0.5))
    rig.pose(attitude=body * yawed(mounted_yaw))
    assert same_attitude(rig.extnav[0].quat, body)


def test_orientation_does_not_turn_the_position(rig: "Rig", yawed: Yawed) -> None:
    rig.set(ORIENT=2)
    rig.align_ready(0.0)
    rig.pose(Vector3f(1, 2, 3), yawed(math.pi / 2))
    rig.pose(Vector3f(2, 2, 3), yawed(math.pi / 2))
    moved = rig.extnav[1].pos - rig.extnav[0].pos
    assert close(moved, 1, 0, 0)


def test_orientation_counts_as_it_was_at_alignment(rig: "Rig") -> None:
    rig.align_ready(0.0)
    rig.pose()
    rig.set(ORIENT=2)
    rig.pose(attitude=TILTED)
    assert rig.extnav[1].quat == TILTED


def test_orientation_set_back_to_none_is_forgotten_at_the_next_alignment(rig: "Rig") -> None:
    rig.set(ORIENT=24)
    rig.align_ready(float(TILTED.get_euler_yaw()))
    rig.pose(attitude=TILTED)
    rig.set(ORIENT=0)
    rig.visual_odom.request_align_yaw_to_ahrs()
    rig.pose(attitude=TILTED)
    assert rig.extnav[1].quat == TILTED


def test_unknown_orientation_is_an_internal_error_and_no_rotation(rig: "Rig", yawed: Yawed) -> None:
    rig.set(ORIENT=50)
    rig.align_ready(1.5)
    rig.pose()
    assert (rig.errors.count, rig.errors.last) == (1, InternalError.BAD_ROTATION)
    assert same_attitude(rig.extnav[0].quat, yawed(1.5))


# Position alignment


@pytest.mark.parametrize(
    ("xy", "z", "expected"),
    [(True, False, (7, 8, 3)), (False, True, (1, 2, 9)), (True, True, (7, 8, 9)), (False, False, (1, 2, 3))],
)
def test_position_is_aligned_on_the_chosen_axes(
    rig: "Rig", xy: bool, z: bool, expected: tuple[float, float, float]
) -> None:
    rig.ahrs.pos = Vector3f(7, 8, 9)
    rig.visual_odom.align_position_to_ahrs(xy, z)
    rig.pose(Vector3f(1, 2, 3))
    assert rig.extnav[0].pos == Vector3f(*expected)


def test_position_is_not_aligned_without_a_request(rig: "Rig") -> None:
    rig.ahrs.pos = Vector3f(7, 8, 9)
    rig.pose(Vector3f(1, 2, 3))
    assert rig.extnav[0].pos == Vector3f(1, 2, 3)


def test_position_is_aligned_once(rig: "Rig") -> None:
    rig.ahrs.pos = Vector3f(7, 8, 9)
    rig.visual_odom.align_position_to_ahrs(True, True)
    rig.pose(Vector3f(1, 2, 3))
    rig.ahrs.pos = Vector3f(70, 80, 90)
    rig.pose(Vector3f(2, 2, 3))
    assert rig.extnav[1].pos == Vector3f(8, 8, 9)


def test_position_alignment_waits_for_a_position_of_the_ahrs(rig: "Rig") -> None:
    rig.visual_odom.align_position_to_ahrs(True, True)
    rig.pose(Vector3f(1, 2, 3))
    rig.ahrs.pos = Vector3f(7, 8, 9)
    rig.pose(Vector3f(1, 2, 3))
    assert [call.pos for call in rig.extnav] == [Vector3f(1, 2, 3), Vector3f(7, 8, 9)]


@pytest.mark.parametrize(
    ("xy", "z", "expected"), [(False, True, (1, 2, 9)), (True, False, (7, 8, 3)), (False, False, (1, 2, 3))]
)
def test_later_position_request_overwrites_both_axes(
    rig: "Rig", xy: bool, z: bool, expected: tuple[float, float, float]
) -> None:
    rig.ahrs.pos = Vector3f(7, 8, 9)
    rig.visual_odom.align_position_to_ahrs(True, True)
    rig.visual_odom.align_position_to_ahrs(xy, z)
    rig.pose(Vector3f(1, 2, 3))
    assert rig.extnav[0].pos == Vector3f(*expected)


def test_scaled_position_is_the_one_aligned(rig: "Rig") -> None:
    rig.set(SCALE=2)
    rig.ahrs.pos = Vector3f(10, 10, 10)
    rig.visual_odom.align_position_to_ahrs(True, True)
    rig.pose(Vector3f(1, 2, 3))
    rig.pose(Vector3f(2, 2, 3))
    assert [call.pos for call in rig.extnav] == [Vector3f(10, 10, 10), Vector3f(12, 10, 10)]


def test_position_is_aligned_after_yaw(rig: "Rig") -> None:
    rig.align_ready(1.5)
    rig.ahrs.pos = Vector3f(7, 8, 9)
    rig.visual_odom.align_position_to_ahrs(True, True)
    rig.pose(Vector3f(1, 2, 3))
    rig.pose(Vector3f(2, 2, 3))
    assert close(rig.extnav[0].pos, 7, 8, 9)
    assert close(rig.extnav[1].pos, 7 + math.cos(1.5), 8 + math.sin(1.5), 9)


# Speed


def test_speed_is_handed_over_as_it_is_before_alignment(rig: "Rig") -> None:
    rig.set(DELAY_MS=35, VEL_M_NSE=0.3)
    rig.speed(Vector3f(1, 2, 3), time_ms=9_876)
    [call] = rig.extvel
    assert (call.vel, call.err) == (Vector3f(1, 2, 3), f32(0.3))
    assert (call.timeStamp_ms, call.delay_ms) == (9_876, 35)


def test_speed_is_turned_by_the_shift_and_neither_scaled_nor_moved(rig: "Rig") -> None:
    rig.set(SCALE=2)
    rig.align_ready(1.5)
    rig.pose(Vector3f(4, 5, 6))
    rig.speed(Vector3f(1, 0, 3))
    assert close(rig.extvel[0].vel, math.cos(1.5), math.sin(1.5), 3)


@pytest.mark.parametrize("noise", [-1, 0, 1e6])
def test_velocity_noise_is_not_clamped(rig: "Rig", noise: float) -> None:
    rig.set(VEL_M_NSE=noise)
    rig.speed()
    assert rig.extvel[0].err == f32(noise)


# The second after a reset


def reset_at(rig: "Rig", time_ms: int) -> None:
    """Let a pose with a new counter arrive."""
    rig.at_ms(time_ms)
    rig.pose(counter=1)


def test_pose_of_a_reset_is_ignored(rig: "Rig") -> None:
    assert rig.pose(counter=1) is RESET_SETTLING
    assert rig.extnav == []


@pytest.mark.parametrize(("age_ms", "verdict"), [(1, RESET_SETTLING), (1000, RESET_SETTLING), (1001, CONSUMED)])
@pytest.mark.parametrize("reset_ms", [10_000, 1, 500, WRAP_MS - 500, WRAP_MS - 1])
def test_pose_ignored_for_1000_ms_after_reset_counter_change(
    rig: "Rig", reset_ms: int, age_ms: int, verdict: object
) -> None:
    reset_at(rig, reset_ms)
    rig.at_ms(reset_ms + age_ms)
    assert rig.pose(counter=1) is verdict


@pytest.mark.parametrize(("age_ms", "verdict"), [(0, RESET_SETTLING), (1000, RESET_SETTLING), (1001, CONSUMED)])
def test_speed_ignored_for_1000_ms_after_reset_counter_change(rig: "Rig", age_ms: int, verdict: object) -> None:
    reset_at(rig, 10_000)
    rig.at_ms(10_000 + age_ms)
    assert rig.speed(counter=1) is verdict
    assert len(rig.extvel) == (verdict is CONSUMED)


@pytest.mark.parametrize("now_ms", [0, WRAP_MS])
def test_reset_seen_at_zero_milliseconds_is_not_ignored(rig: "Rig", now_ms: int) -> None:
    rig.at_ms(now_ms)
    assert rig.pose(counter=1) is CONSUMED


def test_counter_of_a_speed_is_not_looked_at(rig: "Rig") -> None:
    assert rig.speed(counter=7) is CONSUMED


def test_reset_during_settling_starts_another_second(rig: "Rig") -> None:
    reset_at(rig, 10_000)
    rig.at_ms(10_900)
    rig.pose(counter=2)
    rig.at_ms(11_900)
    assert rig.pose(counter=2) is RESET_SETTLING
    rig.at_ms(11_901)
    assert rig.pose(counter=2) is CONSUMED


def test_counter_going_back_is_a_reset_too(rig: "Rig") -> None:
    reset_at(rig, 10_000)
    rig.at_ms(12_000)
    rig.pose(counter=1)
    assert rig.pose(counter=0) is RESET_SETTLING


def test_settling_ends_with_a_speed_as_well(rig: "Rig") -> None:
    reset_at(rig, 10_000)
    rig.at_ms(11_001)
    rig.speed()
    # The flag is cleared now: going back in time does not bring it back.
    rig.at_ms(10_500)
    assert rig.pose(counter=1) is CONSUMED


def test_reset_of_a_pose_of_low_quality_starts_settling(rig: "Rig") -> None:
    rig.set(QUAL_MIN=50)
    rig.pose(counter=1, quality=0)
    assert rig.pose(counter=1, quality=100) is RESET_SETTLING


def test_settling_is_the_reason_given_before_quality(rig: "Rig") -> None:
    rig.set(QUAL_MIN=50)
    assert rig.pose(counter=1, quality=0) is RESET_SETTLING


def test_ignored_pose_is_logged_and_counts_for_health(rig: "Rig") -> None:
    reset_at(rig, 10_000)
    rig.at_ms(10_250)
    rig.pose(counter=1)
    rig.at_ms(10_500)
    assert [fields["Ign"] for fields in rig.logged("VISP")] == [1, 1]
    assert rig.visual_odom.healthy()


def test_ignored_speed_is_logged_and_counts_for_health(rig: "Rig") -> None:
    reset_at(rig, 10_000)
    rig.at_ms(10_250)
    rig.speed()
    rig.at_ms(10_500)
    assert rig.logged("VISV")[0]["Ign"] == 1
    assert rig.visual_odom.healthy()


def test_reset_time_is_noted_when_the_first_pose_after_settling_is_consumed(rig: "Rig") -> None:
    reset_at(rig, 10_000)
    rig.at_ms(11_001)
    rig.pose(counter=1)
    rig.at_ms(12_000)
    rig.pose(counter=1)
    assert [call.resetTime_ms for call in rig.extnav] == [11_001, 11_001]


def test_reset_sends_no_text(rig: "Rig") -> None:
    rig.pose(counter=1)
    assert rig.texts == []


def test_reset_leaves_alignment(rig: "Rig") -> None:
    rig.ahrs.pos = Vector3f(7, 8, 9)
    rig.visual_odom.align_position_to_ahrs(True, True)
    rig.pose(Vector3f(1, 2, 3))
    reset_at(rig, 10_100)
    rig.at_ms(12_000)
    rig.pose(Vector3f(2, 2, 3), counter=1)
    assert rig.extnav[-1].pos == Vector3f(8, 8, 9)


# Quality gate


@pytest.mark.parametrize(("minimum", "quality"), [(0, 0), (50, 50), (-1, -1), (100, 100)])
def test_sample_of_sufficient_quality_is_consumed(rig: "Rig", minimum: int, quality: int) -> None:
    rig.set(QUAL_MIN=minimum)
    assert rig.pose(quality=quality) is CONSUMED
    assert rig.speed(quality=quality) is CONSUMED
    assert len(rig.ahrs.calls) == 2


@pytest.mark.parametrize(("minimum", "quality"), [(0, -1), (50, 49), (-1, -2), (100, 99)])
def test_sample_of_low_quality_is_withheld(rig: "Rig", minimum: int, quality: int) -> None:
    rig.set(QUAL_MIN=minimum)
    assert rig.pose(quality=quality) is QUALITY_BELOW_MIN
    assert rig.speed(quality=quality) is QUALITY_BELOW_MIN
    assert rig.ahrs.calls == []
    assert rig.visual_odom.quality() == quality


# Errors and records


def test_errors_are_clamped(rig: "Rig") -> None:
    rig.set(POS_M_NSE=0.3, YAW_M_NSE=0.4)
    rig.pose(pos_err=0, ang_err=0)
    rig.pose(pos_err=101, ang_err=2)
    assert [(call.posErr, call.angErr) for call in rig.extnav] == [(f32(0.3), f32(0.4)), (f32(100), f32(1.5))]


def test_error_that_is_nan_becomes_the_midpoint_with_an_internal_error(rig: "Rig") -> None:
    rig.set(POS_M_NSE=1, YAW_M_NSE=0.5)
    rig.pose(pos_err=math.nan, ang_err=math.nan)
    assert (rig.extnav[0].posErr, rig.extnav[0].angErr) == (f32(50.5), f32(1.0))
    assert (rig.errors.count, rig.errors.last) == (2, InternalError.CONSTRAINING_NAN)


def test_pose_is_logged_as_it_was_corrected(rig: "Rig") -> None:
    rig.ahrs.pos = Vector3f(7, 8, 9)
    rig.visual_odom.align_position_to_ahrs(True, True)
    rig.pose(Vector3f(1, 2, 3), remote_us=1 << 63, time_ms=9_876, pos_err=0.5, ang_err=0.75, quality=9)
    assert rig.records == [
        (
            "VISP",
            {
                "TimeUS": 10_000_000,
                "RTimeUS": 1 << 63,
                "CTimeMS": 9_876,
                "PX": 7,
                "PY": 8,
                "PZ": 9,
                "R": 0,
                "P": 0,
                "Y": 0,
                "PErr": 0.5,
                "AErr": 0.75,
                "Rst": 0,
                "Ign": 0,
                "Q": 9,
            },
        )
    ]


def test_logged_yaw_is_wrapped_to_360(rig: "Rig", yawed: Yawed) -> None:
    rig.pose(attitude=yawed(-1.5))
    assert rig.logged("VISP")[0]["Y"] == pytest.approx(360 - 85.9437, abs=1e-3)


def test_logged_roll_and_pitch_are_signed(rig: "Rig") -> None:
    rig.pose(attitude=TILTED)
    fields = rig.logged("VISP")[0]
    assert [fields["R"], fields["P"]] == pytest.approx([math.degrees(0.1), math.degrees(-0.2)], abs=1e-4)


def test_speed_is_logged_as_it_was_corrected(rig: "Rig") -> None:
    rig.align_ready(1.5)
    rig.pose()
    rig.speed(Vector3f(1, 0, 0), counter=200)
    [fields] = rig.logged("VISV")
    assert (fields["VX"], fields["VY"], fields["VZ"]) == rig.extvel[0].vel.to_tuple()
    assert (fields["VErr"], fields["Rst"], fields["Ign"], fields["Q"]) == (f32(0.1), 200, 0, 50)


# Corners


def test_type_changed_to_voxl_in_flight_ends_settling_at_once(rig: "Rig") -> None:
    rig.pose(counter=1)
    rig.set(TYPE=3)
    assert rig.pose(counter=1) is CONSUMED


def test_alignment_clears_an_orientation_error(rig: "Rig") -> None:
    backend = AP_VisualOdom_IntelT265(rig.visual_odom)
    backend._error_orientation = True
    backend.align_yaw(Vector3f(), Quaternion(), f32(0))
    assert not backend._error_orientation
