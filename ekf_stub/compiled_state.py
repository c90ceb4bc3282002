# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The filter with its prediction and its fusion compiled by numba, behind the interface of the plain one.

`ekf_stub.error_state` is the definition and the default. What is fused while nothing aids is seldom, and stays with it.
Needs the extra numba.
"""

import math
from collections.abc import Sequence

import numpy as np

from ekf_stub import compiled_kernel as kernel
from ekf_stub import quaternions as quaternion
from ekf_stub.error_state import EARTH, MIN_NOISE_VAR, SHARP, ErrorState
from ekf_stub.inertial import Array, InertialStep
from ekf_stub.states import STATES


def _components(quat: quaternion.quaternion) -> tuple[float, float, float, float]:
    return quat.w, quat.x, quat.y, quat.z


class CompiledErrorState(ErrorState):
    """Nominal state and error covariance at the fusion horizon."""

    def move(self, step: InertialStep, dt_ekf_avg: float, *, aided: bool) -> None:
        """Move on by a step, with less than the measured acceleration if that is large and nothing aids."""
        states, rotation, accel_filtered = self.states.copy(), self.rotation.copy(), self.accel_filtered.copy()
        quat = kernel.move(
            _components(self.quat),
            states,
            rotation,
            accel_filtered,
            step.del_ang,
            step.del_vel,
            step.del_ang_dt,
            step.del_vel_dt,
            dt_ekf_avg,
            self.earth_rate_ned,
            aided,
            self.limits.lowest,
            self.limits.highest,
        )
        self.quat = quaternion.quaternion(*quat)
        self.states, self.rotation, self.accel_filtered = states, rotation, accel_filtered

    def _grow(
        self, del_ang: Array, del_vel: Array, dt: float, attitude_variance: float, variances: tuple[float, ...]
    ) -> None:
        quat = _components(self.quat)
        kernel.grow(self.cov, quat, self.rotation, del_ang, del_vel, dt, attitude_variance, variances)

    def clear(self, states: slice, variance: float) -> None:
        """Forget what some errors have to do with others, and give them a variance, within limits."""
        if states.start >= EARTH.start and not self.learns_field:
            variance = 0.0
        kernel.clear(self.cov, states.start, states.stop, variance, self.limits.highest_var.item(states.start))

    def _bound(self) -> None:
        kernel.bound(self.cov, self.limits.lowest_var, self.limits.highest_var)

    def _fuse(
        self, spread: Array, expected: float, innovation: float, variance: float, left_alone: Sequence[int] = ()
    ) -> bool:
        if left_alone or not self._can_fuse(innovation, variance, expected):
            return super()._fuse(spread, expected, innovation, variance, left_alone)
        variance = max(variance, MIN_NOISE_VAR)
        sigma = math.sqrt(max(expected, 0.0) + variance)
        is_sharp = expected > SHARP * variance
        states, after, limits = self.states.copy(), np.empty((STATES, STATES)), self.limits
        was_fused, *quat = kernel.fuse(
            self.cov,
            spread,
            sigma,
            innovation,
            is_sharp,
            _components(self.quat),
            states,
            limits.lowest,
            limits.highest,
            limits.lowest_var,
            after,
        )
        if was_fused:
            self.quat = quaternion.quaternion(*quat)
            self.states, self.cov = states, after
        return bool(was_fused)
