# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The filter's algebra: against filterpy, and under sequences that nobody would choose."""

import math

import numpy as np
import pytest
import quaternion
from filterpy.kalman import KalmanFilter
from hypothesis import given
from hypothesis import strategies as st

from ekf_stub.error_state import (
    ATT,
    STATES,
    VEL,
    ErrorState,
    ProcessNoise,
    euler_of,
    quat_of_euler,
)
from ekf_stub.inertial import InertialDelta, InertialStep
from ekf_stub.output_predictor import OutputPredictor

DT = 0.0125
NOISE = ProcessNoise(gyro=0.015, accel=0.35, gyro_bias=0.001, accel_bias=0.02)
ANGLES = st.floats(-1.5, 1.5)
AT_REST = InertialStep(0, np.array([0.0, 0.0, -9.80665 * DT]), np.zeros(3), DT, DT)


def fresh(roll: float = 0.0, pitch: float = 0.0, yaw: float = 0.0) -> ErrorState:
    return ErrorState(quat_of_euler(roll, pitch, yaw), np.array([0.09, 0.09, 0.25, 0.25, 0.25, 4.0]))


def predict(state: ErrorState, step: InertialStep = AT_REST) -> None:
    state.predict(step, NOISE, DT, aided=True, on_ground=True)


@given(ANGLES, ANGLES, st.floats(-math.pi, math.pi))
def test_euler_angles_come_back(roll: float, pitch: float, yaw: float) -> None:
    assert np.allclose(euler_of(quat_of_euler(roll, pitch, yaw)), (roll, pitch, yaw), atol=1e-9)


@given(st.integers(0, STATES - 1), st.floats(-10, 10), st.floats(0.01, 10))
def test_update_is_that_of_filterpy(index: int, innovation: float, variance: float) -> None:
    state = fresh(0.1, -0.2, 0.3)
    state.learn_biases(1.0, DT)
    for _ in range(20):
        predict(state)
    reference = KalmanFilter(dim_x=STATES, dim_z=1)
    reference.P, reference.R = state.cov.copy(), np.array([[variance]])
    reference.H[0, index] = 1.0
    reference.update(np.array([[-innovation]]))
    vel_before, row = state.vel.copy(), np.zeros(STATES)
    row[index] = 1.0
    assert state.update(row, innovation, variance)
    assert np.allclose(state.cov, reference.P, rtol=1e-6, atol=1e-4)
    assert np.allclose(state.vel - vel_before, reference.x[VEL, 0], atol=1e-9)


def test_rest_stays_rest() -> None:
    state = fresh()
    for _ in range(800):
        predict(state)
    assert np.allclose([*state.vel, *state.pos, *euler_of(state.quat)], 0, atol=1e-6)


def test_uncertainty_grows_without_measurements() -> None:
    state = fresh()
    before = state.cov.diagonal().copy()
    for _ in range(80):
        predict(state)
    assert (state.cov.diagonal()[:9] > before[:9]).all()


@given(st.lists(st.tuples(st.integers(0, 8), st.floats(-5, 5), st.floats(1e-4, 100)), max_size=60))
def test_covariance_stays_symmetric_and_without_negative_variances(fused: list[tuple[int, float, float]]) -> None:
    state = fresh(0.2, 0.1, -1.0)
    state.learn_biases(1.0, DT)
    turning = InertialStep(0, np.array([0.05, -0.02, -0.12]), np.array([0.01, -0.02, 0.03]), DT, DT)
    for index, innovation, variance in fused:
        predict(state, turning)
        row = np.zeros(STATES)
        row[index] = 1.0
        state.update(row, innovation, variance)
        assert np.array_equal(state.cov, state.cov.T)
        assert (state.cov.diagonal() >= 0).all()
        assert np.isfinite(state.cov).all()


@pytest.mark.parametrize("yaw", [-3.0, 0.0, 2.5])
def test_setting_yaw_keeps_tilt_and_how_well_it_is_known(yaw: float) -> None:
    state = fresh(0.3, -0.4, 1.0)
    tilt_variance = state.tilt_variance()
    turn = state.set_yaw(yaw, 0.01)
    assert np.allclose(euler_of(state.quat), (0.3, -0.4, yaw))
    assert state.tilt_variance() == pytest.approx(tilt_variance)
    assert float(state.yaw_row() @ state.cov @ state.yaw_row()) == pytest.approx(0.01, rel=0.3)
    assert np.allclose(
        quaternion.as_float_array(turn * quat_of_euler(0.3, -0.4, 1.0)), quaternion.as_float_array(state.quat)
    )


def test_bias_of_a_level_axis_is_not_learned_on_the_ground() -> None:
    state = fresh()
    state.learn_biases(1.0, DT)
    for _ in range(10):
        predict(state)
    assert state.cov[12, 12] == state.cov[13, 13] == 0 < state.cov[14, 14]


def test_outputs_follow_the_filter_with_their_time_constant() -> None:
    state = fresh()
    output = OutputPredictor(state, 6)
    state.pos = np.array([1.0, 0.0, 0.0])
    still = InertialDelta(np.array([0.0, 0.0, -9.80665 * DT]), np.zeros(3), DT, DT)
    north = []
    for _ in range(80):
        output.integrate(still, state, DT)
        output.follow(state, delay_s=0.0625, tau_s=0.25, dt_imu_avg=DT, dt_ekf_avg=DT)
        north.append(float(output.now.pos[0]))
    assert 0.5 < north[20] < 0.9
    assert north[-1] == pytest.approx(1.0, abs=0.1)


def test_attitude_error_is_all_that_a_fresh_filter_knows_of_tilt() -> None:
    assert fresh().cov[ATT, ATT].trace() == pytest.approx(3 * 0.1**2)
