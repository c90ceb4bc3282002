# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Rotations in double precision: quaternions, matrices, rotation vectors and Euler angles.

A rotation maps vectors of one frame to another, usually of the body to the world. Quaternions are w, x, y, z in the
last axis [..., 4] and of length 1 unless stated; leading axes broadcast. Angles and rotation vectors are in rad. Euler
angles are roll, pitch and yaw, applied about x, then y, then z of the fixed frame (3-2-1), as in ATTITUDE.

These functions are for arrays. One quaternion at a time, hundreds of times per second, is faster as a tuple; those
functions are in ``ekf_stub.core.vectors``.
"""

from typing import Final

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

IDENTITY_QUAT: Final = np.array((1.0, 0.0, 0.0, 0.0))
_CONJUGATE: Final = np.array((1.0, -1.0, -1.0, -1.0))


def product(first: npt.ArrayLike, second: npt.ArrayLike) -> Array:
    """Return the quaternions [..., 4] that rotate as the second ones, then as the first; of any length."""
    a, b, c, d = np.moveaxis(np.asarray(first, np.float64), -1, 0)
    w, x, y, z = np.moveaxis(np.asarray(second, np.float64), -1, 0)
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


def rotate(quats: npt.ArrayLike, vectors: npt.ArrayLike) -> Array:
    """Return vectors [..., 3] rotated by quaternions [..., 4]."""
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


def euler_from_quats(quats: npt.ArrayLike) -> Array:
    """Return roll, pitch and yaw [..., 3] of quaternions [..., 4]; NaN where they hold one."""
    w, x, y, z = np.moveaxis(np.asarray(quats, np.float64), -1, 0)
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
    w, x, y, z = np.moveaxis(np.asarray(quats, np.float64), -1, 0)
    square = w * w + x * x + y * y + z * z
    rows = (
        (1.0 - 2 * (y * y + z * z) / square, 2 * (x * y - z * w) / square, 2 * (x * z + y * w) / square),
        (2 * (x * y + z * w) / square, 1.0 - 2 * (x * x + z * z) / square, 2 * (y * z - x * w) / square),
        (2 * (x * z - y * w) / square, 2 * (y * z + x * w) / square, 1.0 - 2 * (x * x + y * y) / square),
    )
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def best_rotation(source: Array, target: Array) -> Array:
    """Return the rotation matrix [3, 3] that brings vectors [N, 3] nearest to others [N, 3] in squared distance.

    Source: Kabsch, A solution for the best rotation to relate two sets of vectors (1976).
    """
    left, _, right = np.linalg.svd(target.T @ source)
    sign = np.copysign(1.0, np.linalg.det(left) * np.linalg.det(right))
    rotation: Array = (left * np.array([1.0, 1.0, sign])) @ right
    return rotation
