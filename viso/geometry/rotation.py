# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Rotations in double precision: quaternions, matrices, rotation vectors and Euler angles.

A rotation maps vectors of one frame to another, usually of the body to the world. Quaternions are w, x, y, z in the
last axis [..., 4] and of length 1 unless stated; leading axes broadcast. Angles and rotation vectors are in rad. Euler
angles are roll, pitch and yaw, applied about x, then y, then z of the fixed frame (3-2-1), as in ATTITUDE.

These functions are for arrays. One quaternion at a time, hundreds of times per second, is faster as a tuple; those
functions are in ``ekf_stub.core.vectors``.
"""

import math
from typing import Any, Final

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

SMALL_ANGLE_RAD: Final = 1e-7
ORTHONORMAL: Final = 1e-6
"""The largest difference between the identity and the product of a rotation matrix with its transpose."""
IDENTITY_QUAT: Final = np.array((1.0, 0.0, 0.0, 0.0))
_IDENTITY: Final = np.eye(3)
_NEAR_PI_RAD: Final = 1e-3
_CONJUGATE: Final = np.array((1.0, -1.0, -1.0, -1.0))


def _parts(quats: npt.ArrayLike) -> tuple[Array, Array, Array, Array]:
    wxyz = np.asarray(quats, np.float64)
    return wxyz[..., 0], wxyz[..., 1], wxyz[..., 2], wxyz[..., 3]


def product(first: npt.ArrayLike, second: npt.ArrayLike) -> Array:
    """Return the products [..., 4] of quaternions of any length: the second rotation, then the first."""
    a, b, c, d = _parts(first)
    w, x, y, z = _parts(second)
    return np.stack(
        (
            a * w - b * x - c * y - d * z,
            a * x + b * w + c * z - d * y,
            a * y - b * z + c * w + d * x,
            a * z + b * y - c * x + d * w,
        ),
        axis=-1,
    )


def inverse(quats: npt.ArrayLike) -> Array:
    """Return the quaternions [..., 4] of the inverse rotations."""
    back: Array = np.asarray(quats, np.float64) * _CONJUGATE
    return back


def normalized(quats: npt.ArrayLike) -> Array:
    """Return quaternions [..., 4] with length 1; NaN for those of length 0."""
    wxyz = np.asarray(quats, np.float64)
    unit: Array = wxyz / np.linalg.norm(wxyz, axis=-1, keepdims=True)
    return unit


@np.errstate(all="ignore")
def rotate(quats: npt.ArrayLike, vectors: npt.ArrayLike) -> Array:
    """Return vectors [..., 3] rotated by quaternions [..., 4], as the firmware does it; NaN where they hold one."""
    wxyz, before = np.asarray(quats, np.float64), np.asarray(vectors, np.float64)
    axis = wxyz[..., 1:]
    twice = 2.0 * np.cross(axis, before)
    rotated: Array = before + wxyz[..., :1] * twice + np.cross(axis, twice)
    return rotated


def interpolated_quats(first: Array, second: Array, share: npt.ArrayLike) -> Array:
    """Return the quaternions [..., 4] between two, linearly and of length 1, along the shorter arc.

    ``share`` [...] is 0 at the first, 1 at the second.
    """
    share = np.asarray(share, np.float64)[..., None]
    second = np.where(np.sum(first * second, axis=-1, keepdims=True) < 0, -second, second)
    return normalized((1 - share) * first + share * second)


# Euler angles


def quats_from_euler(roll_pitch_yaw: npt.ArrayLike) -> Array:
    """Return the quaternions [..., 4] of roll, pitch and yaw [..., 3]."""
    half = 0.5 * np.asarray(roll_pitch_yaw, np.float64)
    cos, sin = np.cos(half), np.sin(half)
    roll, pitch, yaw = (
        np.stack((cos[..., axis], *(sin[..., axis] * (axis == k) for k in range(3))), axis=-1) for axis in range(3)
    )
    return product(product(yaw, pitch), roll)


@np.errstate(all="ignore")
def euler_from_quats(quats: npt.ArrayLike) -> Array:
    """Return roll, pitch and yaw [..., 3] of quaternions [..., 4]; NaN where they hold one."""
    w, x, y, z = _parts(quats)
    return np.stack(
        (
            np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)),
            np.arcsin(np.clip(2 * (w * y - z * x), -1.0, 1.0)),
            np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)),
        ),
        axis=-1,
    )


def rotations_from_euler(roll_pitch_yaw: npt.ArrayLike) -> Array:
    """Return the matrices [..., 3, 3] of roll, pitch and yaw [..., 3]."""
    return rotations_from_quats(quats_from_euler(roll_pitch_yaw))


def euler_from_rotations(rotations: Array) -> Array:
    """Return roll, pitch and yaw [..., 3] of matrices [..., 3, 3]."""
    return np.stack(
        (
            np.arctan2(rotations[..., 2, 1], rotations[..., 2, 2]),
            np.arcsin(np.clip(-rotations[..., 2, 0], -1.0, 1.0)),
            np.arctan2(rotations[..., 1, 0], rotations[..., 0, 0]),
        ),
        axis=-1,
    )


# Rotation vectors


def quats_from_rotation_vectors(vectors: npt.ArrayLike) -> Array:
    """Return the quaternions [..., 4] of rotation vectors [..., 3]."""
    half = 0.5 * np.asarray(vectors, np.float64)
    angle = np.linalg.norm(half, axis=-1, keepdims=True)
    factor = np.divide(np.sin(angle), angle, out=np.ones_like(angle), where=angle > 0)
    return np.concatenate((np.cos(angle), factor * half), axis=-1)


def rotation_vectors_from_quats(quats: npt.ArrayLike) -> Array:
    """Return the rotation vectors [..., 3], of a length from 0 to pi, of quaternions [..., 4]."""
    wxyz = np.asarray(quats, np.float64)
    wxyz = np.where(wxyz[..., :1] < 0, -wxyz, wxyz)
    sine = np.linalg.norm(wxyz[..., 1:], axis=-1, keepdims=True)
    angle = 2 * np.arctan2(sine, wxyz[..., :1])
    vectors: Array = wxyz[..., 1:] * np.divide(angle, sine, out=np.full_like(sine, 2.0), where=sine > 0)
    return vectors


# Matrices


def rotations_from_quats(quats: npt.ArrayLike) -> Array:
    """Return the matrices [..., 3, 3] of quaternions [..., 4] of any length but 0."""
    w, x, y, z = _parts(quats)
    square = w * w + x * x + y * y + z * z
    rows = (
        (1.0 - 2 * (y * y + z * z) / square, 2 * (x * y - z * w) / square, 2 * (x * z + y * w) / square),
        (2 * (x * y + z * w) / square, 1.0 - 2 * (x * x + z * z) / square, 2 * (y * z - x * w) / square),
        (2 * (x * z - y * w) / square, 2 * (y * z + x * w) / square, 1.0 - 2 * (x * x + y * y) / square),
    )
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def best_rotation(source: Array, target: Array) -> Array:
    """Return the matrices [..., 3, 3] that bring vectors [..., N, 3] nearest to others in squared distance.

    Source: Kabsch, A solution for the best rotation to relate two sets of vectors (1976).
    """
    left, _, right = np.linalg.svd(np.swapaxes(target, -1, -2) @ source)
    left[..., 2] *= np.copysign(1.0, np.linalg.det(left) * np.linalg.det(right))[..., None]
    rotations: Array = left @ right
    return rotations


# One rotation at a time, as a matrix: SO(3) with right perturbations. Formulas are those of Barfoot, State Estimation
# for Robotics, chapter 7, and Sola et al., A micro Lie theory (2018).


def skew(vector: Array) -> Array:
    """Return the matrix that multiplies as the cross product with a vector [3] does."""
    x, y, z = vector.tolist()
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def skews(vectors: Array) -> Array:
    """Return the matrices [N, 3, 3] that multiply as the cross products with vectors [N, 3] do."""
    skews = np.zeros((len(vectors), 3, 3))
    skews[:, [2, 0, 1], [1, 2, 0]] = vectors
    skews[:, [1, 2, 0], [2, 0, 1]] = -vectors
    return skews


def so3_exp(rotation_vector: Array) -> Array:
    """Return the rotation matrix [3, 3] of a rotation vector [3] in rad."""
    x, y, z = rotation_vector.tolist()
    square = x * x + y * y + z * z
    angle = math.sqrt(square)
    if angle < SMALL_ANGLE_RAD:
        a, b = 1.0 - square / 6, 0.5 - square / 24
    else:
        half = math.sin(0.5 * angle)
        a, b = math.sin(angle) / angle, 2 * half * half / square
    return np.array(
        [
            [1 - b * (y * y + z * z), b * x * y - a * z, b * x * z + a * y],
            [b * x * y + a * z, 1 - b * (x * x + z * z), b * y * z - a * x],
            [b * x * z - a * y, b * y * z + a * x, 1 - b * (x * x + y * y)],
        ]
    )


def so3_log(rotation: Array) -> Array:
    """Return the rotation vector [3] in rad, of a length from 0 to pi, of a rotation matrix [3, 3]."""
    axis = np.array([rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]])
    sine, cosine = 0.5 * math.sqrt(axis.dot(axis)), 0.5 * (float(rotation.trace()) - 1)
    angle = math.atan2(sine, cosine)
    if angle > math.pi - _NEAR_PI_RAD:
        return _log_near_pi(rotation, axis, angle)
    factor = 0.5 + angle * angle / 12 if sine < SMALL_ANGLE_RAD else 0.5 * angle / sine
    vector: Array = axis * factor
    return vector


def _log_near_pi(rotation: Array, axis: Array, angle: float) -> Array:
    # The antisymmetric part vanishes there; the symmetric one gives the axis, and only its sign is left to find.
    outer = 0.5 * (rotation + rotation.T)
    outer = (outer - math.cos(angle) * _IDENTITY) / (1 - math.cos(angle))
    column = int(np.argmax(outer.diagonal()))
    direction = outer[:, column] / math.sqrt(outer[column, column])
    direction = direction / math.sqrt(direction.dot(direction))
    vector: Array = direction * (angle if direction.dot(axis) >= 0 else -angle)
    return vector


def right_jacobian(rotation_vector: Array) -> Array:
    """Return d Log(Exp(v)^-1 Exp(v + dv)) / d dv at a rotation vector [3]."""
    square = float(rotation_vector.dot(rotation_vector))
    angle = math.sqrt(square)
    if angle < 1e-4:  # differences of nearly equal numbers below
        a, b = 0.5 - square / 24, 1 / 6 - square / 120
    else:
        half = math.sin(0.5 * angle)
        a, b = 2 * half * half / square, (angle - math.sin(angle)) / (angle * square)
    cross = skew(rotation_vector)
    jacobian: Array = _IDENTITY - a * cross + b * cross.dot(cross)
    return jacobian


def right_jacobian_inverse(rotation_vector: Array) -> Array:
    """Return the inverse of :func:`right_jacobian`; angles from 0 to pi."""
    square = float(rotation_vector.dot(rotation_vector))
    angle = math.sqrt(square)
    # Half the angle and its cotangent: no cancellation, and no pole at pi.
    factor = (
        1 / 12 + square / 720
        if angle < 1e-3
        else (1 - 0.5 * angle * math.cos(0.5 * angle) / math.sin(0.5 * angle)) / square
    )
    cross = skew(rotation_vector)
    inverse: Array = _IDENTITY + 0.5 * cross + factor * cross.dot(cross)
    return inverse


def rotation_from_quat_wxyz(quat_wxyz: Any) -> Array:
    """Return the rotation matrix [3, 3] of a quaternion (w, x, y, z) of any length but 0.

    Raises ValueError if it has no direction.
    """
    quat = np.asarray(quat_wxyz, dtype=np.float64)
    length = float(np.linalg.norm(quat))
    if quat.shape != (4,) or not math.isfinite(length) or length < 1e-12:
        raise ValueError("quat_wxyz: no rotation")
    w, x, y, z = (quat / length).tolist()
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def quat_wxyz_from_rotation(rotation: Array) -> Array:
    """Return the unit quaternion (w, x, y, z) with w >= 0 of a rotation matrix [3, 3] (Shepperd's method)."""
    r = rotation
    trace = float(r.trace())
    choices = [trace, float(r[0, 0]), float(r[1, 1]), float(r[2, 2])]
    largest = choices.index(max(choices))
    if largest == 0:
        quat = np.array([1 + trace, r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]])
    else:
        i = largest - 1
        j, k = (i + 1) % 3, (i + 2) % 3
        quat = np.empty(4)
        quat[0] = r[k, j] - r[j, k]
        quat[1 + i] = 1 + r[i, i] - r[j, j] - r[k, k]
        quat[1 + j] = r[j, i] + r[i, j]
        quat[1 + k] = r[k, i] + r[i, k]
    unit: Array = quat / math.copysign(float(np.linalg.norm(quat)), quat[0])
    return unit


def yaw_of(rotation: Array) -> float:
    """Return the yaw in rad, about the axis that points up or down, of a rotation from a body to a local frame."""
    return math.atan2(float(rotation[1, 0]), float(rotation[0, 0]))
