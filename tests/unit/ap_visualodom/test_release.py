# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What releases of the library do otherwise: one strategy at a time, and in the library."""

import math
from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ap_core.fmath import f32
from ap_core.vector3 import Vector3f
from ap_visualodom.release import (
    JULY_2025,
    VisualOdomRelease,
    axes_requested,
    no_axes,
    position_as_scaled,
    position_with_correction,
    vel_err_of_message,
    vel_err_of_parameter,
)
from ap_visualodom.var_info import VisualOdom_Type
from ekf_stub.ahrs.ahrs_settable import ExtNav

if TYPE_CHECKING:
    from tests.conftest import MakeRig

LATER = VisualOdomRelease(no_axes, position_with_correction)
FLOATS = st.floats(width=32)
both_ways = pytest.mark.parametrize("axes", [(False, False), (False, True), (True, False), (True, True)])


@both_ways
def test_axes_requested_are_those_of_the_request(axes: tuple[bool, bool]) -> None:
    assert axes_requested(*axes) == axes


@both_ways
def test_no_axes_are_none_whatever_is_requested(axes: tuple[bool, bool]) -> None:
    assert no_axes(*axes) == (False, False)


@given(st.builds(Vector3f, FLOATS, FLOATS, FLOATS))
def test_correction_that_is_zero_changes_negative_zeros_only(position: Vector3f) -> None:
    corrected = position_with_correction(position)
    for before, after in zip(position.to_tuple(), corrected.to_tuple(), strict=True):
        assert before == after or (math.isnan(before) and math.isnan(after))
        assert after != 0 or not math.copysign(1, after) < 0
        assert after == 0 or math.isnan(after) or math.copysign(1, after) == math.copysign(1, before)


def test_position_as_scaled_keeps_negative_zero() -> None:
    assert math.copysign(1, position_as_scaled(Vector3f(-0.0, 1, 2)).x) == -1


@pytest.mark.parametrize(("release", "sign"), [(JULY_2025, -1), (LATER, 1)])
def test_mav_backend_makes_of_a_negative_zero_what_its_release_does(
    make_rig: "MakeRig", release: VisualOdomRelease, sign: int
) -> None:
    rig = make_rig(TYPE=VisualOdom_Type.MAV)
    rig.visual_odom.release = release
    rig.pose(Vector3f(-0.0, 1, 2))
    [call] = rig.ahrs.calls
    assert isinstance(call, ExtNav)
    assert math.copysign(1, call.pos.x) == sign


@pytest.mark.parametrize("kind", [VisualOdom_Type.IntelT265, VisualOdom_Type.VOXL])
@pytest.mark.parametrize(("release", "pos"), [(JULY_2025, Vector3f(7, 8, 9)), (LATER, Vector3f(1, 2, 3))])
def test_position_is_aligned_where_the_release_does(
    make_rig: "MakeRig", kind: VisualOdom_Type, release: VisualOdomRelease, pos: Vector3f
) -> None:
    rig = make_rig(TYPE=kind)
    rig.visual_odom.release = release
    rig.ahrs.is_using_extnav_for_yaw = True
    rig.ahrs.pos = Vector3f(7, 8, 9)
    rig.visual_odom.align_position_to_ahrs(True, True)
    rig.pose(Vector3f(1, 2, 3))
    [call] = rig.ahrs.calls
    assert isinstance(call, ExtNav)
    assert call.pos == pos


@pytest.mark.parametrize(
    ("error", "consume", "taken"),
    [(0.05, True, 0.1), (0.5, True, 0.5), (math.nan, True, 0.1), (math.inf, True, math.inf), (0.05, False, 0.05)],
)
def test_error_of_a_velocity_is_at_least_the_parameter_while_it_is_used(
    error: float, consume: bool, taken: float
) -> None:
    assert vel_err_of_message(f32(error), f32(0.1), consume) == f32(taken)
    assert vel_err_of_parameter(f32(error), f32(0.1), consume) == f32(0.1)


def test_velocity_that_is_refused_keeps_an_error_that_is_no_number() -> None:
    assert math.isnan(vel_err_of_message(f32(math.nan), f32(0.1), False))
