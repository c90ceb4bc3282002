# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The best rotation is a rotation, and vectors are compared with those of the same time."""

import numpy as np
import quaternion
from hypothesis import given
from hypothesis import strategies as st

from tests.unit.viso.estimators.motions import motion
from viso.estimators.pairs import best_rotation, correlation_of, cross_matrices, turn_pair

VECTORS = np.random.default_rng(50).normal(size=(30, 3))


@given(vector=st.tuples(*[st.floats(-1.8, 1.8)] * 3))
def test_best_rotation_is_the_one_that_was_made(vector: tuple[float, float, float]) -> None:
    rotation = quaternion.as_rotation_matrix(quaternion.from_rotation_vector(np.array(vector)))
    np.testing.assert_allclose(best_rotation(VECTORS, VECTORS @ rotation.T), rotation, atol=1e-9)


def test_best_rotation_of_mirrored_vectors_mirrors_nothing() -> None:
    rotation = best_rotation(VECTORS, VECTORS * [1.0, 1.0, -1.0])
    assert np.linalg.det(rotation) > 0.99


def test_correlation_is_one_of_equals_and_none_without_motion() -> None:
    assert correlation_of(VECTORS, 3 * VECTORS) == 1.0
    assert correlation_of(VECTORS, -VECTORS) == -1.0
    assert correlation_of(VECTORS, 0 * VECTORS) == 0.0


def test_cross_matrices_multiply_as_the_cross_product_does() -> None:
    other = np.array([1.0, -2.0, 0.5])
    np.testing.assert_allclose(cross_matrices(VECTORS) @ other, np.cross(VECTORS, other))


def test_rotations_of_the_vehicle_are_those_of_the_delayed_stream() -> None:
    rng = np.random.default_rng(51)
    vehicle = motion(rng)
    pair = turn_pair(*vehicle.seen(rng, delay_ms=80, noise_rad=0.0), vehicle.time_us, vehicle.quat_wxyz)
    turned, known = pair.vehicle_rad(0.08)
    assert known.all()
    np.testing.assert_allclose(pair.stream_rad, turned, atol=1e-12)


def test_thinned_rotations_overlap_by_half() -> None:
    rng = np.random.default_rng(52)
    vehicle = motion(rng)
    pair = turn_pair(*vehicle.seen(rng, hz=90), vehicle.time_us, vehicle.quat_wxyz)
    sparse = pair.thinned()
    assert 0.4 < np.median(np.diff(sparse.start_s)) / pair.window_s <= 0.55
