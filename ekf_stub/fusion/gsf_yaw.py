# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Yaw without a compass: by how the velocity of GPS goes with acceleration (AP_NavEKF/EKFGSF_yaw.cpp).

Five small filters start from five yaws. Each predicts velocity north and east, and so shows how wrong its yaw is; a
Gaussian sum of them is the estimate. All share a tilt, which a complementary filter takes from the accelerometers.
"""

import math
from typing import Final

import numpy as np

from ap_core.fmath import f32
from ekf_stub.filter.inertial import Array, InertialStep, limited
from ekf_stub.filter.release import REFERENCE, FilterRelease
from ekf_stub.reports.core_report import GsfReport, Three

MODELS: Final = 5
GRAVITY_MSS: Final = float(f32(9.80665))
GYRO_NOISE: Final = float(f32(0.1))  # rad/s
ACCEL_NOISE: Final = 2.0  # m/s/s
TILT_GAIN: Final = float(f32(0.2))  # 1/s
BIAS_GAIN: Final = float(f32(0.04))  # 1/s
ACCEL_FILTER_RATIO: Final = 10.0
MAX_BIAS: Final = math.radians(5.0)
MAX_RATE_FOR_BIAS: Final = float(f32(0.175))
MIN_VELOCITY_NOISE: Final = 0.5
MAX_RATIO: Final = 25.0
MIN_WEIGHT: Final = float(f32(1e-5))
_REST: Final = (0.0, 0.0, 0.0)
_STEP: Final = 2 * math.pi / MODELS
_FIRST_YAWS: Final = -math.pi + _STEP * (0.5 + np.arange(MODELS))
_VELOCITY: Final = slice(0, 2)
_YAW: Final = 2


def _cross(first: Three, second: Three) -> Three:
    x, y, z = first
    a, b, c = second
    return y * c - z * b, z * a - x * c, x * b - y * a


class GsfYaw:
    """The five filters.

    Attributes:
        gyro_bias: rad/s, body.
        is_running: velocity is being fused, and there is an estimate.
    """

    def __init__(self, release: FilterRelease = REFERENCE) -> None:
        self._asks_load = release.gsf_asks_load
        self.gyro_bias: Three = _REST
        self._accel: Three = _REST
        self._gain = 0.0
        self._down: Three | None = None  # in the body's frame
        self._may_run = False
        self._forget()

    def _forget(self) -> None:
        self.is_running = self._may_run = False
        self._states = np.zeros((MODELS, 3))  # velocity north and east, yaw
        self._states[:, _YAW] = _FIRST_YAWS
        self._cov = np.zeros((MODELS, 3, 3))
        self._cov[:, _YAW, _YAW] = (0.5 * _STEP) ** 2
        self._weights = np.full(MODELS, 1 / MODELS)
        self._innovations = np.zeros((MODELS, 2))
        self._north_east = np.zeros((2, MODELS, 3))  # the axes of the earth in each model's body frame
        self._motion = np.tile(np.eye(3), (MODELS, 1, 1))
        self._estimate: tuple[float, float] | None = None

    # Prediction

    def predict(self, step: InertialStep, *, may_run: bool) -> None:
        """Follow inertial data; ``may_run`` says whether velocity is to be fused (update)."""
        self._may_run = may_run
        keep = 1.0 - min(ACCEL_FILTER_RATIO * step.del_vel_dt * TILT_GAIN, 1.0)
        x, y, z = (step.del_vel / max(step.del_vel_dt, 1e-3)).tolist()
        if self._down is None:
            length = math.hypot(x, y, z)
            if 0.9 * GRAVITY_MSS < length < 1.1 * GRAVITY_MSS:
                self._accel, self._down = (x, y, z), (-x / length, -y / length, -z / length)
            return
        old_x, old_y, old_z = self._accel
        self._accel = keep * (old_x - x) + x, keep * (old_y - y) + y, keep * (old_z - z) + z
        turn = self._corrected_turn(step, self._down)
        self._turn_down(turn, self._down)
        if self.is_running:
            self._turn_north_east(turn)
            self._predict_models(step, self._down)
            self._estimate = None
            self.is_running = may_run

    def _corrected_turn(self, step: InertialStep, down: Three) -> Three:
        """Return by how much the body has turned, with what draws its tilt to the acceleration's."""
        norm = math.hypot(*self._accel)
        gain = self._gain = self._gain_at(norm / GRAVITY_MSS)
        pull = gain / norm if gain > 0 else 0.0
        x, y, z = _cross(down, self._accel)
        error_x, error_y, error_z = pull * x, pull * y, pull * z
        dt = step.del_ang_dt
        turn_x, turn_y, turn_z = step.del_ang.tolist()
        bias_x, bias_y, bias_z = self.gyro_bias
        if math.hypot(turn_x, turn_y, turn_z) < MAX_RATE_FOR_BIAS * dt:
            learned = BIAS_GAIN * dt
            bias_x = limited(bias_x - error_x * learned, -MAX_BIAS, MAX_BIAS)
            bias_y = limited(bias_y - error_y * learned, -MAX_BIAS, MAX_BIAS)
            bias_z = limited(bias_z - error_z * learned, -MAX_BIAS, MAX_BIAS)
            self.gyro_bias = bias_x, bias_y, bias_z
        return (
            turn_x + (error_x - bias_x) * dt,
            turn_y + (error_y - bias_y) * dt,
            turn_z + (error_z - bias_z) * dt,
        )

    def _gain_at(self, load: float) -> float:
        # FIRMWARE PARITY: up to 2025 it was asked of the last gain whether the load is too great or too small. The gain
        # is never so high: below 1 g the accelerometers never counted.
        asked = load if self._asks_load else self._gain
        if load > 1:
            return TILT_GAIN * (3 - 2 * load) ** 2 if asked <= 1.5 else 0.0
        return TILT_GAIN * (2 * load - 1) ** 2 if asked > 0.5 else 0.0

    def _turn_down(self, turn: Three, down: Three) -> None:
        across_x, across_y, across_z = _cross(down, turn)
        x, y, z = down[0] + across_x, down[1] + across_y, down[2] + across_z
        scale = 1.5 - 0.5 * (x * x + y * y + z * z)
        self._down = x * scale, y * scale, z * scale

    def _turn_north_east(self, turn: Three) -> None:
        x, y, z = turn
        axes = self._north_east.dot(np.array([[1.0, -z, y], [z, 1.0, -x], [-y, x, 1.0]]))
        self._north_east = axes * (1.5 - 0.5 * np.square(axes).sum(axis=2, keepdims=True))

    def _predict_models(self, step: InertialStep, down: Three) -> None:
        north, east = self._north_east
        if self._rolls_more(down):
            self._states[:, _YAW] = np.arctan2(east[:, 0], north[:, 0])
        else:
            self._states[:, _YAW] = np.arctan2(-north[:, 1], east[:, 1])
        change_north, change_east = self._north_east.dot(step.del_vel)
        self._states[:, 0] += change_north
        self._states[:, 1] += change_east
        self._motion[:, 0, _YAW], self._motion[:, 1, _YAW] = -change_east, change_north
        self._cov = self._motion @ self._cov @ self._motion.transpose(0, 2, 1)
        velocity_variance = (ACCEL_NOISE * step.del_vel_dt) ** 2
        self._cov += np.diag([velocity_variance, velocity_variance, (GYRO_NOISE * step.del_ang_dt) ** 2])

    @staticmethod
    def _rolls_more(down: Three) -> bool:
        """Return whether yaw is that of the x axis (3-2-1), not of the y axis (3-1-2)."""
        return abs(down[0]) < abs(down[1])

    # Fusion

    def fuse(self, north: float, east: float, accuracy: float) -> None:
        """Fuse a velocity in m/s, after the step's prediction; the first one starts the filters (fuseVelData)."""
        if not self._may_run or self._down is None:
            return
        variance = max(accuracy, MIN_VELOCITY_NOISE) ** 2
        if self.is_running:
            self.estimate()  # stands until the next prediction
            self._correct(np.array([north, east]), variance)
            return
        self._forget()
        self._states[:, _VELOCITY] = north, east
        self._cov[:, 0, 0] = self._cov[:, 1, 1] = variance
        self._align(self._down)
        self.is_running = True

    def _align(self, down: Three) -> None:
        """Turn each model's body to its yaw."""
        x, y, z = np.array(down) / math.hypot(*down)
        self._down = float(x), float(y), float(z)
        if self._rolls_more(self._down):
            right = np.array([0.0, z, -y]) / math.hypot(y, z)
            ahead = np.cross(right, self._down)
        else:
            ahead = np.array([z, 0.0, -x]) / math.hypot(x, z)
            right = np.cross(self._down, ahead)
        self._north_east = np.array([ahead, right])[:, None, :].repeat(MODELS, axis=1)
        self._turn_about_down(self._states[:, _YAW])

    def _turn_about_down(self, angles: Array) -> None:
        cosines, sines = np.cos(angles)[:, None], np.sin(angles)[:, None]
        north, east = self._north_east
        self._north_east = np.array([north * cosines - east * sines, north * sines + east * cosines])

    def _correct(self, measured: Array, variance: float) -> None:
        """Fuse a velocity in each model, and weigh the models again by how well they had predicted it."""
        innovations = self._innovations = self._states[:, _VELOCITY] - measured
        expected = self._cov[:, _VELOCITY, _VELOCITY] + variance * np.eye(2)
        inverse = np.linalg.inv(expected)
        gains = self._cov[:, :, _VELOCITY] @ inverse
        cov = self._cov - gains @ expected @ gains.transpose(0, 2, 1)
        self._cov = 0.5 * (cov + cov.transpose(0, 2, 1))
        # FIRMWARE PARITY: in this ratio north and east go together with the wrong sign.
        against = np.einsum("mi,mij,mj->m", innovations, inverse * [[1, -1], [-1, 1]], innovations)
        scales = np.sqrt(MAX_RATIO / np.maximum(against, MAX_RATIO))
        changes = -scales[:, None] * np.einsum("mij,mj->mi", gains, innovations)
        self._states = self._states + changes
        self._turn_about_down(changes[:, _YAW])
        ratios = np.einsum("mi,mij,mj->m", innovations, inverse, innovations)
        densities = np.exp(-0.5 * ratios) * np.sqrt(np.linalg.det(inverse)) / (2 * math.pi)
        weights = densities * self._weights
        if (weights < MIN_WEIGHT).all():
            self._forget()
            return
        weights = np.maximum(weights, MIN_WEIGHT)
        self._weights = weights / weights.sum()

    # What comes of it

    def estimate(self) -> tuple[float, float]:
        """Return yaw in rad and its variance, as of the last prediction."""
        if self._estimate is None:
            yaws = self._states[:, _YAW]
            yaw = math.atan2(self._weights.dot(np.sin(yaws)), self._weights.dot(np.cos(yaws)))
            apart = (yaws - yaw + math.pi) % (2 * math.pi) - math.pi
            self._estimate = yaw, float(self._weights.dot(self._cov[:, _YAW, _YAW] + apart * apart))
        return self._estimate

    def innovation_length(self) -> float:
        """Return how far the models' predictions of the last velocity were off on average, m/s."""
        return float(self._weights.dot(np.hypot(self._innovations[:, 0], self._innovations[:, 1])))

    def report(self) -> GsfReport | None:
        """Return what is logged of it; None while it is not running (Log_Write)."""
        if not self.is_running:
            return None
        yaw, variance = self.estimate()
        states, innovations = self._states, self._innovations
        return GsfReport(
            yaw,
            variance,
            tuple(states[:, _YAW].tolist()),
            tuple(self._weights.tolist()),
            tuple(innovations[:, 0].tolist()),
            tuple(innovations[:, 1].tolist()),
        )
