# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The filter's states and covariance: prediction, fusion, resets, limits, and what does not get in."""

import math

import numpy as np
import pytest
import quaternion
from hypothesis import given
from hypothesis import strategies as st

from ekf_stub.filter.attitude import euler_of, quat_of_euler
from ekf_stub.filter.error_state import ErrorState
from ekf_stub.filter.inertial import GRAVITY_MSS, Array, InertialStep
from ekf_stub.filter.process_model import ProcessNoise
from ekf_stub.filter.states import ACCEL, ATT, BODY, EARTH, GYRO, POS, STATES, VEL

DT = 0.0125
NOISE = ProcessNoise(gyro=0.015, accel=0.35, gyro_bias=0.001, accel_bias=0.02, earth_field=0.001, body_field=0.0001)
REST = np.array([0.0, 0.0, -GRAVITY_MSS * DT])
AT_REST = InertialStep(0, REST, np.zeros(3), DT, DT)
NOT_FINITE = [math.nan, math.inf, -math.inf]


def fresh(roll: float = 0.0, pitch: float = 0.0, yaw: float = 0.0) -> ErrorState:
    return ErrorState(quat_of_euler(roll, pitch, yaw), np.array([0.09, 0.09, 0.25, 0.25, 0.25, 4.0]))


def predict(state: ErrorState, step: InertialStep = AT_REST, *, aided: bool = True, on_ground: bool = True) -> None:
    state.predict(step, NOISE, DT, aided=aided, on_ground=on_ground)


def flown(*, aided: bool = True, on_ground: bool = False) -> ErrorState:
    """Return a tilted filter that has learned its biases for a quarter of a second, so that all is correlated."""
    state = fresh(0.3, -0.6, 0.9)
    state.learn_biases(1.0, DT)
    level = state.rotation.T @ REST
    for _ in range(20):
        predict(state, InertialStep(0, level, np.zeros(3), DT, DT), aided=aided, on_ground=on_ground)
    return state


def unit_row(index: int) -> Array:
    row = np.zeros(STATES)
    row[index] = 1.0
    return row


def everything(state: ErrorState) -> Array:
    return np.concatenate([quaternion.as_float_array(state.quat), state.states, state.cov.ravel()])


# Prediction


def test_rest_stays_rest() -> None:
    state = fresh()
    state.earth_rate_ned = np.zeros(3)
    for _ in range(800):
        predict(state)
    assert np.allclose([*state.vel, *state.pos, *euler_of(state.quat)], 0, atol=1e-6)


def test_gyro_that_turns_with_the_earth_shows_no_turn_of_the_vehicle() -> None:
    state = fresh(0.1, 0.2, 0.3)
    state.earth_rate_ned = np.array([0.01, 0.0, -0.02])
    for _ in range(800):
        predict(state, InertialStep(0, REST, state.earth_rate_ned @ state.rotation * DT, DT, DT))
    assert np.allclose(euler_of(state.quat), (0.1, 0.2, 0.3), atol=1e-9)


def test_uncertainty_grows_without_measurements() -> None:
    state = fresh()
    before = state.cov.diagonal().copy()
    for _ in range(80):
        predict(state)
    assert (state.cov.diagonal()[VEL.start : POS.stop] > before[VEL.start : POS.stop]).all()


def test_acceleration_that_nothing_aids_counts_no_more_than_five_metres_a_second_squared() -> None:
    hard = InertialStep(0, np.array([20.0 * DT, 0.0, -GRAVITY_MSS * DT]), np.zeros(3), DT, DT)
    velocities = []
    for aided in (True, False):
        state = fresh()
        for _ in range(400):
            predict(state, hard, aided=aided)
        velocities.append(float(state.vel[0]))
    assert velocities[0] == pytest.approx(20.0 * DT * 400, rel=0.01)
    assert velocities[1] < 0.4 * velocities[0]


def test_position_that_is_lost_does_not_grow_less_certain() -> None:
    state = flown()
    state.clear(POS, 6000.0)
    for _ in range(80):
        predict(state, on_ground=False)
    assert state.cov.diagonal()[POS].tolist() == [6000.0, 6000.0, pytest.approx(6000.3, abs=0.2)]
    assert state.cov[POS.start, VEL.start] == 0


def test_bias_of_a_level_axis_is_not_learned_on_the_ground() -> None:
    state = fresh()
    state.learn_biases(1.0, DT)
    for _ in range(80):
        predict(state)
        state.update_state(VEL.start, 0.1, 0.01)
        state.update_state(VEL.stop - 1, 0.1, 0.01)
    assert state.accel_bias[0] == state.accel_bias[1] == 0
    assert state.accel_bias[2] != 0
    assert state.cov[ACCEL.start, ACCEL.start] == pytest.approx((0.2 * DT) ** 2)


def test_no_bias_of_an_accelerometer_is_learned_while_somebody_moves_the_vehicle() -> None:
    state = fresh()
    state.learn_biases(1.0, DT)
    before = state.cov.diagonal()[ACCEL].copy()
    for _ in range(20):
        state.predict(AT_REST, NOISE, DT, aided=True, on_ground=True, is_moved=True)
    assert state.cov.diagonal()[ACCEL].tolist() == before.tolist()
    state.predict(AT_REST, NOISE, DT, aided=True, on_ground=True)
    assert state.cov[ACCEL, VEL].any()


def test_bias_that_was_frozen_is_as_uncertain_as_before_once_in_flight() -> None:
    state = fresh()
    state.learn_biases(1.0, DT)
    for _ in range(10):
        predict(state)
    predict(state, on_ground=False)
    predict(state, on_ground=False)
    assert state.cov[ACCEL.start, ACCEL.start] == pytest.approx((0.2 * DT) ** 2, rel=1e-3)
    assert state.cov[ACCEL.start, VEL.start] != 0


def landed_with_shared_biases(shared: float, *, forgets: bool) -> Array:
    """Return the covariance of the biases after a step on level ground that follows a flight in which they went along.

    ``shared`` is the correlation of X and Z, Y and Z, and X and Y.
    """
    state = fresh()
    state.forgets_frozen = forgets
    state.learn_biases(1.0, DT)
    predict(state, on_ground=False)
    variance = (0.1 * DT) ** 2
    state.cov[ACCEL] = state.cov[:, ACCEL] = 0.0
    state.cov[ACCEL, ACCEL] = variance * (shared + (1.0 - shared) * np.eye(3))
    predict(state)
    return np.asarray(state.cov[ACCEL, ACCEL] / variance)


def test_bias_that_is_frozen_goes_along_with_that_of_the_vertical_axis_in_releases_that_keep_it() -> None:
    kept, forgotten = (landed_with_shared_biases(0.5, forgets=forgets) for forgets in (False, True))
    assert kept == pytest.approx(np.array([[1, 0, 0.5], [0, 1, 0.5], [0.5, 0.5, 1]]), rel=1e-3)
    assert forgotten == pytest.approx(np.eye(3), rel=1e-3)


def test_biases_are_forgotten_where_a_covariance_would_be_none() -> None:
    assert landed_with_shared_biases(0.9, forgets=False) == pytest.approx(np.eye(3), rel=1e-3)


def test_bias_that_was_given_another_variance_while_frozen_leaves_a_covariance_in_flight() -> None:
    state = fresh()
    state.learn_biases(0.5, DT)
    predict(state)
    state.clear(ACCEL, 0.01)
    for axis in range(3):
        state.update(unit_row(VEL.start + axis) + 10 * unit_row(ACCEL.start + axis), 0.1, 1e-4)
    predict(state, on_ground=False)
    assert np.linalg.eigvalsh(state.cov)[0] > -1e-15


@pytest.mark.parametrize("learns_field", [False, True])
def test_magnetic_fields_have_errors_only_while_they_are_estimated(learns_field: bool) -> None:
    state = flown()
    state.learns_field = learns_field
    state.clear(slice(EARTH.start, BODY.stop), 0.0025)
    predict(state)
    assert (state.cov.diagonal()[EARTH.start :] > 0).all() == learns_field
    state.update(unit_row(BODY.start) + unit_row(EARTH.start), 0.1, 0.01)
    assert bool(state.earth_field.any()) == bool(state.body_field.any()) == learns_field


# Fusion


@pytest.mark.slow
@given(st.integers(0, STATES - 1), st.floats(-10, 10), st.floats(0.01, 10))
def test_update_of_a_state_is_that_of_its_row(index: int, innovation: float, variance: float) -> None:
    by_row, by_index = flown(), flown()
    assert by_row.update(unit_row(index), innovation, variance)
    assert by_index.update_state(index, innovation, variance)
    assert np.allclose(everything(by_row), everything(by_index), rtol=1e-12, atol=1e-15)


def test_fusion_with_a_given_variance_of_the_innovation_is_that_with_the_noise_that_makes_it() -> None:
    by_noise, by_sum = flown(), flown()
    row = by_noise.yaw_row(by_321=True)
    assert by_noise.update(row, 0.1, 0.04)
    assert by_sum.fuse(row, 0.1, float(row @ by_sum.cov @ row) + 0.04)
    assert np.allclose(everything(by_noise), everything(by_sum), rtol=1e-12, atol=1e-15)


def test_variance_of_an_innovation_is_no_less_than_that_of_its_prediction() -> None:
    state = flown()
    row = state.yaw_row(by_321=True)
    assert state.fuse(row, 0.1, 1e-12)
    assert 0 < float(row @ state.cov @ row) < 1e-7
    assert np.linalg.eigvalsh(state.cov)[0] > -1e-12


def test_yaw_comes_to_where_it_was_measured() -> None:
    state = fresh(0.2, -0.3, 0.5)
    for _ in range(50):
        state.update(state.yaw_row(by_321=True), state.yaw(by_321=True) - 0.8, 1e-4)
    assert state.yaw(by_321=True) == pytest.approx(0.8, abs=1e-3)


def test_without_aiding_a_horizontal_measurement_leaves_the_accelerometer_alone_and_what_gravity_shows() -> None:
    aided, alone = flown(), flown(aided=False)
    for state in (aided, alone):
        assert state.update_state(VEL.start, 1.0, 0.01)
    down = np.abs(alone.rotation[2]) > math.sqrt(0.5)
    assert down.sum() == 1
    assert (alone.gyro_bias[down] == 0).all()
    assert (alone.gyro_bias[~down] == aided.gyro_bias[~down]).all()
    assert (alone.accel_bias == 0).all()
    assert (aided.accel_bias != 0).all()
    assert (aided.gyro_bias != 0).all()


def test_without_aiding_a_vertical_measurement_corrects_the_accelerometer() -> None:
    state = flown(aided=False)
    assert state.update_state(POS.stop - 1, 1.0, 0.01)
    assert (state.accel_bias != 0).all()


def test_what_would_make_a_variance_negative_is_not_fused() -> None:
    state = flown()
    state.cov[VEL.start, VEL.start + 1] = state.cov[VEL.start + 1, VEL.start] = 10.0
    before = everything(state)
    assert not state.update_state(VEL.start, 0.1, 0.01)
    assert np.array_equal(everything(state), before)


@pytest.mark.slow
@given(st.lists(st.tuples(st.integers(VEL.start, POS.stop - 1), st.floats(-5, 5), st.floats(1e-4, 100)), max_size=60))
def test_covariance_stays_symmetric_and_positive(fused: list[tuple[int, float, float]]) -> None:
    state = fresh(0.2, 0.1, -1.0)
    state.learn_biases(1.0, DT)
    turning = InertialStep(0, np.array([0.05, -0.02, -0.12]), np.array([0.01, -0.02, 0.03]), DT, DT)
    for index, innovation, variance in fused:
        predict(state, turning)
        assert state.update_state(index, innovation, variance)
        assert np.array_equal(state.cov, state.cov.T)
        assert np.linalg.eigvalsh(state.cov)[0] > -1e-15


# Resets


@pytest.mark.parametrize("yaw", [-3.0, 0.0, 2.5])
@pytest.mark.parametrize("by_321", [True, False])
def test_setting_yaw_keeps_tilt_and_how_well_it_is_known(yaw: float, by_321: bool) -> None:
    state = fresh(0.3, -0.4, 1.0)
    before, down = state.quat, state.rotation[2].copy()
    tilt_variance = state.predicted_tilt_variance
    turn = state.set_yaw(yaw, 0.01, by_321=by_321)
    assert state.yaw(by_321=by_321) == pytest.approx(yaw)
    assert np.allclose(state.rotation[2], down)
    assert state.tilt_variance() == pytest.approx(tilt_variance, rel=0.5)
    row = state.yaw_row(by_321=by_321)
    assert float(row @ state.cov @ row) == pytest.approx(0.01, rel=0.3)
    assert np.allclose(quaternion.as_float_array(turn * before), quaternion.as_float_array(state.quat))


def test_attitude_error_is_all_that_a_fresh_filter_knows_of_tilt() -> None:
    assert fresh(0.1, 0.2, 0.3).tilt_variance() == pytest.approx(2 * 0.1**2, rel=0.1)


def test_tilt_is_never_said_to_be_less_certain_than_thirty_degrees() -> None:
    state = fresh()
    state.clear(ATT, 1.0)
    assert state.tilt_variance() == pytest.approx(math.radians(30) ** 2)


@pytest.mark.parametrize(
    ("variance", "expected"), [(0.3, 0.3), (-1.0, 0.0), (1e9, 1e3), (math.inf, 1e3), (math.nan, 1e3)]
)
def test_cleared_variance_is_one_that_can_be(variance: float, expected: float) -> None:
    state = flown()
    state.clear(VEL, variance)
    assert (state.cov.diagonal()[VEL] == expected).all()
    assert np.count_nonzero(state.cov[VEL]) == (3 if expected else 0)


# Limits


def test_states_are_kept_where_the_firmware_keeps_them() -> None:
    state = fresh()
    state.learn_biases(1.0, DT)
    state.vel = np.array([1e4, -1e4, 600.0])
    state.pos = np.array([1e7, -1e7, -1e5])
    state.body_field, state.earth_field = np.array([1.0, -1.0, 0.1]), np.array([2.0, -2.0, 0.1])
    assert state.vel.tolist() == [500.0, -500.0, 500.0]
    assert state.pos.tolist() == [1e6, -1e6, -4e4]
    assert state.body_field.tolist() == [0.5, -0.5, 0.1]
    assert state.earth_field.tolist() == [1.0, -1.0, 0.1]
    state.pos = np.array([0.0, 0.0, 1e5])
    assert state.pos.tolist() == [0.0, 0.0, 1e4]


def test_biases_are_kept_within_their_limits() -> None:
    state = flown()
    for _ in range(50):
        predict(state, on_ground=False)
        state.update(unit_row(GYRO.start), -1.0, 1e-8)
        state.update(unit_row(ACCEL.start), 1.0, 1e-8)
    assert state.gyro_bias[0] == pytest.approx(0.175 * DT)
    assert state.accel_bias[0] == pytest.approx(-1.0 * DT)


def test_too_large_a_variance_shrinks_with_its_correlations() -> None:
    state = flown()
    state.cov *= 1e5
    predict(state, on_ground=False)
    variances = state.cov.diagonal()
    assert (variances[VEL] == 1e3).all()
    sigma = np.sqrt(np.where(variances > 0, variances, 1.0))
    assert np.linalg.eigvalsh(state.cov / np.outer(sigma, sigma))[0] > -1e-12


# What does not get in


@pytest.mark.parametrize("bad", [*NOT_FINITE, 1e3])
@pytest.mark.parametrize("field", ["del_vel", "del_ang", "del_vel_dt", "del_ang_dt"])
def test_unsound_step_is_refused(field: str, bad: float) -> None:
    state = flown()
    before = everything(state)
    values = {"del_vel": REST, "del_ang": np.zeros(3), "del_vel_dt": DT, "del_ang_dt": DT}
    values[field] = bad if field.endswith("dt") else np.array([0.0, bad, 0.0])
    predict(state, InertialStep(0, **values))  # type: ignore[arg-type]  # by name, each of its type
    assert state.refused == 1
    assert np.array_equal(everything(state), before)


@pytest.mark.parametrize(
    ("innovation", "variance"),
    [*((bad, 1.0) for bad in [*NOT_FINITE, 1e30]), *((0.1, bad) for bad in [*NOT_FINITE, -1e-3])],
)
def test_unsound_measurement_is_refused(innovation: float, variance: float) -> None:
    state = flown()
    before = everything(state)
    assert not state.update_state(VEL.start, innovation, variance)
    assert not state.update(state.yaw_row(by_321=True), innovation, variance)
    assert state.refused == 2
    assert np.array_equal(everything(state), before)


@pytest.mark.parametrize("bad", [*NOT_FINITE, -1.0])
def test_unsound_variance_of_an_innovation_is_refused(bad: float) -> None:
    state = flown()
    before = everything(state)
    assert not state.fuse(unit_row(VEL.start), 0.1, bad)
    assert state.refused == 1
    assert np.array_equal(everything(state), before)


def test_exact_measurement_is_taken_for_a_very_good_one() -> None:
    state = flown()
    state.update_state(POS.start, 1.0, 0.0)
    assert state.refused == 0
    assert state.pos[0] == pytest.approx(-1.0, abs=1e-6)
    assert state.cov[POS.start, POS.start] == 1e-4


@pytest.mark.parametrize("name", ["vel", "pos", "gyro_bias", "accel_bias", "earth_field", "body_field"])
@pytest.mark.parametrize("bad", NOT_FINITE)
def test_state_is_not_set_to_what_is_not_finite(name: str, bad: float) -> None:
    state = flown()
    before = everything(state)
    setattr(state, name, np.array([0.001, bad, 0.001]))
    assert state.refused == 1
    assert np.array_equal(everything(state), before)


@pytest.mark.parametrize("bad", NOT_FINITE)
def test_yaw_is_not_set_to_what_is_not_finite(bad: float) -> None:
    state = flown()
    before = everything(state)
    assert state.set_yaw(bad, 0.01) == quaternion.one
    assert state.refused == 1
    assert np.array_equal(everything(state), before)


@pytest.mark.parametrize("bad", [*NOT_FINITE, 1e30])
def test_noise_that_is_no_noise_leaves_the_covariance_sound(bad: float) -> None:
    state = flown()
    state.predict(AT_REST, ProcessNoise(bad, bad, bad, bad, bad, bad), DT, aided=True, on_ground=False)
    assert np.isfinite(state.cov).all()
    assert np.linalg.eigvalsh(state.cov)[0] > -1e-12


def test_correction_that_leaves_no_attitude_leaves_it_as_it_was() -> None:
    state = fresh(0.1, 0.2, 0.3)
    before = state.quat
    state.correct(np.concatenate([-quaternion.as_float_array(before), np.ones(18)]))
    assert state.quat == before
    assert state.vel.tolist() == [1.0, 1.0, 1.0]


def test_correlations_are_forgotten_and_how_large_errors_are_is_not() -> None:
    state = ErrorState(quat_of_euler(0.1, -0.2, 0.3), np.ones(6))
    state.learn_biases(1.0, 0.01)
    whole = np.random.default_rng(1).normal(size=state.cov.shape)
    state.cov[:] = whole @ whole.T
    before = state.cov.copy()
    state.forget_correlations()
    assert state.cov.diagonal().tolist() == before.diagonal().tolist()
    assert (state.cov[ATT, ATT] == before[ATT, ATT]).all()
    assert (state.cov[VEL, VEL] == before[VEL, VEL]).all()
    assert not state.cov[ATT, ATT.stop :].any()
    assert np.count_nonzero(state.cov[GYRO]) == 3
