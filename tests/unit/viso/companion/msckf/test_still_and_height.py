# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Standing still and heights as measurements."""

import math

import numpy as np
import pytest

from tests.unit.viso.companion.msckf.point_world import filter_at
from viso.companion.msckf.heights import take_height
from viso.companion.msckf.stillness import STILL_GYRO_SIGMA_RAD_S, STILL_VELOCITY_SIGMA_M_S, stand_still
from viso.companion.msckf.window_filter import ATT, GYRO, POS, VEL, WindowFilter, sigma_of
from viso.geometry.pose import SE3
from viso.geometry.rotation import Array, skew, so3_exp

POSE = SE3(so3_exp(np.array([0.1, -0.2, 2.0])), np.array([30.0, -10.0, 40.0]))
BIAS = np.array([0.004, -0.006, 0.003])
YAW_AND_PLACE = slice(2, 6)


def at(velocity_w: Array | float = 0.0, velocity_sigma: float = 0.3) -> WindowFilter:
    state = filter_at(POSE, np.zeros(3) + velocity_w, sigmas=(0.01, 0.01, velocity_sigma, 0.02, 0.15))
    state.clone(1)
    return state


def velocity_cov(state: WindowFilter) -> Array:
    """Return the covariance of the velocity in the world."""
    jacobian = np.zeros((3, len(state.cov)))
    jacobian[:, VEL], jacobian[:, ATT] = np.eye(3), -skew(state.v)
    return jacobian @ state.cov @ jacobian.T


def place_cov(state: WindowFilter) -> Array:
    """Return the covariance of where the body is in the world."""
    jacobian = np.zeros((3, len(state.cov)))
    jacobian[:, POS], jacobian[:, ATT] = np.eye(3), -skew(state.p)
    return jacobian @ state.cov @ jacobian.T


class TestStandingStill:
    """No velocity, and a gyro that shows its bias."""

    def test_velocity_becomes_nothing(self) -> None:
        state = at(np.array([0.2, -0.3, 0.1]))
        assert stand_still(state, BIAS)
        assert np.abs(state.v).max() < 0.005

    def test_velocity_of_a_body_thought_to_rest_becomes_as_certain_as_a_rest_is(self) -> None:
        state = at()
        stand_still(state, BIAS)
        assert sigma_of(velocity_cov(state)) == pytest.approx(1 / math.hypot(1 / 0.3, 1 / STILL_VELOCITY_SIGMA_M_S))

    def test_bias_of_the_gyro_becomes_its_mean(self) -> None:
        state = at()
        stand_still(state, BIAS)
        assert state.gyro_bias == pytest.approx(BIAS, rel=0.05)
        assert sigma_of(state.cov[GYRO, GYRO]) == pytest.approx(STILL_GYRO_SIGMA_RAD_S, rel=0.02)

    def test_body_that_surely_moves_is_not_stopped(self) -> None:
        state = at(np.array([4.0, 0.0, 0.0]))
        before = state.cov.copy()
        assert not stand_still(state, BIAS)
        assert state.v.tolist() == [4.0, 0.0, 0.0]
        assert (state.cov == before).all()

    def test_body_that_may_stand_is_stopped(self) -> None:
        assert stand_still(at(np.array([1.0, 0.0, 0.0])), BIAS)

    def test_parts_of_a_mean_count_as_much_as_the_whole(self) -> None:
        whole, parts = at(), at()
        stand_still(whole, BIAS)
        for _ in range(5):
            stand_still(parts, BIAS, 0.2)
        assert sigma_of(parts.cov[GYRO, GYRO]) == pytest.approx(sigma_of(whole.cov[GYRO, GYRO]), rel=1e-3)

    def test_place_and_heading_are_not_learnt(self) -> None:
        state = at()
        before = state.cov[YAW_AND_PLACE, YAW_AND_PLACE].copy()
        stand_still(state, BIAS)
        assert np.allclose(state.cov[YAW_AND_PLACE, YAW_AND_PLACE], before)


class TestHeight:
    """Heights above the ground."""

    def test_height_is_taken(self) -> None:
        state = at()
        state.cov[5, 5] += 1.0
        assert take_height(state, 40.5, 0.1, 25.0)
        assert state.p[2] == pytest.approx(40.5, abs=0.02)
        assert math.sqrt(place_cov(state)[2, 2]) == pytest.approx(0.1, rel=0.02)

    def test_past_poses_rise_as_well(self) -> None:
        state = at()
        state.cov[5, 5] += 1.0
        state.cov[20, 20] += 1.0
        state.cov[5, 20] += 1.0
        state.cov[20, 5] += 1.0
        take_height(state, 40.5, 0.1, 25.0)
        assert state.clones[0].p[2] == pytest.approx(state.p[2], abs=1e-6)

    def test_height_beyond_the_gate_is_refused(self) -> None:
        state = at()
        state.cov[5, 5] += 0.04
        sigma = math.sqrt(place_cov(state)[2, 2] + 0.01)
        assert not take_height(state, 40.0 + 5.1 * sigma, 0.1, 25.0)
        assert state.p[2] == 40.0
        assert take_height(state, 40.0 + 4.9 * sigma, 0.1, 25.0)

    def test_sideways_is_not_learnt(self) -> None:
        state = at()
        state.cov[3:6, 3:6] += np.eye(3)
        assert take_height(state, 40.3, 0.1, 25.0)
        assert place_cov(state)[:2, :2] == pytest.approx(np.eye(2), abs=1e-4)
