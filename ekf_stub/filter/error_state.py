# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The filter: states, and the covariance of their errors (AP_NavEKF3/AP_NavEKF3_core.cpp).

The errors of the attitude are those of the quaternion's four components, and are added to it. Magnetic fields are
estimated in flight with a compass only. Process noise, limits and order are the firmware's.
"""

import math
from collections.abc import Sequence
from functools import cache
from typing import Final

import numpy as np
import numpy.typing as npt

from ekf_stub.filter import covariance
from ekf_stub.filter import quaternions as quaternion
from ekf_stub.filter.attitude import body_axes_by_attitude, by_rotation, yaw_by_components
from ekf_stub.filter.inertial import Array, InertialStep, is_sound, limited
from ekf_stub.filter.nominal_state import NominalState
from ekf_stub.filter.process_model import ProcessModel, ProcessNoise
from ekf_stub.filter.states import (
    ACCEL,
    ATT,
    BODY,
    EARTH,
    GYRO,
    MAX_ATT_VAR,
    MIN_ACCEL_VAR,
    MIN_VEL_POS_VAR,
    POS,
    STATES,
    VEL,
)
from ekf_stub.reports.core_report import Three

INITIAL_ATT_VAR: Final = 0.1**2
INITIAL_GYRO_BIAS_DEG_S: Final = 2.5
ACCEL_BIAS_LIM_SCALER: Final = 0.2
OBSERVABLE_COSINE: Final = 0.8
POORLY_OBSERVABLE_COSINE: Final = math.sqrt(0.5)
MAX_TILT_VAR: Final = math.radians(30.0) ** 2
MAX_INNOVATION: Final = 1e7
MIN_NOISE_VAR: Final = 1e-8
SHARP: Final = 1e4

_BIASES: Final = slice(GYRO.start - ATT.stop, ACCEL.stop - ATT.stop)
_FIELDS: Final = slice(EARTH.start, BODY.stop)


@cache
def _apart(*are_frozen: bool, forgets_frozen: bool) -> npt.NDArray[np.bool_]:
    """Return where a covariance is to be 0, shape (22, 22), as biases of the accelerometer's axes are not learned."""
    apart = np.zeros((STATES, STATES), np.bool_)
    for state, is_frozen in enumerate(are_frozen, ACCEL.start):
        if is_frozen:
            later = slice(state + 1, ACCEL.stop)
            apart[state] = apart[:, state] = True
            apart[state, later] = apart[later, state] = forgets_frozen
    return apart


class ErrorState(NominalState):
    """Nominal state and error covariance at the fusion horizon.

    Args:
        quat: attitude, body (FRD) to earth (NED).
        variances: initial variances of velocity and position, shape (6,), (m/s)^2 and m^2.

    Attributes:
        cov: shape (22, 22), of the errors of the quaternion's components, velocity, position, biases and fields.
        learns_biases: whether the biases are estimated.
        predicted_tilt_variance: of the direction of down, rad^2, as of the last prediction.
        forgets_frozen: see ``FilterRelease``.
        accel_is_bad: the accelerometers measure something else than the vehicle's acceleration (badIMUdata).
    """

    def __init__(self, quat: quaternion.quaternion, variances: Array) -> None:
        super().__init__(quat)
        self.cov: Array = np.zeros((STATES, STATES))
        self.forgets_frozen = True
        self._set_attitude_covariance(np.full(3, INITIAL_ATT_VAR))
        self.learns_biases = self._learns_field = self.accel_is_bad = False
        for state, variance in enumerate(variances.tolist(), VEL.start):
            self.clear(slice(state, state + 1), variance)
        self.predicted_tilt_variance = self.tilt_variance()
        self._frozen_accel_vars: list[float | None] = [None, None, None]
        self._added_for: tuple[ProcessNoise, float, bool, bool] | None = None
        self._added = 0.0, np.zeros(STATES - VEL.start)
        self._aided = False
        self._model = ProcessModel()

    def _set_attitude_covariance(self, body_variances: Array) -> None:
        by_sigma = by_rotation(self.quat) * np.sqrt(body_variances)
        cov = by_sigma.dot(by_sigma.T)
        self.cov[ATT, ATT] = 0.5 * (cov + cov.T)

    def learn_biases(self, accel_bias_limit: float, dt_ekf_avg: float) -> None:
        """Begin to estimate the biases, as tilt has been aligned (setWindMagStateLearningMode)."""
        self.learns_biases = True
        self.limits.set_accel_bias(accel_bias_limit, dt_ekf_avg)
        gyro_sigma = math.radians(INITIAL_GYRO_BIAS_DEG_S) * dt_ekf_avg
        accel_sigma = ACCEL_BIAS_LIM_SCALER * accel_bias_limit * dt_ekf_avg
        self.clear(GYRO, gyro_sigma * gyro_sigma)
        self.clear(ACCEL, accel_sigma * accel_sigma)

    def doubt_accel(self, *, is_bad: bool, vel_down_variance: float, height_variance: float) -> None:
        """Hear whether the accelerometers are bad, and how large variances of climb and height then are at least."""
        if is_bad != self.accel_is_bad:
            self.accel_is_bad = is_bad
            lowest = self.limits.lowest_var
            lowest[VEL.stop - 1] = vel_down_variance if is_bad else MIN_VEL_POS_VAR
            lowest[POS.stop - 1] = height_variance if is_bad else MIN_VEL_POS_VAR

    @property
    def unlearned(self) -> Sequence[int]:
        """The states that measurements of motion are not to correct: the biases of accelerometers that are bad."""
        return range(ACCEL.start, ACCEL.stop) if self.accel_is_bad else ()

    @property
    def learns_field(self) -> bool:
        """Whether the magnetic fields are estimated; else their errors are zero."""
        return self._learns_field

    @learns_field.setter
    def learns_field(self, learns_field: bool) -> None:
        self._learns_field = learns_field
        if not learns_field:
            self.clear(_FIELDS, 0.0)

    # Prediction

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
        """Move state and covariance on by a step; refuse unsound inertial data.

        On the ground an accelerometer's bias is learned along gravity only, and not at all while somebody moves the
        vehicle.
        """
        if not is_sound(step):
            self.refused += 1
            return
        self._aided = aided
        self.limits.set_step(dt_ekf_avg)
        turned, sped = self._less_biases(step)
        self.move(step, dt_ekf_avg, aided=aided)
        if self.learns_biases:
            self._freeze_unobservable(on_ground=on_ground, is_moved=is_moved)
        dt = limited(0.5 * (step.del_ang_dt + step.del_vel_dt), 0.5 * dt_ekf_avg, 2.0 * dt_ekf_avg)
        attitude_variance, added = self._process_variances(noise, dt)
        self._model.predict(self.cov, self, turned, sped, dt, attitude_variance, added)
        self._isolate()
        covariance.lower(self.cov, self.limits)
        covariance.lift(self.cov, self.limits)
        self._keep_a_covariance()
        self.predicted_tilt_variance = self.tilt_variance()

    def _less_biases(self, step: InertialStep) -> tuple[Three, Three]:
        """Return rotation and change of velocity of a step without the biases, rad and m/s."""
        gx, gy, gz, bx, by, bz = self.states[_BIASES].tolist()
        (x, y, z), (vx, vy, vz) = step.del_ang.tolist(), step.del_vel.tolist()
        return (x - gx, y - gy, z - gz), (vx - bx, vy - by, vz - bz)

    def _process_variances(self, noise: ProcessNoise, dt: float) -> tuple[float, Array]:
        """Return what a step adds to the variance of a rotation about any axis, and to all but the attitude's."""
        key = noise, dt, self.learns_biases, self._learns_field
        if key != self._added_for:  # from one step to the next little of it changes
            self._added_for = key
            variances = noise.variances(dt, biases=self.learns_biases, fields=self._learns_field)
            self._added = noise.attitude_variance(dt), np.array(variances)
        return self._added

    def _freeze_unobservable(self, *, on_ground: bool, is_moved: bool) -> None:
        # On the ground only the bias of an axis that points along gravity can be told from tilt.
        for axis, cosine in enumerate(self.rotation[2].tolist()):
            state = ACCEL.start + axis
            observable = not on_ground or (abs(cosine) > OBSERVABLE_COSINE and not is_moved)
            frozen = self._frozen_accel_vars[axis]
            if not observable and frozen is None:
                self._frozen_accel_vars[axis] = self.cov.item(state, state)
            elif observable and frozen is not None:
                self.clear(slice(state, state + 1), frozen)
                self._frozen_accel_vars[axis] = None

    def _isolate(self) -> None:
        # What is not estimated still adds its variance to velocity at each prediction, as noise.
        if not self.learns_biases:
            self.clear(GYRO, 0.0)
            self.clear(ACCEL, 10 * MIN_ACCEL_VAR)
        first, second, third = (frozen is not None for frozen in self._frozen_accel_vars)
        if first or second or third:
            np.copyto(self.cov, 0.0, where=_apart(first, second, third, forgets_frozen=self.forgets_frozen))
            highest = self.limits.highest_var.item(ACCEL.start)
            for state, frozen in enumerate(self._frozen_accel_vars, ACCEL.start):
                if frozen is not None:
                    self.cov[state, state] = max(frozen, 0.0) if frozen <= highest else highest

    def _keep_a_covariance(self) -> None:
        """Forget what biases have to do with each other where one is frozen, if with it the covariance were none.

        FIRMWARE PARITY: the firmware goes on with such a covariance, also as the bias is learned again.
        """
        among_biases = self.cov[ACCEL, ACCEL]
        shared = any((among_biases.item(0, 1), among_biases.item(0, 2), among_biases.item(1, 2)))
        if shared and not self.forgets_frozen and self._freezes() and not covariance.is_positive(self.cov):
            among_biases[:] = np.diag(among_biases.diagonal())

    def _freezes(self) -> bool:
        return any(frozen is not None for frozen in self._frozen_accel_vars)

    # Fusion

    def update(self, row: Array, innovation: float, variance: float, left_alone: Sequence[int] = ()) -> bool:
        """Fuse a scalar; say whether it was, as it is not when a variance would become negative, or all is unsound.

        Args:
            row: shape (22,), how the prediction depends on the errors.
            innovation: prediction less measurement.
            variance: of the measurement.
            left_alone: states that it is not to correct.
        """
        return self.fuse_spread(*self.spread_of(row), innovation, variance, left_alone)

    def spread_of(self, row: Array) -> tuple[Array, float]:
        """Return how errors go with a prediction that depends on them by ``row``, shape (22,), and its variance."""
        spread = self.cov.dot(row)
        return spread, float(row.dot(spread))

    def fuse(self, row: Array, innovation: float, innovation_variance: float) -> bool:
        """Fuse a scalar like `update`, but with a variance of the innovation that was worked out before."""
        spread, expected = self.spread_of(row)
        variance = max(innovation_variance - expected, 0.0) if innovation_variance > 0.0 else math.nan
        return self.fuse_spread(spread, expected, innovation, variance)

    def update_state(self, index: int, innovation: float, variance: float) -> bool:
        """Fuse a measurement of one state of velocity or position (FuseVelPosNED).

        Without aiding what is measured is assumed, and the biases that it says little of are left alone.
        """
        left_alone = self.unlearned if self._aided else self._poorly_observable(index)
        return self.fuse_spread(self.cov[index], self.cov.item(index, index), innovation, variance, left_alone)

    def update_states(self, wanted: Sequence[tuple[int, float, float]]) -> list[float]:
        """Fuse measurements of states of velocity or position, one after the other; return their innovations.

        Each is the state, what was measured, and the variance of that.
        """
        innovations = []
        for index, measured, variance in wanted:
            innovations.append(self.component(index) - measured)
            self.update_state(index, innovations[-1], variance)
        return innovations

    def _poorly_observable(self, index: int) -> list[int]:
        cosines = enumerate(self.rotation[2].tolist(), GYRO.start)
        states = [state for state, cosine in cosines if abs(cosine) > POORLY_OBSERVABLE_COSINE]
        if self.accel_is_bad or index not in (VEL.stop - 1, POS.stop - 1):
            states += range(ACCEL.start, ACCEL.stop)
        return states

    def fuse_spread(
        self, spread: Array, expected: float, innovation: float, variance: float, left_alone: Sequence[int] = ()
    ) -> bool:
        """Fuse a scalar like `update`, given what `spread_of` says, and the states that it is not to correct."""
        if not self._can_fuse(innovation, variance, expected):
            self.refused += 1
            return False
        variance = max(variance, MIN_NOISE_VAR)
        sigma = math.sqrt(max(expected, 0.0) + variance)
        gain = spread / sigma
        cov = covariance.fused(self.cov, gain, left_alone, is_sharp=expected > SHARP * variance)
        if cov is None:
            return False
        covariance.lift(cov, self.limits)
        self.cov = cov
        if left_alone:
            gain[left_alone] = 0.0
        self.correct(gain * (-innovation / sigma))
        return True

    @staticmethod
    def _can_fuse(innovation: float, variance: float, expected: float) -> bool:
        return abs(innovation) <= MAX_INNOVATION and 0.0 <= variance < math.inf and expected < math.inf

    # Resets

    def clear(self, states: slice, variance: float) -> None:
        """Forget what some errors have to do with others, and give them a variance, within limits."""
        is_estimated = self.learns_field or states.start < EARTH.start
        covariance.clear(self.cov, states, variance if is_estimated else 0.0, self.limits)

    def forget_correlations(self) -> None:
        """Forget what the errors of attitude and of biases have to do with others; how large they are stays."""
        attitude, variances = self.cov[ATT, ATT].copy(), self.cov.diagonal().copy()
        for states in (ATT, slice(GYRO.start, ACCEL.stop)):
            self.cov[states] = self.cov[:, states] = 0.0
        np.fill_diagonal(self.cov, variances)
        self.cov[ATT, ATT] = attitude

    def set_yaw(self, yaw: float, variance: float, *, by_321: bool = True) -> quaternion.quaternion:
        """Set yaw, keep roll, pitch and how well they are known; return the rotation, earth to earth."""
        if not math.isfinite(yaw):
            self.refused += 1
            return quaternion.one
        half = 0.5 * (yaw - self.yaw(by_321=by_321))
        turn = quaternion.quaternion(math.cos(half), 0.0, 0.0, math.sin(half))
        tilt_variance = 0.5 * self.predicted_tilt_variance
        yaw_variance = max(variance, 0.0) if variance <= MAX_ATT_VAR else MAX_ATT_VAR
        self.quat = (turn * self.quat).normalized()
        self.rotation = self.rotation_now()
        self.clear(ATT, 0.0)
        earth_variances = np.array([tilt_variance, tilt_variance, yaw_variance])
        self._set_attitude_covariance(earth_variances.dot(self.rotation * self.rotation))
        self.predicted_tilt_variance = self.tilt_variance()
        return turn

    # What follows from it

    def spread_of_yaw(self, *, by_321: bool) -> tuple[Array, float]:
        """Return what `spread_of` does of yaw, of one of the two sequences of rotation."""
        return self.spread_of(self.yaw_row(by_321=by_321))

    def yaw_row(self, *, by_321: bool) -> Array:
        """Return how yaw, of one of the two sequences of rotation, depends on the errors, shape (22,)."""
        row = np.zeros(STATES)
        row[ATT] = yaw_by_components(self.quat, by_321=by_321)
        return row

    def velocity_row(self, axis: int) -> Array:
        """Return how the velocity along an axis of the body, 0..2, depends on the errors, shape (22,)."""
        quat = self.quat
        w, x, y, z = quat.w, quat.x, quat.y, quat.z
        by_velocity = (
            (w * w + x * x - y * y - z * z, 2 * (w * z + x * y), 2 * (x * z - w * y)),
            (2 * (x * y - w * z), w * w - x * x + y * y - z * z, 2 * (w * x + y * z)),
            (2 * (w * y + x * z), 2 * (y * z - w * x), w * w - x * x - y * y + z * z),
        )
        row = np.zeros(STATES)
        row[ATT], row[VEL] = body_axes_by_attitude(quat, self.vel)[axis], by_velocity[axis]
        return row

    def tilt_variance(self) -> float:
        """Return the variance of the direction of down, rad^2 (calcTiltErrorVariance).

        Each component of the quaternion counts for itself, as if they had nothing to do with each other.
        """
        w, x, y, z = self.quat.w, self.quat.x, self.quat.y, self.quat.z
        var = self.cov.item
        w_var, x_var, y_var, z_var = var(0, 0), var(1, 1), var(2, 2), var(3, 3)
        variance: float = 4 * ((x * x + y * y) * (w_var + z_var) + (w * w + z * z) * (x_var + y_var))
        return min(variance, MAX_TILT_VAR)
