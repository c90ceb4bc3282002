# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the filter holds to be true: attitude, velocity, position, biases and magnetic fields, at the fusion horizon.

They are the first 22 of the firmware's 24 states (AP_NavEKF3/AP_NavEKF3_core.cpp); wind is left out. Nothing that is
not finite gets in.
"""

import math
from typing import Final

import numpy as np

from ekf_stub.filter import quaternions as quaternion
from ekf_stub.filter.attitude import matrix_of_quat, yaw_of
from ekf_stub.filter.inertial import GRAVITY_MSS, MIN_DT, Array, InertialStep
from ekf_stub.filter.states import ACCEL, ATT, BODY, EARTH, GYRO, POS, STATES, VEL, StateLimits, but_attitude, within
from ekf_stub.reports.core_report import Three

EARTH_RATE: Final = 7.292115e-5
MAX_ACCEL_WITHOUT_AIDING: Final = 5.0

_VELOCITY: Final = but_attitude(VEL)
_POSITION: Final = but_attitude(POS)
_DOWN: Final = _POSITION.stop - 1
_BIASES: Final = slice(but_attitude(GYRO).start, but_attitude(ACCEL).stop)


def down_of(states: Array) -> float:
    """Return the third of the position, m, of states of shape (18,)."""
    return states.item(_DOWN)


class _Part:
    """Three of the states. They are kept within limits, and are not set to what is not finite."""

    def __init__(self, states: slice) -> None:
        self._part = but_attitude(states)

    def __get__(self, state: "NominalState", _owner: type) -> Array:
        return state.states[self._part]

    def __set__(self, state: "NominalState", value: Array) -> None:
        if np.isfinite(value).all():
            states = state.states.copy()
            states[self._part] = value
            state.states = within(states, state.limits.lowest, state.limits.highest)
        else:
            state.refused += 1


class NominalState:
    """The states.

    Attributes:
        quat: attitude, body (FRD) to earth (NED).
        vel, pos: m/s and m, NED.
        gyro_bias, accel_bias: rad and m/s a step of the filter of average length.
        earth_field, body_field: magnetic fields of the earth (NED) and of the vehicle (body), Gauss.
        states: shape (18,), these six; replaced, never changed, as others hold parts of it.
        limits: of these, and of variances.
        rotation: body to earth, shape (3, 3), as of the last prediction.
        accel_filtered: earth-frame acceleration without gravity, m/s/s, slowly filtered.
        earth_rate_ned: rad/s.
        refused: how many steps, measurements and states were unsound.
    """

    vel = _Part(VEL)
    pos = _Part(POS)
    gyro_bias = _Part(GYRO)
    accel_bias = _Part(ACCEL)
    earth_field = _Part(EARTH)
    body_field = _Part(BODY)

    def __init__(self, quat: quaternion.quaternion) -> None:
        self.quat = quat
        self.states: Array = np.zeros(STATES - ATT.stop)
        self.limits = StateLimits()
        self.rotation: Array = matrix_of_quat(quat)
        self.accel_filtered: Array = np.zeros(3)
        self.earth_rate_ned: Array = np.array([EARTH_RATE, 0.0, 0.0])
        self.refused = 0

    def turn_of(self, step: InertialStep, dt_ekf_avg: float) -> Array:
        """Return by how much a step has turned the vehicle, rad, body, without the gyro's bias."""
        return step.del_ang - self.gyro_bias * (step.del_ang_dt / dt_ekf_avg)

    def move(self, step: InertialStep, dt_ekf_avg: float, *, aided: bool) -> None:
        """Move on by a step, with less than the measured acceleration if that is large and nothing aids."""
        # Number by number, which takes half the time that arrays of three take; products with a matrix are the BLAS's.
        dt, by_ang, by_vel = step.del_vel_dt, step.del_ang_dt / dt_ekf_avg, step.del_vel_dt / dt_ekf_avg
        vel_n, vel_e, vel_d, pos_n, pos_e, pos_d, gx, gy, gz, bx, by, bz, *fields = self.states.tolist()
        turn_x, turn_y, turn_z = self.earth_rate_ned.dot(self.rotation).tolist()
        x, y, z = step.del_ang.tolist()
        x, y, z = (
            x - gx * by_ang - turn_x * step.del_ang_dt,
            y - gy * by_ang - turn_y * step.del_ang_dt,
            z - gz * by_ang - turn_z * step.del_ang_dt,
        )
        vx, vy, vz = step.del_vel.tolist()
        north, east, down = self.rotation.dot(np.array((vx - bx * by_vel, vy - by * by_vel, vz - bz * by_vel))).tolist()
        down += GRAVITY_MSS * dt
        self.quat = (self.quat * (quaternion.quaternion(0.0, x, y, z) * 0.5).exp()).normalized()
        self.rotation = matrix_of_quat(self.quat)
        new = 0.05 / max(dt, MIN_DT)
        x, y, z = self.accel_filtered.tolist()
        x, y = 0.95 * x + new * north, 0.95 * y + new * east
        self.accel_filtered = np.array((x, y, 0.95 * z + new * down))
        horizontal = math.hypot(x, y)
        if not aided and horizontal > MAX_ACCEL_WITHOUT_AIDING:
            north, east = (speed * (MAX_ACCEL_WITHOUT_AIDING / horizontal) for speed in (north, east))
        moved = (
            *(vel_n + north, vel_e + east, vel_d + down),
            *(pos_n + dt * (vel_n + 0.5 * north), pos_e + dt * (vel_e + 0.5 * east), pos_d + dt * (vel_d + 0.5 * down)),
            *(gx, gy, gz, bx, by, bz, *fields),
        )
        self.states = within(np.array(moved), self.limits.lowest, self.limits.highest)

    def correct(self, error: Array) -> None:
        """Add to the states, of which the attitude's are components of the quaternion; shape (22,)."""
        corrected = self.quat + quaternion.quaternion(*error[ATT].tolist())
        if corrected.norm() > 0.0:
            self.quat = corrected.normalized()
        self.states = within(self.states + error[ATT.stop :], self.limits.lowest, self.limits.highest)

    def component(self, state: int) -> float:
        """Return one of the states by its number among all of them; not of the attitude."""
        return self.states.item(state - ATT.stop)

    @property
    def down(self) -> float:
        """The third of the position, m."""
        return self.states.item(_DOWN)

    def acceleration(self) -> float:
        """Return how large the filtered acceleration is, m/s/s."""
        x, y, z = self.accel_filtered.tolist()
        return math.sqrt(x * x + y * y + z * z)

    def bias_rates(self, dt_ekf_avg: float) -> tuple[Three, Three]:
        """Return the biases in rad/s and m/s/s, by the average length of a step in s."""
        gx, gy, gz, ax, ay, az = self.states[_BIASES].tolist()
        dt = dt_ekf_avg
        return (gx / dt, gy / dt, gz / dt), (ax / dt, ay / dt, az / dt)

    def rotation_now(self) -> Array:
        """Return the rotation from body to earth, shape (3, 3), with what was fused since the last prediction."""
        return matrix_of_quat(self.quat)

    def prefers_321(self) -> bool:
        """Return whether yaw is best measured by the x axis (3-2-1), not by the y axis (3-1-2)."""
        down_x, down_y, _ = self.rotation[2].tolist()
        return bool(abs(down_x) < abs(down_y))

    def yaw(self, *, by_321: bool) -> float:
        """Return yaw in rad, of one of the two sequences of rotation."""
        return yaw_of(self.quat, by_321=by_321)
