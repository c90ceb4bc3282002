# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Attitudes in double precision, one at a time and fast: 400 per second are needed, and more in virtual time.

A quaternion turns vectors from the body (FRD) to the earth (NED).
"""

import math
from collections.abc import Iterable

from ekf_stub.inputs.measurements import Array
from viso.geometry import quaternions as quaternion
from viso.vehicle.sensors.vectors import Three


def quat_of_rpy(roll: float, pitch: float, yaw: float) -> quaternion.quaternion:
    """Return the quaternion of 3-2-1 Euler angles in rad."""
    cr, cp, cy = math.cos(0.5 * roll), math.cos(0.5 * pitch), math.cos(0.5 * yaw)
    sr, sp, sy = math.sin(0.5 * roll), math.sin(0.5 * pitch), math.sin(0.5 * yaw)
    return quaternion.quaternion(
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


def rotate_to_body(quat: quaternion.quaternion, vector_ned: Iterable[float]) -> Array:
    """Return a vector of the earth frame in the body frame."""
    rotated: Array = (quat.conj() * quaternion.quaternion(0.0, *vector_ned) * quat).vec
    return rotated


def rotation_between(first: quaternion.quaternion, second: quaternion.quaternion) -> Three:
    """Return the rotation vector in rad that leads from one attitude to another, in the body frame, the shorter way."""
    turn = first.conj() * second
    length = math.hypot(turn.x, turn.y, turn.z)
    if length == 0.0:
        return 0.0, 0.0, 0.0
    angle = 2.0 * math.atan2(length, abs(turn.w))
    scale = math.copysign(angle / length, turn.w)
    return scale * turn.x, scale * turn.y, scale * turn.z


def halfway(first: quaternion.quaternion, second: quaternion.quaternion) -> quaternion.quaternion:
    """Return the attitude between two that are less than half a turn apart."""
    turn = first.conj() * second
    return (first + math.copysign(1.0, turn.w) * second).normalized()
