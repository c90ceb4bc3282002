# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Rigid motions, SE(3) with right perturbations and tangents ordered rotation first, and covariances of poses."""

from dataclasses import dataclass
from typing import Any, Final, Self

import numpy as np

from viso.geometry.rotation import (
    ORTHONORMAL,
    Array,
    quat_wxyz_from_rotation,
    right_jacobian,
    right_jacobian_inverse,
    rotation_from_quat_wxyz,
    skew,
    so3_exp,
    so3_log,
)

SYMMETRY: Final = 1e-9
NEGATIVE: Final = 1e-12
_IDENTITY: Final = np.eye(3)


def read_only(value: Any, shape: tuple[int, ...], field: str, *, finite: bool = True) -> Array:
    """Return a C-contiguous float64 copy that cannot be written to.

    Raises ValueError if the shape differs or, by default, a number is not finite; names the field.
    """
    array = np.array(value, dtype=np.float64, order="C")
    if array.shape != shape:
        raise ValueError(f"{field}: shape {array.shape}, not {shape}")
    if finite and not np.isfinite(array).all():
        raise ValueError(f"{field}: not finite")
    array.flags.writeable = False
    return array


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
        """Return the identity."""
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
        """Return the inverse motion."""
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


def sound_covariance(cov: Array) -> Array | None:
    """Return a covariance made exactly symmetric and without negative eigenvalues, or None if it is invalid.

    It is valid if it is finite, symmetric to 1e-9 of its largest element, and its smallest eigenvalue is not below
    -1e-12
    of the largest.
    """
    if not np.isfinite(cov).all():
        return None
    largest = float(np.abs(cov).max())
    if np.abs(cov - cov.T).max() > SYMMETRY * largest:
        return None
    symmetric: Array = 0.5 * (cov + cov.T)
    values, vectors = np.linalg.eigh(symmetric)
    if values[0] < -NEGATIVE * max(values[-1], 0.0):
        return None
    if values[0] < 0:
        symmetric = (vectors * np.maximum(values, 0.0)).dot(vectors.T)
        symmetric = 0.5 * (symmetric + symmetric.T)
    return symmetric
