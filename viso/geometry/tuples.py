# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Vectors and quaternions as tuples of numbers, which need not be finite.

Quaternions are w, x, y, z. Angles are in rad.
"""

import math

Vector = tuple[float, float, float]
Quat = tuple[float, float, float, float]


def plus(first: Vector, second: Vector) -> Vector:
    """Return the sum."""
    return first[0] + second[0], first[1] + second[1], first[2] + second[2]


def times(factor: float, vector: Vector) -> Vector:
    """Return the vector, scaled."""
    return factor * vector[0], factor * vector[1], factor * vector[2]


def cross(first: Vector, second: Vector) -> Vector:
    """Return the cross product."""
    (a, b, c), (x, y, z) = first, second
    return b * z - c * y, c * x - a * z, a * y - b * x


def product(first: Quat, second: Quat) -> Quat:
    """Return the quaternion that turns as the second, then as the first."""
    (a, b, c, d), (w, x, y, z) = first, second
    return (
        a * w - b * x - c * y - d * z,
        a * x + b * w + c * z - d * y,
        a * y - b * z + c * w + d * x,
        a * z + b * y - c * x + d * w,
    )


def inverse(quat_wxyz: Quat) -> Quat:
    """Return the turn back, of a unit quaternion."""
    w, x, y, z = quat_wxyz
    return w, -x, -y, -z


def turned(quat_wxyz: Quat, vector: Vector) -> Vector:
    """Return the vector, turned by a unit quaternion."""
    _, x, y, z = product(product(quat_wxyz, (0.0, *vector)), inverse(quat_wxyz))
    return x, y, z


def yaw_quat(yaw_rad: float) -> Quat:
    """Return a turn about the vertical axis."""
    return math.cos(yaw_rad / 2), 0.0, 0.0, math.sin(yaw_rad / 2)


def quat_from_euler(roll: float, pitch: float, yaw: float) -> Quat:
    """Return the attitude of angles in the order yaw, pitch, roll; NaN of infinite ones."""
    if not (math.isfinite(roll) and math.isfinite(pitch) and math.isfinite(yaw)):
        return math.nan, math.nan, math.nan, math.nan
    about_y = math.cos(pitch / 2), 0.0, math.sin(pitch / 2), 0.0
    about_x = math.cos(roll / 2), math.sin(roll / 2), 0.0, 0.0
    return product(product(yaw_quat(yaw), about_y), about_x)


def euler_from_quat(quat_wxyz: Quat) -> Vector:
    """Return roll, pitch and yaw of a unit quaternion."""
    w, x, y, z = quat_wxyz
    sine = 2.0 * (w * y - z * x)
    pitch = math.copysign(math.pi / 2, sine) if abs(sine) >= 1.0 else math.asin(sine)
    roll = math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    return roll, pitch, math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
