# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Makes of a stream of poses, with all its jumps and gaps, a movement for the vehicle to follow.

The tracker works out how what the stream shows moves; the follower takes the jumps and gaps out.
"""

import math
from typing import Final

import numpy as np

from ekf_stub.core.vectors import Quat, scaled
from ekf_stub.inputs.measurements import Array
from viso.vehicle.sensors.stream.frame import Pose, StreamFrame
from viso.vehicle.sensors.stream.imagined_vehicle import MAX_ACCEL, Movement
from viso.vehicle.sensors.vectors import ZERO, Three, added, limited_length, rotation_between, turned

LONGEST_INTERVAL_S: Final = 0.3
"""An interval as long as this explains as much of a difference as any longer one."""

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


class StreamFollower:
    """The target of the vehicle by the stream, from its first pose on."""

    def __init__(self, first: Pose, vehicle: Movement) -> None:
        self.frame = StreamFrame(first, vehicle)
        self.begin_again(first, vehicle, is_reset=False)

    @property
    def time_s(self) -> float:
        """When the newest pose was observed, s since boot."""
        return self._last.time_s

    def target(self, time_s: float) -> Movement:
        """Return the movement to follow at a time."""
        return self._tracker.at(time_s)

    def begin_again(self, pose: Pose, vehicle: Movement, *, is_reset: bool) -> bool:
        """Take a pose after a gap, in which the vehicle went its own way; return whether it says where that is."""
        has_jumped = self.frame.settle_jump(pose, vehicle, LONGEST_INTERVAL_S, is_reset=is_reset)
        shown = self.frame.apply(pose)
        start = vehicle._replace(pos=shown.pos, acc=ZERO, quat=shown.quat, rate=ZERO)
        self._tracker = StreamTracker(pose.time_s, start)
        self._last = pose
        self._before_last: Pose | None = None
        return not has_jumped

    def go_on(self, pose: Pose, *, is_reset: bool) -> bool:
        """Take a pose, later than the last; return whether it says where the vehicle is, and not that of a jump."""
        interval_s = min(pose.time_s - self.time_s, LONGEST_INTERVAL_S)
        expected, steady = self._tracker.at(pose.time_s), self._steady(pose.time_s)
        has_jumped = self.frame.settle_jump(pose, expected, interval_s, steady=steady, is_reset=is_reset)
        self._tracker.take(*self.frame.apply(pose))
        self._last, self._before_last = pose, self._last
        return not has_jumped

    def _steady(self, time_s: float) -> Pose | None:
        # The tracker is slow to learn of a sudden movement, two poses tell at once; but a jump looks like great speed.
        last, before = self._last, self._before_last
        if before is None:
            return None
        per_interval = 1.0 / (last.time_s - before.time_s)
        vel = scaled(added(last.pos, before.pos, -1.0), per_interval)
        rate = scaled(rotation_between(before.quat, last.quat), per_interval)
        if math.hypot(*vel) > MAX_SPEED or math.hypot(*rate) > MAX_RATE:
            return None
        ahead_s = time_s - last.time_s
        return Pose(time_s, added(last.pos, vel, ahead_s), turned(last.quat, scaled(rate, ahead_s)))
