# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The filter: attitude, velocity, position and two biases, and the covariance of their 15 errors.

The firmware's filter has 24 states with a quaternion among them (AP_NavEKF3/AP_NavEKF3_core.cpp). Here the errors of
the attitude are three angles in the body frame, and magnetic field and wind are left out. Process noise, limits and
order are the firmware's.
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import quaternion

from ekf_stub.inertial import Array, InertialStep, limited, quat_of_rotation

ATT: Final = slice(0, 3)
VEL: Final = slice(3, 6)
POS: Final = slice(6, 9)
GYRO: Final = slice(9, 12)
ACCEL: Final = slice(12, 15)
STATES: Final = 15

GRAVITY_MSS: Final = 9.80665
INITIAL_ATT_VAR: Final = 0.1**2
INITIAL_GYRO_BIAS_DEG_S: Final = 2.5
ACCEL_BIAS_LIM_SCALER: Final = 0.2
MIN_VEL_POS_VAR: Final = 1e-4
MAX_VEL_VAR: Final = 1e3
MAX_POS_VAR: Final = 1e6
MAX_GYRO_BIAS: Final = 0.175
MIN_SAFE_ACCEL_VAR: Final = 5e-9
MAX_ACCEL_WITHOUT_AIDING: Final = 5.0
OBSERVABLE_COSINE: Final = 0.8

_EYE3: Final = np.eye(3)


@dataclass(frozen=True, slots=True)
class ProcessNoise:
    """Noise densities as the parameters EK3_GYRO_P_NSE, ACC_P_NSE, GBIAS_P_NSE and ABIAS_P_NSE give them."""

    gyro: float
    accel: float
    gyro_bias: float
    accel_bias: float


def skew(v: Array) -> Array:
    """Return the matrix whose product with a vector is the cross product."""
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def euler_of(quat: quaternion.quaternion) -> tuple[float, float, float]:
    """Return roll, pitch and yaw (3-2-1) in rad."""
    w, x, y, z = quat.w, quat.x, quat.y, quat.z
    return (
        math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)),
        math.asin(limited(2 * (w * y - z * x), -1.0, 1.0)),
        math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)),
    )


def quat_of_euler(roll: float, pitch: float, yaw: float) -> quaternion.quaternion:
    """Return the quaternion, body (FRD) to earth (NED), of roll, pitch and yaw in rad."""
    axes = ((0.0, 0.0, 0.5 * yaw), (0.0, 0.5 * pitch, 0.0), (0.5 * roll, 0.0, 0.0))
    about_z, about_y, about_x = (np.exp(quaternion.quaternion(0.0, *axis)) for axis in axes)
    return about_z * about_y * about_x


class ErrorState:
    """Nominal state and error covariance at the fusion horizon.

    Args:
        quat: attitude, body (FRD) to earth (NED).
        variances: initial variances of velocity and position, shape (6,), (m/s)^2 and m^2.

    Attributes:
        quat: the attitude.
        vel, pos: m/s and m, NED.
        gyro_bias, accel_bias: rad and m/s a step of the filter of average length.
        cov: shape (15, 15), of the errors of attitude (rad, body), velocity, position and the biases.
        learns_biases: whether the biases are estimated.
        rotation: body to earth, shape (3, 3), as of the last prediction.
        predicted_tilt_variance: of the direction of down, rad^2, as of the last prediction.
        accel_filtered: earth-frame acceleration without gravity, m/s/s, slowly filtered.
    """

    def __init__(self, quat: quaternion.quaternion, variances: Array) -> None:
        self.quat = quat
        self.vel: Array = np.zeros(3)
        self.pos: Array = np.zeros(3)
        self.gyro_bias: Array = np.zeros(3)
        self.accel_bias: Array = np.zeros(3)
        self.cov: Array = np.zeros((STATES, STATES))
        self.cov[np.diag_indices(9)] = np.concatenate([np.full(3, INITIAL_ATT_VAR), variances])
        self.learns_biases = False
        self.rotation: Array = quaternion.as_rotation_matrix(quat)
        self.accel_filtered: Array = np.zeros(3)
        self.predicted_tilt_variance = self.tilt_variance()
        self._frozen_accel_vars: list[float | None] = [None, None, None]

    def learn_biases(self, accel_bias_limit: float, dt_ekf_avg: float) -> None:
        """Begin to estimate the biases, as tilt has been aligned (setWindMagStateLearningMode)."""
        self.learns_biases = True
        self.clear(GYRO, (math.radians(INITIAL_GYRO_BIAS_DEG_S) * dt_ekf_avg) ** 2)
        self.clear(ACCEL, (ACCEL_BIAS_LIM_SCALER * accel_bias_limit * dt_ekf_avg) ** 2)

    def predict(
        self, step: InertialStep, noise: ProcessNoise, dt_ekf_avg: float, *, aided: bool, on_ground: bool
    ) -> None:
        """Move state and covariance on by a step."""
        angle = step.del_ang - self.gyro_bias * (step.del_ang_dt / dt_ekf_avg)
        velocity = step.del_vel - self.accel_bias * (step.del_vel_dt / dt_ekf_avg)
        rotation_before = self.rotation
        turn = quat_of_rotation(angle)
        self._predict_state(step, turn, rotation_before @ velocity, aided=aided)
        dt = limited(0.5 * (step.del_ang_dt + step.del_vel_dt), 0.5 * dt_ekf_avg, 2.0 * dt_ekf_avg)
        self._predict_covariance(turn, rotation_before, velocity, noise, dt)
        self._limit(dt_ekf_avg, on_ground=on_ground)
        self.predicted_tilt_variance = self.tilt_variance()

    def _predict_state(
        self, step: InertialStep, turn: quaternion.quaternion, del_vel_ned: Array, *, aided: bool
    ) -> None:
        self.quat = (self.quat * turn).normalized()
        self.rotation = quaternion.as_rotation_matrix(self.quat)
        del_vel_ned[2] += GRAVITY_MSS * step.del_vel_dt
        self.accel_filtered = 0.95 * self.accel_filtered + 0.05 / step.del_vel_dt * del_vel_ned
        horizontal = math.hypot(self.accel_filtered[0], self.accel_filtered[1])
        if not aided and horizontal > MAX_ACCEL_WITHOUT_AIDING:
            del_vel_ned[:2] *= MAX_ACCEL_WITHOUT_AIDING / horizontal
        before = self.vel
        self.vel = before + del_vel_ned
        self.pos = self.pos + (0.5 * step.del_vel_dt) * (self.vel + before)

    def _predict_covariance(
        self, turn: quaternion.quaternion, rotation: Array, velocity: Array, noise: ProcessNoise, dt: float
    ) -> None:
        transition = np.eye(STATES)
        transition[ATT, ATT] = quaternion.as_rotation_matrix(turn).T
        transition[ATT, GYRO] = -_EYE3
        transition[VEL, ATT] = -rotation @ skew(velocity)
        transition[VEL, ACCEL] = -rotation
        transition[POS, VEL] = dt * _EYE3
        cov = transition @ self.cov @ transition.T
        diagonal = np.einsum("ii->i", cov)
        diagonal[ATT] += (dt * noise.gyro) ** 2
        diagonal[VEL] += (dt * noise.accel) ** 2
        if self.learns_biases:
            diagonal[GYRO] += (dt * dt * noise.gyro_bias) ** 2
            diagonal[ACCEL] += (dt * dt * noise.accel_bias) ** 2
        self.cov = 0.5 * (cov + cov.T)

    def _limit(self, dt_ekf_avg: float, *, on_ground: bool) -> None:
        """Keep variances within the firmware's limits (ConstrainVariances)."""
        self._limit_kinematic()
        if not self.learns_biases:
            self.clear(GYRO, 0.0)
            self.clear(ACCEL, 10 * MIN_SAFE_ACCEL_VAR)
            return
        diagonal = np.einsum("ii->i", self.cov)
        np.clip(diagonal[GYRO], 0.0, (MAX_GYRO_BIAS * dt_ekf_avg) ** 2, out=diagonal[GYRO])
        lowest = max(0.01 * float(diagonal[ACCEL].max()), MIN_SAFE_ACCEL_VAR)
        np.clip(diagonal[ACCEL], lowest, (10.0 * dt_ekf_avg) ** 2, out=diagonal[ACCEL])
        for axis in range(3):
            self._freeze_unobservable(axis, on_ground=on_ground)

    def _freeze_unobservable(self, axis: int, *, on_ground: bool) -> None:
        # On the ground only the bias of an axis that points along gravity can be told from tilt.
        state = ACCEL.start + axis
        observable = abs(self.rotation[2, axis]) > OBSERVABLE_COSINE or not on_ground
        frozen = self._frozen_accel_vars[axis]
        if not observable:
            if frozen is None:
                self._frozen_accel_vars[axis] = float(self.cov[state, state])
            self.clear(slice(state, state + 1), 0.0)
        elif frozen is not None:
            self.cov[state, state] = frozen
            self._frozen_accel_vars[axis] = None

    def _limit_kinematic(self) -> None:
        diagonal = np.einsum("ii->i", self.cov)
        np.clip(diagonal[ATT], 0.0, 1.0, out=diagonal[ATT])
        np.clip(diagonal[VEL], MIN_VEL_POS_VAR, MAX_VEL_VAR, out=diagonal[VEL])
        np.clip(diagonal[POS], MIN_VEL_POS_VAR, MAX_POS_VAR, out=diagonal[POS])

    def update(self, row: Array, innovation: float, variance: float) -> bool:
        """Fuse a scalar; tell whether it was, as it is not when a variance would become negative.

        Args:
            row: shape (15,), how the prediction depends on the errors.
            innovation: prediction less measurement.
            variance: of the measurement.
        """
        spread = self.cov @ row
        gain = spread / (float(row @ spread) + variance)
        cov = self.cov - np.outer(gain, spread)
        cov = 0.5 * (cov + cov.T)
        if cov.diagonal().min() < 0:
            return False
        self.cov = cov
        self._limit_kinematic()
        self._inject(-innovation * gain)
        return True

    def _inject(self, error: Array) -> None:
        self.quat = (self.quat * quat_of_rotation(error[ATT])).normalized()
        self.vel = self.vel + error[VEL]
        self.pos = self.pos + error[POS]
        self.gyro_bias = self.gyro_bias + error[GYRO]
        self.accel_bias = self.accel_bias + error[ACCEL]

    def clear(self, states: slice, variance: float) -> None:
        """Forget what some errors have to do with others, and give them a variance."""
        self.cov[states, :] = 0.0
        self.cov[:, states] = 0.0
        for state in range(states.start, states.stop):
            self.cov[state, state] = variance

    def yaw_row(self) -> Array:
        """Return how yaw depends on the errors, shape (15,)."""
        roll, pitch, _ = euler_of(self.quat)
        row = np.zeros(STATES)
        row[1:3] = math.sin(roll) / math.cos(pitch), math.cos(roll) / math.cos(pitch)
        return row

    def set_yaw(self, yaw: float, variance: float) -> quaternion.quaternion:
        """Set yaw, keep roll, pitch and how well they are known; return the rotation, earth to earth."""
        roll, pitch, _ = euler_of(self.quat)
        turned = quat_of_euler(roll, pitch, yaw)
        turn = turned * self.quat.conjugate()
        tilt_variance = 0.5 * self.tilt_variance()
        self.quat = turned
        self.rotation = quaternion.as_rotation_matrix(turned)
        self.clear(ATT, 0.0)
        earth = np.diag([tilt_variance, tilt_variance, variance])
        self.cov[ATT, ATT] = self.rotation.T @ earth @ self.rotation
        return turn

    def tilt_variance(self) -> float:
        """Return the variance of the direction of down, rad^2 (calcTiltErrorVariance)."""
        rotation = quaternion.as_rotation_matrix(self.quat)
        earth = rotation @ self.cov[ATT, ATT] @ rotation.T
        return float(earth[0, 0] + earth[1, 1])
