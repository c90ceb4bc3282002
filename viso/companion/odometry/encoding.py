# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The covariance of a pose as ODOMETRY carries it.

The message's states are x, y, z, roll, pitch, yaw in the frame ``frame_id``. Inside, errors are the right tangent at
the body, which has both its halves in body axes. Both are turned into the local frame: translations become errors of
x, y, z, and rotations small turns about the fixed axes of the local frame, as in the poses of ROS. The last element is
then the variance of the heading, which is what drifts, and the two before it hold the tilt's, which differ little from
axis to axis. Nothing becomes singular, and one change of axes D serves both blocks.
"""

import math
from typing import Final

import numpy as np

from viso.companion.vio.config import CovarianceEncoding
from viso.geometry.rotation import Array

__all__ = ["UNKNOWN", "CovarianceEncoding", "edge_covariance", "encoded"]

POSE_ELEMENTS: Final = 21
UNKNOWN: Final = (math.nan,) + (0.0,) * (POSE_ELEMENTS - 1)
_UPPER: Final = np.triu_indices(6)
_TRANSLATION_FIRST: Final = np.ix_([3, 4, 5, 0, 1, 2], [3, 4, 5, 0, 1, 2])


def edge_covariance(covariance_6x6: Array, local_R_body: Array, local_to_frd: Array) -> Array:
    """Return the covariance [6, 6] of (x, y, z, roll, pitch, yaw) in the local axes of the message.

    Args:
        covariance_6x6: of the pose, right perturbation, rotation first.
        local_R_body: from the body into the local frame.
        local_to_frd: from the local frame into the axes of the message (D).
    """
    turn = local_to_frd.dot(local_R_body)
    M = np.zeros((6, 6))
    M[:3, :3] = M[3:, 3:] = turn
    matrix: Array = M.dot(covariance_6x6[_TRANSLATION_FIRST]).dot(M.T)
    return 0.5 * (matrix + matrix.T)


def encoded(matrix: Array | None, encoding: CovarianceEncoding) -> tuple[float, ...]:
    """Return the upper triangle, row by row, of a covariance [6, 6] in the message's order and axes.

    ArduPilot takes the cube root of the sum of the squared diagonal elements for a sigma. ``ARDUPILOT_ERROR`` writes
    diagonals for which that gives the root mean variance of the three axes; the other elements are 0 then.

    Args:
        matrix: None if unknown; the first element is NaN then, as the message defines it.
    """
    if matrix is None:
        return UNKNOWN
    if encoding is CovarianceEncoding.ARDUPILOT_ERROR:
        diagonal = matrix.diagonal()
        matrix = np.diag([_element(diagonal[:3])] * 3 + [_element(diagonal[3:])] * 3)
    return tuple(matrix[_UPPER].tolist())


def _element(variances: Array) -> float:
    error = math.sqrt(max(float(variances.mean()), 0.0))
    return math.sqrt(error**3 / 3)
