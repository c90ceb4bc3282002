# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Fusion of velocity in the body frame (AP_NavEKF3_PosVelFusion.cpp, SelectBodyOdomFusion, FuseBodyVel)."""

import math
from typing import Final

import numpy as np

from ekf_stub.filter.inertial import Array, InertialStep
from ekf_stub.fusion.parts import FilterParts, Fusion
from ekf_stub.inputs import ingest_rules as rules
from ekf_stub.inputs.ext_nav_ingest import OdometrySample
from ekf_stub.inputs.sources import SourceXY
from ekf_stub.reports.core_report import OdometryReport

GATE_SIGMAS: Final = 5.0
_MIN_DT: Final = 1e-3


class BodyOdometry(Fusion):
    """Tests and fuses body odometry, axis after axis; ``is_fused`` if an axis was since aiding ended last."""

    def __init__(self, parts: FilterParts) -> None:
        super().__init__(parts)
        self._recalled = 0
        self._innovation: Array = np.zeros(3)
        self._variance: Array = np.zeros(3)
        self.is_fused = False

    def report(self) -> OdometryReport | None:
        """Return what was tested last, None while there was nothing."""
        if not self._recalled:
            return None
        x, y, z = self._innovation.tolist()
        vx, vy, vz = self._variance.tolist()
        return OdometryReport(self._recalled, (x, y, z), (vx, vy, vz))

    def step(self, now_ms: int, step: InertialStep) -> None:
        """Fuse what came due in a step."""
        sample = self._ingest.recall_odometry()
        if sample is None:
            return
        self._recalled += 1
        values = *sample.vel.to_tuple(), sample.vel_err, *sample.pos_offset.to_tuple()
        if not all(map(math.isfinite, values)):
            self._ingest.tell("odometry", rules.NOT_FINITE, sample.time_ms)
        elif not self._sources.uses_vel_xy(SourceXY.EXTNAV):
            self._ingest.tell("odometry", rules.UNUSED, sample.time_ms)
        else:
            self._fuse(sample, now_ms, step)

    def _fuse(self, sample: OdometrySample, now_ms: int, step: InertialStep) -> None:
        worst = 0.0
        for axis in range(3):
            ratio = self._fuse_axis(axis, sample, now_ms, step)
            if ratio is None:
                break
            worst = max(worst, ratio)
        rule = rules.FUSED if worst < 1 else rules.GATE_ODOMETRY
        self._ingest.tell("odometry", rule, sample.time_ms, math.sqrt(worst))

    def _fuse_axis(self, axis: int, sample: OdometrySample, now_ms: int, step: InertialStep) -> float | None:
        """Return the square of innovation to gate; None where the calculation is badly conditioned."""
        state = self._state
        measured, noise = float(sample.vel.to_tuple()[axis]), float(sample.vel_err) ** 2
        predicted = float(state.rotation[:, axis] @ state.vel)
        if step.del_ang_dt > _MIN_DT:
            offset = np.array([float(part) for part in sample.pos_offset.to_tuple()])
            predicted += float(np.cross(step.del_ang / step.del_ang_dt, offset)[axis])
        row = state.velocity_row(axis)
        variance = float(row @ state.cov @ row) + noise
        if variance <= noise:
            return None
        self._innovation[axis], self._variance[axis] = predicted - measured, variance
        ratio = (predicted - measured) ** 2 / (GATE_SIGMAS**2 * variance)
        if ratio < 1:
            self._aiding.times.odometry = now_ms
            if not self.is_fused:
                self.is_fused = True
                self._texts.add("fusing odometry")
            state.update(row, predicted - measured, noise, state.unlearned)
        return ratio
