# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Measurements at the fusion horizon, with what is corrected as they are recalled.

Source: AP_NavEKF3/AP_NavEKF3_PosVelFusion.cpp (CorrectExtNavForSensorOffset, CorrectExtNavVelForSensorOffset).
"""

import math
from typing import NamedTuple

import numpy as np

from ekf_stub.filter.error_state import ErrorState
from ekf_stub.filter.inertial import Array, InertialStep
from ekf_stub.inputs import ingest_rules as rules
from ekf_stub.inputs.ext_nav_ingest import ExtNavIngest, PoseSample, VelocitySample
from ekf_stub.reports.core_report import Three


class Pose(NamedTuple):
    """A position (m, NED) of the IMU, its error in m, and whether the camera's frame has jumped."""

    time_ms: int
    pos: Array
    err: float
    is_reset: bool


class Velocity(NamedTuple):
    """A velocity (m/s, NED) of the IMU, and its error."""

    time_ms: int
    vel: Array
    err: float


class BaroSample(NamedTuple):
    """A height above the place of calibration, m."""

    time_ms: int
    height: float


class MagSample(NamedTuple):
    """A magnetic field, Gauss, body."""

    time_ms: int
    field: Array


class Delayed:
    """The last measurements that the horizon has reached.

    Attributes:
        pose, velocity: the last of each, however old.
        has_pose, has_velocity: whether it came in this step.
    """

    def __init__(self, ingest: ExtNavIngest) -> None:
        self._ingest = ingest
        self.pose: Pose | None = None
        self.velocity: Velocity | None = None
        self.has_pose = self.has_velocity = False

    def recall(self, state: ErrorState, step: InertialStep, lever_arm: Three) -> None:
        """Take out what has come due, and move it from the camera to the IMU, by its place there in m, body (FRD)."""
        self.has_pose = self.has_velocity = False
        if self._ingest.has_due:
            pose = self._ingest.recall_pose()
            self.has_pose = pose is not None and self._take_pose(pose, state, lever_arm)
            velocity = self._ingest.recall_velocity()
            self.has_velocity = velocity is not None and self._take_velocity(velocity, state, step, lever_arm)

    def _take_pose(self, sample: PoseSample, state: ErrorState, lever_arm: Three) -> bool:
        x, y, z, err = map(float, (*sample.pos.to_tuple(), sample.pos_err))
        if not math.isfinite(x + y + z + err):
            return self._refuse("pose", sample.time_ms)
        pos = np.array((x, y, z))
        if any(lever_arm):
            pos -= state.rotation @ np.array(lever_arm)
        self.pose = Pose(sample.time_ms, pos, err, sample.pos_reset)
        return True

    def _take_velocity(self, sample: VelocitySample, state: ErrorState, step: InertialStep, lever_arm: Three) -> bool:
        x, y, z, err = map(float, (*sample.vel.to_tuple(), sample.err))
        if not math.isfinite(x + y + z + err):
            return self._refuse("velocity", sample.time_ms)
        vel = np.array((x, y, z))
        if any(lever_arm):
            vel -= state.rotation @ np.cross(step.del_ang / step.del_ang_dt, np.array(lever_arm))
        self.velocity = Velocity(sample.time_ms, vel, err)
        return True

    def _refuse(self, kind: str, time_ms: int) -> bool:
        """Refuse what is not finite: of numbers that were single precision their sum tells."""
        # FIRMWARE PARITY: there an infinite position fails its gate, but is fused once position has timed out.
        self._ingest.tell(kind, rules.NOT_FINITE, time_ms)
        return False
