# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""VOXL cameras (VISO_TYPE 3): a reset re-aligns at once, and nothing is ignored."""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import pytest

from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ap_visualodom.release import JULY_2025
from ap_visualodom.verdicts import CONSUMED, QUALITY_BELOW_MIN

if TYPE_CHECKING:
    from tests.conftest import MakeRig, Rig

Yawed = Callable[[float], Quaternion]

RESET = (4, "VisOdom: reset")  # MAV_SEVERITY_WARNING


@pytest.fixture
def rig(make_rig: "MakeRig") -> "Rig":
    rig = make_rig(TYPE=3)
    rig.visual_odom.release = JULY_2025  # the last that aligns position
    return rig


def close(v: Vector3f, x: float, y: float, z: float) -> bool:
    return float((v - Vector3f(x, y, z)).length()) < 1e-5


def test_first_sample_with_counter_zero_is_no_reset(rig: "Rig") -> None:
    rig.pose(Vector3f(1, 2, 3))
    assert rig.texts == []
    assert rig.extnav[0].pos == Vector3f(1, 2, 3)


def test_first_sample_with_another_counter_is_a_reset_towards_the_origin(rig: "Rig") -> None:
    rig.pose(Vector3f(1, 2, 3), counter=7)
    assert rig.texts == [RESET]
    assert rig.extnav[0].pos == Vector3f(0, 0, 0)


def test_position_goes_on_where_it_was_before_a_reset(rig: "Rig") -> None:
    rig.pose(Vector3f(1, 2, 3))
    rig.pose(Vector3f(10, 20, 30), counter=1)
    rig.pose(Vector3f(11, 20, 30), counter=1)
    assert [call.pos for call in rig.extnav[1:]] == [Vector3f(1, 2, 3), Vector3f(2, 2, 3)]


def test_corrected_position_is_the_one_to_go_on_from(rig: "Rig") -> None:
    rig.ahrs.pos = Vector3f(7, 8, 9)
    rig.visual_odom.align_position_to_ahrs(True, True)
    rig.pose(Vector3f(1, 2, 3))
    rig.pose(Vector3f(0, 0, 0), counter=1)
    assert rig.extnav[1].pos == Vector3f(7, 8, 9)


def test_scaled_position_is_the_one_aligned(rig: "Rig") -> None:
    rig.set(SCALE=2)
    rig.pose(Vector3f(1, 2, 3))
    rig.pose(Vector3f(10, 20, 30), counter=1)
    rig.pose(Vector3f(11, 20, 30), counter=1)
    assert rig.extnav[2].pos == Vector3f(4, 4, 6)


def test_reset_is_announced_once(rig: "Rig") -> None:
    rig.pose(counter=1)
    rig.pose(counter=1)
    assert rig.texts == [RESET]


@pytest.mark.parametrize("counter", [0, 2, 255])
def test_any_other_counter_is_a_reset(rig: "Rig", counter: int) -> None:
    rig.pose(counter=1)
    rig.pose(counter=counter)
    assert rig.texts == [RESET, RESET]


def test_reset_aligns_yaw(rig: "Rig", yawed: Yawed) -> None:
    rig.align_ready(0.5)
    rig.pose()
    rig.align_ready(1.5)
    rig.pose(attitude=yawed(-1.0), counter=1)
    assert float(rig.extnav[1].quat.get_euler_yaw()) == pytest.approx(1.5, abs=1e-6)


def test_texts_of_a_reset_are_in_order(rig: "Rig", yawed: Yawed) -> None:
    rig.align_ready(0.5)
    rig.pose()
    rig.align_ready(1.5)
    rig.pose(attitude=yawed(-1.0), counter=1)
    assert rig.texts[1:] == [RESET, (6, "VisOdom: yaw shifted 114 to 85 deg")]


def test_position_is_kept_when_a_reset_turns_the_camera(rig: "Rig", yawed: Yawed) -> None:
    rig.align_ready(0.5)
    rig.pose(Vector3f(1, 2, 3))
    rig.pose(Vector3f(10, 20, 30), yawed(-1.0), counter=1)
    rig.pose(Vector3f(11, 20, 30), yawed(-1.0), counter=1)
    assert close(rig.extnav[1].pos, 1, 2, 3)
    assert close(rig.extnav[2].pos, 1 + math.cos(1.5), 2 + math.sin(1.5), 3)


def test_position_is_kept_where_yaw_alignment_is_refused(rig: "Rig", yawed: Yawed) -> None:
    rig.pose(Vector3f(1, 2, 3))
    rig.pose(Vector3f(10, 20, 30), yawed(1.0), counter=1)
    assert rig.texts == [RESET]
    assert rig.extnav[1].pos == Vector3f(1, 2, 3)
    assert rig.extnav[1].quat == yawed(1.0)


def test_pending_yaw_alignment_is_done_again_after_that_of_a_reset(rig: "Rig") -> None:
    rig.align_ready(1.5)
    rig.pose(counter=1)
    shifts = [(6, "VisOdom: yaw shifted 85 to 85 deg"), (6, "VisOdom: yaw shifted 0 to 85 deg")]
    assert rig.texts == [RESET, *shifts]


def test_nothing_is_ignored_after_a_reset(rig: "Rig") -> None:
    assert rig.pose(counter=1) is CONSUMED
    assert rig.speed(counter=2) is CONSUMED


def test_reset_time_is_the_time_of_the_reset(rig: "Rig") -> None:
    rig.pose()
    rig.at_ms(10_500)
    rig.pose(counter=1)
    assert rig.extnav[1].resetTime_ms == 10_500


def test_quality_gate_applies(rig: "Rig") -> None:
    rig.set(QUAL_MIN=50)
    assert rig.pose(quality=49) is QUALITY_BELOW_MIN
    assert rig.speed(quality=49) is QUALITY_BELOW_MIN
    assert rig.ahrs.calls == []


def test_withheld_pose_is_remembered_for_the_next_reset(rig: "Rig") -> None:
    rig.set(QUAL_MIN=50)
    rig.pose(Vector3f(1, 2, 3), quality=0)
    rig.pose(Vector3f(10, 20, 30), counter=1)
    assert rig.extnav[0].pos == Vector3f(1, 2, 3)


def test_counter_of_a_speed_is_no_reset(rig: "Rig") -> None:
    rig.speed(counter=1)
    assert rig.texts == []


def test_type_changed_to_t265_in_flight_ends_re_alignment(rig: "Rig") -> None:
    rig.pose(Vector3f(1, 2, 3))
    rig.set(TYPE=2)
    rig.pose(Vector3f(10, 20, 30), counter=1)
    assert rig.texts == []
    assert rig.logged("VISP")[1]["PX"] == 10
