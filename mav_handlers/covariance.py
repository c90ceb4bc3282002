# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""From a pose covariance to the two errors that the firmware uses."""

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from ap_core.fmath import cbrtf, f32

_POSITION: Final = (0, 6, 11)
_ATTITUDE: Final = (15, 18, 20)
_ZERO: Final = f32(0)


def _cube_root_of_squares(covariance: Sequence[float], diagonal: tuple[int, int, int]) -> np.float32:
    i, j, k = diagonal
    a, b, c = f32(covariance[i]), f32(covariance[j]), f32(covariance[k])
    return cbrtf(a * a + b * b + c * c)


def pose_errors(covariance: Sequence[float]) -> tuple[np.float32, np.float32]:
    """Return (posErr, angErr) from the 21 elements of the upper triangle.

    The firmware takes the cube root of the sum of squared variances, which is no standard deviation. A first element
    that is NaN means that there is no covariance: both errors are 0 then.

    Source: GCS_Common.cpp, GCS_MAVLINK::handle_odometry and handle_common_vision_position_estimate_data.
    """
    if math.isnan(covariance[0]):
        return _ZERO, _ZERO
    return _cube_root_of_squares(covariance, _POSITION), _cube_root_of_squares(covariance, _ATTITUDE)
