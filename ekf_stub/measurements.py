# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Measurements at the fusion horizon, with what is corrected as they are recalled.

Source: AP_NavEKF3/AP_NavEKF3_PosVelFusion.cpp (CorrectExtNavForSensorOffset, CorrectExtNavVelForSensorOffset).
"""

from dataclasses import dataclass

import numpy as np

from ekf_stub.error_state import ErrorState
from ekf_stub.ext_nav_ingest import ExtNavIngest
from ekf_stub.inertial import Array


@dataclass(frozen=True, slots=True)
class Pose:
    """A position (m, NED) of the IMU, its error in m, and whether the camera's frame has jumped."""

    pos: Array
    err: float
    is_reset: bool


@dataclass(frozen=True, slots=True)
class Velocity:
    """A velocity (m/s, NED) of the IMU, and its error."""

    vel: Array
    err: float


@dataclass(frozen=True, slots=True)
class BaroSample:
    """A height above the place of calibration, m."""

    time_ms: int
    height: float


@dataclass(frozen=True, slots=True)
class MagSample:
    """A magnetic field, Gauss, body."""

    time_ms: int
    field: Array


class Delayed:
    """The last measurements that the horizon has reached.

    Args:
        ingest: where external navigation waits.

    Attributes:
        pose, velocity: the last of each, however old.
        has_pose, has_velocity: whether it came in this step.
    """

    def __init__(self, ingest: ExtNavIngest) -> None:
        self._ingest = ingest
        self.pose: Pose | None = None
        self.velocity: Velocity | None = None
        self.has_pose = self.has_velocity = False

    def velocity_stamp_ms(self) -> int:
        """Return the stamp of the newest velocity taken."""
        return self._ingest.velocity_stamp_ms

    def recall(self, state: ErrorState, body_rates: Array, lever_arm: Array) -> None:
        """Take out what has come due, and move it from the camera to the IMU.

        Args:
            state: the filter after its prediction.
            body_rates: rad/s.
            lever_arm: the camera's place on the vehicle, m, body (FRD).
        """
        pose, velocity = self._ingest.recall_pose(), self._ingest.recall_velocity()
        self.has_pose, self.has_velocity = pose is not None, velocity is not None
        if pose is not None:
            offset = state.rotation @ lever_arm
            self.pose = Pose(_array(pose.pos.to_tuple()) - offset, float(pose.pos_err), pose.pos_reset)
        if velocity is not None:
            offset = state.rotation @ np.cross(body_rates, lever_arm)
            self.velocity = Velocity(_array(velocity.vel.to_tuple()) - offset, float(velocity.err))


def _array(values: tuple[np.float32, np.float32, np.float32]) -> Array:
    return np.array([float(value) for value in values])
