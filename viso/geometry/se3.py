# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Rotations and rigid motions: SO(3) and SE(3) with right perturbations, tangents ordered rotation first.

The formulas are those of Barfoot, State Estimation for Robotics, chapter 7, and Sola et al., A micro Lie theory (2018).
"""

import math
from dataclasses import dataclass
from typing import Any, Final, Self

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

SMALL_ANGLE_RAD: Final = 1e-7
ORTHONORMAL: Final = 1e-6
_NEAR_PI_RAD: Final = 1e-3
_IDENTITY: Final = np.eye(3)


def read_only(value: Any, shape: tuple[int, ...], field: str, *, finite: bool = True) -> Array:
    """Return a C-contiguous float64 copy that cannot be written to.

    Raises ValueError if the shape differs or, unless told otherwise, a number is not finite; names the field.
    """
    array = np.array(value, dtype=np.float64, order="C")
    if array.shape != shape:
        raise ValueError(f"{field}: shape {array.shape}, not {shape}")
    if finite and not np.isfinite(array).all():
        raise ValueError(f"{field}: not finite")
    array.flags.writeable = False
    return array


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


@dataclass(frozen=True, slots=True, eq=False)
class SE3:
    """A rigid motion: ``A_T_B`` maps coordinates given in B into A, ``p_A = R p_B + t``.

    Attributes:
        R: rotation matrix, orthonormal to 1e-6.
        t: translation in m.

    Raises:
        ValueError: if a field is not finite, R is no rotation, or a shape is wrong; names the field.
    """

    R: Array
    t: Array

    def __post_init__(self) -> None:
        rotation = read_only(self.R, (3, 3), "R")
        if np.abs(rotation.dot(rotation.T) - _IDENTITY).max() > ORTHONORMAL or np.linalg.det(rotation) < 0:
            raise ValueError("R: not orthonormal to 1e-6, or mirrored")
        object.__setattr__(self, "R", rotation)
        object.__setattr__(self, "t", read_only(self.t, (3,), "t"))

    @classmethod
    def identity(cls) -> Self:
        """Return the motion that leaves everything where it is."""
        return cls(_IDENTITY, np.zeros(3))

    @classmethod
    def exp(cls, tangent: Array) -> Self:
        """Return the motion of a tangent [6], rotation (rad) first, then translation (m)."""
        phi, rho = np.asarray(tangent, np.float64)[:3], np.asarray(tangent, np.float64)[3:]
        # The left Jacobian is the right one of the opposite rotation.
        return cls(so3_exp(phi), right_jacobian(-phi).dot(rho))

    def log(self) -> Array:
        """Return the tangent [6], rotation first."""
        phi = so3_log(self.R)
        return np.concatenate([phi, right_jacobian_inverse(-phi).dot(self.t)])

    @classmethod
    def from_matrix(cls, matrix: Any) -> Self:
        """Return the motion of a homogeneous matrix [4, 4]. Raises ValueError if it is none."""
        full = read_only(matrix, (4, 4), "matrix")
        if np.abs(full[3] - [0, 0, 0, 1]).max() > ORTHONORMAL:
            raise ValueError("matrix: its last row is not 0 0 0 1")
        return cls(full[:3, :3], full[:3, 3])

    def matrix(self) -> Array:
        """Return the homogeneous matrix [4, 4]."""
        full = np.eye(4)
        full[:3, :3], full[:3, 3] = self.R, self.t
        return full

    @classmethod
    def from_quat_wxyz(cls, quat_wxyz: Any, t: Any) -> Self:
        """Return the motion of a quaternion (w, x, y, z) and a translation in m."""
        return cls(rotation_from_quat_wxyz(quat_wxyz), t)

    def quat_wxyz(self) -> Array:
        """Return the rotation as a unit quaternion (w, x, y, z), w >= 0."""
        return quat_wxyz_from_rotation(self.R)

    def inverse(self) -> "SE3":
        """Return the motion back."""
        return SE3(self.R.T, -self.R.T.dot(self.t))

    def __matmul__(self, other: "SE3") -> "SE3":
        return SE3(self.R.dot(other.R), self.R.dot(other.t) + self.t)

    def map(self, points: Array) -> Array:
        """Map points [..., 3] of B into A."""
        mapped: Array = points @ self.R.T + self.t
        return mapped

    def adjoint(self) -> Array:
        """Return the matrix [6, 6] that carries tangents from B to A, rotation first."""
        adjoint = np.zeros((6, 6))
        adjoint[:3, :3] = adjoint[3:, 3:] = self.R
        adjoint[3:, :3] = skew(self.t).dot(self.R)
        return adjoint
