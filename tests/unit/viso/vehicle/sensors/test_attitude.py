# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Attitudes agree with a slower library's, whatever the sign of the quaternion."""

import math

import numpy as np
import pytest
import quaternion
from hypothesis import given
from hypothesis import strategies as st

from ekf_stub.core.vectors import quat_of_euler
from viso.vehicle.sensors.attitude import halfway, quat_of_rpy, rotate_to_body, rotation_between

ANGLES = st.floats(-math.pi, math.pi)
ATTITUDES = st.builds(quat_of_rpy, ANGLES, st.floats(-1.5, 1.5), ANGLES)
TURNS = st.tuples(*[st.floats(-1.0, 1.0)] * 3).map(np.array)
SIGNS = st.sampled_from([1.0, -1.0])


@given(ANGLES, ANGLES, ANGLES)
def test_euler_angles_make_the_filters_attitude(roll: float, pitch: float, yaw: float) -> None:
    ours, theirs = quat_of_rpy(roll, pitch, yaw), quat_of_euler(roll, pitch, yaw)
    assert ours.components == pytest.approx(theirs, abs=1e-14)


@given(ATTITUDES, TURNS)
def test_vector_is_turned_into_the_body(attitude: quaternion.quaternion, vector: np.ndarray) -> None:
    expected = quaternion.as_rotation_matrix(attitude).T @ vector
    assert rotate_to_body(attitude, vector.tolist()) == pytest.approx(expected, abs=1e-14)


@given(ATTITUDES, TURNS, SIGNS)
def test_rotation_leads_from_one_to_the_other(attitude: quaternion.quaternion, turn: np.ndarray, sign: float) -> None:
    turned = sign * attitude * quaternion.from_rotation_vector(turn)
    assert rotation_between(attitude, turned) == pytest.approx(turn, abs=1e-14)


def test_rotation_between_equals_is_zero() -> None:
    attitude = quat_of_rpy(0.1, 0.2, 0.3)
    assert rotation_between(attitude, attitude) == pytest.approx((0, 0, 0), abs=1e-16)
    assert rotation_between(quaternion.one, -quaternion.one) == (0, 0, 0)


@given(ATTITUDES, TURNS, SIGNS)
def test_halfway_is_half_of_the_rotation(attitude: quaternion.quaternion, turn: np.ndarray, sign: float) -> None:
    between = halfway(attitude, sign * attitude * quaternion.from_rotation_vector(turn))
    assert rotation_between(attitude, between) == pytest.approx(0.5 * turn, abs=1e-14)
