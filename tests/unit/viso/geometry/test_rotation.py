# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Rotations keep their laws in each of their forms, and agree with scipy's and with numpy-quaternion's."""

import math

import numpy as np
import pytest
import quaternion
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from scipy.spatial.transform import Rotation

from ekf_stub.core import vectors
from viso.geometry.rotation import (
    IDENTITY_QUAT,
    Array,
    best_rotation,
    euler_from_quats,
    euler_from_rotations,
    interpolated_quats,
    inverse,
    normalized,
    product,
    quats_from_euler,
    quats_from_rotation_vectors,
    rotate,
    rotation_vectors_from_quats,
    rotations_from_euler,
    rotations_from_quats,
)

SHAPES = st.sampled_from([(), (0,), (1,), (3,), (2, 2)])
ANGLES = st.floats(-math.pi, math.pi)
TURNS = SHAPES.flatmap(lambda shape: arrays.arrays(np.float64, (*shape, 3), elements=st.floats(-1.8, 1.8)))
"""Rotation vectors of less than half a turn."""
VECTORS = arrays.arrays(np.float64, 3, elements=st.floats(-1e3, 1e3))
ONE_TURN = arrays.arrays(np.float64, 3, elements=st.floats(-1.8, 1.8))
POINTS = np.random.default_rng(50).normal(size=(30, 3))


def approx(expected: Array, atol: float = 1e-9) -> object:
    return pytest.approx(expected, abs=atol)


def in_scipy(quat: Array) -> Rotation:
    return Rotation.from_quat(np.roll(quat, -1))


@given(TURNS)
def test_rotation_vectors_come_back_in_their_shape(turns: Array) -> None:
    quats = quats_from_rotation_vectors(turns)
    assert quats.shape == (*turns.shape[:-1], 4)
    assert rotation_vectors_from_quats(quats) == approx(turns)
    assert rotation_vectors_from_quats(-quats) == approx(turns)


@given(ANGLES, st.floats(-1.5, 1.5), ANGLES)
def test_euler_angles_come_back(roll: float, pitch: float, yaw: float) -> None:
    quat = quats_from_euler((roll, pitch, yaw))
    for angles in (euler_from_quats(quat), euler_from_rotations(rotations_from_quats(quat))):
        assert np.sin(angles) == approx(np.sin((roll, pitch, yaw)))
        assert np.cos(angles) == approx(np.cos((roll, pitch, yaw)))


@given(ANGLES, ANGLES, ANGLES)
def test_euler_angles_are_those_of_scipy_and_of_the_filter(roll: float, pitch: float, yaw: float) -> None:
    expected = Rotation.from_euler("ZYX", (yaw, pitch, roll)).as_matrix()
    assert rotations_from_euler((roll, pitch, yaw)) == approx(expected)
    assert quats_from_euler((roll, pitch, yaw)) == approx(np.array(vectors.quat_of_euler(roll, pitch, yaw)))


@given(ONE_TURN, ONE_TURN, ONE_TURN, VECTORS)
def test_a_product_rotates_as_its_second_factor_then_its_first(a: Array, b: Array, c: Array, vector: Array) -> None:
    p, q, r = map(quats_from_rotation_vectors, (a, b, c))
    assert rotate(product(p, q), vector) == approx(rotate(p, rotate(q, vector)))
    assert product(product(p, q), r) == approx(product(p, product(q, r)))
    assert rotations_from_quats(product(p, q)) == approx(rotations_from_quats(p) @ rotations_from_quats(q))
    assert product(p, q) == approx(quaternion.as_float_array(quaternion.quaternion(*p) * quaternion.quaternion(*q)))


@given(ONE_TURN, VECTORS)
def test_an_inverse_undoes_a_rotation(turn: Array, vector: Array) -> None:
    quat = quats_from_rotation_vectors(turn)
    assert product(quat, inverse(quat)) == approx(IDENTITY_QUAT)
    assert rotate(inverse(quat), rotate(quat, vector)) == approx(vector)
    assert rotations_from_quats(inverse(quat)) == approx(rotations_from_quats(quat).T)


@given(ONE_TURN, VECTORS)
def test_a_vector_is_rotated_as_by_the_matrix_and_as_in_scipy(turn: Array, vector: Array) -> None:
    quat = quats_from_rotation_vectors(turn)
    assert rotate(quat, vector) == approx(rotations_from_quats(quat) @ vector)
    assert rotate(quat, vector) == approx(Rotation.from_rotvec(turn).apply(vector))
    assert np.array(vectors.rotated(tuple(quat.tolist()), tuple(vector.tolist()))) == approx(rotate(quat, vector))


@given(ONE_TURN, st.floats(0.1, 10.0))
def test_a_matrix_does_not_depend_on_the_length_of_the_quaternion(turn: Array, length: float) -> None:
    quat = quats_from_rotation_vectors(turn)
    assert rotations_from_quats(length * quat) == approx(in_scipy(quat).as_matrix())
    assert normalized(length * quat) == approx(quat)


def test_next_to_no_rotation_is_told() -> None:
    tiny = np.array([[0.0, 0.0, 0.0], [1e-200, 0.0, 0.0], [0.0, -1e-9, 0.0]])
    assert rotation_vectors_from_quats(quats_from_rotation_vectors(tiny)) == approx(tiny, atol=1e-24)


def test_leading_axes_broadcast() -> None:
    quats = quats_from_rotation_vectors(np.random.default_rng(51).uniform(-1, 1, (5, 1, 3)))
    assert rotate(quats, POINTS).shape == (5, 30, 3)
    assert product(quats, quats.swapaxes(0, 1)).shape == (5, 5, 4)


@given(ONE_TURN, ONE_TURN, st.floats(0.0, 1.0))
def test_what_is_between_two_attitudes_is_on_the_shorter_arc(start: Array, step: Array, share: float) -> None:
    first = quats_from_rotation_vectors(start)
    second = product(first, quats_from_rotation_vectors(0.5 * step))
    between = interpolated_quats(first, -second, share)
    turned = rotation_vectors_from_quats(product(inverse(first), between))
    assert np.cross(turned, step) == approx(np.zeros(3))
    # The arc is cut by its chord: off by little, and not at all at the ends and in the middle.
    assert turned == approx(share * 0.5 * step, atol=0.05)
    middle = interpolated_quats(first, second, 0.5)
    assert rotation_vectors_from_quats(product(inverse(first), middle)) == approx(0.25 * step)


def test_what_is_not_a_number_stays_so() -> None:
    unknown = np.full((1, 4), math.nan)
    assert np.isnan(euler_from_quats(unknown)).all()
    assert np.isnan(rotations_from_quats(unknown)).all()
    assert np.isnan(product(unknown, IDENTITY_QUAT)).all()


@given(ONE_TURN)
def test_best_rotation_is_the_one_that_was_made(turn: Array) -> None:
    rotation = rotations_from_quats(quats_from_rotation_vectors(turn))
    rotated = POINTS @ rotation.T
    assert best_rotation(POINTS, rotated) == approx(rotation)
    assert best_rotation(POINTS, rotated) == approx(Rotation.align_vectors(rotated, POINTS)[0].as_matrix(), atol=1e-7)


def test_best_rotation_of_mirrored_vectors_mirrors_nothing() -> None:
    assert np.linalg.det(best_rotation(POINTS, POINTS * [1.0, 1.0, -1.0])) > 0.99
