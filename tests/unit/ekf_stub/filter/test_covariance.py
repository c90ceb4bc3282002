# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What becomes of a covariance: it stays one."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ekf_stub.filter import covariance
from ekf_stub.filter.inertial import Array
from ekf_stub.filter.states import ACCEL, ATT, POS, STATES, VEL, StateLimits

SEEDS = st.integers(0, 2**32 - 1)


def drawn(seed: int, *, rank: int = STATES) -> Array:
    """Return a covariance whose errors have much to do with each other."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(STATES, rank)) * 10.0 ** rng.uniform(-3, 0, size=(STATES, 1))
    cov: Array = root @ root.T
    return 0.5 * (cov + cov.T)


def least_eigenvalue(cov: Array) -> float:
    """Return that of the correlations."""
    sigma = np.sqrt(np.where(cov.diagonal() > 0, cov.diagonal(), 1.0))
    return float(np.linalg.eigvalsh(cov / np.outer(sigma, sigma))[0])


def joseph(cov: Array, index: int, variance: float, left_alone: list[int]) -> Array:
    """Return the covariance after any gain at all, in the form that holds for any."""
    gain = cov[:, index] / (cov[index, index] + variance)
    gain[left_alone] = 0.0
    rest = np.eye(STATES)
    rest[:, index] -= gain
    after: Array = rest @ cov @ rest.T + variance * np.outer(gain, gain)
    return after


def fused(cov: Array, index: int, variance: float, left_alone: list[int]) -> Array:
    after = covariance.fused(cov, cov[index] / np.sqrt(cov[index, index] + variance), left_alone, is_sharp=False)
    assert after is not None
    return after


def firmwares(cov: Array, index: int, variance: float, left_alone: list[int]) -> Array:
    """Return what the firmware makes of it."""
    gain = cov[:, index] / (cov[index, index] + variance)
    gain[left_alone] = 0.0
    after: Array = cov - np.outer(gain, cov[index])
    return 0.5 * (after + after.T)


@given(SEEDS, st.integers(0, STATES - 1), st.floats(1e-3, 1e3))
def test_best_gain_gives_what_holds_for_any_gain(seed: int, index: int, variance: float) -> None:
    cov = drawn(seed)
    after = fused(cov, index, variance, [])
    assert np.array_equal(after, after.T)
    assert np.allclose(after, joseph(cov, index, variance, []), rtol=1e-9, atol=1e-12)


@given(SEEDS, st.integers(VEL.start, POS.stop - 1), st.floats(1e-3, 1e3))
def test_other_gain_gives_the_firmwares_covariance_where_that_is_one(seed: int, index: int, variance: float) -> None:
    cov, left_alone = drawn(seed), [10, 13, 14, 15]
    after, expected = fused(cov, index, variance, left_alone), firmwares(cov, index, variance, left_alone)
    if least_eigenvalue(expected) > -1e-14:
        assert np.allclose(after, expected, rtol=1e-12, atol=1e-15)
    assert np.array_equal(after, after.T)
    assert least_eigenvalue(after) > -1e-11


def test_other_gain_gives_a_covariance_where_the_firmware_has_none() -> None:
    cov, left_alone = drawn(1, rank=3) + 1e-9 * np.eye(STATES), [10, 13, 14, 15]
    assert least_eigenvalue(firmwares(cov, VEL.start, 1e-6, left_alone)) < -0.01
    after = fused(cov, VEL.start, 1e-6, left_alone)
    assert least_eigenvalue(after) > -1e-12
    assert np.allclose(after, joseph(cov, VEL.start, 1e-6, left_alone), rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("left_alone", [[], [10]])
def test_variance_that_would_become_negative_gives_none(left_alone: list[int]) -> None:
    cov = np.eye(STATES)
    gain = np.zeros(STATES)
    gain[VEL.start] = 1.1
    assert covariance.fused(cov, gain, left_alone, is_sharp=False) is None


def test_what_a_sharp_measurement_leaves_is_a_covariance_in_spite_of_lost_digits() -> None:
    cov = np.zeros((STATES, STATES))
    cov[POS.start, POS.start], cov[3, 3] = 588856.0, 0.0025
    row = np.zeros(STATES)
    row[POS.start], row[3] = 8.0, 2.0
    spread = cov @ row
    gain = spread / np.sqrt(row @ spread + 1e-8)
    blunt, sharp = (covariance.fused(cov, gain, [], is_sharp=is_sharp) for is_sharp in (False, True))
    assert blunt is not None
    assert sharp is not None
    assert least_eigenvalue(blunt) < -1e-9
    assert least_eigenvalue(sharp) >= 0
    assert np.allclose(sharp.diagonal(), blunt.diagonal(), rtol=1e-3)


def test_positive_is_what_has_no_mix_of_negative_variance() -> None:
    cov = np.eye(STATES)
    assert covariance.is_positive(cov)
    cov[0, 1] = cov[1, 0] = 1.0
    assert covariance.is_positive(cov)
    cov[0, 1] = cov[1, 0] = 1.001
    assert not covariance.is_positive(cov)
    assert covariance.is_positive(np.zeros((STATES, STATES)))


@given(SEEDS)
def test_lowered_variances_keep_correlations(seed: int) -> None:
    cov, limits = 1e3 * drawn(seed), StateLimits()
    before = cov.copy()
    covariance.lower(cov, limits)
    variances = cov.diagonal()
    assert (variances <= limits.highest_var).all()
    assert np.array_equal(cov, cov.T)
    sigma, sigma_before = np.sqrt(variances), np.sqrt(before.diagonal())
    assert np.allclose(cov / np.outer(sigma, sigma), before / np.outer(sigma_before, sigma_before), atol=1e-9)


def test_lifted_variances_change_no_covariances() -> None:
    cov, limits = 1e-12 * drawn(3), StateLimits()
    cov[ACCEL.start, ACCEL.start] = 1e-4
    before = cov.copy()
    covariance.lift(cov, limits)
    assert (cov.diagonal()[VEL.start : POS.stop] == 1e-4).all()
    assert cov.diagonal()[ACCEL] == pytest.approx([1e-4, 1e-6, 1e-6])
    assert np.array_equal(cov.diagonal()[ATT], before.diagonal()[ATT])
    off = ~np.eye(STATES, dtype=bool)
    assert np.array_equal(cov[off], before[off])
