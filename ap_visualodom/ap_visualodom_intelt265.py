# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The Intel T265 and VOXL backend, VISO_TYPE 2 and 3 (AP_VisualOdom/AP_VisualOdom_IntelT265.cpp)."""

from typing import TYPE_CHECKING, Final

import numpy as np

from ap_core.cint import int_of_float, u32
from ap_core.fmath import constrain_float, degrees, f32, is_zero, wrap_2pi, wrap_360
from ap_core.matrix3 import Matrix3f
from ap_core.print_format import fixed
from ap_core.quaternion import Quaternion
from ap_core.rotations import Rotation, quaternion_from_rotation
from ap_core.vector3 import Vector3f
from ap_core.verdict import Verdict
from ap_visualodom.ap_visualodom_backend import ANG_ERR_MAX_RAD, NO_ERR, POS_ERR_MAX_M, AP_VisualOdom_Backend
from ap_visualodom.var_info import VisualOdom_Type
from ap_visualodom.verdicts import CONSUMED, QUALITY_BELOW_MIN, RESET_SETTLING

if TYPE_CHECKING:
    from ap_visualodom.ap_visualodom import AP_VisualOdom

VISUALODOM_RESET_IGNORE_DURATION_MS: Final = 1000
ATTITUDE_DIFF_MAX_DEG: Final = f32(10.0)

_MAV_SEVERITY_WARNING: Final = 4
_MAV_SEVERITY_INFO: Final = 6
_ZERO: Final = f32(0)
_VOXL: Final = int(VisualOdom_Type.VOXL)


class AP_VisualOdom_IntelT265(AP_VisualOdom_Backend):
    """Aligns the camera's yaw, and on request its position, with the vehicle's before passing samples on.

    After a change of the reset counter, samples of a T265 are ignored for a second; a VOXL is re-aligned at once
    instead.
    """

    def __init__(self, frontend: "AP_VisualOdom") -> None:
        super().__init__(frontend)
        self._yaw_trim = _ZERO
        self._yaw_rotation = Quaternion()
        self._att_rotation = Quaternion()
        self._posvel_rotation = Matrix3f()
        self._pos_correction = Vector3f()
        self._use_att_rotation = False
        self._use_posvel_rotation = False
        self._align_yaw = True
        self._align_posxy = False
        self._align_posz = False
        self._error_orientation = False
        self._attitude_last = Quaternion()
        self._pos_reset_counter_last = 0
        self._pos_reset_ignore_start_ms = 0
        self._voxl_reset_counter_last = 0
        self._voxl_position_last = Vector3f()

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

        Source: AP_VisualOdom_IntelT265::handle_pose_estimate.
        """
        frontend = self._frontend
        pos = pos * frontend.get_pos_scale()
        att = attitude

        self.handle_voxl_camera_reset_jump(pos, att, reset_counter)
        if self._align_yaw and self.align_yaw_to_ahrs(pos, attitude):
            self._align_yaw = False
        if (self._align_posxy or self._align_posz) and self._align_sensor_position(
            pos, self._align_posxy, self._align_posz
        ):
            self._align_posxy = self._align_posz = False

        pos = self.rotate_and_correct_position(pos)
        att = self.rotate_attitude(att)
        self.record_voxl_position_and_reset_count(pos, reset_counter)

        posErr = constrain_float(posErr, frontend.get_pos_noise(), POS_ERR_MAX_M, frontend.errors, line=60)
        angErr = constrain_float(angErr, frontend.get_yaw_noise(), ANG_ERR_MAX_RAD, frontend.errors, line=61)
        self._quality = quality

        verdict = self._judge(self.should_consume_sensor_data(True, reset_counter))
        consume = verdict is CONSUMED
        if consume:
            self._ahrs.writeExtNavData(
                pos,
                att,
                posErr,
                angErr,
                time_ms,
                frontend.get_delay_ms(),
                self.get_reset_timestamp_ms(reset_counter),
            )

        roll, pitch, yaw = att.to_euler()
        euler_deg = (degrees(roll), degrees(pitch), wrap_360(degrees(yaw)))
        self._log.Write_VisualPosition(
            remote_time_us, time_ms, pos, euler_deg, posErr, angErr, reset_counter, not consume, quality
        )
        self._attitude_last = att
        self._last_update_ms = self._clock.millis()
        return verdict

    def handle_vision_speed_estimate(
        self,
        remote_time_us: int,
        time_ms: int,
        vel: Vector3f,
        reset_counter: int,
        quality: int,
        vel_err: np.float32 = NO_ERR,
    ) -> Verdict:
        """Handle a velocity in m/s in the camera's frame, which is rotated into NED; its error is ignored.

        Source: AP_VisualOdom_IntelT265::handle_vision_speed_estimate.
        """
        frontend = self._frontend
        vel = self.rotate_velocity(vel)
        self._quality = quality
        verdict = self._judge(self.should_consume_sensor_data(False, reset_counter))
        consume = verdict is CONSUMED
        if consume:
            self._ahrs.writeExtNavVelData(vel, frontend.get_vel_noise(), time_ms, frontend.get_delay_ms())

        self._last_update_ms = self._clock.millis()
        self._log.Write_VisualVelocity(
            remote_time_us, time_ms, vel, frontend.get_vel_noise(), reset_counter, not consume, quality
        )
        return verdict

    def _judge(self, settled: bool) -> Verdict:
        if not settled:
            return RESET_SETTLING
        return CONSUMED if self._quality >= self._frontend.get_quality_min() else QUALITY_BELOW_MIN

    def rotate_and_correct_position(self, position: Vector3f) -> Vector3f:
        """Return the position rotated and shifted into the vehicle's frame."""
        if self._use_posvel_rotation:
            position = self._posvel_rotation * position
        return position + self._pos_correction

    def rotate_velocity(self, velocity: Vector3f) -> Vector3f:
        """Return the velocity rotated into the vehicle's frame."""
        return self._posvel_rotation * velocity if self._use_posvel_rotation else velocity

    def rotate_attitude(self, attitude: Quaternion) -> Quaternion:
        """Return the attitude corrected for the camera's orientation, then for the yaw trim."""
        if self._use_att_rotation:
            attitude = attitude * self._att_rotation
        if not is_zero(self._yaw_trim):
            attitude = self._yaw_rotation * attitude
        return attitude

    def request_align_yaw_to_ahrs(self) -> None:
        """Align yaw at the next pose (AP_VisualOdom_IntelT265.h, request_align_yaw_to_ahrs)."""
        self._align_yaw = True

    def align_position_to_ahrs(self, align_xy: bool, align_z: bool) -> None:
        """Align position at the next pose, on the release's axes; overwrites an earlier request.

        Source: AP_VisualOdom_IntelT265.h, align_position_to_ahrs(bool, bool).
        """
        self._align_posxy, self._align_posz = self._frontend.release.axes_to_align(align_xy, align_z)

    def align_yaw_to_ahrs(self, position: Vector3f, attitude: Quaternion) -> bool:
        """Align yaw with the AHRS, unless the AHRS takes its yaw from external navigation or has none yet.

        Source: AP_VisualOdom_IntelT265::align_yaw_to_ahrs.
        """
        if self._ahrs.using_extnav_for_yaw():
            return False
        if not self._ahrs.initialised() or not self._ahrs.dcm_yaw_initialised():
            return False
        self.align_yaw(position, attitude, self._ahrs.get_yaw_rad())
        return True

    def align_yaw(self, position: Vector3f, attitude: Quaternion, yaw_rad: np.float32) -> None:
        """Rotate the camera's frame so that ``attitude`` has the given yaw, without moving ``position``.

        Source: AP_VisualOdom_IntelT265::align_yaw.
        """
        self._error_orientation = False
        rot = self._frontend.get_orientation()
        self._att_rotation = Quaternion()
        self._use_att_rotation = False
        if rot != Rotation.NONE:
            rotated = self._att_rotation * quaternion_from_rotation(rot, self._frontend.errors)
            self._att_rotation = rotated.inverse()
            self._use_att_rotation = True

        sens_yaw = (attitude * self._att_rotation).get_euler_yaw()
        yaw_trim_orig = self._yaw_trim
        self._yaw_trim = f32(wrap_2pi(float(yaw_rad - sens_yaw)))
        shifted_deg = int_of_float(float(degrees(self._yaw_trim - yaw_trim_orig)))
        to_deg = int_of_float(float(wrap_360(degrees(sens_yaw + self._yaw_trim))))
        self._frontend.gcs.send_text(_MAV_SEVERITY_INFO, f"VisOdom: yaw shifted {shifted_deg} to {to_deg} deg")
        self._yaw_rotation = Quaternion.from_euler(_ZERO, _ZERO, self._yaw_trim)

        pos_orig = self.rotate_and_correct_position(position)
        self._use_posvel_rotation = False
        if not is_zero(self._yaw_trim):
            self._posvel_rotation = Matrix3f.from_euler(_ZERO, _ZERO, self._yaw_trim)
            self._use_posvel_rotation = True
        pos_new = self.rotate_and_correct_position(position)
        self._pos_correction = self._pos_correction + (pos_orig - pos_new)

    def _align_sensor_position(self, sensor_pos: Vector3f, align_xy: bool, align_z: bool) -> bool:
        """Align position with the AHRS; refused while it has none.

        Source: AP_VisualOdom_IntelT265::align_position_to_ahrs(const Vector3f &, bool, bool).
        """
        ahrs_pos_ned = self._ahrs.get_relative_position_NED_origin_float()
        if ahrs_pos_ned is None:
            return False
        self.align_position(sensor_pos, ahrs_pos_ned, align_xy, align_z)
        return True

    def align_position(self, sensor_pos: Vector3f, new_pos: Vector3f, align_xy: bool, align_z: bool) -> None:
        """Shift the camera's frame so that ``sensor_pos`` maps to ``new_pos`` on the chosen axes.

        Source: AP_VisualOdom_IntelT265::align_position.
        """
        pos_orig = self.rotate_and_correct_position(sensor_pos)
        x, y, z = self._pos_correction.to_tuple()
        if align_xy:
            x = x + (new_pos.x - pos_orig.x)
            y = y + (new_pos.y - pos_orig.y)
        if align_z:
            z = z + (new_pos.z - pos_orig.z)
        self._pos_correction = Vector3f(x, y, z)

    def pre_arm_check(self) -> str | None:
        """Return the text of the first failed check, or None.

        Source: AP_VisualOdom_IntelT265::pre_arm_check.
        """
        if not self.healthy():
            return "not healthy"
        if self._error_orientation:
            return "check VISO_ORIENT parameter"
        ahrs_quat = self._ahrs.get_quaternion()
        if ahrs_quat is None:
            return "waiting for AHRS attitude"
        rp_diff_deg = degrees(ahrs_quat.roll_pitch_difference(self._attitude_last, self._frontend.errors))
        if rp_diff_deg > ATTITUDE_DIFF_MAX_DEG:
            return f"roll/pitch diff {fixed(float(rp_diff_deg), 1, 4)} deg (>10)"
        angle_diff = ahrs_quat.angular_difference(self._attitude_last).to_axis_angle()
        yaw_diff_deg = degrees(abs(angle_diff.z))
        if yaw_diff_deg > ATTITUDE_DIFF_MAX_DEG:
            return f"yaw diff {fixed(float(yaw_diff_deg), 1, 4)} deg (>10)"
        return None

    def should_consume_sensor_data(self, vision_position_estimate: bool, reset_counter: int) -> bool:
        """Return whether samples may be used; those of a T265 may not for a second after a position reset.

        Source: AP_VisualOdom_IntelT265::should_consume_sensor_data.
        """
        if self.get_type() == _VOXL:
            return True
        now_ms = self._clock.millis()
        if vision_position_estimate and reset_counter != self._pos_reset_counter_last:
            self._pos_reset_counter_last = reset_counter
            self._pos_reset_ignore_start_ms = now_ms
        if u32(now_ms - self._pos_reset_ignore_start_ms) > VISUALODOM_RESET_IGNORE_DURATION_MS:
            self._pos_reset_ignore_start_ms = 0
        return self._pos_reset_ignore_start_ms == 0

    def record_voxl_position_and_reset_count(self, position: Vector3f, reset_counter: int) -> None:
        """Store a VOXL camera's corrected position and its reset counter."""
        if self.get_type() == _VOXL:
            self._voxl_position_last = position
            self._voxl_reset_counter_last = reset_counter

    def handle_voxl_camera_reset_jump(self, sensor_pos: Vector3f, sensor_att: Quaternion, reset_counter: int) -> None:
        """Re-align a VOXL camera whose reset counter changed, so that its output does not jump.

        Source: AP_VisualOdom_IntelT265::handle_voxl_camera_reset_jump.
        """
        if self.get_type() != _VOXL or reset_counter == self._voxl_reset_counter_last:
            return
        self._frontend.gcs.send_text(_MAV_SEVERITY_WARNING, "VisOdom: reset")
        self.align_yaw_to_ahrs(sensor_pos, sensor_att)
        self.align_position(sensor_pos, self._voxl_position_last, True, True)
        self._voxl_reset_counter_last = reset_counter
