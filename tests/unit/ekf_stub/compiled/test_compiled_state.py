# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The compiled filter does what the plain one does, but for rounding."""

import math
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ekf_stub.compiled.compiled_state import CompiledErrorState
from ekf_stub.filter.attitude import quat_of_euler
from ekf_stub.filter.error_state import ErrorState
from ekf_stub.filter.inertial import Array, InertialStep
from ekf_stub.filter.process_model import ProcessNoise
from ekf_stub.filter.states import ATT, BODY, EARTH, GYRO, STATES, VEL

DT = 0.0125
NOISE = ProcessNoise(gyro=0.015, accel=0.35, gyro_bias=0.001, accel_bias=0.02, earth_field=0.001, body_field=0.0001)
VARIANCES = np.array([0.09, 0.09, 0.25, 0.25, 0.25, 4.0])
STEPS = 1500
WORST = 1e-8
"""By how many sigmas the two may differ after these steps; the rounding of one step is some 1e-16."""


class Pair:
    """The same filter twice.

    Attributes:
        both: the plain one, and the compiled one.
    """

    def __init__(self, *, forgets_frozen: bool = True) -> None:
        quat = quat_of_euler(0.2, -0.1, 0.7)
        self.both = ErrorState(quat, VARIANCES), CompiledErrorState(quat, VARIANCES)
        for state in self.both:
            state.forgets_frozen = forgets_frozen

    def predict(self, del_vel: Array, del_ang: Array, *, aided: bool, on_ground: bool, is_moved: bool = False) -> None:
        step = InertialStep(0, del_vel, del_ang, DT, DT)
        for state in self.both:
            state.predict(step, NOISE, DT, aided=aided, on_ground=on_ground, is_moved=is_moved)

    def update_state(self, index: int, innovation: float, variance: float) -> bool:
        plain, compiled = (state.update_state(index, innovation, variance) for state in self.both)
        assert plain == compiled
        return plain

    def worst(self) -> float:
        """Return the largest difference in sigmas."""
        plain, compiled = self.both
        sigma = np.sqrt(np.maximum(plain.cov.diagonal(), 1e-12))
        by_cov = np.abs(plain.cov - compiled.cov) / np.outer(sigma, sigma)
        by_state = np.abs(plain.states - compiled.states) / sigma[ATT.stop :]
        turn = plain.quat.conjugate() * compiled.quat
        return float(max(by_cov.max(), by_state.max(), math.hypot(turn.x, turn.y, turn.z) / sigma[ATT].max()))


@cache
def led_about(seed: int) -> Pair:
    """Return a pair that has run for a while, for looking at alone."""
    rng, pair = np.random.default_rng(seed), Pair(forgets_frozen=seed == 2)
    for number in range(STEPS):
        if number == 200:
            for state in pair.both:
                state.learn_biases(1.0, DT)
        if number == 700:
            for state in pair.both:
                state.learns_field = True
                state.clear(slice(EARTH.start, BODY.stop), 0.0025)
        gravity = np.array([0.0, 0.0, -0.1226])
        aided, on_ground = number > 100, number % 500 < 250
        del_vel, del_ang = rng.normal(0, 0.02, 3) + gravity, rng.normal(0, 0.005, 3)
        pair.predict(del_vel, del_ang, aided=aided, on_ground=on_ground, is_moved=number % 400 < 100)
        if number % 3 == 0:
            for index in range(VEL.start, VEL.start + 6):
                pair.update_state(index, rng.normal(0, 0.1), 0.04)
    return pair


@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_both_go_the_same_way(seed: int) -> None:
    pair = led_about(seed)
    plain, compiled = pair.both
    assert pair.worst() < WORST
    assert compiled.predicted_tilt_variance == pytest.approx(plain.predicted_tilt_variance, rel=WORST)
    assert np.allclose(compiled.rotation, plain.rotation, rtol=0, atol=WORST)
    assert np.allclose(compiled.accel_filtered, plain.accel_filtered, rtol=0, atol=WORST)
    assert (plain.refused, compiled.refused) == (0, 0)


@settings(derandomize=True)
@given(
    index=st.integers(VEL.start, VEL.start + 5),
    innovation=st.floats(-100, 100) | st.floats(),
    variance=st.floats(1e-9, 100) | st.floats(),
)
def test_fusion_has_the_same_results_in_the_same_filter(index: int, innovation: float, variance: float) -> None:
    plain, _ = led_about(1).both
    pair = Pair()
    for state in pair.both:
        state.quat, state.states, state.cov = plain.quat, plain.states, plain.cov.copy()
        state._aided = True
    pair.update_state(index, innovation, variance)
    ours, other = pair.both
    assert np.array_equal(ours.cov, other.cov)
    assert np.array_equal(ours.states, other.states)
    assert repr(ours.quat) == repr(other.quat)
    assert ours.refused == other.refused


@settings(derandomize=True)
@given(
    wanted=st.lists(
        st.tuples(
            st.integers(VEL.start, VEL.start + 5),
            st.floats(-100, 100) | st.floats(),
            st.floats(1e-9, 100) | st.floats(),
        ),
        min_size=1,
        max_size=6,
    ),
    aided=st.booleans(),
)
def test_fusion_of_several_is_that_of_one_after_the_other(wanted: list[tuple[int, float, float]], aided: bool) -> None:
    plain, _ = led_about(1).both
    pair = Pair()
    for state in pair.both:
        state.quat, state.states, state.cov = plain.quat, plain.states, plain.cov.copy()
        state._aided = aided
    ours, other = pair.both
    said = [state.update_states(wanted) for state in pair.both]
    assert repr(said[0]) == repr(said[1])
    assert np.array_equal(ours.cov, other.cov)
    assert np.array_equal(ours.states, other.states)
    assert repr(ours.quat) == repr(other.quat)
    assert ours.refused == other.refused


@pytest.mark.parametrize("by_321", [True, False])
def test_spread_of_yaw_is_the_same(by_321: bool) -> None:
    plain, compiled = led_about(1).both
    spread, expected = plain.spread_of_yaw(by_321=by_321)
    other_spread, other_expected = compiled.spread_of_yaw(by_321=by_321)
    assert np.allclose(other_spread, spread, rtol=1e-6, atol=1e-12)
    assert other_expected == pytest.approx(expected, rel=1e-6)


def test_compiled_one_keeps_what_others_hold() -> None:
    _, state = Pair().both
    states, rotation, cov = state.states, state.rotation, state.cov
    kept = states.copy(), rotation.copy()
    step = InertialStep(0, np.array([0.1, 0.0, -0.1]), np.full(3, 0.01), DT, DT)
    state.predict(step, NOISE, DT, aided=True, on_ground=False)
    assert np.array_equal(states, kept[0])
    assert np.array_equal(rotation, kept[1])
    assert state.cov is cov
    assert state.update_state(VEL.start, 0.1, 0.04)
    assert state.cov is not cov


def test_compiled_one_refuses_what_is_unsound() -> None:
    _, state = Pair().both
    cov = state.cov.copy()
    state.predict(InertialStep(0, np.full(3, math.nan), np.zeros(3), DT, DT), NOISE, DT, aided=True, on_ground=True)
    assert state.refused == 1
    assert not state.update_state(VEL.start, math.inf, 0.04)
    assert state.refused == 2
    assert np.array_equal(state.cov, cov)


def test_field_that_is_not_learned_gets_no_variance() -> None:
    for state in Pair().both:
        state.clear(EARTH, 1.0)
        assert not state.cov[EARTH].any()
        state.clear(GYRO, 1e-9)
        assert state.cov.diagonal()[GYRO].tolist() == [1e-9] * 3
        assert state.cov.shape == (STATES, STATES)
