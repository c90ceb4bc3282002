# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The fit finds what made the data, and its uncertainty is that of repeated trials, also for coloured noise."""

import math

import numpy as np

from viso.estimators.least_squares import BLOCKS, blocks_of, fit, inliers, mean_and_sigma


def test_step_is_the_parameters_that_made_the_residuals() -> None:
    rng = np.random.default_rng(2)
    design = rng.normal(size=(100, 2, 3))
    step, covariance = fit(design, design @ np.array([1.0, -2.0, 0.5]), blocks_of(np.arange(100.0), 1.0))
    np.testing.assert_allclose(step, [1.0, -2.0, 0.5])
    np.testing.assert_allclose(covariance, 0.0, atol=1e-20)


def test_uncertainty_of_a_mean_holds_for_noise_that_stays_a_while() -> None:
    rng = np.random.default_rng(3)
    blocks = blocks_of(np.arange(1000.0), 1.0)
    trials = [mean_and_sigma(np.repeat(rng.normal(size=100), 10), blocks) for _ in range(200)]
    errors, sigmas = np.array(trials).T
    assert 0.8 < errors.std() / sigmas.mean() < 1.25
    assert math.isclose(sigmas.mean(), 0.1, rel_tol=0.1)  # of 100 independent ones


def test_what_the_samples_do_not_tell_is_of_infinite_uncertainty() -> None:
    rng = np.random.default_rng(4)
    design = np.repeat(rng.normal(size=(100, 2, 1)), 2, axis=2)  # two parameters of one effect
    _, covariance = fit(design, rng.normal(size=(100, 2)), blocks_of(np.arange(100.0), 1.0))
    assert np.isinf(covariance).all()
    assert np.isinf(fit(np.zeros((100, 1, 1)), np.ones((100, 1)), np.arange(100) // 10)[1]).all()


def test_units_of_parameters_have_no_say_in_what_can_be_told() -> None:
    design = np.random.default_rng(5).normal(size=(100, 2, 2)) * [1e6, 1e-6]
    step, _ = fit(design, design @ np.array([1e-6, 1e6]), blocks_of(np.arange(100.0), 1.0))
    np.testing.assert_allclose(step, [1e-6, 1e6])


def test_too_short_a_time_is_of_infinite_uncertainty() -> None:
    assert mean_and_sigma(np.ones(50), blocks_of(np.linspace(0, 5.9, 50), 1.0))[1] == math.inf


def test_blocks_are_of_equal_length_and_not_too_many() -> None:
    assert np.bincount(blocks_of(np.arange(100.0), 1.0)).tolist() == [5] * BLOCKS
    assert blocks_of(np.array([0.0, 0.9, 1.1, 2.0]), 1.0).tolist() == [0, 0, 1, 1]
    assert blocks_of(np.zeros(3), 1.0).tolist() == [0, 0, 0]
    assert blocks_of(np.zeros(0), 1.0).tolist() == []


def test_only_jumps_are_outliers() -> None:
    lengths = np.abs(np.random.default_rng(6).normal(size=1000))
    lengths[[10, 500]] = 50.0
    assert np.flatnonzero(~inliers(lengths)).tolist() == [10, 500]
    assert inliers(np.zeros(5)).all()
    assert inliers(np.zeros(0)).tolist() == []
