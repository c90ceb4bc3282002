# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A float32 quaternion (AP_Math/quaternion.cpp, Quaternion).

Components are (q1, q2, q3, q4) = (w, x, y, z), Hamilton convention. Nothing is normalised on input or output.
"""

import math

import numpy as np

from ap_core.fmath import (
    asinf,
    atan2f,
    constrain_float,
    cosf,
    f32,
    is_zero,
    safe_asin,
    sinf,
    sqrtf,
    wrap_pi,
)
from ap_core.internal_error import InternalError, InternalErrorSink
from ap_core.matrix3 import Matrix3f
from ap_core.vector3 import Vector3f

_ZERO = f32(0)
_HALF = f32(0.5)
_ONE = f32(1)
_TWO = f32(2)
_DOWN = Vector3f(0, 0, 1)


class Quaternion:
    """Attitude as (w, x, y, z); the identity when constructed without arguments. Treat it as immutable."""

    __slots__ = ("_yaw", "q1", "q2", "q3", "q4")

    def __init__(
        self,
        q1: float | np.float32 = 1.0,
        q2: float | np.float32 = 0.0,
        q3: float | np.float32 = 0.0,
        q4: float | np.float32 = 0.0,
    ):
        # As in Vector3f.
        self.q1 = q1 if type(q1) is f32 else f32(q1)
        self.q2 = q2 if type(q2) is f32 else f32(q2)
        self.q3 = q3 if type(q3) is f32 else f32(q3)
        self.q4 = q4 if type(q4) is f32 else f32(q4)
        self._yaw: np.float32 | None = None

    def __repr__(self) -> str:
        return f"Quaternion({self.q1}, {self.q2}, {self.q3}, {self.q4})"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Quaternion) and self.to_wxyz() == other.to_wxyz()

    def __hash__(self) -> int:
        return hash(self.to_wxyz())

    def to_wxyz(self) -> tuple[np.float32, np.float32, np.float32, np.float32]:
        """Return (w, x, y, z)."""
        return self.q1, self.q2, self.q3, self.q4

    def is_nan(self) -> bool:
        """Return whether any component is NaN (QuaternionT::is_nan)."""
        return math.isnan(self.q1) or math.isnan(self.q2) or math.isnan(self.q3) or math.isnan(self.q4)

    @classmethod
    def from_euler(cls, roll: np.float32, pitch: np.float32, yaw: np.float32) -> "Quaternion":
        """Return the quaternion of 3-2-1 Euler angles in radians (QuaternionT::from_euler)."""
        r2, p2, y2 = roll * _HALF, pitch * _HALF, yaw * _HALF
        cr2, cp2, cy2 = cosf(r2), cosf(p2), cosf(y2)
        sr2, sp2, sy2 = sinf(r2), sinf(p2), sinf(y2)
        cr2cp2, sr2sp2, sr2cp2, cr2sp2 = cr2 * cp2, sr2 * sp2, sr2 * cp2, cr2 * sp2
        return cls(
            cr2cp2 * cy2 + sr2sp2 * sy2,
            sr2cp2 * cy2 - cr2sp2 * sy2,
            cr2sp2 * cy2 + sr2cp2 * sy2,
            cr2cp2 * sy2 - sr2sp2 * cy2,
        )

    def __mul__(self, v: "Quaternion") -> "Quaternion":
        """Return the Hamilton product (QuaternionT::operator*)."""
        w1, x1, y1, z1 = self.q1, self.q2, self.q3, self.q4
        w2, x2, y2, z2 = v.q1, v.q2, v.q3, v.q4
        return Quaternion(
            w1 * w2 - x1 * x2 - y1 * y2 - z1 * z2,
            w1 * x2 + x1 * w2 + y1 * z2 - z1 * y2,
            w1 * y2 - x1 * z2 + y1 * w2 + z1 * x2,
            w1 * z2 + x1 * y2 - y1 * x2 + z1 * w2,
        )

    def rotate_vector(self, v: Vector3f) -> Vector3f:
        """Rotate a vector without normalising: a zero quaternion leaves it unchanged, a long one stretches it.

        Source: QuaternionT::operator*(const Vector3<T> &).
        """
        q1, q2, q3, q4 = self.q1, self.q2, self.q3, self.q4
        uv_x = q3 * v.z - q4 * v.y
        uv_y = q4 * v.x - q2 * v.z
        uv_z = q2 * v.y - q3 * v.x
        uv_x, uv_y, uv_z = uv_x + uv_x, uv_y + uv_y, uv_z + uv_z
        return Vector3f(
            v.x + (q1 * uv_x + q3 * uv_z - q4 * uv_y),
            v.y + (q1 * uv_y + q4 * uv_x - q2 * uv_z),
            v.z + (q1 * uv_z + q2 * uv_y - q3 * uv_x),
        )

    def inverse(self) -> "Quaternion":
        """Return the conjugate; the norm is not divided out (QuaternionT::inverse, QuaternionT::invert)."""
        return Quaternion(self.q1, -self.q2, -self.q3, -self.q4)

    def normalized(self, errors: InternalErrorSink) -> "Quaternion":
        """Return the unit quaternion; a zero one stays zero and raises an internal error (QuaternionT::normalize)."""
        q1, q2, q3, q4 = self.q1, self.q2, self.q3, self.q4
        length = sqrtf(q1 * q1 + q2 * q2 + q3 * q3 + q4 * q4)
        if is_zero(length):
            errors(InternalError.FLOW_OF_CONTROL, 673)
            return self
        factor = _ONE / length
        return Quaternion(q1 * factor, q2 * factor, q3 * factor, q4 * factor)

    def get_euler_roll(self) -> np.float32:
        """Return roll in radians, -pi..pi."""
        q1, q2, q3, q4 = self.q1, self.q2, self.q3, self.q4
        return atan2f(_TWO * (q1 * q2 + q3 * q4), _ONE - _TWO * (q2 * q2 + q3 * q3))

    def get_euler_pitch(self) -> np.float32:
        """Return pitch in radians, -pi/2..pi/2."""
        return safe_asin(_TWO * (self.q1 * self.q3 - self.q4 * self.q2))

    def get_euler_yaw(self) -> np.float32:
        """Return yaw in radians, -pi..pi; computed once, because a sample's yaw is used several times."""
        if self._yaw is None:
            q1, q2, q3, q4 = self.q1, self.q2, self.q3, self.q4
            self._yaw = atan2f(_TWO * (q1 * q4 + q2 * q3), _ONE - _TWO * (q3 * q3 + q4 * q4))
        return self._yaw

    def to_euler(self) -> tuple[np.float32, np.float32, np.float32]:
        """Return (roll, pitch, yaw) in radians (QuaternionT::to_euler)."""
        return self.get_euler_roll(), self.get_euler_pitch(), self.get_euler_yaw()

    def rotation_matrix(self) -> Matrix3f:
        """Return the rotation matrix, body to earth (QuaternionT::rotation_matrix)."""
        q1, q2, q3, q4 = self.q1, self.q2, self.q3, self.q4
        q3q3, q3q4, q2q2, q2q3 = q3 * q3, q3 * q4, q2 * q2, q2 * q3
        q2q4, q1q2, q1q3, q1q4, q4q4 = q2 * q4, q1 * q2, q1 * q3, q1 * q4, q4 * q4
        return Matrix3f(
            Vector3f(_ONE - _TWO * (q3q3 + q4q4), _TWO * (q2q3 - q1q4), _TWO * (q2q4 + q1q3)),
            Vector3f(_TWO * (q2q3 + q1q4), _ONE - _TWO * (q2q2 + q4q4), _TWO * (q3q4 - q1q2)),
            Vector3f(_TWO * (q2q4 - q1q3), _TWO * (q3q4 + q1q2), _ONE - _TWO * (q2q2 + q3q3)),
        )

    def to_axis_angle(self) -> Vector3f:
        """Return the rotation vector: axis times angle in radians (QuaternionT::to_axis_angle)."""
        length = sqrtf(self.q2 * self.q2 + self.q3 * self.q3 + self.q4 * self.q4)
        v = Vector3f(self.q2, self.q3, self.q4)
        if is_zero(length):
            return v
        return (v / length) * f32(wrap_pi(float(_TWO * atan2f(length, self.q1))))

    def angular_difference(self, v: "Quaternion") -> "Quaternion":
        """Return the rotation from ``v`` to this attitude (QuaternionT::angular_difference)."""
        return v.inverse() * self

    def roll_pitch_difference(self, v: "Quaternion", errors: InternalErrorSink) -> np.float32:
        """Return the earth-frame tilt between two attitudes in radians, 0..pi.

        Source: QuaternionT::roll_pitch_difference.
        """
        z_unit_m = self.rotation_matrix().mul_transpose(_DOWN)
        z_unit_vm = v.rotation_matrix().mul_transpose(_DOWN)
        half_length = (z_unit_vm - z_unit_m).length() * _HALF
        return _TWO * asinf(constrain_float(half_length, _ZERO, _ONE, errors, line=822))
