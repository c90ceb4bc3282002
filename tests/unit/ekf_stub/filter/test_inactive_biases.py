# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The biases of IMUs that are not in use, and what happens as one of them is."""

import numpy as np
import pytest

from ekf_stub.filter.error_state import ErrorState
from ekf_stub.filter.inactive_biases import GAIN, MAX_GYRO_ERROR, ImuRates, InactiveBiases, with_biases
from ekf_stub.filter.inertial import EKF_TARGET_DT, InertialStep
from ekf_stub.filter.plain_quaternion import quaternion
from ekf_stub.reports.core_report import Three

DT = EKF_TARGET_DT
REST: Three = (0.0, 0.0, 0.0)
TURNING: Three = (0.02, 0.0, -1.0)


@pytest.fixture
def state() -> ErrorState:
    state = ErrorState(quaternion(1.0, 0.0, 0.0, 0.0), np.full(6, 0.1))
    state.limits.set_accel_bias(1.0, DT)
    state.limits.set_step(DT)
    return state


def rates(gyro: int, accel: int, *, second: Three | None = TURNING) -> ImuRates:
    return ImuRates(gyro, accel, [REST, second, None], [REST, (0.0, 4.0, 0.0), None])


def test_other_sensors_are_drawn_to_what_the_one_in_use_measures(state: ErrorState) -> None:
    biases = InactiveBiases(0)
    for _ in range(10):
        assert biases.update(rates(0, 0), state, DT) is None
    changes = biases.update(rates(1, 1), state, DT)
    assert changes is not None
    # The error counts up to a limit, of 5 deg/s and of 1 m/s/s.
    assert state.gyro_bias == pytest.approx([10 * GAIN * DT * 0.02, 0.0, -10 * GAIN * DT * MAX_GYRO_ERROR], rel=1e-3)
    assert state.accel_bias == pytest.approx([0.0, 10 * GAIN * DT, 0.0])
    assert np.array(changes) == pytest.approx(np.array([state.gyro_bias, state.accel_bias]))


def test_bias_of_the_filter_comes_back_with_its_sensor(state: ErrorState) -> None:
    biases = InactiveBiases(0)
    state.gyro_bias = np.array([1e-4, 2e-4, 3e-4])
    biases.update(rates(0, 0), state, DT)
    biases.update(rates(1, 0), state, DT)
    assert abs(state.gyro_bias).max() < 1e-6
    biases.update(rates(0, 0), state, DT)
    assert state.gyro_bias == pytest.approx([1e-4, 2e-4, 3e-4], rel=1e-2)


def test_sensor_that_is_not_to_be_used_learns_nothing(state: ErrorState) -> None:
    biases = InactiveBiases(0)
    for _ in range(10):
        biases.update(rates(0, 0, second=None), state, DT)
    biases.update(rates(1, 0), state, DT)
    assert list(state.gyro_bias) == [0.0, 0.0, 0.0]


def test_step_of_the_sensor_before_keeps_its_own_bias() -> None:
    step = InertialStep(5, np.array([0.0, 0.1, 0.0]), np.array([0.01, 0.0, 0.0]), 2 * DT, DT)
    moved = with_biases(step, np.array([0.002, 0.0, 0.0]), np.array([0.0, 0.0, 0.03]), DT)
    assert moved.del_ang == pytest.approx([0.012, 0.0, 0.0])
    assert moved.del_vel == pytest.approx([0.0, 0.1, 0.06])
