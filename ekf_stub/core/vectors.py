# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Vectors, quaternions and rotation matrices as tuples of floats, which compiled code keeps in registers.

A quaternion (w, x, y, z) or a rotation matrix turns vectors of the body (FRD) to those of the earth (NED).
"""

import math
import struct
from typing import Final

Vec2 = tuple[float, float]
Vec3 = tuple[float, float, float]
Quat = tuple[float, float, float, float]
Rotation = tuple[Vec3, Vec3, Vec3]

# Not Final, as compiled code takes a final tuple of floats for unset.
ZERO: Vec3 = (0.0, 0.0, 0.0)
ONE: Quat = (1.0, 0.0, 0.0, 0.0)
_FLT_EPSILON: Final = 2.0**-23
_TURN: Final = 2 * math.pi


def limited(value: float, low: float, high: float) -> float:
    """Return the value, not below ``low`` nor above ``high``; ``low`` for NaN."""
    if high < value:
        value = high
    return value if value > low else low


def square(value: float) -> float:
    """Return the square."""
    return value * value


def larger(a: float, b: float) -> float:
    """Return the larger of two numbers; the first if the second is NaN."""
    return b if b > a else a


def smaller(a: float, b: float) -> float:
    """Return the smaller of two numbers; the first if the second is NaN."""
    return b if b < a else a


def single(value: float) -> float:
    """Return the number in single precision."""
    (rounded,) = struct.unpack("<f", struct.pack("<f", value))
    return float(rounded)


def is_finite(a: Vec3) -> bool:
    """Return whether no component is infinite or NaN."""
    return math.isfinite(a[0]) and math.isfinite(a[1]) and math.isfinite(a[2])


def wrap_pi(angle: float) -> float:
    """Return an angle within -pi..pi."""
    if -math.pi <= angle <= math.pi:
        return angle
    return math.remainder(angle, _TURN)


# Vectors


def add(a: Vec3, b: Vec3) -> Vec3:
    """Return the sum."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def sub(a: Vec3, b: Vec3) -> Vec3:
    """Return the difference."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def scaled(a: Vec3, by: float) -> Vec3:
    """Return the vector times a number."""
    return a[0] * by, a[1] * by, a[2] * by


def dot(a: Vec3, b: Vec3) -> float:
    """Return the scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vec3, b: Vec3) -> Vec3:
    """Return the vector product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def length(a: Vec3) -> float:
    """Return the length."""
    return math.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])


def length2(x: float, y: float) -> float:
    """Return the length of a horizontal vector."""
    return math.sqrt(x * x + y * y)


def is_zero(a: Vec3) -> bool:
    """Return whether all components are zero."""
    return a[0] == 0.0 and a[1] == 0.0 and a[2] == 0.0


def within(a: Vec3, limit: float) -> Vec3:
    """Return the vector with each component within +- a limit."""
    return limited(a[0], -limit, limit), limited(a[1], -limit, limit), limited(a[2], -limit, limit)


# Quaternions


def times(p: Quat, q: Quat) -> Quat:
    """Return the product: the rotation q, then p."""
    a, b, c, d = p
    w, x, y, z = q
    return (
        a * w - b * x - c * y - d * z,
        a * x + b * w + c * z - d * y,
        a * y - b * z + c * w + d * x,
        a * z + b * y - c * x + d * w,
    )


def conjugate(q: Quat) -> Quat:
    """Return the inverse of a unit quaternion."""
    return q[0], -q[1], -q[2], -q[3]


def normalized(q: Quat) -> Quat:
    """Return the quaternion with length 1."""
    w, x, y, z = q
    size = math.sqrt(w * w + x * x + y * y + z * z)
    return w / size, x / size, y / size, z / size


def turned(q: Quat, by: Vec3) -> Quat:
    """Return an attitude after a rotation of the body by a rotation vector, rad.

    FIRMWARE PARITY: a rotation of less than the epsilon of a float counts as none (QuaternionT::from_axis_angle).
    """
    if not length(by) >= _FLT_EPSILON:
        return normalized(q)
    x, y, z = 0.5 * by[0], 0.5 * by[1], 0.5 * by[2]
    half = math.sqrt(x * x + y * y + z * z)
    part = math.sin(half) / half
    return normalized(times(q, (math.cos(half), part * x, part * y, part * z)))


def rotated(q: Quat, a: Vec3) -> Vec3:
    """Return a vector of the body as the earth sees it."""
    _, x, y, z = times(times(q, (0.0, a[0], a[1], a[2])), conjugate(q))
    return x, y, z


def rotation_vector(q: Quat) -> Vec3:
    """Return the rotation vector of a unit quaternion, rad, the shorter way round.

    FIRMWARE PARITY: of a rotation of less than twice the epsilon of a float it is half (QuaternionT::to_axis_angle).
    """
    w, x, y, z = q
    if w < 0:
        w, x, y, z = -w, -x, -y, -z
    size = math.sqrt(x * x + y * y + z * z)
    if not size >= _FLT_EPSILON:
        return x, y, z
    scale = 2.0 * (math.atan2(size, w) / size)
    return scale * x, scale * y, scale * z


def quat_of_euler(roll: float, pitch: float, yaw: float) -> Quat:
    """Return the quaternion of roll, pitch and yaw (3-2-1) in rad."""
    about_z = math.cos(0.5 * yaw), 0.0, 0.0, math.sin(0.5 * yaw)
    about_y = math.cos(0.5 * pitch), 0.0, math.sin(0.5 * pitch), 0.0
    about_x = math.cos(0.5 * roll), math.sin(0.5 * roll), 0.0, 0.0
    return times(times(about_z, about_y), about_x)


def euler_of(q: Quat) -> Vec3:
    """Return roll, pitch and yaw (3-2-1) in rad."""
    w, x, y, z = q
    return (
        math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)),
        math.asin(limited(2 * (w * y - z * x), -1.0, 1.0)),
        math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)),
    )


def angle_between(first: Quat, second: Quat) -> float:
    """Return the angle from one attitude to another, rad."""
    turn = normalized(times(first, conjugate(second)))
    return 2 * math.acos(limited(abs(turn[0]), 0.0, 1.0))


def yaw_of(q: Quat, by_321: bool) -> float:
    """Return yaw in rad, of the sequence of rotations 3-2-1 or 3-1-2."""
    sine, cosine = yaw_sine_cosine(q, by_321)
    return math.atan2(sine, cosine)


def yaw_sine_cosine(q: Quat, by_321: bool) -> Vec2:
    """Return sine and cosine of yaw, both times the same positive number."""
    w, x, y, z = q
    if by_321:
        return 2 * (w * z + x * y), w * w + x * x - y * y - z * z
    return 2 * (w * z - x * y), w * w - x * x + y * y - z * z


# Rotation matrices


def matrix(q: Quat) -> Rotation:
    """Return the rotation matrix of a unit quaternion."""
    w, x, y, z = q
    return (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )


def to_earth(r: Rotation, a: Vec3) -> Vec3:
    """Return a vector of the body as the earth sees it."""
    return dot(r[0], a), dot(r[1], a), dot(r[2], a)


def to_body(r: Rotation, a: Vec3) -> Vec3:
    """Return a vector of the earth as the body sees it."""
    n, e, d = r
    x, y, z = a
    return (
        x * n[0] + y * e[0] + z * d[0],
        x * n[1] + y * e[1] + z * d[1],
        x * n[2] + y * e[2] + z * d[2],
    )


# Times, in ms since boot, that wrap at 2^32

U32: Final = 0xFFFFFFFF
_SIGN: Final = 1 << 31


def since_ms(later: int, earlier: int) -> int:
    """Return the time from one stamp to another, 0..2^32 - 1."""
    return (later - earlier) & U32


def signed_since_ms(later: int, earlier: int) -> int:
    """Return the time from one stamp to another, which may be the later one, -2^31..2^31 - 1."""
    return (((later - earlier) & U32) ^ _SIGN) - _SIGN


def later_ms(first: int, second: int) -> int:
    """Return the later of two stamps."""
    return first if 0 < ((first - second) & U32) < _SIGN else second
