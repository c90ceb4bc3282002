# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What is told of the present: it follows the filter, jumps with resets, and never to what is not finite."""

import math
from collections.abc import Callable

import numpy as np
import pytest
import quaternion

from ekf_stub.filter.attitude import quat_of_euler
from ekf_stub.filter.error_state import ErrorState
from ekf_stub.filter.inertial import GRAVITY_MSS, Array, InertialDelta
from ekf_stub.filter.output_predictor import Output, OutputPredictor

DT = 0.0025
STEP = 0.0125
LENGTH = 6
AT_REST = InertialDelta(np.array([0.0, 0.0, -GRAVITY_MSS * DT]), np.zeros(3), DT, DT)
NOT_FINITE = [math.nan, math.inf, -math.inf]


def level() -> ErrorState:
    return ErrorState(quat_of_euler(0.0, 0.0, 0.0), np.full(6, 0.1))


def run(output: OutputPredictor, state: ErrorState, steps: int, delta: InertialDelta = AT_REST) -> list[Output]:
    """Return what it said at the end of each of some steps."""
    said = []
    for _ in range(steps):
        for _ in range(5):
            output.integrate(delta, state, STEP)
        output.follow(state, delay_s=LENGTH * STEP, tau_s=0.25, dt_ekf_avg=STEP)
        said.append(output.now)
    return said


def test_integrates_the_newest_motion() -> None:
    state = level()
    output = OutputPredictor(state, LENGTH)
    rates = np.array([0.0, 0.0, 0.1])
    for _ in range(400):
        output.integrate(InertialDelta(np.array([DT, 0.0, -GRAVITY_MSS * DT]), rates * DT, DT, DT), state, STEP)
    angles = 0.1 * DT * np.arange(1, 401)
    assert np.allclose(output.now.vel, (DT * np.cos(angles).sum(), DT * np.sin(angles).sum(), 0.0), atol=1e-12)
    assert np.allclose(quaternion.as_rotation_vector(output.now.quat), rates)
    assert output.now.pos[0] == pytest.approx(0.5, rel=0.01)


def test_takes_the_filters_biases_off() -> None:
    state = level()
    state.learn_biases(1.0, STEP)
    state.gyro_bias, state.accel_bias = np.array([1e-4, 0.0, 0.0]), np.array([0.0, 1e-3, 0.0])
    output = OutputPredictor(state, LENGTH)
    biased = InertialDelta(AT_REST.del_vel + 0.2 * state.accel_bias, 0.2 * state.gyro_bias, DT, DT)
    for _ in range(400):
        output.integrate(biased, state, STEP)
    assert np.allclose(output.now.vel, 0, atol=1e-12)
    assert np.allclose(quaternion.as_float_array(output.now.quat), (1, 0, 0, 0), atol=1e-12)


def test_follows_the_filter_with_its_time_constant() -> None:
    state = level()
    output = OutputPredictor(state, LENGTH)
    state.pos = np.array([1.0, 0.0, 0.0])
    north = [float(said.pos[0]) for said in run(output, state, 80)]
    assert 0.5 < north[20] < 0.9
    assert north[-1] == pytest.approx(1.0, abs=0.1)
    assert output.pos_error < 0.1


def test_errors_are_how_far_it_was_from_the_filter() -> None:
    state = level()
    output = OutputPredictor(state, LENGTH)
    state.pos, state.vel = np.array([3.0, 4.0, 0.0]), np.array([0.0, 0.0, 0.5])
    state.quat = quat_of_euler(0.0, 0.0, 0.1)
    run(output, state, 1)
    assert output.pos_error == pytest.approx(5.0)
    assert output.vel_error == pytest.approx(0.5)
    assert output.angle_error == pytest.approx(0.1, rel=1e-3)


@pytest.mark.parametrize("sign", [1, -1])
def test_attitude_follows_the_filter_the_shorter_way_round(sign: int) -> None:
    state = level()
    output = OutputPredictor(state, LENGTH)
    state.quat = quat_of_euler(0.0, 0.0, 0.2) * float(sign)
    yaws = [float(quaternion.as_rotation_vector(said.quat)[2]) for said in run(output, state, 80)]
    assert all(0.0 < yaw < 0.2 for yaw in yaws[1:10])
    assert yaws[-1] == pytest.approx(0.2, abs=0.02)


def shifted(output: OutputPredictor) -> None:
    output.shift(np.array([1.0, 2.0, 3.0]))
    output.overwrite(vel={0: 0.1, 1: 0.2, 2: 0.3})


def overwritten(output: OutputPredictor) -> None:
    output.overwrite(pos={0: 1.0, 1: 2.0, 2: 3.0}, vel={0: 0.1, 1: 0.2, 2: 0.3})


@pytest.mark.parametrize("change", [shifted, overwritten])
@pytest.mark.parametrize("is_step", [True, False])
def test_present_and_past_jump_together(change: Callable[[OutputPredictor], None], is_step: bool) -> None:
    state = level()
    output = OutputPredictor(state, LENGTH)
    run(output, state, 3)
    if not is_step:
        output.integrate(AT_REST, state, STEP)
    change(output)
    assert np.allclose(output.now.pos, (1, 2, 3), atol=1e-9)
    assert np.allclose(output.now.vel, (0.1, 0.2, 0.3), atol=1e-9)
    state.pos, state.vel = np.array([1.0, 2.0, 3.0]), np.array([0.1, 0.2, 0.3])
    run(output, state, 1)
    assert output.pos_error == pytest.approx(0, abs=1e-9)
    assert output.vel_error == pytest.approx(0, abs=1e-9)


def test_only_the_given_components_are_overwritten() -> None:
    output = OutputPredictor(level(), LENGTH)
    output.overwrite(pos={2: 5.0})
    output.overwrite(vel={0: 1.0})
    assert output.now.pos.tolist() == [0.0, 0.0, 5.0]
    assert output.now.vel.tolist() == [1.0, 0.0, 0.0]


def test_turn_of_the_filter_turns_present_and_past() -> None:
    state = level()
    output = OutputPredictor(state, LENGTH)
    run(output, state, 3)
    output.rotate(state.set_yaw(1.0, 0.01))
    assert np.allclose(quaternion.as_rotation_vector(output.now.quat), (0, 0, 1.0), atol=1e-5)
    run(output, state, 1)
    assert output.angle_error == pytest.approx(0, abs=1e-4)


@pytest.mark.parametrize("bad", NOT_FINITE)
def test_does_not_go_where_is_nothing(bad: float) -> None:
    output = OutputPredictor(level(), LENGTH)
    output.shift(np.array([bad, 0.0, 0.0]))
    output.overwrite(pos={0: bad}, vel={1: bad})
    assert not output.now.pos.any()
    assert not output.now.vel.any()


def test_goes_no_farther_than_the_filter() -> None:
    state = level()
    output = OutputPredictor(state, LENGTH)
    far, fast = np.array([1e30, -1e30, 1e30]), np.array([1e30, -1e30, 600.0])
    state.pos, state.vel = far, fast
    output.shift(far)
    output.overwrite(vel=dict(enumerate(fast)))
    assert np.array_equal(output.now.pos, state.pos)
    assert np.array_equal(output.now.vel, state.vel)


def climbing(metres_per_second: float) -> Array:
    state = level()
    output = OutputPredictor(state, LENGTH)
    state.vel = np.array([0.0, 0.0, -metres_per_second])
    output.overwrite(vel={2: -metres_per_second})
    rates = []
    for _ in range(1200):
        output.integrate(AT_REST, state, STEP)
        rates.append(output.height_rate)
    return np.array(rates)


def test_height_rate_comes_to_that_of_the_height() -> None:
    rates = climbing(2.0)
    assert abs(rates[0]) < 0.1
    assert rates[-1] == pytest.approx(-2.0, abs=1e-3)


def test_height_rate_begins_anew_with_height() -> None:
    output = OutputPredictor(level(), LENGTH)
    output.overwrite(pos={2: -100.0})
    output.restart_height_filter(vel=-1.0)
    assert output.height_rate == -1.0
    output.integrate(AT_REST, level(), STEP)
    assert output.height_rate == pytest.approx(-1.0)
