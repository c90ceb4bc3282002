# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The filter's state: propagation against numerical derivatives and drawn noise, clones, updates, relative poses."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from viso.companion.msckf.window_filter import (
    ACCEL,
    ATT,
    GYRO,
    MOTION,
    POS,
    VEL,
    WindowFilter,
    default_cov,
    invariant_cov,
    sigma_of,
)
from viso.companion.vio.config import ImuNoise
from viso.companion.vio.imu import ImuSteps
from viso.companion.vio.types import ImuBias
from viso.geometry.pose import SE3
from viso.geometry.rotation import Array, right_jacobian, right_jacobian_inverse, skew, so3_exp, so3_log

NOISE = ImuNoise()
POSE = SE3(so3_exp(np.array([0.3, -0.4, 1.2])), np.array([30.0, -20.0, 40.0]))
VELOCITY = np.array([6.0, -3.0, 1.0])
BIAS = ImuBias(np.array([0.1, -0.05, 0.07]), np.array([0.01, -0.02, 0.005]))


def spread(size: int, scale: float = 1e-2, seed: int = 1) -> Array:
    root = np.random.default_rng(seed).normal(0, scale, (size, size))
    return root @ root.T


def make(cov: Array | None = None) -> WindowFilter:
    return WindowFilter(NOISE, POSE.R, POSE.t, VELOCITY, BIAS, spread(MOTION) if cov is None else cov)


def steps(count: int = 40, seed: int = 2) -> ImuSteps:
    rng = np.random.default_rng(seed)
    gyro, accel = rng.normal(0, 0.5, (count, 3)), rng.normal((1.0, -0.5, 9.8), 1.0, (count, 3))
    return ImuSteps(np.full(count, 0.005), gyro, accel)


def off(state: WindowFilter, error: Array) -> WindowFilter:
    """Return a filter whose state is off by an error [15]: all of the motion is turned and shifted in the world."""
    turn, left = so3_exp(error[ATT]), right_jacobian(-error[ATT])
    return WindowFilter(
        NOISE,
        turn @ state.R,
        turn @ state.p + left @ error[POS],
        turn @ state.v + left @ error[VEL],
        ImuBias(state.accel_bias + error[ACCEL], state.gyro_bias + error[GYRO]),
        state.cov,
    )


def error_between(other: WindowFilter, state: WindowFilter) -> Array:
    """Return the error [15] by which the other one is off."""
    turn = other.R @ state.R.T
    angle = so3_log(turn)
    left = right_jacobian_inverse(-angle)
    return np.concatenate(
        [
            angle,
            left @ (other.p - turn @ state.p),
            left @ (other.v - turn @ state.v),
            other.gyro_bias - state.gyro_bias,
            other.accel_bias - state.accel_bias,
        ]
    )


class TestPropagation:
    """Moving on with inertial data."""

    def test_no_data_change_nothing(self) -> None:
        state = make()
        state.propagate(ImuSteps(np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3))))
        assert (state.p == POSE.t).all()
        assert (state.cov == spread(MOTION)).all()

    def test_body_at_rest_stays(self) -> None:
        state = WindowFilter(NOISE, POSE.R, POSE.t, np.zeros(3), BIAS, spread(MOTION))
        felt = POSE.R.T @ np.array([0, 0, 9.80665]) + BIAS.accel
        state.propagate(ImuSteps(np.full(200, 0.005), np.tile(BIAS.gyro, (200, 1)), np.tile(felt, (200, 1))))
        assert np.allclose(state.p, POSE.t, atol=1e-9)
        assert np.allclose(state.v, 0, atol=1e-9)
        assert np.allclose(state.R, POSE.R, atol=1e-12)

    def test_body_in_free_fall_falls(self) -> None:
        state = make()
        state.propagate(ImuSteps(np.full(100, 0.01), np.tile(BIAS.gyro, (100, 1)), np.tile(BIAS.accel, (100, 1))))
        assert np.allclose(state.v, VELOCITY - [0, 0, 9.80665])
        assert np.allclose(state.p, POSE.t + VELOCITY - [0, 0, 9.80665 / 2])

    def test_two_halves_are_as_good_as_the_whole(self) -> None:
        whole, halves, data = make(), make(), steps(40)
        whole.propagate(data)
        for half in (slice(0, 20), slice(20, 40)):
            halves.propagate(ImuSteps(data.dt_s[half], data.gyro[half], data.accel[half]))
        assert np.allclose(error_between(whole, halves), 0, atol=1e-12)
        sigma = np.sqrt(whole.cov.diagonal())
        # The walk of the bias acts on the motion only from one call to the next.
        assert np.allclose(whole.cov / np.outer(sigma, sigma), halves.cov / np.outer(sigma, sigma), atol=1e-3)

    def test_transition_is_the_derivative(self) -> None:
        data, middle = steps(), make()
        middle.propagate(data)
        transition, step = np.zeros((MOTION, MOTION)), 1e-5
        for column in range(MOTION):
            both = []
            for sign in (1, -1):
                state = off(make(), sign * step * np.eye(MOTION)[column])
                state.propagate(data)
                both.append(error_between(state, middle))
            transition[:, column] = (both[0] - both[1]) / (2 * step)
        certain = make(np.zeros((MOTION, MOTION)))
        certain.propagate(data)
        expected = transition @ spread(MOTION) @ transition.T
        assert np.allclose(middle.cov - certain.cov, expected, atol=1e-6 * np.abs(expected).max())

    @pytest.mark.slow
    def test_covariance_is_that_of_drawn_noise(self) -> None:
        data, true = steps(20), make(np.zeros((MOTION, MOTION)))
        true.propagate(data)
        rng, errors = np.random.default_rng(4), []
        for _ in range(400):
            state = make()
            noise = [rng.normal(0, density / math.sqrt(0.005), (20, 3)) for density in (NOISE.gyro, NOISE.accel)]
            state.propagate(ImuSteps(data.dt_s, data.gyro + noise[0], data.accel + noise[1]))
            errors.append(error_between(state, true)[:9])
        sampled, stated = np.cov(np.array(errors).T), true.cov[:9, :9]
        sigma = np.sqrt(stated.diagonal())
        # A variance from 400 draws is right to a share of sqrt(2 / 400), one standard error.
        assert np.allclose(sampled / np.outer(sigma, sigma), stated / np.outer(sigma, sigma), atol=0.2)

    def test_biases_walk(self) -> None:
        state = make(np.zeros((MOTION, MOTION)))
        state.propagate(steps(200))
        assert np.allclose(state.cov[GYRO, GYRO], np.eye(3) * NOISE.gyro_walk**2)
        assert np.allclose(state.cov[ACCEL, ACCEL], np.eye(3) * NOISE.accel_walk**2)

    def test_covariance_stays_symmetric_and_rotation_stays_one(self) -> None:
        state = make()
        for seed in range(100):
            state.propagate(steps(4, seed))
        assert (state.cov == state.cov.T).all()
        assert np.linalg.eigvalsh(state.cov)[0] > 0
        assert np.abs(state.pose.R @ state.pose.R.T - np.eye(3)).max() < 1e-12

    def test_past_poses_do_not_move(self) -> None:
        state = make()
        state.clone(1)
        before = state.cov[MOTION:, MOTION:].copy()
        state.propagate(steps())
        assert (state.clones[0].p == POSE.t).all()
        assert (state.cov[MOTION:, MOTION:] == before).all()
        assert (state.cov == state.cov.T).all()


class TestBlind:
    """Moving on without inertial data."""

    def test_body_goes_on_as_it_went(self) -> None:
        state = make()
        state.propagate_blind(0.5)
        assert np.allclose(state.p, POSE.t + 0.5 * VELOCITY)
        assert (state.v == VELOCITY).all()

    def test_uncertainty_grows_in_all_that_moves(self) -> None:
        state = make()
        before = state.cov.diagonal().copy()
        state.propagate_blind(0.5)
        grown = state.cov.diagonal() - before
        assert (grown[:9] > 0.05).all()
        assert np.linalg.eigvalsh(state.cov)[0] > 0

    def test_more_time_is_less_certain(self) -> None:
        short, long = make(), make()
        short.propagate_blind(0.1)
        long.propagate_blind(0.3)
        assert np.linalg.eigvalsh(long.cov - short.cov)[-1] > 0.1

    @pytest.mark.parametrize("far_m", [0.0, 1000.0])
    def test_turning_unnoticed_is_about_the_body_wherever_that_is(self, far_m: float) -> None:
        state = WindowFilter(NOISE, POSE.R, np.full(3, far_m), VELOCITY, BIAS, np.zeros((MOTION, MOTION)))
        state.blur(0.1)
        by_position = np.hstack([-skew(state.p), np.eye(3)])
        assert sigma_of(by_position @ state.cov[:6, :6] @ by_position.T) == pytest.approx(0.015, rel=1e-4)


class TestClones:
    """The window of past poses."""

    def test_clone_is_the_pose_and_as_uncertain(self) -> None:
        state = make()
        state.clone(7)
        assert (state.clones[0].R == POSE.R).all()
        assert (state.clones[0].p == POSE.t).all()
        expected = spread(MOTION)
        assert (state.cov[MOTION:, MOTION:] == expected[:6, :6]).all()
        assert (state.cov[MOTION:, :MOTION] == expected[:6, :]).all()

    def test_clone_has_its_own_memory(self) -> None:
        state = make()
        state.clone(7)
        state.clones[0].p += 1
        assert (state.p == POSE.t).all()

    def test_dropped_clone_takes_its_rows_along(self) -> None:
        state = make()
        for number in (3, 5, 9):
            state.clone(number)
            state.propagate(steps(4, number))
        kept = np.r_[0:MOTION, MOTION : MOTION + 6, MOTION + 12 : MOTION + 18]
        expected = state.cov[np.ix_(kept, kept)]
        state.drop(5)
        assert [clone.number for clone in state.clones] == [3, 9]
        assert (state.cov == expected).all()
        assert state.index_of(9) == 1

    def test_clone_that_is_not_there_is_named(self) -> None:
        with pytest.raises(KeyError, match="4"):
            make().index_of(4)


class TestUpdate:
    """Measurements."""

    def test_it_is_the_one_of_the_textbook(self) -> None:
        state, sigma = make(), 0.3
        rng = np.random.default_rng(3)
        jacobian, residual = rng.normal(0, 1, (4, MOTION)), rng.normal(0, 1, 4)
        information = np.linalg.inv(state.cov) + jacobian.T @ jacobian / sigma**2
        expected = np.linalg.inv(information)
        before = make()
        state.update(jacobian, residual, sigma)
        assert np.allclose(state.cov, expected, atol=1e-12)
        assert np.allclose(error_between(state, before), expected @ jacobian.T @ residual / sigma**2, atol=1e-9)

    def test_clones_move_with_their_errors(self) -> None:
        state = make()
        state.clone(1)
        jacobian = np.zeros((3, len(state.cov)))
        jacobian[:, POS], jacobian[:, ATT] = np.eye(3), -skew(state.p)
        shift = np.array([1e-3, -2e-3, 3e-3])  # little, as an update is right to first order
        state.update(jacobian, shift, 1e-6)
        assert np.allclose(state.p, POSE.t + shift, atol=1e-5)
        assert np.allclose(state.clones[0].p, state.p, atol=1e-9)
        assert np.allclose(state.clones[0].R, state.R, atol=1e-12)

    def test_nis_is_the_squared_length_of_the_innovation(self) -> None:
        state = make(np.eye(MOTION))
        jacobian = np.zeros((2, MOTION))
        jacobian[0, 3], jacobian[1, 7] = 1.0, 2.0
        assert state.nis(jacobian, np.array([3.0, 4.0]), 2.0) == pytest.approx(9 / 5 + 16 / 8)

    @given(st.integers(0, 10_000), st.floats(1e-6, 1e3), st.floats(1e-3, 1e3))
    def test_covariance_stays_symmetric_and_positive_and_does_not_grow(
        self, seed: int, sigma: float, scale: float
    ) -> None:
        state = make(spread(MOTION, seed=seed))
        state.clone(1)
        rng = np.random.default_rng(seed)
        for _ in range(3):
            before = state.cov
            state.update(scale * rng.normal(0, 1, (6, len(before))), np.zeros(6), sigma)
            largest = np.linalg.eigvalsh(before)[-1]
            assert (state.cov == state.cov.T).all()
            assert np.linalg.eigvalsh(state.cov)[0] > -1e-12 * largest
            assert np.linalg.eigvalsh(before - state.cov)[0] > -1e-9 * largest

    def test_certain_state_learns_nothing(self) -> None:
        state = make(np.zeros((MOTION, MOTION)))
        state.update(np.eye(3, MOTION), np.ones(3), 0.1)
        assert (state.p == POSE.t).all()
        assert not state.cov.any()


class TestRelativePose:
    """The body in the frame of a past pose."""

    def moved(self) -> WindowFilter:
        state = make(spread(MOTION, 3e-3))
        state.clone(1)
        for seed in range(3):
            state.propagate(steps(40, seed))
        return state

    def test_pose_is_that_of_the_body_in_the_past_one(self) -> None:
        state = self.moved()
        relative, _ = state.relative_to(1)
        assert np.allclose((POSE @ relative).matrix(), state.pose.matrix(), atol=1e-9)

    def test_covariance_is_that_of_drawn_errors(self) -> None:
        state = self.moved()
        relative, stated = state.relative_to(1)
        draws = np.random.default_rng(1).multivariate_normal(np.zeros(len(state.cov)), state.cov, 500, method="eigh")
        past = SE3(state.clones[0].R, state.clones[0].p)
        errors = []
        for draw in draws:
            true = (SE3.exp(draw[MOTION:]) @ past).inverse() @ SE3.exp(draw[:6]) @ state.pose
            errors.append((relative.inverse() @ true).log())
        sigma = np.sqrt(stated.diagonal())
        sampled = np.cov(np.array(errors).T)
        # A variance from 500 draws is right to a share of sqrt(2 / 500), one standard error.
        assert np.allclose(sampled / np.outer(sigma, sigma), stated / np.outer(sigma, sigma), atol=0.2)

    def test_it_does_not_depend_on_where_the_world_is(self) -> None:
        state = self.moved()
        _, before = state.relative_to(1)
        common = np.zeros((len(state.cov), 6))
        common[:6] = common[MOTION:] = np.eye(6)
        state.cov = state.cov + 100.0 * common @ common.T
        _, after = state.relative_to(1)
        assert np.allclose(before, after, atol=1e-6 * np.abs(before).max())

    def test_pose_just_cloned_is_certain(self) -> None:
        state = make()
        state.clone(1)
        relative, cov = state.relative_to(1)
        assert np.allclose(relative.log(), 0, atol=1e-12)
        assert np.abs(cov).max() < 1e-9


class TestState:
    """What can be told about it."""

    def test_it_is_finite_as_made(self) -> None:
        assert make().is_finite()

    @pytest.mark.parametrize("field", ["R", "p", "v", "gyro_bias", "accel_bias", "cov"])
    def test_it_is_not_finite_with_a_nan(self, field: str) -> None:
        state = make()
        getattr(state, field)[0] = np.nan
        assert not state.is_finite()

    def test_it_is_not_finite_with_a_negative_variance(self) -> None:
        state = make()
        state.cov[4, 4] = -1e-9
        assert not state.is_finite()

    def test_arguments_are_copied(self) -> None:
        cov = spread(MOTION)
        state = make(cov)
        cov[:] = 0
        assert state.cov.any()


def test_invariant_covariance_is_that_of_the_same_errors() -> None:
    """Of attitude in the body, position and velocity in the world, as a warm start has them."""
    state, step = make(), 1e-6
    jacobian = np.zeros((MOTION, MOTION))
    for column in range(MOTION):
        error = step * np.eye(MOTION)[column]
        other = make()
        other.R = state.R @ so3_exp(error[ATT])
        other.p, other.v = state.p + error[POS], state.v + error[VEL]
        other.gyro_bias, other.accel_bias = state.gyro_bias + error[GYRO], state.accel_bias + error[ACCEL]
        jacobian[:, column] = error_between(other, state) / step
    expected = jacobian @ spread(MOTION) @ jacobian.T
    stated = invariant_cov(spread(MOTION), POSE.R, POSE.t, VELOCITY)
    assert np.allclose(stated, expected, atol=1e-5 * np.abs(expected).max())


def test_default_covariance_is_about_the_axes_of_the_world() -> None:
    cov = default_cov(0.03, 0.1, 0.3, 0.02, 0.2, POSE.R)
    in_world = POSE.R @ cov[ATT, ATT] @ POSE.R.T
    assert np.allclose(in_world, np.diag([0.03**2, 0.03**2, 0.1**2]))
    assert not cov[POS].any()
    assert np.allclose(np.sqrt(cov.diagonal()[6:]), [0.3] * 3 + [0.02] * 3 + [0.2] * 3)


def test_sigma_is_that_of_the_worst_direction() -> None:
    turn = so3_exp(np.array([0.4, 0.5, -0.6]))
    assert sigma_of(turn @ np.diag([1.0, 9.0, 4.0]) @ turn.T) == pytest.approx(3)
    assert sigma_of(np.zeros((3, 3))) == 0
