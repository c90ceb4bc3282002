# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Arrays of quaternions, as numpy-quaternion has them, whether it is installed or not.

Names and results are those of that package.
"""

from typing import Any, Final

import numpy as np
import numpy.typing as npt

from viso.geometry.quaternions import IS_PLAIN
from viso.geometry.quaternions import quaternion as quaternion

Array = npt.NDArray[np.float64]

_DTYPE: Final[Any] = np.dtype(object if IS_PLAIN else quaternion)


def as_quat_array(wxyz: npt.ArrayLike) -> Any:
    """Return the quaternions [...] of components w, x, y, z [..., 4]."""
    parts = np.ascontiguousarray(wxyz, dtype=np.float64)
    if not IS_PLAIN:
        return parts.view(_DTYPE)[..., 0]
    quats = np.empty(parts.shape[:-1], dtype=_DTYPE)
    quats.flat[:] = [quaternion(*row) for row in parts.reshape(-1, 4).tolist()]
    return quats


def as_float_array(quats: Any) -> Array:
    """Return the components w, x, y, z [..., 4] of quaternions [...]."""
    array = np.asarray(quats, dtype=_DTYPE)
    if IS_PLAIN:
        return np.array([quat.components for quat in array.flat], dtype=np.float64).reshape(*array.shape, 4)
    parts: Array = array.view((np.float64, 4))
    return parts


def from_rotation_vector(rotations: npt.ArrayLike) -> Any:
    """Return the unit quaternions [...] of rotation vectors in rad [..., 3]."""
    vectors = np.asarray(rotations, dtype=np.float64)
    wxyz = np.zeros((*vectors.shape[:-1], 4))
    wxyz[..., 1:] = vectors / 2
    return np.exp(as_quat_array(wxyz))


def as_rotation_matrix(quats: Any) -> Array:
    """Return the matrices [..., 3, 3] that rotate as quaternions [...] of any length but zero do."""
    return matrices_of(as_float_array(quats))


def matrices_of(wxyz: Array) -> Array:
    """Return likewise the matrices of components w, x, y, z [..., 4]."""
    w, x, y, z = np.moveaxis(wxyz, -1, 0)
    square = w * w + x * x + y * y + z * z
    rows = (
        (1.0 - 2 * (y**2 + z**2) / square, 2 * (x * y - z * w) / square, 2 * (x * z + y * w) / square),
        (2 * (x * y + z * w) / square, 1.0 - 2 * (x**2 + z**2) / square, 2 * (y * z - x * w) / square),
        (2 * (x * z - y * w) / square, 2 * (y * z + x * w) / square, 1.0 - 2 * (x**2 + y**2) / square),
    )
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
