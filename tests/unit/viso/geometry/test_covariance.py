# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What is let through as a covariance, and its other order."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from viso.geometry.covariance import sound_covariance
from viso.geometry.se3 import Array, so3_exp

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
