# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The covariance in the message's axes, order and encodings, and what the autopilot makes of it."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mav_handlers.covariance import pose_errors
from viso.companion.odometry.message import edge_covariance, encoded
from viso.companion.vio.config import CovarianceEncoding
from viso.companion.vio.frames import ENU_TO_NED, FLU_TO_FRD
from viso.geometry.pose import SE3
from viso.geometry.rotation import Array, so3_exp, so3_log

DIAGONAL = (0, 6, 11, 15, 18, 20)
LEANING = so3_exp(np.array([0.0, 0.0, 2.0])).dot(so3_exp(np.array([0.3, -0.4, 0.0])))


def some_covariance(seed: int = 3) -> Array:
    root = np.random.default_rng(seed).normal(0, 1, (6, 6))
    covariance: Array = root.dot(root.T)
    return covariance


@pytest.mark.parametrize("local_to_frd", [FLU_TO_FRD, ENU_TO_NED])
def test_errors_are_those_of_position_and_of_rotation_about_the_local_axes(local_to_frd: Array) -> None:
    """The change of the message's position and attitude with each element of the tangent, by differences."""
    pose, h = SE3(LEANING, np.array([5.0, -3.0, 2.0])), 1e-6

    def edge(tangent: Array) -> tuple[Array, Array]:
        moved = pose @ SE3.exp(tangent)
        return local_to_frd.dot(moved.t), local_to_frd.dot(moved.R).dot(FLU_TO_FRD.T)

    columns = []
    for error in h * np.eye(6):
        (x1, r1), (x0, r0) = edge(error), edge(-error)
        columns.append(np.concatenate([x1 - x0, so3_log(r1.dot(r0.T))]) / (2 * h))
    jacobian = np.array(columns).T
    covariance = some_covariance()
    expected = jacobian.dot(covariance).dot(jacobian.T)
    assert edge_covariance(covariance, LEANING, local_to_frd) == pytest.approx(expected, rel=1e-6, abs=1e-6)


def test_cross_terms_with_one_flipped_axis_change_sign() -> None:
    elements = encoded(edge_covariance(some_covariance(), np.eye(3), FLU_TO_FRD), CovarianceEncoding.VARIANCE)
    flipped = [1, -1, -1, 1, -1, -1]
    rotation_first = some_covariance()
    order = [3, 4, 5, 0, 1, 2]
    expected = [flipped[i] * flipped[j] * rotation_first[order[i], order[j]] for i in range(6) for j in range(i, 6)]
    assert elements == pytest.approx(expected)


def test_drift_of_the_heading_stands_in_the_last_element_however_the_body_leans() -> None:
    up_in_body = LEANING.T.dot([0.0, 0.0, 1.0])
    covariance = np.zeros((6, 6))
    covariance[:3, :3] = 0.04 * np.outer(up_in_body, up_in_body)
    elements = encoded(edge_covariance(covariance, LEANING, ENU_TO_NED), CovarianceEncoding.VARIANCE)
    assert [elements[index] for index in DIAGONAL] == pytest.approx([0, 0, 0, 0, 0, 0.04], abs=1e-12)


def test_north_comes_first_when_aligned_to_it() -> None:
    uncertain_north = np.diag([0.0, 0.0, 0.0, 0.0, 9.0, 0.0])
    elements = encoded(edge_covariance(uncertain_north, np.eye(3), ENU_TO_NED), CovarianceEncoding.VARIANCE)
    assert [elements[index] for index in DIAGONAL[:3]] == [9.0, 0.0, 0.0]


def test_variances_stand_at_the_diagonal_of_the_upper_triangle() -> None:
    elements = encoded(np.diag([1.0, 2.0, 3.0, 4.0, 5.0, 6.0]), CovarianceEncoding.VARIANCE)
    assert len(elements) == 21
    assert [elements[index] for index in DIAGONAL] == [1, 2, 3, 4, 5, 6]
    assert sum(elements) == 21


@pytest.mark.parametrize("encoding", CovarianceEncoding)
def test_unknown_covariance_is_nan_in_its_first_element(encoding: CovarianceEncoding) -> None:
    elements = encoded(None, encoding)
    assert math.isnan(elements[0])
    assert elements[1:] == (0.0,) * 20


def errors_of(position_sigma: float, angle_sigma: float, encoding: CovarianceEncoding) -> tuple[np.float32, np.float32]:
    """Return posErr and angErr as the autopilot computes them, in float32."""
    matrix = np.diag([position_sigma**2] * 3 + [angle_sigma**2] * 3)
    return pose_errors([float(np.float32(value)) for value in encoded(matrix, encoding)])


@pytest.mark.parametrize(("sigma_m", "pos_err"), [(0.1, 0.067), (1 / 3, 0.3333), (3.0, 6.24)])
def test_autopilot_mistakes_variances(sigma_m: float, pos_err: float) -> None:
    found = errors_of(sigma_m, sigma_m, CovarianceEncoding.VARIANCE)
    assert found[0].dtype == np.float32
    assert [float(value) for value in found] == pytest.approx([pos_err] * 2, rel=5e-3)


@given(st.floats(1e-3, 100.0), st.floats(1e-4, 3.0))
def test_autopilot_gets_the_right_sigma_from_its_own_encoding(position_sigma: float, angle_sigma: float) -> None:
    found = errors_of(position_sigma, angle_sigma, CovarianceEncoding.ARDUPILOT_ERROR)
    assert [float(value) for value in found] == pytest.approx([position_sigma, angle_sigma], rel=1e-5)


def test_sigma_for_the_autopilot_is_the_root_mean_variance() -> None:
    matrix = np.diag([1.0, 4.0, 7.0, 0.01, 0.02, 0.06])
    matrix[0, 1] = matrix[1, 0] = 0.5
    elements = encoded(matrix, CovarianceEncoding.ARDUPILOT_ERROR)
    pos_err, ang_err = pose_errors(elements)
    assert float(pos_err) == pytest.approx(2.0, rel=1e-6)
    assert float(ang_err) == pytest.approx(math.sqrt(0.03), rel=1e-6)
    assert all(value == 0 for index, value in enumerate(elements) if index not in DIAGONAL)
