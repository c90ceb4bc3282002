# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A 3x3 float32 matrix (AP_Math/matrix3.cpp, Matrix3f)."""

from ap_core.fmath import cosf, f32, sinf
from ap_core.vector3 import Vector3f


class Matrix3f:
    """Rows ``a``, ``b`` and ``c``; zero when constructed without arguments. Treat it as immutable."""

    __slots__ = ("a", "b", "c")

    def __init__(self, a: Vector3f | None = None, b: Vector3f | None = None, c: Vector3f | None = None):
        self.a = a if a is not None else Vector3f()
        self.b = b if b is not None else Vector3f()
        self.c = c if c is not None else Vector3f()

    def __repr__(self) -> str:
        return f"Matrix3f({self.a}, {self.b}, {self.c})"

    @classmethod
    def from_euler(cls, roll: "f32", pitch: "f32", yaw: "f32") -> "Matrix3f":
        """Return the 3-2-1 rotation matrix, body to earth, of angles in radians (Matrix3::from_euler)."""
        cp, sp = cosf(pitch), sinf(pitch)
        sr, cr = sinf(roll), cosf(roll)
        sy, cy = sinf(yaw), cosf(yaw)
        return cls(
            Vector3f(cp * cy, (sr * sp * cy) - (cr * sy), (cr * sp * cy) + (sr * sy)),
            Vector3f(cp * sy, (sr * sp * sy) + (cr * cy), (cr * sp * sy) - (sr * cy)),
            Vector3f(-sp, sr * cp, cr * cp),
        )

    def __mul__(self, v: Vector3f) -> Vector3f:
        """Return the product with a column vector, each row left to right."""
        a, b, c = self.a, self.b, self.c
        return Vector3f(
            a.x * v.x + a.y * v.y + a.z * v.z,
            b.x * v.x + b.y * v.y + b.z * v.z,
            c.x * v.x + c.y * v.y + c.z * v.z,
        )

    def mul_transpose(self, v: Vector3f) -> Vector3f:
        """Return the product of the transpose with a column vector (Matrix3::mul_transpose)."""
        a, b, c = self.a, self.b, self.c
        return Vector3f(
            a.x * v.x + b.x * v.y + c.x * v.z,
            a.y * v.x + b.y * v.y + c.y * v.z,
            a.z * v.x + b.z * v.y + c.z * v.z,
        )
