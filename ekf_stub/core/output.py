# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The filter's state carried from the fusion horizon to the present (AP_NavEKF3_core.cpp, calcOutputStates).

The output predictor integrates the newest inertial data, and follows the filter by comparing what it said at the
horizon with what the filter says now.
"""

import math
from typing import Final, final

from ekf_stub.core.inertial import GRAVITY_MSS, LOOP_DT, Inertial
from ekf_stub.core.state import State, within_pos, within_vel
from ekf_stub.core.vectors import (
    ZERO,
    Quat,
    Vec3,
    add,
    conjugate,
    is_finite,
    larger,
    length,
    limited,
    normalized,
    rotated,
    scaled,
    sub,
    times,
    turned,
)

_ATTITUDE_GAIN: Final = 0.5
_INTEGRAL_GAIN: Final = 0.1
_BAD_ACCEL_INTEGRAL_GAIN: Final = 0.07
_MAX_DOWN_ERROR_M: Final = 1e5


@final
class Output:
    """Attitude, body (FRD) to earth (NED), velocity, m/s, and position, m, NED."""

    def __init__(self, quat: Quat, vel: Vec3, pos: Vec3) -> None:
        self.quat = quat
        self.vel = vel
        self.pos = pos

    def copy(self) -> "Output":
        """Return another one that is the same."""
        return Output(self.quat, self.vel, self.pos)


@final
class OutputPredictor:
    """The state at the present time, and its history back to the horizon, ``length`` steps.

    Attributes:
        now: attitude, velocity and position.
        height_rate: d(down)/dt, m/s, of height and vertical acceleration through a complementary filter.
        angle_error, vel_error, pos_error: how far it was from the filter at the last step: rad, m/s, m.
    """

    def __init__(self, state: State, length: int) -> None:
        self.now = Output(state.quat, state.vel, state.pos)
        self._history = [self.now.copy() for _ in range(length)]  # a ring, of which ``_oldest`` is the first
        self._oldest = 0
        self._angle_correction: Vec3 = ZERO
        self._pos_integral: Vec3 = ZERO
        self._vel_integral: Vec3 = ZERO
        self._climb_integral = 0.0  # of the vertical velocity while accelerometers are bad
        self.angle_error = 0.0
        self.vel_error = 0.0
        self.pos_error = 0.0
        self.height_rate = state.vel[2]
        self._filtered_down = state.pos[2]
        self._filtered_accel = 0.0

    def integrate(
        self, delta: Inertial, gyro_bias: Vec3, accel_bias: Vec3, dt_ekf_avg: float, height_filter_hz: float
    ) -> None:
        """Move on by a pass of the main loop, whose inertial data must be sound.

        The biases are those at the beginning of the pass; the filter of heights is EK3_HRT_FILT's.
        """
        now = self.now
        dt = delta.del_vel_dt
        angle = sub(delta.del_ang, scaled(gyro_bias, delta.del_ang_dt / dt_ekf_avg))
        quat = turned(now.quat, add(angle, self._angle_correction))
        velocity = sub(delta.del_vel, scaled(accel_bias, dt / dt_ekf_avg))
        north, east, down = rotated(quat, velocity)
        down += GRAVITY_MSS * dt
        self._filter_height(now.pos[2], down, dt, height_filter_hz)
        vel = add(now.vel, (north, east, down))
        now.quat = quat
        now.pos = add(now.pos, scaled(add(vel, now.vel), 0.5 * dt))
        now.vel = vel

    def _filter_height(self, down: float, del_vel_down: float, dt: float, filter_hz: float) -> None:
        omega = 2 * math.pi * limited(filter_hz, 0.1, 30.0)
        error = limited(down - self._filtered_down, -_MAX_DOWN_ERROR_M, _MAX_DOWN_ERROR_M)
        self._filtered_accel += error * (omega * omega * omega) * dt
        self.height_rate += del_vel_down + (self._filtered_accel + error * (omega * omega) * 3) * dt
        self._filtered_down += (self.height_rate + error * omega * 3) * dt

    def follow(self, state: State, delay_s: float, tau_s: float, dt_ekf_avg: float) -> None:
        """Steer towards the filter, once a step; velocity and position all along the history.

        The horizon lies ``delay_s`` back; ``tau_s`` is the time constant of velocity and position.
        """
        history, newest = self._history, self._oldest
        history[newest] = self.now.copy()
        self._oldest = newest + 1 if newest + 1 < len(history) else 0
        delayed = history[self._oldest]
        error = normalized(times(conjugate(delayed.quat), state.quat))
        attitude_gain = _ATTITUDE_GAIN / larger(delay_s, LOOP_DT) * LOOP_DT
        if error[0] < 0:
            attitude_gain = -attitude_gain
        vector = error[1], error[2], error[3]
        self._angle_correction = scaled(vector, 2.0 * attitude_gain)
        gain = dt_ekf_avg / limited(tau_s, dt_ekf_avg, 10.0)
        pos_error, vel_error = sub(state.pos, delayed.pos), sub(state.vel, delayed.vel)
        self.angle_error = 2.0 * length(vector)
        self.pos_error, self.vel_error = length(pos_error), length(vel_error)
        self._pos_integral = add(self._pos_integral, pos_error)
        before = self._vel_integral
        self._vel_integral = add(before, vel_error)
        if state.accel_is_bad:  # vertically what counts is how far the present velocity is from that at the horizon
            self._climb_integral += state.vel[2] - self.now.vel[2]
            self._vel_integral = self._vel_integral[0], self._vel_integral[1], self._climb_integral
        else:
            self._climb_integral = before[2]  # FIRMWARE PARITY: without the error of the last good step
        by_integral = _INTEGRAL_GAIN * gain * gain
        pos = add(scaled(pos_error, gain), scaled(self._pos_integral, by_integral))
        vel = add(scaled(vel_error, gain), scaled(self._vel_integral, by_integral))
        if state.accel_is_bad:
            down = vel_error[2] * gain + self._vel_integral[2] * (_BAD_ACCEL_INTEGRAL_GAIN * gain * gain)
            vel = vel[0], vel[1], down
        for output in history:
            output.vel = add(output.vel, vel)
            output.pos = add(output.pos, pos)
        self.now.vel, self.now.pos = history[newest].vel, history[newest].pos

    # Resets

    def shift_pos(self, shift: Vec3) -> None:
        """Add to position, now and in the history; not what is not finite."""
        if is_finite(shift):
            self.now.pos = within_pos(add(self.now.pos, shift))
            for output in self._history:
                output.pos = within_pos(add(output.pos, shift))

    def set_pos_ne(self, north: float, east: float) -> None:
        """Set the horizontal position, now and in the history; not to what is not finite."""
        if math.isfinite(north) and math.isfinite(east):
            self.now.pos = within_pos((north, east, self.now.pos[2]))
            for output in self._history:
                output.pos = within_pos((north, east, output.pos[2]))

    def set_vel_ne(self, north: float, east: float) -> None:
        """Set the horizontal velocity, now and in the history; not to what is not finite."""
        if math.isfinite(north) and math.isfinite(east):
            self.now.vel = within_vel((north, east, self.now.vel[2]))
            for output in self._history:
                output.vel = within_vel((north, east, output.vel[2]))

    def set_down(self, pos_down: float, vel_down: float) -> None:
        """Set height and vertical velocity, now and in the history, and restart the filtered height there."""
        if math.isfinite(pos_down):
            self.now.pos = within_pos((self.now.pos[0], self.now.pos[1], pos_down))
            for output in self._history:
                output.pos = within_pos((output.pos[0], output.pos[1], pos_down))
        if math.isfinite(vel_down):
            self.now.vel = within_vel((self.now.vel[0], self.now.vel[1], vel_down))
            for output in self._history:
                output.vel = within_vel((output.vel[0], output.vel[1], vel_down))
        self.restart_height_filter()
        self.height_rate = vel_down

    def restart_height_filter(self) -> None:
        """Let the filtered height begin at the present one, as height is reset."""
        self._filtered_down = self.now.pos[2]

    def rotate(self, turn: Quat) -> None:
        """Turn the attitude, now and in the history, each about the axes of its own body (StoreQuatRotate)."""
        self.now.quat = normalized(times(self.now.quat, turn))
        for output in self._history:
            output.quat = normalized(times(output.quat, turn))
