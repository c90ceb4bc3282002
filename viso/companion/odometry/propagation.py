# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Propagation of the last state with the IMU between camera frames."""

from collections import deque
from dataclasses import dataclass
from typing import Final

import numpy as np

from viso.companion.odometry.composer import LocalPose
from viso.companion.vio.config import ImuNoise
from viso.companion.vio.frames import GRAVITY_MSS
from viso.companion.vio.imu import steps_of
from viso.companion.vio.preintegration import PreintegratedDelta, preintegrate
from viso.companion.vio.types import ImuBias, ImuSample, ImuWindow
from viso.geometry.pose import SE3
from viso.geometry.rotation import Array, skew

HISTORY_NS: Final = 10_000_000_000
VELOCITY_SIGMA_M_S: Final = 0.1
UP: Final = np.array([0.0, 0.0, 1.0])
_IDENTITY: Final = np.eye(3)
_POSE: Final = np.ix_([0, 1, 2, 6, 7, 8], [0, 1, 2, 6, 7, 8])


@dataclass(frozen=True, slots=True, eq=False)
class MotionState:
    """The motion of the body at an instant.

    Attributes:
        velocity_b: in m/s, FLU.
        gyro_b: rate in rad/s without bias, FLU; None without inertial data.
    """

    t_ns: int
    pose: LocalPose
    velocity_b: Array
    gyro_b: Array | None


@dataclass(frozen=True, slots=True, eq=False)
class _Motion:
    """Attitude, velocity and position, P of their errors in this order, the first in the body, the others local."""

    t_ns: int
    R: Array
    v: Array
    p: Array
    P: Array
    gravity: Array


class OdometryPropagator:
    """Propagates the last corrected state with the inertial data since its stamp.

    Args:
        velocity_sigma_m_s: of each axis of the velocity that comes with a camera frame.
    """

    def __init__(self, noise: ImuNoise, *, velocity_sigma_m_s: float = VELOCITY_SIGMA_M_S) -> None:
        self._noise = noise
        self._velocity_sigma_m_s = velocity_sigma_m_s
        self._samples: deque[ImuSample] = deque()
        self._corrected_ns: int | None = None
        self._bias = ImuBias.zero()
        self._motion: _Motion | None = None

    def add_imu(self, sample: ImuSample) -> bool:
        """Add a sample; return False, and ignore it, if it is not newer than the last one."""
        if self._samples and sample.t_ns <= self._samples[-1].t_ns:
            return False
        self._samples.append(sample)
        while sample.t_ns - self._samples[0].t_ns > HISTORY_NS:
            self._samples.popleft()
        return True

    def correct(
        self, t_ns: int, pose: LocalPose, velocity_b: Array, bias: ImuBias, up: Array = UP
    ) -> tuple[Array, Array] | None:
        """Restart from a camera frame.

        Args:
            t_ns: the frame's stamp, usually well in the past.
            velocity_b: in m/s, FLU.
            up: the vertical in the local frame, of length 1.

        Returns:
            The change of position [3] in m at the newest instant, and the covariance [3, 3] of the position as it was
            before, both in the local frame; None for the first frame.

        Raises:
            ValueError: if the frame is not newer than the last one.
        """
        if self._corrected_ns is not None and t_ns <= self._corrected_ns:
            raise ValueError("t_ns: not newer than the last camera frame")
        before = self._carried_on()
        self._corrected_ns, self._bias = t_ns, bias
        self._motion = self._motion_of(t_ns, pose, velocity_b, up * -GRAVITY_MSS)
        after = self._carried_on()
        if before is None or after is None:
            return None
        # A frame newer than all inertial data is compared with where the old velocity would have led.
        position = before.p + before.v * ((after.t_ns - before.t_ns) * 1e-9)
        return after.p - position, before.P[6:, 6:]

    def state(self) -> MotionState | None:
        """Return the state at the newest sample, or at the last camera frame if that is newer; None before one."""
        motion = self._carried_on()
        if motion is None:
            return None
        to_body = np.eye(6)
        to_body[3:, 3:] = motion.R.T
        pose = LocalPose(SE3(motion.R, motion.p), to_body.dot(motion.P[_POSE]).dot(to_body.T))
        gyro_b = self._samples[-1].gyro - self._bias.gyro if self._samples else None
        return MotionState(motion.t_ns, pose, motion.R.T.dot(motion.v), gyro_b)

    def _motion_of(self, t_ns: int, pose: LocalPose, velocity_b: Array, gravity: Array) -> _Motion:
        rotation = pose.L_T_B.R
        to_local = np.eye(6)
        to_local[3:, 3:] = rotation
        P = np.zeros((9, 9))
        P[3:6, 3:6] = self._velocity_sigma_m_s**2 * _IDENTITY
        P[_POSE] = to_local.dot(pose.covariance_6x6).dot(to_local.T)
        return _Motion(t_ns, rotation, rotation.dot(velocity_b), pose.L_T_B.t, P, gravity)

    def _carried_on(self) -> _Motion | None:
        """Propagate the motion to the newest sample, store it and return it."""
        motion = self._motion
        if motion is not None and self._samples and self._samples[-1].t_ns > motion.t_ns:
            window = ImuWindow(motion.t_ns, self._samples[-1].t_ns, self._samples_since(motion.t_ns))
            steps = steps_of(window)
            if steps.dt_s.size:
                self._motion = motion = _moved(motion, preintegrate(steps, self._noise, self._bias), window.end_t_ns)
        return motion

    def _samples_since(self, t_ns: int) -> tuple[ImuSample, ...]:
        """Return the newest samples, back to the last one not after a time."""
        samples = []
        for sample in reversed(self._samples):
            samples.append(sample)
            if sample.t_ns <= t_ns:
                break
        return tuple(reversed(samples))


def _moved(motion: _Motion, delta: PreintegratedDelta, t_ns: int) -> _Motion:
    R, dt_s = motion.R, delta.dt_s
    F, G = np.eye(9), np.eye(9)
    F[:3, :3] = delta.dR.T
    F[3:6, :3], F[6:, :3] = -R.dot(skew(delta.dv)), -R.dot(skew(delta.dp))
    F[6:, 3:6] = dt_s * _IDENTITY
    G[3:6, 3:6] = G[6:, 6:] = R
    return _Motion(
        t_ns,
        R.dot(delta.dR),
        motion.v + motion.gravity * dt_s + R.dot(delta.dv),
        motion.p + motion.v * dt_s + motion.gravity * (0.5 * dt_s**2) + R.dot(delta.dp),
        F.dot(motion.P).dot(F.T) + G.dot(delta.cov).dot(G.T),
        motion.gravity,
    )
