# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The covariance of the errors of the filter's 22 states, and what becomes of it.

It stays symmetric to the bit, and positive: no mix of errors gets a negative variance. The order of the states is
attitude (4), velocity, position, gyro bias, accelerometer bias, field of the earth, field of the vehicle (3 each).
Source: AP_NavEKF3/AP_NavEKF3_core.cpp (CovariancePrediction, ConstrainVariances).
"""

import math
from typing import Final, final

from librt.vecs import vec
from mypy_extensions import i64

from ekf_stub.core.vectors import Quat, Rotation, Vec2, Vec3, larger

STATES: Final = 22
VEL: Final = 4
VEL_D: Final = 6
POS: Final = 7
POS_D: Final = 9
GYRO: Final = 10
ACCEL: Final = 13
EARTH: Final = 16
BODY: Final = 19
_MOVING: Final = 10  # states that a step changes

MIN_NOISE_VAR: Final = 1e-8
MIN_ACCEL_VAR: Final = 5e-9
_MIN_ACCEL_VAR_RATIO: Final = 0.01
_MAX_GROWING_POS_VAR: Final = 1e4
_SHARP: Final = 1e4
_ROUNDING: Final = 1e-13
_NO_VAR: Final = 1e-30


@final
class Covariance:
    """The covariance.

    A measurement is fused in two steps: ``look_at`` or ``look_along`` works out how the errors go with what is
    predicted, and ``fuse`` corrects the covariance by it.

    Attributes:
        row: how a prediction depends on the errors, for ``look_along``.
        gain: by how much each state is corrected, in units of the innovation's sigma, as of the last ``fuse``.
    """

    def __init__(self) -> None:
        self._p = vec[float]([0.0] * (STATES * STATES))
        self._half = vec[float]([0.0] * (STATES * STATES))
        self._transition = vec[float]([0.0] * 49)
        self._spread = vec[float]([0.0] * STATES)
        self._lowest = vec[float]([0.0] * STATES)
        self._highest = vec[float]([0.0] * STATES)
        self.row = vec[float]([0.0] * STATES)
        self.gain = vec[float]([0.0] * STATES)

    def var(self, state: i64) -> float:
        """Return a variance."""
        return self._p[state * STATES + state]

    def at(self, row: i64, column: i64) -> float:
        """Return an element."""
        return self._p[row * STATES + column]

    def put(self, row: i64, column: i64, value: float) -> None:
        """Set an element, on both sides of the diagonal."""
        self._p[row * STATES + column] = value
        self._p[column * STATES + row] = value

    def _used(self) -> i64:
        """Return how many states are estimated: all, or all but the two fields (stateIndexLim)."""
        i: i64
        for i in range(EARTH, STATES):
            if self._p[i * (STATES + 1)] != 0.0:
                return STATES
        return EARTH

    def variances(self) -> list[float]:
        """Return all variances."""
        return [self._p[state * (STATES + 1)] for state in range(STATES)]

    def set_limits(self, first: i64, end: i64, lowest: float, highest: float) -> None:
        """Set the limits of some variances."""
        i: i64
        for i in range(first, end):
            self._lowest[i] = lowest
            self._highest[i] = highest

    # Prediction

    def predict(
        self,
        quat: Quat,
        rotation: Rotation,
        del_ang: Vec3,
        del_vel: Vec3,
        dt: float,
        attitude_var: float,
        vel_var: float,
        bias_vars: Vec2,
        field_vars: Vec2,
    ) -> None:
        """Move on by a step.

        Args:
            quat, rotation: the attitude at the end of the step.
            del_ang, del_vel: of the step, without biases, rad and m/s, body.
            dt: its length, s.
            attitude_var: what it adds to the variance of a rotation about any axis, rad^2.
            vel_var: what it adds to each variance of velocity.
            bias_vars: what it adds to those of the biases of gyro and accelerometer.
            field_vars: what it adds to those of the fields of the earth and of the vehicle.
        """
        self._set_transition(quat, rotation, del_ang, del_vel)
        p, half, f = self._p, self._half, self._transition
        # FIRMWARE PARITY: where the firmware keeps a position from growing less certain it keeps its covariances too.
        first_axis: i64 = 2 if self.var(POS) + self.var(POS + 1) > _MAX_GROWING_POS_VAR else 0
        i: i64
        j: i64
        k: i64
        m: i64
        used, y_row, z_row, w_row = self._used(), STATES, 2 * STATES, 3 * STATES
        # F P. The rows of biases and fields are those of P.
        for i in range(POS):
            k = 7 * i
            a, b, c, d, x, y, z = f[k], f[k + 1], f[k + 2], f[k + 3], f[k + 4], f[k + 5], f[k + 6]
            own = 0.0 if i < VEL else 1.0
            k = STATES * (GYRO if i < VEL else ACCEL)
            m = STATES * i
            for j in range(used):
                total = a * p[j] + b * p[y_row + j] + c * p[z_row + j] + d * p[w_row + j]
                total = total - x * p[k] - y * p[k + y_row] - z * p[k + z_row]
                half[m] = total + own * p[m]
                k += 1
                m += 1
        for i in range(POS, _MOVING):
            by_dt = dt if i - POS >= first_axis else 0.0
            k = STATES * (i - 3)
            m = STATES * i
            for _ in range(used):
                half[m] = p[m] + by_dt * p[k]
                k += 1
                m += 1
        # F P F', of which one half is the mirror image of the other.
        for j in range(_MOVING):
            m = 7 * j
            a, b, c, d, x, y, z = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            if j < POS:
                a, b, c, d, x, y, z = f[m], f[m + 1], f[m + 2], f[m + 3], f[m + 4], f[m + 5], f[m + 6]
            bias: i64 = GYRO if j < VEL else ACCEL
            by_dt = dt if j - POS >= first_axis else 0.0
            for i in range(j, _MOVING):
                k = i * STATES
                if j < POS:
                    total = a * half[k] + b * half[k + 1] + c * half[k + 2] + d * half[k + 3]
                    m = k + bias
                    total = total - x * half[m] - y * half[m + 1] - z * half[m + 2]
                    if j >= VEL:
                        total += half[k + j]
                else:
                    total = half[k + j] + by_dt * half[k + j - 3]
                p[k + j] = total
                p[j * STATES + i] = total
            k = j * STATES + _MOVING
            m = _MOVING * STATES + j
            for _ in range(_MOVING, used):
                total = half[k]
                p[k] = total
                p[m] = total
                k += 1
                m += STATES
        self._add_noise(attitude_var, vel_var, bias_vars, field_vars)

    def _set_transition(self, quat: Quat, rotation: Rotation, del_ang: Vec3, del_vel: Vec3) -> None:
        """Set how attitude and velocity depend on attitude (4) and, negative, on the bias (3), a row each."""
        w, x, y, z = 0.5 * quat[0], 0.5 * quat[1], 0.5 * quat[2], 0.5 * quat[3]
        a, b, c = 0.5 * del_ang[0], 0.5 * del_ang[1], 0.5 * del_ang[2]
        self._set_row(0, 1.0, -a, -b, -c, (-x, -y, -z))
        self._set_row(1, a, 1.0, c, -b, (w, -z, y))
        self._set_row(2, b, -c, 1.0, a, (z, w, -x))
        self._set_row(3, c, b, -a, 1.0, (-y, x, w))
        w, x, y, z = 2 * quat[0], 2 * quat[1], 2 * quat[2], 2 * quat[3]
        p, q, r = del_vel
        self._set_row(
            4, r * y - q * z, q * y + r * z, r * w + q * x - 2 * p * y, r * x - q * w - 2 * p * z, rotation[0]
        )
        self._set_row(
            5, p * z - r * x, p * y - 2 * q * x - r * w, p * x + r * z, p * w - 2 * q * z + r * y, rotation[1]
        )
        self._set_row(
            6, q * x - p * y, p * z + q * w - 2 * r * x, q * z - p * w - 2 * r * y, p * x + q * y, rotation[2]
        )

    def _set_row(self, row: i64, a: float, b: float, c: float, d: float, by_bias: Vec3) -> None:
        f = self._transition
        k: i64 = 7 * row
        f[k] = a
        f[k + 1] = b
        f[k + 2] = c
        f[k + 3] = d
        f[k + 4] = by_bias[0]
        f[k + 5] = by_bias[1]
        f[k + 6] = by_bias[2]

    def _add_noise(self, attitude_var: float, vel_var: float, bias_vars: Vec2, field_vars: Vec2) -> None:
        p, f = self._p, self._transition
        i: i64
        j: i64
        for i in range(VEL):
            x, y, z = attitude_var * f[7 * i + 4], attitude_var * f[7 * i + 5], attitude_var * f[7 * i + 6]
            for j in range(i + 1):
                total = p[i * STATES + j] + (x * f[7 * j + 4] + y * f[7 * j + 5] + z * f[7 * j + 6])
                p[i * STATES + j] = total
                p[j * STATES + i] = total
        for i in range(3):
            p[(VEL + i) * (STATES + 1)] += vel_var
            p[(GYRO + i) * (STATES + 1)] += bias_vars[0]
            p[(ACCEL + i) * (STATES + 1)] += bias_vars[1]
            p[(EARTH + i) * (STATES + 1)] += field_vars[0]
            p[(BODY + i) * (STATES + 1)] += field_vars[1]

    # Limits

    def clear(self, first: i64, end: i64, variance: float) -> None:
        """Forget what some errors have to do with others, and give them a variance; the highest if it is NaN."""
        p, highest = self._p, self._highest[first]
        i: i64
        j: i64
        for i in range(first, end):
            for j in range(STATES):
                p[i * STATES + j] = 0.0
                p[j * STATES + i] = 0.0
        for i in range(first, end):
            p[i * STATES + i] = larger(variance, 0.0) if variance <= highest else highest

    def lower(self) -> None:
        """Shrink errors whose variance is too large.

        FIRMWARE PARITY: the firmware cuts the variance only. Errors may then seem correlated by more than one, and the
        next fusion makes variances negative. Here covariances shrink too, and correlations stay.
        """
        p, highest = self._p, self._highest
        i: i64
        j: i64
        for i in range(STATES):
            if p[i * STATES + i] > highest[i]:
                scale = math.sqrt(highest[i] / p[i * STATES + i])
                for j in range(STATES):
                    p[i * STATES + j] *= scale
                for j in range(STATES):
                    p[j * STATES + i] *= scale
                p[i * STATES + i] = highest[i]

    def lift(self) -> None:
        """Raise variances that are too small; of an axis of the accelerometer's bias, beside the largest of three."""
        p, lowest = self._p, self._lowest
        largest = larger(larger(self.var(ACCEL), self.var(ACCEL + 1)), self.var(ACCEL + 2))
        i: i64
        for i in range(ACCEL, EARTH):
            lowest[i] = larger(_MIN_ACCEL_VAR_RATIO * largest, MIN_ACCEL_VAR)
        for i in range(STATES):
            if p[i * STATES + i] < lowest[i]:
                p[i * STATES + i] = lowest[i]

    def is_positive(self) -> bool:
        """Return whether no mix of errors has a negative variance, but for rounding (Cholesky's decomposition)."""
        p, low = self._p, self._half
        i: i64
        j: i64
        k: i64
        for j in range(STATES):
            for i in range(j, STATES):
                total = p[i * STATES + j]
                if i == j:
                    total += _ROUNDING * total + _NO_VAR
                for k in range(j):
                    total -= low[i * STATES + k] * low[j * STATES + k]
                if i == j:
                    if not total > 0.0:
                        return False
                    low[j * STATES + j] = math.sqrt(total)
                else:
                    low[i * STATES + j] = total / low[j * STATES + j]
        return True

    # Fusion

    def look_at(self, state: i64) -> float:
        """Look at a state; return its variance."""
        p, spread = self._p, self._spread
        i: i64
        for i in range(STATES):
            spread[i] = p[state * STATES + i]
        return spread[state]

    def look_along(self, first: i64, end: i64) -> float:
        """Look at what depends on some of the errors by ``row``; return its variance."""
        p, row, spread = self._p, self.row, self._spread
        i: i64
        j: i64
        for i in range(STATES):
            total = 0.0
            for j in range(first, end):
                total += p[i * STATES + j] * row[j]
            spread[i] = total
        total = 0.0
        for j in range(first, end):
            total += row[j] * spread[j]
        return total

    def fuse(self, expected: float, variance: float, left_alone: i64) -> float:
        """Fuse what was looked at last; set ``gain`` and return the sigma of the innovation.

        Args:
            expected: the variance of the prediction, as ``look_at`` or ``look_along`` returned it.
            variance: that of the measurement.
            left_alone: a bit for each state that the measurement is not to correct.

        Returns:
            0, with all as it was, if a variance would become negative.
        """
        variance = larger(variance, MIN_NOISE_VAR)
        sigma = math.sqrt(larger(expected, 0.0) + variance)
        p, gain, spread = self._p, self.gain, self._spread
        i: i64
        j: i64
        k: i64
        m: i64
        for i in range(STATES):
            gain[i] = spread[i] / sigma
            if p[i * STATES + i] - gain[i] * gain[i] < 0.0 and not left_alone >> i & 1:
                return 0.0
        # So much more may be known after it than before that the difference of the two has lost its last digits;
        # these are made up for, on the safe side.
        rounding = _ROUNDING if expected > _SHARP * variance else 0.0
        for i in range(STATES):
            spread[i] = rounding * p[i * STATES + i]
        for i in range(self._used()):
            g = gain[i]
            k = i * STATES
            m = i
            for j in range(i + 1):
                total = p[k] - g * gain[j]
                p[k] = total
                p[m] = total
                k += 1
                m += STATES
        if left_alone:
            self._give_back(left_alone, 1.0, 0.5)
            if not self.is_positive():
                # FIRMWARE PARITY: the firmware goes on with that. This is the covariance of such a gain.
                self._give_back(left_alone, 0.0, -0.5)
            for i in range(STATES):
                if left_alone >> i & 1:
                    gain[i] = 0.0
        if rounding > 0.0:
            for i in range(STATES):
                p[i * STATES + i] += spread[i]
        self.lift()
        return sigma

    def _give_back(self, left_alone: i64, of_two: float, of_one: float) -> None:
        """Give back a share of what states that are to be left alone have lost: with each other, and with others."""
        p, gain = self._p, self.gain
        i: i64
        j: i64
        for i in range(STATES):
            for j in range(i + 1):
                left: i64 = (left_alone >> i & 1) + (left_alone >> j & 1)
                if left:
                    total = p[i * STATES + j] + (of_two if left == 2 else of_one) * gain[i] * gain[j]
                    p[i * STATES + j] = total
                    p[j * STATES + i] = total

    # Resets

    def forget_correlations(self) -> None:
        """Forget what the errors of attitude and of biases have to do with others; how large they are stays."""
        p = self._p
        i: i64
        j: i64
        for i in range(STATES):
            for j in range(STATES):
                is_attitude = i < VEL and j < VEL
                is_forgotten = i < VEL or j < VEL or GYRO <= i < EARTH or GYRO <= j < EARTH
                if is_forgotten and not is_attitude and i != j:
                    p[i * STATES + j] = 0.0

    def set_attitude(self, quat: Quat, body_vars: Vec3) -> None:
        """Set the covariance of the attitude by variances of rotations about the axes of the body, rad^2.

        The gyro's bias adds what it turns the body by in a step.
        """
        w, x, y, z = 0.5 * quat[0], 0.5 * quat[1], 0.5 * quat[2], 0.5 * quat[3]
        rows = [(-x, -y, -z), (w, -z, y), (z, w, -x), (-y, x, w)]
        x_y, x_z, y_z = self.at(GYRO, GYRO + 1), self.at(GYRO, GYRO + 2), self.at(GYRO + 1, GYRO + 2)
        a, b, c = body_vars[0] + self.var(GYRO), body_vars[1] + self.var(GYRO + 1), body_vars[2] + self.var(GYRO + 2)
        for i in range(VEL):
            p = rows[i]
            about_x = a * p[0] + x_y * p[1] + x_z * p[2]
            about_y = x_y * p[0] + b * p[1] + y_z * p[2]
            about_z = x_z * p[0] + y_z * p[1] + c * p[2]
            for j in range(i + 1):
                q = rows[j]
                self.put(i, j, about_x * q[0] + about_y * q[1] + about_z * q[2])
