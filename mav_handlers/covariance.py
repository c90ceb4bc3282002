# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""From a pose covariance to the two errors that the firmware uses."""

import math
from collections.abc import Callable, Sequence
from operator import itemgetter
from typing import Final

import numpy as np

from ap_core.fmath import cbrtf, f32, sqrtf

_VARIANCES: Final = itemgetter(0, 6, 11, 15, 18, 20)  # of x, y, z, then of roll, pitch and yaw
_ZERO = f32(0)

ErrorFormula = Callable[[np.float32, np.float32, np.float32], np.float32]
"""Function from three variances (m^2 or rad^2) to one error (m or rad)."""


def cube_root_of_squares(a: np.float32, b: np.float32, c: np.float32) -> np.float32:
    """Return the cube root of the sum of squared variances, which is not a standard deviation.

    Source: GCS_Common.cpp, GCS_MAVLINK::handle_odometry and handle_common_vision_position_estimate_data, up to
    4.6 and in masters before 2026-02-05.
    """
    return cbrtf(a * a + b * b + c * c)


def root_of_sum(a: np.float32, b: np.float32, c: np.float32) -> np.float32:
    """Return the root of the sum of variances: the standard deviation of the distance; NaN for a negative sum.

    Source: the same functions, since then.
    """
    return sqrtf(a + b + c)


def pose_errors(
    covariance: Sequence[float], formula: ErrorFormula = cube_root_of_squares
) -> tuple[np.float32, np.float32]:
    """Return (posErr, angErr) from the 21 elements of the upper triangle, by the release's formula.

    If the first element is NaN, there is no covariance and both errors are 0.
    """
    if math.isnan(covariance[0]):
        return _ZERO, _ZERO
    a, b, c, d, e, f = map(f32, _VARIANCES(covariance))
    return formula(a, b, c), formula(d, e, f)


def velocity_error(covariance: Sequence[float]) -> np.float32:
    """Return the error of a velocity (m/s) from the 9 elements of its covariance: the root of the sum of variances.

    It is 0 when the first element is NaN, and NaN for a negative sum.

    Source: GCS_MAVLINK::handle_vision_speed_estimate, since 2026-03-20.
    """
    x, y, z = map(f32, (covariance[0], covariance[4], covariance[8]))
    return _ZERO if math.isnan(x) else root_of_sum(x, y, z)


def no_velocity_error(_covariance: Sequence[float]) -> np.float32:
    """Return an error of 0, for a release that does not read the covariance."""
    return _ZERO


def no_errors(_covariance: Sequence[float], _formula: ErrorFormula) -> tuple[np.float32, np.float32]:
    """Return errors of 0, for a message whose covariance the release does not read."""
    return _ZERO, _ZERO
