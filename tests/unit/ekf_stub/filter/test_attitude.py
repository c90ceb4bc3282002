# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Angles of attitudes, and how they change."""

import math

import numpy as np
import pytest
import quaternion
from hypothesis import given
from hypothesis import strategies as st

from ekf_stub.filter.attitude import by_rotation, euler_of, matrix_of_quat, quat_of_euler, yaw_by_components, yaw_of
from ekf_stub.filter.inertial import Array, quat_of_rotation

TILTS = st.floats(-1.4, 1.4)
YAWS = st.floats(-math.pi, math.pi, exclude_min=True)  # which is the same yaw as pi


def about(axis: int, angle: float) -> Array:
    matrix: Array = quaternion.as_rotation_matrix(quat_of_rotation(angle * np.eye(3)[axis]))
    return matrix


@given(TILTS, TILTS, YAWS)
def test_euler_angles_come_back(roll: float, pitch: float, yaw: float) -> None:
    assert np.allclose(euler_of(quat_of_euler(roll, pitch, yaw)), (roll, pitch, yaw), atol=1e-9)


@given(TILTS, TILTS, YAWS)
def test_matrix_is_that_of_the_three_rotations(roll: float, pitch: float, yaw: float) -> None:
    expected = about(2, yaw) @ about(1, pitch) @ about(0, roll)
    assert np.allclose(matrix_of_quat(quat_of_euler(roll, pitch, yaw)), expected, atol=1e-12)


@given(TILTS, TILTS, YAWS)
def test_yaw_is_the_first_angle_of_either_sequence(roll: float, pitch: float, yaw: float) -> None:
    by_321 = quat_of_euler(roll, pitch, yaw)
    by_312 = quaternion.from_rotation_matrix(about(2, yaw) @ about(0, roll) @ about(1, pitch))
    assert math.remainder(yaw_of(by_321, by_321=True) - yaw, 2 * math.pi) == pytest.approx(0, abs=1e-9)
    assert math.remainder(yaw_of(by_312, by_321=False) - yaw, 2 * math.pi) == pytest.approx(0, abs=1e-9)


@given(TILTS, TILTS, YAWS, st.booleans())
def test_yaw_changes_with_the_components_as_it_says(roll: float, pitch: float, yaw: float, by_321: bool) -> None:
    quat = quat_of_euler(roll, pitch, yaw)
    changes = []
    for component in np.eye(4):
        little = quaternion.from_float_array(1e-6 * component)
        there, here = yaw_of(quat + little, by_321=by_321), yaw_of(quat - little, by_321=by_321)
        changes.append(math.remainder(there - here, 2 * math.pi) / 2e-6)
    assert np.allclose(yaw_by_components(quat, by_321=by_321), changes, rtol=1e-5, atol=1e-6)


def test_where_there_is_no_yaw_it_changes_with_nothing() -> None:
    nose_up, on_its_side = quaternion.quaternion(0.5, 0.0, 0.5, 0.0), quaternion.quaternion(0.5, 0.5, 0.0, 0.0)
    assert yaw_by_components(nose_up, by_321=True) == (0.0, 0.0, 0.0, 0.0)
    assert yaw_by_components(on_its_side, by_321=False) == (0.0, 0.0, 0.0, 0.0)
    assert any(yaw_by_components(nose_up, by_321=False))


@given(TILTS, TILTS, YAWS)
def test_components_change_with_a_small_rotation_as_it_says(roll: float, pitch: float, yaw: float) -> None:
    quat = quat_of_euler(roll, pitch, yaw)
    for axis, change in zip(np.eye(3), by_rotation(quat).T, strict=True):
        there, here = (quaternion.as_float_array(quat * quat_of_rotation(angle * axis)) for angle in (1e-6, -1e-6))
        assert np.allclose(change, (there - here) / 2e-6, atol=1e-9)
