# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The ODOMETRY message of a state (MAVLink common.xml, message 331)."""

import math
from typing import Final

import numpy as np

from mav_handlers.wire.messages import ODOMETRY
from viso.companion.odometry.composer import local_to_frd
from viso.companion.odometry.encoding import UNKNOWN, edge_covariance, encoded
from viso.companion.odometry.propagation import MotionState
from viso.companion.vio.config import CovarianceEncoding, LocalAlignment
from viso.companion.vio.frames import FLU_TO_FRD
from viso.geometry.rotation import quat_wxyz_from_rotation

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
