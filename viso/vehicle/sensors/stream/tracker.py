# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Works out from a stream of poses how what it shows moves."""

import math
from typing import Final

import numpy as np

from ekf_stub.core.vectors import Quat, scaled, turned
from ekf_stub.inputs.measurements import Array
from viso.vehicle.sensors.stream.imagined_vehicle import MAX_ACCEL, Movement
from viso.vehicle.sensors.vectors import Three, added, limited_length, rotation_between

MAX_SPEED: Final = 20.0
MAX_RATE: Final = 10.0
POS_NOISE_M: Final = 0.01
"""What a camera's positions are taken to err by, and ..."""

JERK_NOISE: Final = 0.5
"""... the density of the jerk of what it sees, m/s^3 a root of Hz: together they say how fast to follow."""

ATT_MEMORY_S: Final = 0.06
"""Time constant with which older attitudes are forgotten, which cameras know better."""

_INITIAL_VARIANCES: Final = (POS_NOISE_M**2, 1.0**2, 2.0**2)  # m^2, (m/s)^2, (m/s^2)^2
_MAX_TURN: Final = 0.5  # of a sample against what was expected, rad


class StreamTracker:
    """Estimates velocity and acceleration from positions, rates from attitudes.

    Whatever moves with constant acceleration, or turns at a constant rate, is shown without lag. Speed, acceleration
    and rate are limited to 20 m/s, 15 m/s^2 and 10 rad/s. The newest sample was observed at ``time_s``.
    """

    def __init__(self, time_s: float, start: Movement) -> None:
        self.time_s = time_s
        self._state = start
        self._cov: Array = np.diag(_INITIAL_VARIANCES)

    def at(self, time_s: float) -> Movement:
        """Return the movement at a time, as it goes on from the newest sample."""
        dt = time_s - self.time_s
        pos, vel, acc, quat, rate = self._state
        return Movement(
            added(added(pos, vel, dt), acc, 0.5 * dt * dt),
            added(vel, acc, dt),
            acc,
            turned(quat, scaled(rate, dt)),
            rate,
        )

    def take(self, time_s: float, pos: Three, quat: Quat) -> None:
        """Take a sample later than the one before."""
        expected = self.at(time_s)
        dt = time_s - self.time_s
        gain_pos, gain_vel, gain_acc = self._gains(dt)
        error = added(pos, expected.pos, -1.0)
        kept_att = math.exp(-dt / ATT_MEMORY_S)
        turn = limited_length(rotation_between(expected.quat, quat), _MAX_TURN)
        self._state = Movement(
            added(expected.pos, error, gain_pos),
            limited_length(added(expected.vel, error, gain_vel), MAX_SPEED),
            limited_length(added(expected.acc, error, gain_acc), MAX_ACCEL),
            turned(expected.quat, scaled(turn, 1.0 - kept_att**2)),
            limited_length(added(expected.rate, turn, (1.0 - kept_att) ** 2 / dt), MAX_RATE),
        )
        self.time_s = time_s

    def _gains(self, dt: float) -> Three:
        # A Kalman filter of position, velocity and acceleration, driven by white jerk; the axes share the covariance.
        step = np.array([[1.0, dt, 0.5 * dt * dt], [0.0, 1.0, dt], [0.0, 0.0, 1.0]])
        by_jerk = np.array([dt**3 / 6.0, dt * dt / 2.0, dt])
        cov = step @ self._cov @ step.T + JERK_NOISE**2 / dt * np.outer(by_jerk, by_jerk)
        gains = cov[:, 0] / (cov[0, 0] + POS_NOISE_M**2)
        self._cov = cov - np.outer(gains, cov[0])
        pos, vel, acc = gains.tolist()
        return pos, vel, acc
