# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Rotations, rigid motions and covariances, against the matrix exponential's power series and a quaternion library."""

import math

import numpy as np
import pytest
import quaternion
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from viso.geometry.pose import SE3, read_only, sound_covariance
from viso.geometry.rotation import (
    SMALL_ANGLE_RAD,
    Array,
    quat_wxyz_from_rotation,
    right_jacobian,
    right_jacobian_inverse,
    rotation_from_quat_wxyz,
    skew,
    so3_exp,
    so3_log,
    yaw_of,
)

DIAGONAL = np.array([1.0, -2.0, 3.0]) / math.sqrt(14)
COORDINATES = st.floats(-1, 1)
VECTORS = st.tuples(COORDINATES, COORDINATES, COORDINATES).map(np.array)
DIRECTIONS = VECTORS.filter(lambda vector: np.linalg.norm(vector) > 0.1).map(
    lambda vector: vector / np.linalg.norm(vector)
)
SMALL = st.floats(-12, -5).map(lambda exponent: 10.0**exponent)
NEARLY_PI = st.floats(-8, -2).map(lambda exponent: math.pi - 10.0**exponent)
ANGLES = st.one_of(st.just(0.0), SMALL, st.floats(0, 3.1), NEARLY_PI)
ROTATION_VECTORS = st.tuples(DIRECTIONS, ANGLES).map(lambda pair: pair[0] * pair[1])
TANGENTS = st.tuples(ROTATION_VECTORS, VECTORS).map(lambda pair: np.concatenate([pair[0], 10 * pair[1]]))


def power_series(matrix: Array) -> Array:
    """Return the matrix exponential, the slow and obvious way: halved ten times, summed, squared ten times."""
    part, term, total = matrix / 1024, np.eye(len(matrix)), np.eye(len(matrix))
    for order in range(1, 15):
        term = term @ part / order
        total = total + term
    return np.linalg.matrix_power(total, 1024)


def generator(tangent: Array) -> Array:
    matrix = np.zeros((4, 4))
    matrix[:3, :3], matrix[:3, 3] = skew(tangent[:3]), tangent[3:]
    return matrix


@given(VECTORS, VECTORS)
def test_skew_multiplies_as_the_cross_product(left: Array, right: Array) -> None:
    assert np.allclose(skew(left) @ right, np.cross(left, right), atol=1e-15)


@given(ROTATION_VECTORS)
def test_exp_is_the_power_series(vector: Array) -> None:
    assert np.allclose(so3_exp(vector), power_series(skew(vector)), atol=1e-12)


@given(ROTATION_VECTORS)
def test_exp_gives_a_rotation(vector: Array) -> None:
    rotation = so3_exp(vector)
    assert np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-14)
    assert np.linalg.det(rotation) == pytest.approx(1)


@given(ROTATION_VECTORS)
def test_log_undoes_exp(vector: Array) -> None:
    assert np.allclose(so3_log(so3_exp(vector)), vector, atol=1e-9)


@given(DIRECTIONS, SMALL)
def test_log_of_a_small_angle_keeps_its_digits(direction: Array, angle: float) -> None:
    assert np.allclose(so3_log(so3_exp(direction * angle)) / angle, direction, atol=1e-10)


@pytest.mark.parametrize("factor", [1 - 1e-6, 1 + 1e-6])
def test_series_and_closed_form_meet_at_the_small_angle(factor: float) -> None:
    vector = DIAGONAL * SMALL_ANGLE_RAD * factor
    rotation = so3_exp(vector)
    assert np.allclose(rotation, np.eye(3) + skew(vector) + 0.5 * skew(vector) @ skew(vector), atol=1e-20, rtol=1e-12)
    assert np.allclose(so3_log(rotation), vector, atol=0, rtol=1e-9)


def test_no_rotation_has_the_log_zero() -> None:
    assert so3_log(np.eye(3)).tolist() == [0, 0, 0]


@pytest.mark.parametrize("direction", [*np.eye(3), DIAGONAL, -DIAGONAL])
def test_half_a_turn_has_a_log_of_length_pi_along_its_axis(direction: Array) -> None:
    vector = so3_log(2 * np.outer(direction, direction) - np.eye(3))
    assert np.linalg.norm(vector) == pytest.approx(math.pi, abs=1e-12)
    assert abs(vector.dot(direction)) == pytest.approx(math.pi, abs=1e-12)


@given(DIRECTIONS, st.floats(-8, -2).map(lambda exponent: 10.0**exponent))
def test_log_beyond_half_a_turn_goes_the_shorter_way(direction: Array, beyond: float) -> None:
    vector = so3_log(so3_exp(direction * (math.pi + beyond)))
    assert np.allclose(vector, -direction * (math.pi - beyond), atol=1e-8)


@given(ROTATION_VECTORS, DIRECTIONS)
def test_right_jacobian_is_the_derivative_of_exp(vector: Array, direction: Array) -> None:
    step = 1e-5
    forth = so3_log(so3_exp(vector).T @ so3_exp(vector + step * direction))
    back = so3_log(so3_exp(vector).T @ so3_exp(vector - step * direction))
    assert np.allclose(right_jacobian(vector) @ direction, (forth - back) / (2 * step), atol=1e-9)


@given(ROTATION_VECTORS)
def test_inverse_of_the_right_jacobian_is_its_inverse(vector: Array) -> None:
    assert np.allclose(right_jacobian_inverse(vector) @ right_jacobian(vector), np.eye(3), atol=1e-9)


@pytest.mark.parametrize("angle", [1e-4, 1e-3])
def test_jacobians_do_not_jump_where_their_series_end(angle: float) -> None:
    below, above = DIAGONAL * angle * (1 - 1e-9), DIAGONAL * angle * (1 + 1e-9)
    assert np.allclose(right_jacobian(below), right_jacobian(above), atol=1e-11)
    assert np.allclose(right_jacobian_inverse(below), right_jacobian_inverse(above), atol=1e-11)


@given(ROTATION_VECTORS)
def test_quaternion_is_that_of_the_rotation_vector(vector: Array) -> None:
    quat_wxyz = quaternion.as_float_array(quaternion.from_rotation_vector(vector))
    assert np.allclose(rotation_from_quat_wxyz(quat_wxyz), so3_exp(vector), atol=1e-12)
    assert np.allclose(quat_wxyz_from_rotation(so3_exp(vector)), quat_wxyz, atol=1e-9)


@given(DIRECTIONS, st.floats(0, 2 * math.pi))
def test_quaternion_of_a_rotation_has_length_one_and_no_negative_w(direction: Array, angle: float) -> None:
    quat_wxyz = quat_wxyz_from_rotation(so3_exp(direction * angle))
    assert quat_wxyz[0] >= 0
    assert np.linalg.norm(quat_wxyz) == pytest.approx(1, abs=1e-12)


@pytest.mark.parametrize("axis", range(3))
def test_quaternion_of_half_a_turn_about_an_axis_is_that_axis(axis: int) -> None:
    half_turn = 2 * np.outer(np.eye(3)[axis], np.eye(3)[axis]) - np.eye(3)
    assert np.abs(quat_wxyz_from_rotation(half_turn)).tolist() == np.eye(4)[axis + 1].tolist()


def test_length_of_a_quaternion_does_not_count() -> None:
    assert np.allclose(rotation_from_quat_wxyz([0.02, 0, 0, 0.02]), [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-15)


@pytest.mark.parametrize("quat_wxyz", [[0, 0, 0, 0], [math.nan, 0, 0, 1], [math.inf, 0, 0, 1], [0, 0, 1]])
def test_quaternion_without_direction_is_refused(quat_wxyz: list[float]) -> None:
    with pytest.raises(ValueError, match=r"^quat_wxyz: "):
        rotation_from_quat_wxyz(quat_wxyz)


@given(st.floats(-3.1, 3.1), st.floats(-1.5, 1.5), st.floats(-3.1, 3.1))
def test_yaw_is_the_first_of_the_three_turns(yaw: float, pitch: float, roll: float) -> None:
    turns = [so3_exp(axis * angle) for axis, angle in zip(np.eye(3)[::-1], (yaw, pitch, roll), strict=True)]
    assert yaw_of(turns[0] @ turns[1] @ turns[2]) == pytest.approx(yaw, abs=1e-9)


@given(TANGENTS)
def test_exp_of_a_tangent_is_the_power_series(tangent: Array) -> None:
    assert np.allclose(SE3.exp(tangent).matrix(), power_series(generator(tangent)), atol=1e-10)


@given(TANGENTS)
def test_log_of_a_motion_undoes_exp(tangent: Array) -> None:
    assert np.allclose(SE3.exp(tangent).log(), tangent, atol=1e-7)


@pytest.mark.slow
@given(TANGENTS, TANGENTS)
def test_product_of_motions_is_that_of_their_matrices(left: Array, right: Array) -> None:
    product = SE3.exp(left) @ SE3.exp(right)
    assert np.allclose(product.matrix(), SE3.exp(left).matrix() @ SE3.exp(right).matrix(), atol=1e-12)


@given(TANGENTS)
def test_motion_and_its_inverse_cancel(tangent: Array) -> None:
    motion = SE3.exp(tangent)
    assert np.allclose((motion @ motion.inverse()).matrix(), np.eye(4), atol=1e-12)


@given(TANGENTS, TANGENTS)
def test_adjoint_carries_a_tangent_to_the_other_side(tangent: Array, small: Array) -> None:
    motion, moved = SE3.exp(tangent), 1e-2 * small
    left = motion @ SE3.exp(moved) @ motion.inverse()
    assert np.allclose(left.matrix(), SE3.exp(motion.adjoint() @ moved).matrix(), atol=1e-10)


@given(TANGENTS, VECTORS)
def test_motion_maps_a_point_as_its_matrix_does(tangent: Array, point: Array) -> None:
    motion = SE3.exp(tangent)
    assert np.allclose(motion.map(point), (motion.matrix() @ [*point, 1])[:3], atol=1e-12)


def test_many_points_are_mapped_at_once() -> None:
    motion, points = SE3.exp(np.array([0.1, 0.2, 0.3, 1, 2, 3])), np.arange(12.0).reshape(2, 2, 3)
    assert motion.map(points).shape == (2, 2, 3)
    assert np.allclose(motion.map(points)[1, 0], motion.map(points[1, 0]))


@given(TANGENTS)
def test_matrix_and_quaternion_give_the_motion_back(tangent: Array) -> None:
    motion = SE3.exp(tangent)
    assert np.array_equal(SE3.from_matrix(motion.matrix()).matrix(), motion.matrix())
    assert np.allclose(SE3.from_quat_wxyz(motion.quat_wxyz(), motion.t).matrix(), motion.matrix(), atol=1e-9)


def test_identity_leaves_points_where_they_are() -> None:
    assert SE3.identity().matrix().tolist() == np.eye(4).tolist()


@pytest.mark.parametrize("field", ["R", "t"])
def test_motion_cannot_be_written_to(field: str) -> None:
    with pytest.raises(ValueError, match="read-only"):
        getattr(SE3.identity(), field)[0] = 1


def test_motion_is_not_changed_through_what_it_was_made_from() -> None:
    origin = np.zeros(3)
    motion = SE3(np.eye(3), origin)
    origin[0] = 1
    assert motion.t.tolist() == [0, 0, 0]


@pytest.mark.parametrize(
    ("rotation", "t", "field"),
    [
        (np.eye(4), np.zeros(3), "R"),
        (np.full((3, 3), math.nan), np.zeros(3), "R"),
        (np.diag([1, 1, -1.0]), np.zeros(3), "R"),
        (np.diag([1, 1, 1 + 1e-6]), np.zeros(3), "R"),
        (np.eye(3), np.zeros(2), "t"),
        (np.eye(3), np.array([0, math.inf, 0]), "t"),
    ],
)
def test_bad_motion_is_refused_by_the_name_of_its_field(rotation: Array, t: Array, field: str) -> None:
    with pytest.raises(ValueError, match=f"^{field}: "):
        SE3(rotation, t)


def test_rotation_within_1e_6_of_orthonormal_is_taken() -> None:
    assert SE3(np.diag([1, 1, 1 + 4e-7]), np.zeros(3)).R[2, 2] == 1 + 4e-7


@pytest.mark.parametrize("matrix", [np.eye(3), np.diag([1, 1, 1, 2.0]), np.full((4, 4), math.nan)])
def test_matrix_that_is_no_motion_is_refused(matrix: Array) -> None:
    with pytest.raises(ValueError, match=r"^matrix: "):
        SE3.from_matrix(matrix)


def test_read_only_returns_contiguous_doubles() -> None:
    array = read_only(np.asfortranarray(np.arange(6, dtype=np.float32).reshape(2, 3)), (2, 3), "field")
    assert array.dtype == np.float64
    assert array.flags.c_contiguous
    assert not array.flags.writeable


@pytest.mark.parametrize("value", [[1, 2], [1, 2, math.nan], [[1, 2, 3]]])
def test_read_only_refuses_by_the_name_of_the_field(value: object) -> None:
    with pytest.raises(ValueError, match=r"^field: "):
        read_only(value, (3,), "field")


# Covariances

ROOTS = arrays(np.float64, (6, 6), elements=st.floats(-100, 100))
TURN = so3_exp(np.array([0.3, -0.5, 0.8]))


def with_eigenvalues(*values: float) -> Array:
    product: Array = (TURN * np.array(values)) @ TURN.T
    return 0.5 * (product + product.T)


def sound(cov: Array) -> Array:
    result = sound_covariance(cov)
    assert result is not None
    return result


@given(ROOTS)
def test_product_of_a_matrix_and_its_transpose_is_sound(root: Array) -> None:
    cov = root @ root.T
    result = sound(cov)
    assert np.array_equal(result, result.T)
    assert np.allclose(result, cov, atol=1e-10 * np.abs(cov).max())


def test_sound_covariance_is_not_changed() -> None:
    cov = with_eigenvalues(1, 2, 3)
    assert np.array_equal(sound(cov), cov)


def test_certainty_is_sound() -> None:
    assert np.array_equal(sound(np.zeros((6, 6))), np.zeros((6, 6)))


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_what_is_not_finite_is_refused(bad: float) -> None:
    cov = np.eye(6)
    cov[3, 3] = bad
    assert sound_covariance(cov) is None


def test_slight_asymmetry_is_averaged_out() -> None:
    cov = 100 * np.eye(3)
    cov[0, 1] = 0.9e-7
    assert sound(cov)[0, 1] == sound(cov)[1, 0] == 0.45e-7


def test_asymmetry_above_1e_9_of_the_largest_element_is_refused() -> None:
    cov = 100 * np.eye(3)
    cov[0, 1] = 1.1e-7
    assert sound_covariance(cov) is None


def test_eigenvalue_a_rounding_below_zero_is_raised_to_zero() -> None:
    result = sound(with_eigenvalues(-0.9e-9, 1, 1000))
    assert np.allclose(np.linalg.eigvalsh(result), [0, 1, 1000], rtol=1e-9, atol=2e-13)
    assert np.array_equal(result, result.T)


def test_eigenvalue_further_below_zero_is_refused() -> None:
    assert sound_covariance(with_eigenvalues(-1.1e-9, 1, 1000)) is None


def test_negative_definite_matrix_is_refused() -> None:
    assert sound_covariance(-np.eye(6)) is None
