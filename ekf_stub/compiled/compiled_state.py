# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The filter with its prediction and its fusion compiled by numba, behind the interface of the plain one.

`ekf_stub.filter.error_state` is the definition and the default. What is fused while nothing aids is seldom, and
stays with it. Needs the extra numba.
"""

import math
from collections.abc import Sequence

import numpy as np

from ekf_stub.compiled import compiled_kernel as kernel
from ekf_stub.filter import quaternions as quaternion
from ekf_stub.filter.attitude import yaw_by_components
from ekf_stub.filter.error_state import ErrorState
from ekf_stub.filter.inertial import Array, InertialStep, limited
from ekf_stub.filter.process_model import ProcessNoise
from ekf_stub.filter.states import EARTH, STATES


class CompiledErrorState(ErrorState):
    """Nominal state and error covariance at the fusion horizon."""

    def __init__(self, quat: quaternion.quaternion, variances: Array) -> None:
        super().__init__(quat, variances)
        self._frozen: Array = np.full(3, math.nan)  # in place of _frozen_accel_vars; NaN for None

    def predict(
        self,
        step: InertialStep,
        noise: ProcessNoise,
        dt_ekf_avg: float,
        *,
        aided: bool,
        on_ground: bool,
        is_moved: bool = False,
    ) -> None:
        limits, quat = self.limits, self.quat
        limits.set_step(dt_ekf_avg)
        dt = limited(0.5 * (step.del_ang_dt + step.del_vel_dt), 0.5 * dt_ekf_avg, 2.0 * dt_ekf_avg)
        states, rotation, accel_filtered = self.states.copy(), self.rotation.copy(), self.accel_filtered.copy()
        w, x, y, z, tilt_variance = kernel.predict(
            self.cov,
            (quat.w, quat.x, quat.y, quat.z),
            states,
            rotation,
            accel_filtered,
            self._frozen,
            step.del_ang,
            step.del_vel,
            step.del_ang_dt,
            step.del_vel_dt,
            dt,
            dt_ekf_avg,
            self.earth_rate_ned,
            aided,
            on_ground,
            is_moved,
            self.learns_biases,
            self.forgets_frozen,
            *self._process_variances(noise, dt),
            limits.lowest,
            limits.highest,
            limits.lowest_var,
            limits.highest_var,
        )
        if tilt_variance < 0.0:
            self.refused += 1
            return
        self._aided = aided
        self.quat, self.predicted_tilt_variance = quaternion.quaternion(w, x, y, z), tilt_variance
        self.states, self.rotation, self.accel_filtered = states, rotation, accel_filtered
        self._keep_a_covariance()

    def _freezes(self) -> bool:
        return not all(map(math.isnan, self._frozen.tolist()))

    def clear(self, states: slice, variance: float) -> None:
        if states.start >= EARTH.start and not self.learns_field:
            variance = 0.0
        kernel.clear(self.cov, states.start, states.stop, variance, self.limits.highest_var.item(states.start))

    def update_states(self, wanted: Sequence[tuple[int, float, float]]) -> list[float]:
        if not self._aided or self.accel_is_bad:
            return super().update_states(wanted)
        states, cov, limits, innovations = self.states.copy(), self.cov.copy(), self.limits, np.empty(len(wanted))
        quat = self.quat
        refused, *components = kernel.update_states(
            cov,
            (quat.w, quat.x, quat.y, quat.z),
            states,
            np.array(wanted),
            limits.lowest,
            limits.highest,
            limits.lowest_var,
            innovations,
        )
        self.quat = quaternion.quaternion(*components)
        self.states, self.cov = states, cov
        self.refused += refused
        return innovations.tolist()

    def spread_of_yaw(self, *, by_321: bool) -> tuple[Array, float]:
        spread = np.empty(STATES)
        return spread, kernel.set_spread(spread, self.cov, *yaw_by_components(self.quat, by_321=by_321))

    def fuse_spread(
        self, spread: Array, expected: float, innovation: float, variance: float, left_alone: Sequence[int] = ()
    ) -> bool:
        if left_alone or not self._can_fuse(innovation, variance, expected):
            return super().fuse_spread(spread, expected, innovation, variance, left_alone)
        states, after, limits, quat = self.states.copy(), np.empty((STATES, STATES)), self.limits, self.quat
        was_fused, *components = kernel.fuse(
            self.cov,
            spread,
            expected,
            innovation,
            variance,
            (quat.w, quat.x, quat.y, quat.z),
            states,
            limits.lowest,
            limits.highest,
            limits.lowest_var,
            after,
        )
        if was_fused:
            self.quat = quaternion.quaternion(*components)
            self.states, self.cov = states, after
        return bool(was_fused)
