# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Carries the filter's state from the fusion horizon to the present (AP_NavEKF3_core.cpp, calcOutputStates).

It integrates the newest inertial data, and follows the filter by comparing what it said at the horizon with what the
filter says now. Vectors are pure quaternions, for speed; see `ekf_stub.filter.inertial`.
"""

import math
from collections import deque
from collections.abc import Callable
from typing import Final, NamedTuple, Protocol

import numpy as np

from ekf_stub.filter import quaternions as quaternion
from ekf_stub.filter.error_state import ErrorState
from ekf_stub.filter.inertial import GRAVITY_MSS, LOOP_DT, Array, InertialDelta, limited, pure_quat
from ekf_stub.filter.states import HIGHEST_POS, HIGHEST_VEL, LOWEST_POS, LOWEST_VEL, POS, but_attitude, within

ATTITUDE_GAIN: Final = 0.5
INTEGRAL_GAIN: Final = 0.1
BAD_ACCEL_INTEGRAL_GAIN: Final = 0.07
_END_OF_POS: Final = but_attitude(POS).stop


class Output(NamedTuple):
    """Attitude (body to earth), and velocity and position (NED) as pure quaternions."""

    quat: quaternion.quaternion
    pure_vel: quaternion.quaternion
    pure_pos: quaternion.quaternion

    @property
    def vel(self) -> Array:
        """Velocity, m/s, NED."""
        vel: Array = self.pure_vel.vec
        return vel

    @property
    def pos(self) -> Array:
        """Position, m, NED."""
        pos: Array = self.pure_pos.vec
        return pos


class OutputChanges(Protocol):
    """What resets do to an output, given what changes it now and in the history."""

    def _change(self, change: Callable[[Output], Output]) -> None: ...

    def shift(self, pos: Array) -> None:
        """Add to position, now and in the history; not what is not finite."""
        self._change(lambda output: _moved(output, output.pos + pos, output.vel))

    def overwrite(self, *, pos: dict[int, float] | None = None, vel: dict[int, float] | None = None) -> None:
        """Set components of position and velocity by their index, now and in the history; not to what is not finite."""
        self._change(lambda output: _moved(output, _with(output.pos, pos or {}), _with(output.vel, vel or {})))

    def rotate(self, turn: quaternion.quaternion) -> None:
        """Turn the attitude, earth to earth, now and in the history."""
        self._change(lambda output: output._replace(quat=(turn * output.quat).normalized()))

    def restart_height_filter(self, *, vel: float | None = None) -> None:
        """Let the filtered height begin at the present one, and its rate at a velocity, as height is reset."""


class OutputState(OutputChanges, Protocol):
    """The present state as others see it.

    Attributes:
        now: attitude, velocity and position.
        height_rate: d(down)/dt, m/s, of height and vertical acceleration through a complementary filter.
        angle_error, vel_error, pos_error: how far it was from the filter at the last step: rad, m/s, m.
    """

    @property
    def now(self) -> Output: ...
    @property
    def height_rate(self) -> float: ...
    @property
    def angle_error(self) -> float: ...
    @property
    def vel_error(self) -> float: ...
    @property
    def pos_error(self) -> float: ...


class OutputPredictor(OutputChanges):
    """The state at the present time, and its history back to the horizon, ``length`` steps."""

    def __init__(self, state: ErrorState, length: int) -> None:
        self.now = Output(state.quat, pure_quat(state.vel), pure_quat(state.pos))
        self._history: deque[Output] = deque([self.now] * length, maxlen=length)
        self._angle_correction = self._pos_integral = self._vel_integral = quaternion.zero
        self.angle_error = self.vel_error = self.pos_error = 0.0
        self.height_rate: float = self.now.pure_vel.z
        self._filtered_down: float = self.now.pure_pos.z
        self._filtered_accel = 0.0
        self._filter_hz, self._omegas = math.nan, (0.0, 0.0, 0.0)
        self._states = state.states
        self._pure_biases = pure_quat(state.gyro_bias), pure_quat(state.accel_bias)
        self._delta: InertialDelta | None = None
        self._dt_ekf_avg = 0.0
        self._turn = self._velocity = self._by_gravity = quaternion.zero

    def integrate(
        self, delta: InertialDelta, state: ErrorState, dt_ekf_avg: float, *, height_filter_hz: float = 2.0
    ) -> None:
        """Move on by a pass of the main loop, whose inertial data must be sound."""
        before_quat, before_vel, before_pos = self.now
        dt = delta.del_vel_dt
        if state.states is not self._states:  # which most passes of the main loop leave as they are
            self._states, self._delta = state.states, None
            self._pure_biases = pure_quat(state.gyro_bias), pure_quat(state.accel_bias)
        if delta is not self._delta or dt_ekf_avg != self._dt_ekf_avg:  # which are the same while a vehicle is at rest
            self._delta, self._dt_ekf_avg = delta, dt_ekf_avg
            gyro_bias, accel_bias = self._pure_biases
            angle = delta.pure_ang - gyro_bias * (delta.del_ang_dt / dt_ekf_avg)
            self._turn = ((angle + self._angle_correction) * 0.5).exp()
            self._velocity = delta.pure_vel - accel_bias * (dt / dt_ekf_avg)
            self._by_gravity = quaternion.quaternion(0.0, 0.0, 0.0, GRAVITY_MSS * dt)
        quat = (before_quat * self._turn).normalized()
        del_vel = quat * self._velocity * quat.conjugate() + self._by_gravity
        self._filter_height(before_pos.z, del_vel.z, dt, height_filter_hz)
        vel = before_vel + del_vel
        self.now = Output(quat, vel, before_pos + (vel + before_vel) * (0.5 * dt))

    def _filter_height(self, down: float, del_vel_down: float, dt: float, filter_hz: float) -> None:
        if filter_hz != self._filter_hz:
            self._filter_hz = filter_hz
            omega = 2 * math.pi * limited(filter_hz, 0.1, 30.0)
            self._omegas = omega, omega**2, omega**3
        omega, squared, cubed = self._omegas
        error = limited(down - self._filtered_down, -1e5, 1e5)
        accel = self._filtered_accel = self._filtered_accel + error * cubed * dt
        rate = self.height_rate = self.height_rate + (del_vel_down + (accel + error * squared * 3) * dt)
        self._filtered_down += (rate + error * omega * 3) * dt

    def follow(self, state: ErrorState, *, delay_s: float, tau_s: float, dt_ekf_avg: float) -> None:
        """Steer towards the filter, once a step; velocity and position all along the history.

        The horizon lies ``delay_s`` back; ``tau_s`` is the time constant of velocity and position.
        """
        self._history.append(self.now)
        delayed = self._history[0]
        error = (delayed.quat.conjugate() * state.quat).normalized()
        attitude_gain = ATTITUDE_GAIN / max(delay_s, LOOP_DT) * LOOP_DT
        self._angle_correction = (error - error.conjugate()) * (attitude_gain if error.w >= 0 else -attitude_gain)
        self._delta = None
        gain = dt_ekf_avg / limited(tau_s, dt_ekf_avg, 10.0)
        vel_x, vel_y, vel_z, pos_x, pos_y, pos_z = state.states[:_END_OF_POS].tolist()
        pos_error = quaternion.quaternion(0.0, pos_x, pos_y, pos_z) - delayed.pure_pos
        vel_error = quaternion.quaternion(0.0, vel_x, vel_y, vel_z) - delayed.pure_vel
        self.angle_error = 2.0 * math.hypot(error.x, error.y, error.z)
        self.vel_error, self.pos_error = vel_error.abs(), pos_error.abs()
        self._pos_integral += pos_error
        counted = vel_error
        if state.accel_is_bad:  # vertically what counts is how far the present velocity is from that at the horizon
            counted = quaternion.quaternion(0.0, vel_error.x, vel_error.y, vel_z - self.now.pure_vel.z)
        self._vel_integral += counted
        by_integral = INTEGRAL_GAIN * gain * gain
        pos = pos_error * gain + self._pos_integral * by_integral
        vel = vel_error * gain + self._vel_integral * by_integral
        if state.accel_is_bad:
            down = vel_error.z * gain + self._vel_integral.z * (BAD_ACCEL_INTEGRAL_GAIN * gain * gain)
            vel = quaternion.quaternion(0.0, vel.x, vel.y, down)
        self._history = deque(
            [Output(quat, its_vel + vel, its_pos + pos) for quat, its_vel, its_pos in self._history],
            maxlen=self._history.maxlen,
        )
        self.now = self._history[-1]

    def restart_height_filter(self, *, vel: float | None = None) -> None:
        self._filtered_down = self.now.pure_pos.z
        if vel is not None:
            self.height_rate = vel

    def _change(self, change: Callable[[Output], Output]) -> None:
        is_newest = bool(self._history) and self._history[-1] is self.now
        self._history = deque(map(change, self._history), maxlen=self._history.maxlen)
        self.now = self._history[-1] if is_newest else change(self.now)


def _with(vector: Array, components: dict[int, float]) -> Array:
    changed = vector.copy()
    for index, value in components.items():
        changed[index] = value
    return changed


def _moved(output: Output, pos: Array, vel: Array) -> Output:
    pos = within(pos, LOWEST_POS, HIGHEST_POS) if np.isfinite(pos).all() else output.pos
    vel = within(vel, LOWEST_VEL, HIGHEST_VEL) if np.isfinite(vel).all() else output.vel
    return Output(output.quat, pure_quat(vel), pure_quat(pos))
