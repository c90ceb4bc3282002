# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The ODOMETRY message of a state (MAVLink common.xml, message 331), and its covariance.

The states of the message's covariance are x, y, z, roll, pitch, yaw in the frame ``frame_id``. Inside, errors are the
right tangent at the body, which has both its halves in body axes. Both are turned into the local frame: translations
become errors of x, y, z, and rotations small turns about the fixed axes of the local frame, as in the poses of ROS. The
last element is then the variance of the heading, which is what drifts, and the two before it hold the tilt's, which
differ little from axis to axis. Nothing becomes singular, and one change of axes D serves both blocks.
"""

import math
from typing import Final

import numpy as np

from mav_handlers.wire.messages import ODOMETRY
from viso.companion.odometry.composer import local_to_frd
from viso.companion.odometry.propagation import MotionState
from viso.companion.vio.config import CovarianceEncoding, LocalAlignment
from viso.companion.vio.frames import FLU_TO_FRD
from viso.geometry.rotation import Array, quat_wxyz_from_rotation

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

    ArduPilot up to 4.6 takes the cube root of the sum of the squared diagonal elements for a sigma.
    ``ARDUPILOT_ERROR`` writes diagonals for which that gives the root mean variance of the three axes; the other
    elements are 0 then.

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


MAV_FRAME_BODY_FRD: Final = 12
MAV_FRAME_LOCAL_FRD: Final = 20
MAV_ESTIMATOR_TYPE_VIO: Final = 3
_UNKNOWN_RATES: Final = np.full(3, math.nan)


def odometry_message(
    state: MotionState,
    alignment: LocalAlignment,
    *,
    reset_counter: int,
    quality: int,
    encoding: CovarianceEncoding = CovarianceEncoding.VARIANCE,
    time_us: int | None = None,
) -> ODOMETRY:
    """Return the message: pose in NED or LOCAL_FRD, velocity and rates in the body's FRD axes.

    The frames are LOCAL_FRD and BODY_FRD whatever the alignment: ArduPilot takes no other pair.

    Args:
        state: in the local frame, FLU body.
        alignment: of the local frame.
        reset_counter: 0..255.
        quality: -1 or 1..100.
        time_us: to stamp the message with, on the companion's clock; None for the state's own time.
    """
    to_frd, body_to_frd = local_to_frd(alignment), FLU_TO_FRD
    L_T_B = state.pose.L_T_B
    x, y, z = to_frd.dot(L_T_B.t).tolist()
    vx, vy, vz = body_to_frd.dot(state.velocity_b).tolist()
    gyro_b = _UNKNOWN_RATES if state.gyro_b is None else state.gyro_b
    rollspeed, pitchspeed, yawspeed = body_to_frd.dot(gyro_b).tolist()
    quat_wxyz = quat_wxyz_from_rotation(to_frd.dot(L_T_B.R).dot(body_to_frd.T))
    return ODOMETRY(
        state.t_ns // 1000 if time_us is None else time_us,
        MAV_FRAME_LOCAL_FRD,
        MAV_FRAME_BODY_FRD,
        x,
        y,
        z,
        tuple(quat_wxyz.tolist()),
        vx,
        vy,
        vz,
        rollspeed,
        pitchspeed,
        yawspeed,
        pose_covariance=encoded(edge_covariance(state.pose.covariance_6x6, L_T_B.R, to_frd), encoding),
        velocity_covariance=UNKNOWN,
        reset_counter=reset_counter,
        estimator_type=MAV_ESTIMATOR_TYPE_VIO,
        quality=quality,
    )
