# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Arrays of quaternions, as numpy-quaternion has them, without what its package imports besides.

Names and results are those of that package; ``ekf_stub.filter.quaternions`` says why it is not imported itself.
"""

from typing import Any, Final

import numpy as np
import numpy.typing as npt

from ekf_stub.filter.quaternions import one, quaternion

Array = npt.NDArray[np.float64]

_DTYPE: Final[Any] = np.dtype(quaternion)
_NORM: Final[Any] = vars(np)["norm"]  # where the extension module puts it: the sum of the squares


def as_quat_array(wxyz: npt.ArrayLike) -> Any:
    """Return the quaternions [...] of components w, x, y, z [..., 4]."""
    return np.ascontiguousarray(wxyz, dtype=np.float64).view(_DTYPE)[..., 0]


def as_float_array(quats: Any) -> Array:
    """Return the components w, x, y, z [..., 4] of quaternions [...]."""
    parts: Array = np.asarray(quats, dtype=_DTYPE).view((np.float64, 4))
    return parts


def from_rotation_vector(rotations: npt.ArrayLike) -> Any:
    """Return the unit quaternions [...] of rotation vectors in rad [..., 3]."""
    vectors = np.asarray(rotations, dtype=np.float64)
    wxyz = np.zeros((*vectors.shape[:-1], 4))
    wxyz[..., 1:] = vectors / 2
    return np.exp(as_quat_array(wxyz))


def as_rotation_matrix(quats: Any) -> Array:
    """Return the matrices [..., 3, 3] that rotate as quaternions [...] of any length but zero do."""
    square = _NORM(quats)
    w, x, y, z = np.moveaxis(as_float_array(quats), -1, 0)
    rows = (
        (1.0 - 2 * (y**2 + z**2) / square, 2 * (x * y - z * w) / square, 2 * (x * z + y * w) / square),
        (2 * (x * y + z * w) / square, 1.0 - 2 * (x**2 + z**2) / square, 2 * (y * z - x * w) / square),
        (2 * (x * z - y * w) / square, 2 * (y * z + x * w) / square, 1.0 - 2 * (x**2 + y**2) / square),
    )
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


__all__ = ["as_float_array", "as_quat_array", "as_rotation_matrix", "from_rotation_vector", "one", "quaternion"]
