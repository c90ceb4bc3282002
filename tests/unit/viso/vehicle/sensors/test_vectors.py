# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Attitudes agree with another library's, whatever the sign of the quaternion."""

import math

import numpy as np
import pytest
import quaternion
from hypothesis import given
from hypothesis import strategies as st

from ekf_stub.core.vectors import ONE, Quat, quat_of_euler
from viso.vehicle.sensors.vectors import halfway, rotation_between, to_body

ANGLES = st.floats(-math.pi, math.pi)
ATTITUDES = st.builds(quat_of_euler, ANGLES, st.floats(-1.5, 1.5), ANGLES)
TURNS = st.tuples(*[st.floats(-1.0, 1.0)] * 3).map(np.array)
SIGNS = st.sampled_from([1.0, -1.0])


def turned(attitude: Quat, turn: np.ndarray, sign: float) -> Quat:
    w, x, y, z = (sign * quaternion.quaternion(*attitude) * quaternion.from_rotation_vector(turn)).components.tolist()
    return w, x, y, z


@given(ATTITUDES, TURNS)
def test_vector_is_turned_into_the_body(attitude: Quat, vector: np.ndarray) -> None:
    expected = quaternion.as_rotation_matrix(quaternion.quaternion(*attitude)).T @ vector
    assert to_body(attitude, tuple(vector.tolist())) == pytest.approx(expected, abs=1e-14)


@given(ATTITUDES, TURNS, SIGNS)
def test_rotation_leads_from_one_to_the_other(attitude: Quat, turn: np.ndarray, sign: float) -> None:
    assert rotation_between(attitude, turned(attitude, turn, sign)) == pytest.approx(turn, abs=1e-14)


def test_rotation_between_equals_is_zero() -> None:
    attitude = quat_of_euler(0.1, 0.2, 0.3)
    assert rotation_between(attitude, attitude) == pytest.approx((0, 0, 0), abs=1e-16)
    assert rotation_between(ONE, (-1.0, 0.0, 0.0, 0.0)) == (0, 0, 0)


@given(ATTITUDES, TURNS, SIGNS)
def test_halfway_is_half_of_the_rotation(attitude: Quat, turn: np.ndarray, sign: float) -> None:
    between = halfway(attitude, turned(attitude, turn, sign))
    assert rotation_between(attitude, between) == pytest.approx(0.5 * turn, abs=1e-14)
