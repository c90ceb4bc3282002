# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Vectors and attitudes of a vehicle as tuples: at 400 per second an array of numpy for each would cost too much.

Quaternions are w, x, y, z and turn the body (FRD) to the earth (NED). More is in ``ekf_stub.core.vectors``, whose
rotations leave out small ones as the firmware does; those here are exact.
"""

import math
from typing import Final

from ekf_stub.core.vectors import Quat, conjugate, normalized, rotated, scaled, times

Three = tuple[float, float, float]

ZERO: Final = (0.0, 0.0, 0.0)


def added(vector: Three, other: Three, factor: float = 1.0) -> Three:
    """Return a vector plus a multiple of another one."""
    return vector[0] + factor * other[0], vector[1] + factor * other[1], vector[2] + factor * other[2]


def yawed(vector: Three, angle_rad: float) -> Three:
    """Return a vector turned about the vertical, to the right."""
    cos, sin = math.cos(angle_rad), math.sin(angle_rad)
    return cos * vector[0] - sin * vector[1], sin * vector[0] + cos * vector[1], vector[2]


def limited_length(vector: Three, limit: float) -> Three:
    """Return a vector, no longer than the limit."""
    length = math.hypot(*vector)
    return vector if length <= limit else scaled(vector, limit / length)


def to_body(quat: Quat, vector_ned: Three) -> Three:
    """Return a vector of the earth frame in the body frame."""
    return rotated(conjugate(quat), vector_ned)


def turned(quat: Quat, by_rad: Three) -> Quat:
    """Return an attitude after a rotation of the body by a rotation vector in rad."""
    x, y, z = 0.5 * by_rad[0], 0.5 * by_rad[1], 0.5 * by_rad[2]
    half = math.sqrt(x * x + y * y + z * z)
    part = math.sin(half) / half if half else 1.0
    return normalized(times(quat, (math.cos(half), part * x, part * y, part * z)))


def rotation_vector(quat: Quat) -> Three:
    """Return the rotation vector of a unit quaternion in rad, the shorter way round."""
    w, x, y, z = quat if quat[0] >= 0 else (-quat[0], -quat[1], -quat[2], -quat[3])
    size = math.sqrt(x * x + y * y + z * z)
    scale = 2.0 * math.atan2(size, w) / size if size else 2.0
    return scale * x, scale * y, scale * z


def rotation_between(first: Quat, second: Quat) -> Three:
    """Return the rotation vector in rad that leads from one attitude to another, in the body frame, the shorter way."""
    return rotation_vector(times(conjugate(first), second))


def halfway(first: Quat, second: Quat) -> Quat:
    """Return the attitude between two that are less than half a turn apart."""
    sign = math.copysign(1.0, times(conjugate(first), second)[0])
    (a, b, c, d), (w, x, y, z) = first, second
    return normalized((a + sign * w, b + sign * x, c + sign * y, d + sign * z))
