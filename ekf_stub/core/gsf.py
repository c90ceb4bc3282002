# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Yaw without a compass: by how the velocity of GPS goes with acceleration (AP_NavEKF/EKFGSF_yaw.cpp).

Five small filters start from five yaws. Each predicts velocity north and east, and so shows how wrong its yaw is; a
Gaussian sum of them is the estimate. All share a tilt, which a complementary filter takes from the accelerometers.
"""

import math
from typing import Final, final

from ekf_stub.core.inertial import Inertial
from ekf_stub.core.vectors import ZERO, Vec2, Vec3, cross, dot, larger, length, length2, limited, scaled, square

MODELS: Final = 5
_GRAVITY_MSS: Final = 9.806650161743164  # as the firmware has it in single precision, here and below
_GYRO_NOISE: Final = 0.10000000149011612  # rad/s
_ACCEL_NOISE: Final = 2.0  # m/s/s
_TILT_GAIN: Final = 0.20000000298023224  # 1/s
_BIAS_GAIN: Final = 0.03999999910593033  # 1/s
_ACCEL_FILTER_RATIO: Final = 10.0
_MAX_BIAS: Final = math.radians(5.0)
_MAX_RATE_FOR_BIAS: Final = 0.17499999701976776
_MIN_VELOCITY_NOISE: Final = 0.5
_MAX_RATIO: Final = 25.0
_MIN_WEIGHT: Final = 9.999999747378752e-06
_STEP: Final = 2 * math.pi / MODELS
_MAX_TURN: Final = 1.0  # rad in a step, of 80 rad/s; the axes are turned as if by a small angle


@final
class YawModel:
    """One of the five filters: velocity north and east, yaw, and their covariance.

    Attributes:
        north, east, yaw: m/s and rad.
        nn, ne, ny, ee, ey, yy: the covariance of these.
        innovation_north, innovation_east: prediction less measurement of the last velocity, m/s.
        weight: its share in the sum.
        axis_north, axis_east: the axes of the earth in the body's frame.
    """

    def __init__(self, number: int) -> None:
        self.north = 0.0
        self.east = 0.0
        self.yaw = -math.pi + _STEP * (0.5 + number)
        self.nn = 0.0
        self.ne = 0.0
        self.ny = 0.0
        self.ee = 0.0
        self.ey = 0.0
        self.yy = square(0.5 * _STEP)
        self.innovation_north = 0.0
        self.innovation_east = 0.0
        self.weight = 1.0 / MODELS
        self.axis_north: Vec3 = ZERO
        self.axis_east: Vec3 = ZERO

    def turn_body(self, turn: Vec3) -> None:
        """Turn the body by a small rotation, rad."""
        self.axis_north = _turned_axis(self.axis_north, turn)
        self.axis_east = _turned_axis(self.axis_east, turn)

    def turn_about_down(self, angle: float) -> None:
        """Turn the body about the vertical."""
        cosine, sine = math.cos(angle), math.sin(angle)
        north, east = self.axis_north, self.axis_east
        self.axis_north = (
            north[0] * cosine - east[0] * sine,
            north[1] * cosine - east[1] * sine,
            north[2] * cosine - east[2] * sine,
        )
        self.axis_east = (
            north[0] * sine + east[0] * cosine,
            north[1] * sine + east[1] * cosine,
            north[2] * sine + east[2] * cosine,
        )

    def predict(self, step: Inertial, rolls_more: bool) -> None:
        """Move on by a step; yaw is that of the x axis (3-2-1) if the vehicle rolls more than it pitches."""
        north, east = self.axis_north, self.axis_east
        self.yaw = math.atan2(east[0], north[0]) if rolls_more else math.atan2(-north[1], east[1])
        change_north, change_east = dot(north, step.del_vel), dot(east, step.del_vel)
        self.north += change_north
        self.east += change_east
        # F P F' where velocity changes with yaw by (-east, north).
        a, b = -change_east, change_north
        ny, ey, yy = self.ny + a * self.yy, self.ey + b * self.yy, self.yy
        self.nn += a * (self.ny + ny)
        self.ne += b * self.ny + a * ey
        self.ee += b * (self.ey + ey)
        velocity_var = square(_ACCEL_NOISE * step.del_vel_dt)
        self.nn += velocity_var
        self.ee += velocity_var
        self.ny, self.ey, self.yy = ny, ey, yy + square(_GYRO_NOISE * step.del_ang_dt)

    def correct(self, north: float, east: float, variance: float) -> float:
        """Fuse a velocity; return the weight that it gives the filter, 0 where nothing can be reckoned."""
        dn, de = self.north - north, self.east - east
        self.innovation_north, self.innovation_east = dn, de
        s_nn, s_ee, s_ne = self.nn + variance, self.ee + variance, self.ne
        det = s_nn * s_ee - s_ne * s_ne
        if not 0.0 < det < math.inf:
            return 0.0
        i_nn, i_ee, i_ne = s_ee / det, s_nn / det, -s_ne / det
        # Gains K = P H' S^-1, a row each for north, east and yaw.
        kn_n, kn_e = self.nn * i_nn + self.ne * i_ne, self.nn * i_ne + self.ne * i_ee
        ke_n, ke_e = self.ne * i_nn + self.ee * i_ne, self.ne * i_ne + self.ee * i_ee
        ky_n, ky_e = self.ny * i_nn + self.ey * i_ne, self.ny * i_ne + self.ey * i_ee
        # P - K S K', where S K' = H P.
        nn, ne, ny, ee, ey = self.nn, self.ne, self.ny, self.ee, self.ey
        self.nn -= kn_n * nn + kn_e * ne
        self.ne -= kn_n * ne + kn_e * ee
        self.ny -= kn_n * ny + kn_e * ey
        self.ee -= ke_n * ne + ke_e * ee
        self.ey -= ke_n * ny + ke_e * ey
        self.yy -= ky_n * ny + ky_e * ey
        # FIRMWARE PARITY: in this ratio north and east go together with the wrong sign.
        against = dn * dn * i_nn - 2 * dn * de * i_ne + de * de * i_ee
        scale = -math.sqrt(_MAX_RATIO / larger(against, _MAX_RATIO))
        self.north += scale * (kn_n * dn + kn_e * de)
        self.east += scale * (ke_n * dn + ke_e * de)
        turn = scale * (ky_n * dn + ky_e * de)
        self.yaw += turn
        self.turn_about_down(turn)
        ratio = dn * dn * i_nn + 2 * dn * de * i_ne + de * de * i_ee
        if not ratio >= 0.0:
            return 0.0
        return math.exp(-0.5 * ratio) * math.sqrt(1.0 / det) / (2 * math.pi) * self.weight


@final
class GsfYaw:
    """The five filters.

    Args:
        asks_load: see ``FilterRelease.gsf_asks_load``.

    Attributes:
        gyro_bias: rad/s, body.
        is_running: velocity is being fused, and there is an estimate.
        models: the filters.
    """

    def __init__(self, asks_load: bool) -> None:
        self._asks_load = asks_load
        self.gyro_bias: Vec3 = ZERO
        self._accel: Vec3 = ZERO
        self._gain = 0.0
        self._has_tilt = False
        self._down: Vec3 = ZERO  # in the body's frame
        self._forget()

    def _forget(self) -> None:
        self.is_running = False
        self._may_run = False
        self.models = [YawModel(number) for number in range(MODELS)]
        self._has_estimate = False
        self._estimate: Vec2 = (0.0, 0.0)

    # Prediction

    def predict(self, step: Inertial, may_run: bool) -> None:
        """Follow inertial data; ``may_run`` says whether velocity is to be fused (update)."""
        self._may_run = may_run
        share = _ACCEL_FILTER_RATIO * step.del_vel_dt * _TILT_GAIN
        keep = 1.0 - (share if share < 1.0 else 1.0)
        x, y, z = scaled(step.del_vel, 1.0 / larger(step.del_vel_dt, 1e-3))
        if not self._has_tilt:
            size = length((x, y, z))
            if 0.9 * _GRAVITY_MSS < size < 1.1 * _GRAVITY_MSS:
                self._accel, self._down = (x, y, z), (-x / size, -y / size, -z / size)
                self._has_tilt = True
            return
        old_x, old_y, old_z = self._accel
        self._accel = keep * (old_x - x) + x, keep * (old_y - y) + y, keep * (old_z - z) + z
        turn = self._corrected_turn(step)
        if not length(turn) < _MAX_TURN:
            # FIRMWARE PARITY: the firmware's axes grow from here on, until nothing of them is a number any more.
            self._forget()
            self._has_tilt = False
            return
        self._down = _turned_axis(self._down, turn)
        if self.is_running:
            rolls_more = self._rolls_more()
            for model in self.models:
                model.turn_body(turn)
                model.predict(step, rolls_more)
            self._has_estimate = False
            self.is_running = may_run

    def _corrected_turn(self, step: Inertial) -> Vec3:
        """Return by how much the body has turned, with what draws its tilt to the acceleration's."""
        size = length(self._accel)
        gain = self._gain_at(size / _GRAVITY_MSS)
        self._gain = gain
        pull = gain / size if gain > 0 else 0.0
        error_x, error_y, error_z = scaled(cross(self._down, self._accel), pull)
        dt = step.del_ang_dt
        turn_x, turn_y, turn_z = step.del_ang
        if length(step.del_ang) < _MAX_RATE_FOR_BIAS * dt:
            learned = _BIAS_GAIN * dt
            self.gyro_bias = (
                limited(self.gyro_bias[0] - error_x * learned, -_MAX_BIAS, _MAX_BIAS),
                limited(self.gyro_bias[1] - error_y * learned, -_MAX_BIAS, _MAX_BIAS),
                limited(self.gyro_bias[2] - error_z * learned, -_MAX_BIAS, _MAX_BIAS),
            )
        bias_x, bias_y, bias_z = self.gyro_bias
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
            return _TILT_GAIN * square(3 - 2 * load) if asked <= 1.5 else 0.0
        return _TILT_GAIN * square(2 * load - 1) if asked > 0.5 else 0.0

    def _rolls_more(self) -> bool:
        return abs(self._down[0]) < abs(self._down[1])

    # Fusion

    def fuse(self, north: float, east: float, accuracy: float) -> None:
        """Fuse a velocity in m/s, after the step's prediction; the first one starts the filters (fuseVelData)."""
        if not self._may_run or not self._has_tilt:
            return
        variance = square(larger(accuracy, _MIN_VELOCITY_NOISE))
        if self.is_running:
            self.estimate()  # stands until the next prediction
            self._correct(north, east, variance)
            return
        self._forget()
        for model in self.models:
            model.north, model.east = north, east
            model.nn, model.ee = variance, variance
        self._align()
        self.is_running = True

    def _align(self) -> None:
        """Turn each model's body to its yaw."""
        x, y, z = scaled(self._down, 1.0 / length(self._down))
        down = x, y, z
        self._down = down
        if self._rolls_more():
            right = scaled((0.0, z, -y), 1.0 / length2(y, z))
            ahead = cross(right, down)
        else:
            ahead = scaled((z, 0.0, -x), 1.0 / length2(x, z))
            right = cross(down, ahead)
        for model in self.models:
            model.axis_north, model.axis_east = ahead, right
            model.turn_about_down(model.yaw)

    def _correct(self, north: float, east: float, variance: float) -> None:
        """Fuse a velocity in each model, and weigh the models again by how well they had predicted it."""
        are_all_light = True
        for model in self.models:
            model.weight = model.correct(north, east, variance)
            if not model.weight < _MIN_WEIGHT:
                are_all_light = False
        if are_all_light:
            self._forget()
            return
        total = 0.0
        for model in self.models:
            model.weight = larger(model.weight, _MIN_WEIGHT)
            total += model.weight
        for model in self.models:
            model.weight /= total

    # What comes of it

    def estimate(self) -> Vec2:
        """Return yaw in rad and its variance, as of the last prediction."""
        if not self._has_estimate:
            sine, cosine = 0.0, 0.0
            for model in self.models:
                sine += model.weight * math.sin(model.yaw)
                cosine += model.weight * math.cos(model.yaw)
            yaw = math.atan2(sine, cosine)
            variance = 0.0
            for model in self.models:
                apart = (model.yaw - yaw + math.pi) % (2 * math.pi) - math.pi
                variance += model.weight * (model.yy + apart * apart)
            self._estimate, self._has_estimate = (yaw, variance), True
        return self._estimate

    def innovation_length(self) -> float:
        """Return how far the models' predictions of the last velocity were off on average, m/s."""
        total = 0.0
        for model in self.models:
            total += model.weight * length2(model.innovation_north, model.innovation_east)
        return total


def _turned_axis(axis: Vec3, turn: Vec3) -> Vec3:
    """Return an axis of the earth after a small rotation of the body, rad, with a length of 1 again."""
    across = cross(axis, turn)
    x, y, z = axis[0] + across[0], axis[1] + across[1], axis[2] + across[2]
    scale = 1.5 - 0.5 * (x * x + y * y + z * z)
    return x * scale, y * scale, z * scale
