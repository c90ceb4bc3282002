# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Attitudes, body (FRD) to earth (NED), as quaternions: their angles, and how these depend on the four components."""

import math

import numpy as np

from ekf_stub.filter import quaternions as quaternion
from ekf_stub.filter.inertial import Array, limited

Four = tuple[float, float, float, float]


def euler_of(quat: quaternion.quaternion) -> tuple[float, float, float]:
    """Return roll, pitch and yaw (3-2-1) in rad."""
    w, x, y, z = quat.w, quat.x, quat.y, quat.z
    return (
        math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)),
        math.asin(limited(2 * (w * y - z * x), -1.0, 1.0)),
        math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)),
    )


def quat_of_euler(roll: float, pitch: float, yaw: float) -> quaternion.quaternion:
    """Return the quaternion of roll, pitch and yaw (3-2-1) in rad."""
    about_z = quaternion.quaternion(math.cos(0.5 * yaw), 0.0, 0.0, math.sin(0.5 * yaw))
    about_y = quaternion.quaternion(math.cos(0.5 * pitch), 0.0, math.sin(0.5 * pitch), 0.0)
    about_x = quaternion.quaternion(math.cos(0.5 * roll), math.sin(0.5 * roll), 0.0, 0.0)
    return about_z * about_y * about_x


def matrix_of_quat(quat: quaternion.quaternion) -> Array:
    """Return the rotation matrix of a unit quaternion, shape (3, 3)."""
    w, x, y, z = quat.w, quat.x, quat.y, quat.z
    matrix = (  # nine numbers, of which numpy makes an array in half the time that it takes for three rows
        *(1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        *(2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        *(2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )
    return np.array(matrix).reshape(3, 3)


def by_rotation(quat: quaternion.quaternion) -> Array:
    """Return how the components change with a small rotation of the body, shape (4, 3)."""
    w, x, y, z = 0.5 * quat.w, 0.5 * quat.x, 0.5 * quat.y, 0.5 * quat.z
    return np.array((-x, -y, -z, w, -z, y, z, w, -x, -y, x, w)).reshape(4, 3)


def yaw_of(quat: quaternion.quaternion, *, by_321: bool) -> float:
    """Return yaw in rad, of the sequence of rotations 3-2-1 or 3-1-2."""
    sine, cosine = _sine_and_cosine(quat, by_321=by_321)
    return math.atan2(sine, cosine)


def yaw_by_components(quat: quaternion.quaternion, *, by_321: bool) -> tuple[float, float, float, float]:
    """Return how yaw, of the sequence of rotations 3-2-1 or 3-1-2, changes with each component."""
    w, x, y, z = quat.w, quat.x, quat.y, quat.z
    sine, cosine = _sine_and_cosine(quat, by_321=by_321)
    square = sine * sine + cosine * cosine
    if square == 0.0:  # x (3-2-1) or y (3-1-2) points up or down, and there is no yaw
        return 0.0, 0.0, 0.0, 0.0
    sine, cosine = 2 * sine / square, 2 * cosine / square
    if by_321:
        return cosine * z - sine * w, cosine * y - sine * x, cosine * x + sine * y, cosine * w + sine * z
    return cosine * z - sine * w, sine * x - cosine * y, -cosine * x - sine * y, cosine * w + sine * z


def _sine_and_cosine(quat: quaternion.quaternion, *, by_321: bool) -> tuple[float, float]:
    w, x, y, z = quat.w, quat.x, quat.y, quat.z
    if by_321:
        return 2 * (w * z + x * y), w * w + x * x - y * y - z * z
    return 2 * (w * z - x * y), w * w - x * x + y * y - z * z


def body_axes_by_attitude(quat: quaternion.quaternion, vector_ned: Array) -> tuple[Four, Four, Four]:
    """Return how a vector, seen along each axis of the body, depends on the errors of attitude."""
    w, x, y, z = quat.w, quat.x, quat.y, quat.z
    north, east, down = 2.0 * vector_ned
    along = w * north + z * east - y * down
    across = x * north + y * east + z * down
    over = w * down - x * east + y * north
    aside = w * east + x * down - z * north
    return (along, across, -over, aside), (aside, over, across, -along), (over, -aside, along, across)
