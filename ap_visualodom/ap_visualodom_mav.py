# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The MAVLink backend, VISO_TYPE 1 (AP_VisualOdom/AP_VisualOdom_MAV.cpp)."""

import numpy as np

from ap_core.fmath import constrain_float, degrees
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ap_core.verdict import Verdict
from ap_visualodom.ap_visualodom_backend import ANG_ERR_MAX_RAD, NO_ERR, POS_ERR_MAX_M, AP_VisualOdom_Backend
from ap_visualodom.verdicts import CONSUMED, QUALITY_BELOW_MIN


class AP_VisualOdom_MAV(AP_VisualOdom_Backend):
    """Passes samples on without alignment: scaled, with errors clamped, gated on quality alone."""

    def handle_pose_estimate(
        self,
        remote_time_us: int,
        time_ms: int,
        pos: Vector3f,
        attitude: Quaternion,
        posErr: np.float32,
        angErr: np.float32,
        reset_counter: int,
        quality: int,
    ) -> Verdict:
        """Handle a position (m) and attitude with their errors (m, rad).

        Source: AP_VisualOdom_MAV::handle_pose_estimate.
        """
        frontend = self._frontend
        pos = frontend.release.mav_position(pos * frontend.get_pos_scale())
        posErr = constrain_float(posErr, frontend.get_pos_noise(), POS_ERR_MAX_M, frontend.errors, line=33)
        angErr = constrain_float(angErr, frontend.get_yaw_noise(), ANG_ERR_MAX_RAD, frontend.errors, line=34)
        self._quality = quality

        consume = quality >= frontend.get_quality_min()
        if consume:
            self._ahrs.writeExtNavData(
                pos,
                attitude,
                posErr,
                angErr,
                time_ms,
                frontend.get_delay_ms(),
                self.get_reset_timestamp_ms(reset_counter),
            )

        roll, pitch, yaw = attitude.to_euler()
        euler_deg = (degrees(roll), degrees(pitch), degrees(yaw))
        self._log.Write_VisualPosition(
            remote_time_us, time_ms, pos, euler_deg, posErr, angErr, reset_counter, not consume, quality
        )
        self._last_update_ms = self._clock.millis()
        return CONSUMED if consume else QUALITY_BELOW_MIN

    def handle_vision_speed_estimate(
        self,
        remote_time_us: int,
        time_ms: int,
        vel: Vector3f,
        reset_counter: int,
        quality: int,
        vel_err: np.float32 = NO_ERR,
    ) -> Verdict:
        """Handle a velocity in m/s NED, which is not scaled, and its error.

        Source: AP_VisualOdom_MAV::handle_vision_speed_estimate.
        """
        frontend = self._frontend
        self._quality = quality
        consume = quality >= frontend.get_quality_min()
        vel_err = frontend.release.mav_vel_err(vel_err, frontend.get_vel_noise(), consume)
        if consume:
            self._ahrs.writeExtNavVelData(vel, vel_err, time_ms, frontend.get_delay_ms())

        self._last_update_ms = self._clock.millis()
        self._log.Write_VisualVelocity(remote_time_us, time_ms, vel, vel_err, reset_counter, not consume, quality)
        return CONSUMED if consume else QUALITY_BELOW_MIN
