# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Fusion of velocity in the body frame (AP_NavEKF3_PosVelFusion.cpp, SelectBodyOdomFusion, FuseBodyVel)."""

import math
from typing import Final, final

from ekf_stub.core import events as ev
from ekf_stub.core.aiding import Aiding
from ekf_stub.core.events import Events
from ekf_stub.core.ext_nav import ExtNav
from ekf_stub.core.inertial import Inertial
from ekf_stub.core.params import EXTNAV, EkfSources
from ekf_stub.core.samples import OdometrySample
from ekf_stub.core.state import State
from ekf_stub.core.vectors import ZERO, Quat, Vec3, cross, is_finite, length, scaled, square, to_body

GATE_SIGMAS: Final = 5.0
_MIN_DT: Final = 1e-3


@final
class BodyOdometry:
    """Tests and fuses body odometry, axis after axis.

    Attributes:
        is_fused: an axis was fused since aiding ended last.
        recalled: how many samples have come due, so that whoever logs can tell a new one.
        innovation, variance: of the last that was tested, m/s and (m/s)^2, body (FRD).
    """

    def __init__(self, state: State, aiding: Aiding, sources: EkfSources, ext_nav: ExtNav, events: Events) -> None:
        self._state = state
        self._aiding = aiding
        self._sources = sources
        self._ext_nav = ext_nav
        self._events = events
        self.is_fused = False
        self.recalled = 0
        self.innovation: Vec3 = ZERO
        self.variance: Vec3 = ZERO

    def step(self, now_ms: int, step: Inertial) -> None:
        """Fuse what came due in a step."""
        sample = self._ext_nav.recall_odometry()
        if sample is None:
            return
        self.recalled += 1
        if not (is_finite(sample.vel) and math.isfinite(sample.err) and is_finite(sample.offset)):
            self._events.tell(ev.ODOMETRY, ev.NOT_FINITE, sample.time_ms)
        elif not self._sources.uses_vel_xy(EXTNAV):
            self._events.tell(ev.ODOMETRY, ev.UNUSED, sample.time_ms)
        else:
            self._fuse(sample, now_ms, step)

    def _fuse(self, sample: OdometrySample, now_ms: int, step: Inertial) -> None:
        worst = 0.0
        before = self._state.quat, self._state.vel
        for axis in range(3):
            ratio = self._fuse_axis(axis, sample, now_ms, step, before)
            if ratio < 0.0:
                break
            if ratio > worst:
                worst = ratio
        rule = ev.FUSED if worst < 1 else ev.GATE_ODOMETRY
        self._events.tell(ev.ODOMETRY, rule, sample.time_ms, math.sqrt(worst), length(self.innovation))

    def _fuse_axis(
        self, axis: int, sample: OdometrySample, now_ms: int, step: Inertial, before: tuple[Quat, Vec3]
    ) -> float:
        """Return the square of innovation to gate; negative where the calculation is badly conditioned.

        ``before`` are attitude and velocity before the first axis, by which errors count along all three.
        """
        state = self._state
        noise_var = square(sample.err)
        predicted = to_body(state.rotation, state.vel)[axis]
        if step.del_ang_dt > _MIN_DT:
            predicted += cross(scaled(step.del_ang, 1.0 / step.del_ang_dt), sample.offset)[axis]
        expected = state.look_along_body_velocity(axis, 1.0, before[0], before[1])
        variance = expected + noise_var
        if variance <= noise_var:
            return -1.0
        innovation = predicted - sample.vel[axis]
        self.innovation = _with(self.innovation, axis, innovation)
        self.variance = _with(self.variance, axis, variance)
        ratio = square(innovation) / (GATE_SIGMAS * GATE_SIGMAS * variance)
        if ratio < 1:
            self._aiding.odometry_ms = now_ms
            if not self.is_fused:
                self.is_fused = True
                self._events.say(ev.FUSING_ODOMETRY)
            state.fuse(expected, innovation, noise_var, state.unlearned)
        return ratio


def _with(vector: Vec3, axis: int, value: float) -> Vec3:
    x, y, z = vector
    return (value, y, z) if axis == 0 else (x, value, z) if axis == 1 else (x, y, value)
