# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Measurements at the fusion horizon, with what is corrected as they are recalled.

Source: AP_NavEKF3/AP_NavEKF3_PosVelFusion.cpp (CorrectExtNavForSensorOffset, CorrectExtNavVelForSensorOffset).
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ekf_stub import ingest_rules as rules
from ekf_stub.error_state import ErrorState
from ekf_stub.ext_nav_ingest import ExtNavIngest
from ekf_stub.inertial import Array


@dataclass(frozen=True, slots=True)
class Pose:
    """A position (m, NED) of the IMU, its error in m, and whether the camera's frame has jumped."""

    time_ms: int
    pos: Array
    err: float
    is_reset: bool


@dataclass(frozen=True, slots=True)
class Velocity:
    """A velocity (m/s, NED) of the IMU, and its error."""

    time_ms: int
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

    def recall(self, state: ErrorState, body_rates: Array, lever_arm: tuple[float, float, float]) -> None:
        """Take out what has come due, and move it from the camera to the IMU.

        Args:
            state: the filter after its prediction.
            body_rates: rad/s.
            lever_arm: the camera's place from the IMU, m, body (FRD).
        """
        self._recall_pose(state, lever_arm)
        self._recall_velocity(state, body_rates, lever_arm)

    def _recall_pose(self, state: ErrorState, lever_arm: tuple[float, float, float]) -> None:
        pose = self._ingest.recall_pose()
        self.has_pose = pose is not None and self._is_finite("pose", pose.time_ms, (*pose.pos.to_tuple(), pose.pos_err))
        if pose is not None and self.has_pose:
            pos = _array(pose.pos.to_tuple())
            if any(lever_arm):
                pos -= state.rotation @ np.array(lever_arm)
            self.pose = Pose(pose.time_ms, pos, float(pose.pos_err), pose.pos_reset)

    def _recall_velocity(self, state: ErrorState, body_rates: Array, lever_arm: tuple[float, float, float]) -> None:
        sample = self._ingest.recall_velocity()
        self.has_velocity = sample is not None and self._is_finite(
            "velocity", sample.time_ms, (*sample.vel.to_tuple(), sample.err)
        )
        if sample is not None and self.has_velocity:
            vel = _array(sample.vel.to_tuple())
            if any(lever_arm):
                vel -= state.rotation @ np.cross(body_rates, np.array(lever_arm))
            self.velocity = Velocity(sample.time_ms, vel, float(sample.err))

    def _is_finite(self, kind: str, time_ms: int, values: Iterable[np.float32]) -> bool:
        # FIRMWARE PARITY: there an infinite position fails its gate, but is fused once position has timed out.
        if all(map(math.isfinite, values)):
            return True
        self._ingest.tell(kind, rules.NOT_FINITE, time_ms)
        return False


def _array(values: tuple[np.float32, np.float32, np.float32]) -> Array:
    return np.array(values, dtype=np.float64)
