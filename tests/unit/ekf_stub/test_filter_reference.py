# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The filter against a slow and obvious one: covariances by filterpy, how errors grow by differences of the motion.

The motion is quadratic in the quaternion, and linear in all else, so that differences of any size are exact.
"""

import math

import numpy as np
import pytest
import quaternion
from hypothesis import given
from hypothesis import strategies as st

from ekf_stub.filter.error_state import ErrorState
from ekf_stub.filter.inertial import GRAVITY_MSS, Array, InertialStep
from ekf_stub.filter.process_model import ProcessNoise
from ekf_stub.filter.states import (
    ACCEL,
    ATT,
    BODY,
    EARTH,
    GYRO,
    MIN_ACCEL_VAR,
    MIN_ACCEL_VAR_RATIO,
    MIN_VEL_POS_VAR,
    POS,
    STATES,
    VEL,
)

DT = 0.0125
SECONDS = 60
NOISE = ProcessNoise(gyro=0.015, accel=0.35, gyro_bias=0.001, accel_bias=0.02, earth_field=0.001, body_field=0.0001)
ACCEL_BIAS_MSS = np.array([0.1, -0.2, 0.15])
GYRO_BIAS_RAD_S = np.array([0.01, -0.02, 0.005])
FIELD_NED = np.array([0.22, 0.05, 0.42])
VARIANCES = np.array([0.09, 0.09, 0.25, 0.25, 0.25, 4.0])


def product(left: Array, right: Array) -> Array:
    """Return products of quaternions, shape (n, 4)."""
    w, x, y, z = left.T
    a, b, c, d = right.T
    return np.array(
        [
            w * a - x * b - y * c - z * d,
            w * b + x * a + y * d - z * c,
            w * c - x * d + y * a + z * b,
            w * d + x * c - y * b + z * a,
        ]
    ).T


def earth_from_body(quats: Array) -> Array:
    """Return matrices that count a quaternion's length in as the firmware does, shape (n, 3, 3)."""
    w, x, y, z = quats.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), -1, 0)


class Reference:
    """The filter in filterpy's terms.

    Attributes:
        kalman: the errors' filter: ``x`` is what was found of them, and is moved into ``nominal`` at once.
        nominal: shape (22,).
    """

    def __init__(self, quat: quaternion.quaternion) -> None:
        self.nominal = np.zeros(STATES)
        self.nominal[ATT] = quaternion.as_float_array(quat)
        from filterpy.kalman import KalmanFilter  # with scipy.stats, half a second in every process that collects

        self.kalman = KalmanFilter(dim_x=STATES, dim_z=1)
        self.kalman.P = np.zeros((STATES, STATES))
        self.kalman.P[ATT, ATT] = 0.1**2 * self._by_rotation() @ self._by_rotation().T
        self.kalman.P[VEL, VEL], self.kalman.P[POS, POS] = np.diag(VARIANCES[:3]), np.diag(VARIANCES[3:])
        self.rotation = self._rotation()
        self.earth_rate_ned = np.array([7.292115e-5, 0.0, 0.0])
        self.learns_biases = self.learns_field = False

    def _by_rotation(self) -> Array:
        quats = np.tile(self.nominal[ATT], (3, 1))
        return product(quats, 0.5 * np.eye(4)[1:]).T

    def _rotation(self) -> Array:
        matrix: Array = quaternion.as_rotation_matrix(quaternion.from_float_array(self.nominal[ATT]))
        return matrix

    def _moved(self, states: Array, step: InertialStep) -> Array:
        """Return where states go, to first order of the small turn, shape (n, 22)."""
        moved = states.copy()
        turns = np.hstack([np.ones((len(states), 1)), 0.5 * (step.del_ang - states[:, GYRO])])
        moved[:, ATT] = product(states[:, ATT], turns)
        del_vels = step.del_vel - states[:, ACCEL]
        moved[:, VEL] += np.einsum("nij,nj->ni", earth_from_body(states[:, ATT]), del_vels)
        moved[:, POS] += DT * states[:, VEL]
        return moved

    def _transition(self, step: InertialStep) -> Array:
        there = self._moved(self.nominal + 0.5 * np.eye(STATES), step)
        here = self._moved(self.nominal - 0.5 * np.eye(STATES), step)
        transition: Array = (there - here).T
        return transition

    def predict(self, step: InertialStep) -> None:
        gyro_bias, accel_bias = self.nominal[GYRO], self.nominal[ACCEL]
        turn = step.del_ang - gyro_bias - self.rotation.T @ self.earth_rate_ned * DT
        del_vel = self.rotation @ (step.del_vel - accel_bias) + np.array([0.0, 0.0, GRAVITY_MSS * DT])
        quat = quaternion.from_float_array(self.nominal[ATT]) * quaternion.from_rotation_vector(turn)
        self.nominal[ATT] = quaternion.as_float_array(quat / abs(quat))
        self.nominal[POS] += DT * (self.nominal[VEL] + 0.5 * del_vel)
        self.nominal[VEL] += del_vel
        self.rotation = self._rotation()
        noise = np.zeros((STATES, STATES))
        noise[ATT, ATT] = (DT * NOISE.gyro) ** 2 * self._by_rotation() @ self._by_rotation().T
        noise[VEL, VEL] = (DT * NOISE.accel) ** 2 * np.eye(3)
        if self.learns_biases:
            noise[GYRO, GYRO] = (DT**2 * NOISE.gyro_bias) ** 2 * np.eye(3)
            noise[ACCEL, ACCEL] = (DT**2 * NOISE.accel_bias) ** 2 * np.eye(3)
        if self.learns_field:
            noise[EARTH, EARTH] = (DT * NOISE.earth_field) ** 2 * np.eye(3)
            noise[BODY, BODY] = (DT * NOISE.body_field) ** 2 * np.eye(3)
        self.kalman.predict(F=self._transition(step), Q=noise)
        if not self.learns_biases:
            self.clear(GYRO, 0.0)
            self.clear(ACCEL, 10 * MIN_ACCEL_VAR)
        self._limit()

    def update(self, row: Array, innovation: float, variance: float) -> None:
        self.kalman.update(-innovation, R=variance, H=row[np.newaxis])
        self.nominal += self.kalman.x[:, 0]
        self.nominal[ATT] /= np.linalg.norm(self.nominal[ATT])
        self.kalman.x = np.zeros((STATES, 1))
        self._limit()

    def _limit(self) -> None:
        cov = self.kalman.P
        lowest = max(MIN_ACCEL_VAR, MIN_ACCEL_VAR_RATIO * cov.diagonal()[ACCEL].max())
        for state in range(STATES):
            if VEL.start <= state < POS.stop:
                cov[state, state] = max(cov[state, state], MIN_VEL_POS_VAR)
            if ACCEL.start <= state < ACCEL.stop:
                cov[state, state] = max(cov[state, state], lowest)

    def clear(self, states: slice, variance: float) -> None:
        self.kalman.P[states] = 0.0
        self.kalman.P[:, states] = 0.0
        self.kalman.P[states, states] = variance * np.eye(states.stop - states.start)


class Flight:
    """A flight whose velocity and attitude sway, seen by sensors with biases and noise."""

    def __init__(self, seed: int) -> None:
        self._rng = np.random.default_rng(seed)
        self._quat = quaternion.one
        self.pos = np.zeros(3)
        self.vel = np.zeros(3)
        self._time_s = 0.0

    def step(self) -> InertialStep:
        time_s = self._time_s = self._time_s + DT
        rates = np.array([0.3 * math.sin(1.3 * time_s), 0.2 * math.cos(0.9 * time_s), 0.15])
        accel = np.array([1.5 * math.sin(0.8 * time_s), 1.0 * math.cos(0.5 * time_s), 0.7 * math.sin(0.3 * time_s)])
        force = self.rotation().T @ (accel - np.array([0.0, 0.0, GRAVITY_MSS]))
        self._quat = self._quat * quaternion.from_rotation_vector(rates * DT)
        self.pos = self.pos + DT * self.vel + 0.5 * DT**2 * accel
        self.vel = self.vel + DT * accel
        gyro_noise, accel_noise = self._rng.normal(0, 1e-5, 3), self._rng.normal(0, 1e-3, 3)
        del_vel = DT * (force + ACCEL_BIAS_MSS) + accel_noise
        return InertialStep(0, del_vel, DT * (rates + GYRO_BIAS_RAD_S) + gyro_noise, DT, DT)

    def rotation(self) -> Array:
        matrix: Array = quaternion.as_rotation_matrix(self._quat)
        return matrix

    def yaw(self) -> float:
        rotation = self.rotation()
        return math.atan2(rotation[1, 0], rotation[0, 0])

    def noise(self, sigma: float) -> Array:
        return self._rng.normal(0, sigma, 3)


def unit_row(index: int) -> Array:
    row = np.zeros(STATES)
    row[index] = 1.0
    return row


def field_row(state: ErrorState, axis: int) -> Array:
    """Return how the field along an axis of the body depends on the errors, but for the attitude."""
    row = unit_row(BODY.start + axis)
    row[EARTH] = state.rotation_now()[:, axis]
    return row


class Pair:
    """The filter and its reference, given the same; how far they are apart is looked at after every step."""

    def __init__(self) -> None:
        self.state = ErrorState(quaternion.one, VARIANCES)
        self.reference = Reference(quaternion.one)

    def predict(self, step: InertialStep) -> None:
        self.state.predict(step, NOISE, DT, aided=True, on_ground=False)
        self.reference.predict(step)

    def update_state(self, index: int, innovation: float, variance: float) -> None:
        assert self.state.update_state(index, innovation, variance)
        self.reference.update(unit_row(index), innovation, variance)

    def update(self, row: Array, innovation: float, variance: float) -> None:
        assert self.state.update(row, innovation, variance)
        self.reference.update(row, innovation, variance)

    def learn_biases(self) -> None:
        self.state.learn_biases(1.0, DT)
        self.reference.learns_biases = True
        self.reference.clear(GYRO, (math.radians(2.5) * DT) ** 2)
        self.reference.clear(ACCEL, (0.2 * DT) ** 2)

    def learn_field(self) -> None:
        self.state.learns_field = self.reference.learns_field = True
        for clear in (self.state.clear, self.reference.clear):
            clear(slice(EARTH.start, BODY.stop), 0.0025)

    def check(self) -> None:
        nominal = np.concatenate([quaternion.as_float_array(self.state.quat), self.state.states])
        cov, sigma = self.reference.kalman.P, np.sqrt(np.maximum(self.reference.kalman.P.diagonal(), 1e-30))
        assert np.allclose(nominal, self.reference.nominal, rtol=1e-9, atol=1e-10)
        assert np.abs((self.state.cov - cov) / np.outer(sigma, sigma)).max() < 1e-9


def measure(pair: Pair, flight: Flight, step_number: int) -> None:
    """Fuse velocity, position and yaw at 27 Hz, and the magnetic field at 10 Hz."""
    state = pair.state
    if step_number % 3 == 0:
        vel, pos = flight.vel + flight.noise(0.1), flight.pos + flight.noise(0.2)
        for axis in range(3):
            pair.update_state(VEL.start + axis, float(state.vel[axis] - vel[axis]), 0.01)
        for axis in range(3):
            pair.update_state(POS.start + axis, float(state.pos[axis] - pos[axis]), 0.04)
        innovation = math.remainder(state.yaw(by_321=True) - flight.yaw(), 2 * math.pi)
        pair.update(state.yaw_row(by_321=True), innovation, 0.04)
    if state.learns_field and step_number % 8 == 0:
        measured = flight.rotation().T @ FIELD_NED + flight.noise(0.01)
        for axis in range(3):
            predicted = state.rotation_now()[:, axis] @ state.earth_field + state.body_field[axis]
            pair.update(field_row(state, axis), float(predicted - measured[axis]), 0.0025)


@pytest.mark.slow
def test_a_minute_of_flight_is_that_of_filterpy() -> None:
    flight, pair = Flight(1), Pair()
    for step_number in range(round(SECONDS / DT)):
        if step_number == 400:
            pair.learn_biases()
        if step_number == 1600:
            pair.learn_field()
        pair.predict(flight.step())
        measure(pair, flight, step_number)
        pair.check()
    state = pair.state
    assert np.allclose(state.vel, flight.vel, atol=0.2)
    assert np.allclose(state.pos, flight.pos, atol=0.3)
    assert np.allclose(state.accel_bias / DT, ACCEL_BIAS_MSS, atol=0.1)
    assert np.allclose(state.gyro_bias / DT, GYRO_BIAS_RAD_S, atol=0.003)
    assert np.allclose(state.earth_field, FIELD_NED, atol=0.1)


@pytest.fixture(scope="module")
def settled() -> tuple[Array, Array]:
    """Nominal state and covariance after ten seconds of flight."""
    flight, pair = Flight(2), Pair()
    pair.learn_biases()
    pair.learn_field()
    for step_number in range(800):
        pair.predict(flight.step())
        measure(pair, flight, step_number)
    return pair.reference.nominal, pair.reference.kalman.P


def pair_of(settled: tuple[Array, Array]) -> Pair:
    pair, (nominal, cov) = Pair(), settled
    pair.learn_biases()
    pair.learn_field()
    pair.reference.nominal, pair.reference.kalman.P = nominal.copy(), cov.copy()
    pair.state.quat, pair.state.states = quaternion.from_float_array(nominal[ATT]), nominal[ATT.stop :].copy()
    pair.state.cov = cov.copy()
    pair.predict(InertialStep(0, np.array([0.01, 0.02, -0.12]), np.array([0.001, 0.002, 0.003]), DT, DT))
    return pair


ROWS = st.lists(st.floats(-3, 3), min_size=STATES, max_size=STATES).map(np.array)


@given(ROWS, st.floats(-0.01, 0.01), st.floats(1e-2, 10))
def test_any_update_is_that_of_filterpy(
    settled: tuple[Array, Array], row: Array, innovation: float, variance: float
) -> None:
    pair = pair_of(settled)
    pair.update(row, innovation, variance)
    pair.check()


@given(st.integers(0, STATES - 1), st.floats(-0.01, 0.01), st.floats(1e-2, 10))
def test_any_update_of_a_state_is_that_of_filterpy(
    settled: tuple[Array, Array], index: int, innovation: float, variance: float
) -> None:
    pair = pair_of(settled)
    pair.update_state(index, innovation, variance)
    pair.check()
