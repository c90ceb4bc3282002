# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Carries the filter's state from the fusion horizon to the present (AP_NavEKF3_core.cpp, calcOutputStates).

It integrates the newest inertial data, and follows the filter by comparing what it said at the horizon with what the
filter says now.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import quaternion

from ekf_stub.error_state import GRAVITY_MSS, ErrorState
from ekf_stub.inertial import Array, InertialDelta, limited, quat_of_rotation

_ATTITUDE_GAIN: Final = 0.5
_INTEGRAL_GAIN: Final = 0.1


@dataclass(frozen=True, slots=True)
class Output:
    """Attitude (body to earth), velocity (m/s, NED) and position (m, NED)."""

    quat: quaternion.quaternion
    vel: Array
    pos: Array


class OutputPredictor:
    """The state at the present time, and its history back to the horizon.

    Args:
        state: the filter at its start.
        length: how many steps the horizon lies back.

    Attributes:
        now: the present state.
    """

    def __init__(self, state: ErrorState, length: int) -> None:
        self.now = Output(state.quat, state.vel, state.pos)
        self._history: deque[Output] = deque(maxlen=length)
        self._angle_correction: Array = np.zeros(3)
        self._pos_integral: Array = np.zeros(3)
        self._vel_integral: Array = np.zeros(3)

    def integrate(self, delta: InertialDelta, state: ErrorState, dt_ekf_avg: float) -> None:
        """Move on by a pass of the main loop."""
        angle = delta.del_ang - state.gyro_bias * (delta.del_ang_dt / dt_ekf_avg) + self._angle_correction
        velocity = delta.del_vel - state.accel_bias * (delta.del_vel_dt / dt_ekf_avg)
        quat = (self.now.quat * quat_of_rotation(angle)).normalized()
        del_vel_ned = quaternion.as_rotation_matrix(quat) @ velocity
        del_vel_ned[2] += GRAVITY_MSS * delta.del_vel_dt
        vel = self.now.vel + del_vel_ned
        self.now = Output(quat, vel, self.now.pos + (0.5 * delta.del_vel_dt) * (vel + self.now.vel))

    def follow(self, state: ErrorState, *, delay_s: float, tau_s: float, dt_imu_avg: float, dt_ekf_avg: float) -> None:
        """Steer towards the filter, once a step; velocity and position all along the history.

        Args:
            state: the filter at the horizon.
            delay_s: how far the horizon lies back.
            tau_s: time constant of velocity and position.
            dt_imu_avg: average interval of the main loop.
            dt_ekf_avg: average interval of the steps.
        """
        self._history.append(self.now)
        delayed = self._history[0]
        error = (delayed.quat.conjugate() * state.quat).normalized()
        twice = 2.0 if error.w >= 0 else -2.0
        self._angle_correction = np.array([error.x, error.y, error.z]) * (
            twice * _ATTITUDE_GAIN / max(delay_s, dt_imu_avg) * dt_imu_avg
        )
        gain = dt_ekf_avg / limited(tau_s, dt_ekf_avg, 10.0)
        pos_error, vel_error = state.pos - delayed.pos, state.vel - delayed.vel
        self._pos_integral = self._pos_integral + pos_error
        self._vel_integral = self._vel_integral + vel_error
        by_integral = _INTEGRAL_GAIN * gain * gain
        self.shift(
            pos=pos_error * gain + self._pos_integral * by_integral,
            vel=vel_error * gain + self._vel_integral * by_integral,
        )

    def shift(self, *, pos: Array | None = None, vel: Array | None = None) -> None:
        """Add to position and velocity, now and in the history."""
        self._change(
            lambda output: replace(
                output,
                pos=output.pos if pos is None else output.pos + pos,
                vel=output.vel if vel is None else output.vel + vel,
            )
        )

    def overwrite(self, *, pos: dict[int, float] | None = None, vel: dict[int, float] | None = None) -> None:
        """Set components of position and velocity by their index, now and in the history."""
        self._change(lambda output: replace(output, pos=_with(output.pos, pos or {}), vel=_with(output.vel, vel or {})))

    def rotate(self, turn: quaternion.quaternion) -> None:
        """Turn the attitude, earth to earth, now and in the history."""
        self._change(lambda output: replace(output, quat=(turn * output.quat).normalized()))

    def _change(self, change: Callable[[Output], Output]) -> None:
        is_newest = bool(self._history) and self._history[-1] is self.now
        self._history = deque(map(change, self._history), maxlen=self._history.maxlen)
        self.now = self._history[-1] if is_newest else change(self.now)


def _with(vector: Array, components: dict[int, float]) -> Array:
    changed = vector.copy()
    for index, value in components.items():
        changed[index] = value
    return changed
