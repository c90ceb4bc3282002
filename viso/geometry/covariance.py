# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a 6x6 covariance of a pose must be before it leaves a module."""

from typing import Final

import numpy as np

from viso.geometry.se3 import Array

SYMMETRY: Final = 1e-9
NEGATIVE: Final = 1e-12


def sound_covariance(cov: Array) -> Array | None:
    """Return a covariance, exactly symmetric and without negative eigenvalues, or None if it is none.

    It is one if it is finite, symmetric to 1e-9 of its largest element, and its smallest eigenvalue is not below -1e-12
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
