# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The filter's states at the fusion horizon, with the covariance of their errors (AP_NavEKF3/AP_NavEKF3_core.cpp).

They are the first 22 of the firmware's 24 states; wind is left out. The errors of the attitude are those of the
quaternion's four components, and are added to it. Magnetic fields are estimated in flight with a compass only. Process
noise, limits and order are the firmware's. Nothing that is not finite gets in.
"""

import math
from typing import Final, final

from ekf_stub.core.covariance import ACCEL, EARTH, GYRO, MIN_ACCEL_VAR, POS, POS_D, STATES, VEL, VEL_D, Covariance
from ekf_stub.core.inertial import EKF_TARGET_DT, GRAVITY_MSS, MIN_DT, Inertial
from ekf_stub.core.params import Params
from ekf_stub.core.vectors import (
    ONE,
    ZERO,
    Quat,
    Rotation,
    Vec3,
    add,
    conjugate,
    is_finite,
    larger,
    length,
    length2,
    limited,
    matrix,
    normalized,
    scaled,
    smaller,
    square,
    sub,
    times,
    to_body,
    to_earth,
    turned,
    within,
    yaw_of,
    yaw_sine_cosine,
)

EARTH_RATE: Final = 7.292115e-5
MAX_INNOVATION: Final = 1e7
_MAX_VEL: Final = 500.0
_MAX_POS_NE: Final = 50e6
_MAX_HEIGHT: Final = 4e4
_MAX_DEPTH: Final = 1e4
_MAX_EARTH_FIELD: Final = 1.0
_MAX_BODY_FIELD: Final = 0.5
_MAX_GYRO_BIAS: Final = 0.5
_MAX_GYRO_BIAS_SIGMA: Final = 0.175
_MAX_ACCEL_BIAS_SIGMA: Final = 10.0
_MAX_ATT_VAR: Final = 1.0
_MAX_VEL_VAR: Final = 1e3
_MAX_POS_VAR: Final = 1e6
_MAX_FIELD_VAR: Final = 0.01
_MIN_VEL_POS_VAR: Final = 1e-4
_MAX_TILT_VAR: Final = math.radians(30.0) ** 2
_INITIAL_ATT_VAR: Final = 0.1 * 0.1
_INITIAL_GYRO_BIAS: Final = math.radians(2.5)
_ACCEL_BIAS_LIM_SCALER: Final = 0.2
_OBSERVABLE_COSINE: Final = 0.8
_POORLY_OBSERVABLE_COSINE: Final = math.sqrt(0.5)
_MAX_ACCEL_WITHOUT_AIDING: Final = 5.0
_BAD_ACCEL_NOISE: Final = 5.0  # m/s/s
_ALL_ACCEL: Final = 7 << 13  # a bit for each state of the accelerometer's bias


def within_vel(vel: Vec3) -> Vec3:
    """Return a velocity within the filter's limits, m/s, NED."""
    return within(vel, _MAX_VEL)


def within_pos(pos: Vec3) -> Vec3:
    """Return a position within the filter's limits, m, NED."""
    return (
        limited(pos[0], -_MAX_POS_NE, _MAX_POS_NE),
        limited(pos[1], -_MAX_POS_NE, _MAX_POS_NE),
        limited(pos[2], -_MAX_HEIGHT, _MAX_DEPTH),
    )


@final
class State:
    """States and covariance.

    Args:
        quat: attitude, body (FRD) to earth (NED).
        vel_vars, pos_vars: initial variances of velocity and position, (m/s)^2 and m^2.
        forgets_frozen: see ``FilterRelease``.

    Attributes:
        quat: attitude, body to earth.
        vel, pos: m/s and m, NED.
        gyro_bias, accel_bias: rad and m/s a step of the filter of average length.
        earth_field, body_field: magnetic fields of the earth (NED) and of the vehicle (body), Gauss.
        rotation: body to earth, as of the last prediction; zero before the first, as the firmware has it.
        accel_filtered: earth-frame acceleration without gravity, m/s/s, slowly filtered.
        earth_rate_ned: rad/s.
        cov: the covariance of the errors.
        learns_biases, learns_field: whether biases and magnetic fields are estimated.
        accel_is_bad: the accelerometers measure something else than the vehicle's acceleration (badIMUdata).
        predicted_tilt_var: variance of the direction of down, rad^2, as of the last prediction.
        refused: how many steps, measurements and states were unsound.
    """

    def __init__(self, params: Params, quat: Quat, vel_vars: Vec3, pos_vars: Vec3, forgets_frozen: bool) -> None:
        self._params = params
        self.quat: Quat = quat
        self.vel: Vec3 = ZERO
        self.pos: Vec3 = ZERO
        self.gyro_bias: Vec3 = ZERO
        self.accel_bias: Vec3 = ZERO
        self.earth_field: Vec3 = ZERO
        self.body_field: Vec3 = ZERO
        self.rotation: Rotation = (ZERO, ZERO, ZERO)
        self.accel_filtered: Vec3 = ZERO
        self.earth_rate_ned: Vec3 = (EARTH_RATE, 0.0, 0.0)
        self.learns_biases = False
        self.learns_field = False
        self.accel_is_bad = False
        self.refused = 0
        self._forgets_frozen = forgets_frozen
        self._aided = False
        self._frozen: Vec3 = (-1.0, -1.0, -1.0)  # variances of biases that are not learned, negative for those that are
        self._max_gyro_bias = 0.0
        self._max_accel_bias = 0.0
        self._dt_ekf_avg = 0.0
        self.cov = Covariance()
        self.cov.set_limits(0, VEL, 0.0, _MAX_ATT_VAR)
        self.cov.set_limits(VEL, POS, _MIN_VEL_POS_VAR, _MAX_VEL_VAR)
        self.cov.set_limits(POS, GYRO, _MIN_VEL_POS_VAR, _MAX_POS_VAR)
        self.cov.set_limits(EARTH, STATES, 0.0, _MAX_FIELD_VAR)
        self.cov.set_attitude(quat, (_INITIAL_ATT_VAR, _INITIAL_ATT_VAR, _INITIAL_ATT_VAR))
        for axis in range(3):
            self.clear(VEL + axis, VEL + axis + 1, vel_vars[axis])
            self.clear(POS + axis, POS + axis + 1, pos_vars[axis])
        self._set_dt(EKF_TARGET_DT)
        self._doubt_biases(EKF_TARGET_DT)
        self.predicted_tilt_var = self._tilt_var()

    def _set_dt(self, dt_ekf_avg: float) -> None:
        """Set the average length of a step in s, for which biases are kept."""
        self._max_accel_bias = larger(self._params.ACC_BIAS_LIM, 0.0) * dt_ekf_avg
        if dt_ekf_avg == self._dt_ekf_avg:
            return
        self._dt_ekf_avg = dt_ekf_avg
        self._max_gyro_bias = _MAX_GYRO_BIAS * dt_ekf_avg
        self.cov.set_limits(GYRO, ACCEL, 0.0, square(_MAX_GYRO_BIAS_SIGMA * dt_ekf_avg))
        self.cov.set_limits(ACCEL, EARTH, 0.0, square(_MAX_ACCEL_BIAS_SIGMA * dt_ekf_avg))

    def learn_biases(self, dt_ekf_avg: float) -> None:
        """Begin to estimate the biases, as tilt has been aligned (setWindMagStateLearningMode)."""
        self.learns_biases = True
        self._set_dt(dt_ekf_avg)
        self._doubt_biases(dt_ekf_avg)

    def _doubt_biases(self, dt_ekf_avg: float) -> None:
        """Set the variances of the biases as they are before any measurement; the first prediction adds them."""
        self.clear(GYRO, ACCEL, square(_INITIAL_GYRO_BIAS * dt_ekf_avg))
        self.clear(ACCEL, EARTH, square(_ACCEL_BIAS_LIM_SCALER * self._params.ACC_BIAS_LIM * dt_ekf_avg))

    def learn_field(self, learns_field: bool) -> None:
        """Begin to estimate the magnetic fields, or stop; else their errors are zero."""
        self.learns_field = learns_field
        if not learns_field:
            self.clear(EARTH, STATES, 0.0)

    def doubt_accel(self, is_bad: bool, vel_down_var: float, height_var: float) -> None:
        """Take the accelerometers for bad or good; bad ones keep variances of climb and height from being small."""
        if is_bad != self.accel_is_bad:
            self.accel_is_bad = is_bad
            self.cov.set_limits(VEL_D, VEL_D + 1, vel_down_var if is_bad else _MIN_VEL_POS_VAR, _MAX_VEL_VAR)
            self.cov.set_limits(POS_D, POS_D + 1, height_var if is_bad else _MIN_VEL_POS_VAR, _MAX_POS_VAR)

    # Prediction

    def predict(
        self, step: Inertial, measured: Inertial, dt_ekf_avg: float, aided: bool, on_ground: bool, is_moved: bool
    ) -> None:
        """Move state and covariance on by a step; refuse unsound inertial data.

        ``measured`` is the step as its sensors measured it, of which the covariance's prediction takes the state's
        biases, though they are other sensors' (`InactiveBiases.corrected`).

        On the ground an accelerometer's bias is learned along gravity only, and not at all while somebody moves the
        vehicle.
        """
        if not step.is_sound():
            self.refused += 1
            return
        self._aided = aided
        self._set_dt(dt_ekf_avg)
        if self.learns_biases:
            self._max_accel_bias = limited(self._params.ACC_BIAS_LIM, 0.0, _MAX_ACCEL_BIAS_SIGMA) * dt_ekf_avg
        self._move(step, dt_ekf_avg, aided)
        angle, velocity = (
            sub(measured.del_ang, self.gyro_bias),
            sub(measured.del_vel, self.accel_bias),
        )  # within limits now
        if self.learns_biases:
            self._freeze_unobservable(on_ground, is_moved)
        dt = limited(0.5 * (step.del_ang_dt + step.del_vel_dt), 0.5 * dt_ekf_avg, 2.0 * dt_ekf_avg)
        self._predict_covariance(angle, velocity, dt)
        self._isolate()
        self.cov.lower()
        self.cov.lift()
        self._keep_a_covariance()
        self.predicted_tilt_var = self._tilt_var()

    def _predict_covariance(self, angle: Vec3, velocity: Vec3, dt: float) -> None:
        params = self._params
        accel = _BAD_ACCEL_NOISE if self.accel_is_bad else limited(params.ACC_P_NSE, 0.0, _BAD_ACCEL_NOISE)
        bias_vars = 0.0, 0.0
        if self.learns_biases:
            bias_vars = (
                square(dt * dt * limited(params.GBIAS_P_NSE, 0.0, 1.0)),
                square(dt * dt * limited(params.ABIAS_P_NSE, 0.0, 1.0)),
            )
        field_vars = 0.0, 0.0
        if self.learns_field:
            field_vars = (
                square(dt * limited(params.MAGE_P_NSE, 0.0, 1.0)),
                square(dt * limited(params.MAGB_P_NSE, 0.0, 1.0)),
            )
        attitude_var = square(dt * limited(params.GYRO_P_NSE, 0.0, 1.0))
        self.cov.predict(
            self.quat, self.rotation, angle, velocity, dt, attitude_var, square(dt * accel), bias_vars, field_vars
        )

    def _move(self, step: Inertial, dt_ekf_avg: float, aided: bool) -> None:
        """Move on by a step, with less than the measured acceleration if that is large and nothing aids."""
        dt = step.del_vel_dt
        angle = sub(
            self.turn_of(step, dt_ekf_avg), scaled(to_body(self.rotation, self.earth_rate_ned), step.del_ang_dt)
        )
        north, east, down = to_earth(self.rotation, sub(step.del_vel, scaled(self.accel_bias, dt / dt_ekf_avg)))
        down += GRAVITY_MSS * dt
        self.quat = turned(self.quat, angle)
        self.rotation = matrix(self.quat)
        new = 0.05 / larger(dt, MIN_DT)
        x, y, z = self.accel_filtered
        x, y = 0.95 * x + new * north, 0.95 * y + new * east
        self.accel_filtered = x, y, 0.95 * z + new * down
        horizontal = length2(x, y)
        if not aided and horizontal > _MAX_ACCEL_WITHOUT_AIDING:
            north *= _MAX_ACCEL_WITHOUT_AIDING / horizontal
            east *= _MAX_ACCEL_WITHOUT_AIDING / horizontal
        self.pos = add(self.pos, scaled(add(self.vel, (0.5 * north, 0.5 * east, 0.5 * down)), dt))
        self.vel = add(self.vel, (north, east, down))
        self._limit()

    def _limit(self) -> None:
        self.vel = within_vel(self.vel)
        self.pos = within_pos(self.pos)
        self.gyro_bias = within(self.gyro_bias, self._max_gyro_bias)
        self.accel_bias = within(self.accel_bias, self._max_accel_bias)

    def _freeze_unobservable(self, on_ground: bool, is_moved: bool) -> None:
        # On the ground only the bias of an axis that points along gravity can be told from tilt.
        down = self.rotation[2]
        self._frozen = (
            self._freeze(ACCEL, self._frozen[0], down[0], on_ground, is_moved),
            self._freeze(ACCEL + 1, self._frozen[1], down[1], on_ground, is_moved),
            self._freeze(ACCEL + 2, self._frozen[2], down[2], on_ground, is_moved),
        )

    def _freeze(self, state: int, frozen: float, cosine: float, on_ground: bool, is_moved: bool) -> float:
        """Return the variance at which the bias of an axis is frozen, negative if it is learned."""
        if on_ground and (abs(cosine) <= _OBSERVABLE_COSINE or is_moved):
            return frozen if frozen >= 0.0 else larger(self.cov.var(state), 0.0)
        if frozen >= 0.0:
            self.clear(state, state + 1, frozen)
        return -1.0

    def _freezes(self) -> bool:
        return self._frozen[0] >= 0.0 or self._frozen[1] >= 0.0 or self._frozen[2] >= 0.0

    def _isolate(self) -> None:
        # What is not estimated still adds its variance to velocity at each prediction, as noise.
        cov = self.cov
        if not self.learns_biases:
            cov.clear(GYRO, ACCEL, 0.0)
            cov.clear(ACCEL, EARTH, 10 * MIN_ACCEL_VAR)
        if not self._freezes():
            return
        x_y, x_z, y_z = cov.at(ACCEL, ACCEL + 1), cov.at(ACCEL, ACCEL + 2), cov.at(ACCEL + 1, ACCEL + 2)
        x, y, z = self._frozen
        if x >= 0.0:
            cov.clear(ACCEL, ACCEL + 1, x)
        if y >= 0.0:
            cov.clear(ACCEL + 1, ACCEL + 2, y)
        if z >= 0.0:
            cov.clear(ACCEL + 2, ACCEL + 3, z)
        if not self._forgets_frozen:
            # FIRMWARE PARITY: up to 2025 what a frozen bias has to do with a learned one of a later axis is kept.
            if x >= 0.0 > y:
                cov.put(ACCEL, ACCEL + 1, x_y)
            if x >= 0.0 > z:
                cov.put(ACCEL, ACCEL + 2, x_z)
            if y >= 0.0 > z:
                cov.put(ACCEL + 1, ACCEL + 2, y_z)

    def _keep_a_covariance(self) -> None:
        """Forget what biases have to do with each other where one is frozen, if with it the covariance were none.

        FIRMWARE PARITY: the firmware goes on with such a covariance, also as the bias is learned again.
        """
        if self._forgets_frozen or not self._freezes():
            return
        cov = self.cov
        shared = (
            cov.at(ACCEL, ACCEL + 1) != 0.0 or cov.at(ACCEL, ACCEL + 2) != 0.0 or cov.at(ACCEL + 1, ACCEL + 2) != 0.0
        )
        if shared and not cov.is_positive():
            cov.put(ACCEL, ACCEL + 1, 0.0)
            cov.put(ACCEL, ACCEL + 2, 0.0)
            cov.put(ACCEL + 1, ACCEL + 2, 0.0)

    # Fusion

    def update_state(self, state: int, innovation: float, variance: float) -> bool:
        """Fuse a measurement of one state of velocity or position; say whether it was (FuseVelPosNED).

        Without aiding what is measured is assumed, and the biases that it says little of are left alone.
        """
        left_alone = self.unlearned if self._aided else self._poorly_observable(state)
        return self.fuse(self.cov.look_at(state), innovation, variance, left_alone)

    @property
    def unlearned(self) -> int:
        """A bit for each state that measurements of motion are not to correct: the biases of bad accelerometers."""
        return _ALL_ACCEL if self.accel_is_bad else 0

    def _poorly_observable(self, state: int) -> int:
        left_alone = 0
        for axis in range(3):
            if abs(self.rotation[2][axis]) > _POORLY_OBSERVABLE_COSINE:
                left_alone |= 1 << (GYRO + axis)
        is_vertical = state == VEL_D or state == POS_D
        return left_alone if is_vertical and not self.accel_is_bad else left_alone | _ALL_ACCEL

    def look_along_yaw(self, by_321: bool) -> float:
        """Look at yaw, of one of the two sequences of rotation; return its variance, rad^2."""
        w, x, y, z = self.quat
        sine, cosine = yaw_sine_cosine(self.quat, by_321)
        size = sine * sine + cosine * cosine
        row = self.cov.row
        if size == 0.0:  # x (3-2-1) or y (3-1-2) points up or down, and there is no yaw
            row[0] = row[1] = row[2] = row[3] = 0.0
        else:
            s, c = 2 * sine / size, 2 * cosine / size
            row[0] = c * z - s * w
            row[1] = c * y - s * x if by_321 else s * x - c * y
            row[2] = c * x + s * y if by_321 else -c * x - s * y
            row[3] = c * w + s * z
        return self.cov.look_along(0, VEL)

    def look_along_body_velocity(self, axis: int, scale: float, quat: Quat, vel: Vec3) -> float:
        """Look at a velocity along an axis of the body, 0..2, times a number; return its variance.

        ``quat`` and ``vel`` are the attitude and the velocity, m/s, NED, at which it depends on the errors.
        """
        w, x, y, z = quat
        row = self.cov.row
        self.set_body_axis_row(axis, quat, vel)
        if axis == 0:
            row[4], row[5], row[6] = w * w + x * x - y * y - z * z, 2 * (w * z + x * y), 2 * (x * z - w * y)
        elif axis == 1:
            row[4], row[5], row[6] = 2 * (x * y - w * z), w * w - x * x + y * y - z * z, 2 * (w * x + y * z)
        else:
            row[4], row[5], row[6] = 2 * (w * y + x * z), 2 * (y * z - w * x), w * w - x * x - y * y + z * z
        for i in range(POS):
            row[i] *= scale
        return self.cov.look_along(0, POS)

    def set_body_axis_row(self, axis: int, quat: Quat, vector_ned: Vec3) -> None:
        """Set in the covariance's row how a vector, seen along an axis of the body, depends on an attitude."""
        w, x, y, z = quat
        north, east, down = scaled(vector_ned, 2.0)
        along = w * north + z * east - y * down
        across = x * north + y * east + z * down
        over = w * down - x * east + y * north
        aside = w * east + x * down - z * north
        row = self.cov.row
        if axis == 0:
            row[0], row[1], row[2], row[3] = along, across, -over, aside
        elif axis == 1:
            row[0], row[1], row[2], row[3] = aside, over, across, -along
        else:
            row[0], row[1], row[2], row[3] = over, -aside, along, across

    def fuse(self, expected: float, innovation: float, variance: float, left_alone: int = 0) -> bool:
        """Fuse what the covariance has looked at last; say whether it was.

        It is not when a variance would become negative, or when all is unsound.

        Args:
            expected: the variance of the prediction, as the covariance returned it.
            innovation: prediction less measurement.
            variance: of the measurement.
            left_alone: a bit for each state that it is not to correct.
        """
        if not (abs(innovation) <= MAX_INNOVATION and 0.0 <= variance < math.inf and expected < math.inf):
            self.refused += 1
            return False
        sigma = self.cov.fuse(expected, variance, left_alone)
        if sigma == 0.0:
            return False
        self._correct(-innovation / sigma)
        return True

    def _correct(self, by: float) -> None:
        """Add the covariance's gains, times a number, to the states; biases are limited with the next prediction."""
        g = self.cov.gain
        w, x, y, z = self.quat
        w, x, y, z = w + g[0] * by, x + g[1] * by, y + g[2] * by, z + g[3] * by
        if w * w + x * x + y * y + z * z > 0.0:
            self.quat = normalized((w, x, y, z))
        self.vel = within_vel(add(self.vel, (g[4] * by, g[5] * by, g[6] * by)))
        self.pos = within_pos(add(self.pos, (g[7] * by, g[8] * by, g[9] * by)))
        # Biases may leave their limits until the next prediction (ConstrainStates).
        self.gyro_bias = add(self.gyro_bias, (g[10] * by, g[11] * by, g[12] * by))
        self.accel_bias = add(self.accel_bias, (g[13] * by, g[14] * by, g[15] * by))
        if self.learns_field:
            self.earth_field = add(self.earth_field, (g[16] * by, g[17] * by, g[18] * by))
            self.body_field = add(self.body_field, (g[19] * by, g[20] * by, g[21] * by))
            self.earth_field = within(self.earth_field, _MAX_EARTH_FIELD)
            self.body_field = within(self.body_field, _MAX_BODY_FIELD)

    # Resets

    def clear(self, first: int, end: int, variance: float) -> None:
        """Forget what some errors have to do with others, and give them a variance, within limits."""
        is_estimated = self.learns_field or first < EARTH
        self.cov.clear(first, end, variance if is_estimated else 0.0)

    def set_vel(self, vel: Vec3) -> None:
        """Set the velocity; not to what is not finite."""
        if self._may_set(vel):
            self.vel = within_vel(vel)

    def set_pos(self, pos: Vec3) -> None:
        """Set the position; not to what is not finite."""
        if self._may_set(pos):
            self.pos = within_pos(pos)

    def set_gyro_bias(self, bias: Vec3) -> None:
        """Set the gyro's bias; not to what is not finite."""
        if self._may_set(bias):
            self.gyro_bias = within(bias, self._max_gyro_bias)

    def set_accel_bias(self, bias: Vec3) -> None:
        """Set the accelerometer's bias; not to what is not finite."""
        if self._may_set(bias):
            self.accel_bias = within(bias, self._max_accel_bias)

    def set_earth_field(self, field: Vec3) -> None:
        """Set the earth's magnetic field; not to what is not finite."""
        if self._may_set(field):
            self.earth_field = within(field, _MAX_EARTH_FIELD)

    def set_body_field(self, field: Vec3) -> None:
        """Set the vehicle's magnetic field; not to what is not finite."""
        if self._may_set(field):
            self.body_field = within(field, _MAX_BODY_FIELD)

    def _may_set(self, value: Vec3) -> bool:
        if is_finite(value):
            return True
        self.refused += 1
        return False

    def set_yaw(self, yaw: float, variance: float, by_321: bool) -> Quat:
        """Set yaw, keep roll, pitch and how well they are known; return the rotation, as seen from the body."""
        if not math.isfinite(yaw):
            self.refused += 1
            return ONE
        half = 0.5 * (yaw - self.yaw(by_321))
        turn = math.cos(half), 0.0, 0.0, math.sin(half)
        before = self.quat
        tilt_var = 0.5 * self.predicted_tilt_var
        yaw_var = larger(variance, 0.0) if variance <= _MAX_ATT_VAR else _MAX_ATT_VAR
        self.quat = normalized(times(turn, before))
        self.rotation = matrix(self.quat)
        self.clear(0, VEL, 0.0)
        north, east, down = self.rotation
        self.cov.set_attitude(
            self.quat,
            (
                tilt_var * (square(north[0]) + square(east[0])) + yaw_var * square(down[0]),
                tilt_var * (square(north[1]) + square(east[1])) + yaw_var * square(down[1]),
                tilt_var * (square(north[2]) + square(east[2])) + yaw_var * square(down[2]),
            ),
        )
        self.predicted_tilt_var = self._tilt_var()
        return times(conjugate(before), self.quat)

    # What follows from it

    def yaw(self, by_321: bool) -> float:
        """Return yaw in rad, of one of the two sequences of rotation."""
        return yaw_of(self.quat, by_321)

    def prefers_321(self) -> bool:
        """Return whether yaw is best measured by the x axis (3-2-1), not by the y axis (3-1-2)."""
        return abs(self.rotation[2][0]) < abs(self.rotation[2][1])

    def turn_of(self, step: Inertial, dt_ekf_avg: float) -> Vec3:
        """Return by how much a step has turned the vehicle, rad, body, without the gyro's bias."""
        return sub(step.del_ang, scaled(self.gyro_bias, step.del_ang_dt / dt_ekf_avg))

    def acceleration(self) -> float:
        """Return how large the filtered acceleration is, m/s/s."""
        return length(self.accel_filtered)

    def component(self, state: int) -> float:
        """Return one of the states of velocity and position by its number among all of them."""
        return self.vel[state - VEL] if state < POS else self.pos[state - POS]

    def _tilt_var(self) -> float:
        """Return the variance of the direction of down, rad^2 (calcTiltErrorVariance).

        Each component of the quaternion counts for itself, as if they had nothing to do with each other.
        """
        w, x, y, z = self.quat
        cov = self.cov
        var = (x * x + y * y) * (cov.var(0) + cov.var(3)) + (w * w + z * z) * (cov.var(1) + cov.var(2))
        return smaller(4 * var, _MAX_TILT_VAR)
