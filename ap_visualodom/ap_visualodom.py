# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The frontend: parameters, the choice of a backend, and the calls of the vehicle (AP_VisualOdom/AP_VisualOdom.cpp)."""

from collections.abc import Callable, Mapping
from typing import Final

import numpy as np

from ap_core.cint import u8
from ap_core.clock import Clock
from ap_core.fmath import ieee754
from ap_core.internal_error import InternalErrorSink
from ap_core.param import ParamGroup
from ap_core.quaternion import Quaternion
from ap_core.sinks import RecordSink, TextSink
from ap_core.vector3 import Vector3f
from ap_core.verdict import Verdict
from ap_visualodom.ap_visualodom_backend import NO_ERR, AP_VisualOdom_Backend
from ap_visualodom.ap_visualodom_intelt265 import AP_VisualOdom_IntelT265
from ap_visualodom.ap_visualodom_mav import AP_VisualOdom_MAV
from ap_visualodom.ports import Ahrs
from ap_visualodom.release import STABLE_4_7, VisualOdomRelease
from ap_visualodom.var_info import GROUP_PREFIX, VAR_INFO, VisualOdom_Type
from ap_visualodom.verdicts import DISABLED, NO_BACKEND

BACKENDS: Final[Mapping[VisualOdom_Type, Callable[["AP_VisualOdom"], AP_VisualOdom_Backend]]] = {
    VisualOdom_Type.MAV: AP_VisualOdom_MAV,
    VisualOdom_Type.IntelT265: AP_VisualOdom_IntelT265,
    VisualOdom_Type.VOXL: AP_VisualOdom_IntelT265,
}

_NO_TYPE: Final = int(VisualOdom_Type.NONE)


def make_params() -> ParamGroup:
    """Return the VISO_ parameters at their defaults."""
    return ParamGroup(GROUP_PREFIX, VAR_INFO)


class AP_VisualOdom:
    """The frontend of external navigation, with at most one backend, which is chosen at boot.

    Args:
        params: the VISO_ parameters, not shared with another frontend; a stored value takes effect at the next use.
        ahrs: receiver of the data, and reference for alignment and the pre-arm check.
        gcs: receiver of texts.
        logger: receiver of log records.
        clock: time since boot.
        errors: receiver of internal errors.
        release: the behaviour where releases differ.
    """

    def __init__(
        self,
        params: ParamGroup,
        *,
        ahrs: Ahrs,
        gcs: TextSink,
        logger: RecordSink,
        clock: Clock,
        errors: InternalErrorSink,
        release: VisualOdomRelease = STABLE_4_7,
    ) -> None:
        self.params = params
        self.ahrs = ahrs
        self.gcs = gcs
        self.logger = logger
        self.clock = clock
        self.errors = errors
        self.release = release
        self._driver: AP_VisualOdom_Backend | None = None
        self._read_params()
        params.on_change.append(self._read_params)

    def _read_params(self) -> None:
        """Read the parameters after one was stored; caching pays because a sample calls about ten getters."""
        params = self.params
        self._type = params.get_int("_TYPE")
        self._orientation = u8(params.get_int("_ORIENT"))
        self._pos_scale = params.get_float("_SCALE")
        self._pos_offset = params.get_vector("_POS")
        self._delay_ms = max(0, params.get_int("_DELAY_MS"))
        self._vel_noise = params.get_float("_VEL_M_NSE")
        self._pos_noise = params.get_float("_POS_M_NSE")
        self._yaw_noise = params.get_float("_YAW_M_NSE")
        self._quality_min = params.get_int("_QUAL_MIN")

    def init(self) -> None:
        """Create the backend that VISO_TYPE names; an unknown number creates none (AP_VisualOdom::init)."""
        make = BACKENDS.get(self.get_type())  # type: ignore[call-overload]  # any int8 may be stored
        self._driver = make(self) if make is not None else None

    def enabled(self) -> bool:
        """Return whether VISO_TYPE is set (AP_VisualOdom::enabled)."""
        return self._type != _NO_TYPE

    def healthy(self) -> bool:
        """Return whether there is a backend and it receives data (AP_VisualOdom::healthy)."""
        return self.enabled() and self._driver is not None and self._driver.healthy()

    def quality(self) -> int:
        """Return the last quality: -1 failed, 0 unknown, 1 worst .. 100 best (AP_VisualOdom::quality)."""
        return self._driver.quality() if self._driver is not None else 0

    def get_type(self) -> int:
        """Return VISO_TYPE as stored, which may name no backend."""
        return self._type

    def get_orientation(self) -> int:
        """Return VISO_ORIENT as an orientation number (a negative one becomes its unsigned byte)."""
        return self._orientation

    def get_pos_scale(self) -> np.float32:
        """Return VISO_SCALE."""
        return self._pos_scale

    def get_pos_offset(self) -> Vector3f:
        """Return VISO_POS in metres, FRD."""
        return self._pos_offset

    def get_delay_ms(self) -> int:
        """Return VISO_DELAY_MS, 0 when negative (AP_VisualOdom.h, get_delay_ms)."""
        return self._delay_ms

    def get_vel_noise(self) -> np.float32:
        """Return VISO_VEL_M_NSE in m/s."""
        return self._vel_noise

    def get_pos_noise(self) -> np.float32:
        """Return VISO_POS_M_NSE in m."""
        return self._pos_noise

    def get_yaw_noise(self) -> np.float32:
        """Return VISO_YAW_M_NSE in rad."""
        return self._yaw_noise

    def get_quality_min(self) -> int:
        """Return VISO_QUAL_MIN."""
        return self._quality_min

    def _refusal(self) -> Verdict:
        return NO_BACKEND if self.enabled() else DISABLED

    def _active_driver(self) -> AP_VisualOdom_Backend | None:
        return self._driver if self._type != _NO_TYPE else None

    @ieee754
    def handle_vision_position_delta_msg(
        self, time_delta_usec: int, angle_delta: Vector3f, position_delta: Vector3f, confidence: np.float32
    ) -> Verdict:
        """Handle the fields of VISION_POSITION_DELTA: us, rad, m, 0..100.

        Source: AP_VisualOdom::handle_vision_position_delta_msg.
        """
        driver = self._active_driver()
        if driver is None:
            return self._refusal()
        return driver.handle_vision_position_delta_msg(time_delta_usec, angle_delta, position_delta, confidence)

    @ieee754
    def handle_pose_estimate_euler(
        self,
        remote_time_us: int,
        time_ms: int,
        pos: Vector3f,
        euler_rad: Vector3f,
        posErr: np.float32,
        angErr: np.float32,
        reset_counter: int,
        quality: int,
    ) -> Verdict:
        """Handle a position (m) and roll, pitch, yaw (rad).

        Source: AP_VisualOdom::handle_pose_estimate, the overload with Euler angles.
        """
        driver = self._active_driver()
        if driver is None:
            return self._refusal()
        attitude = Quaternion.from_euler(euler_rad.x, euler_rad.y, euler_rad.z)
        return driver.handle_pose_estimate(
            remote_time_us, time_ms, pos, attitude, posErr, angErr, reset_counter, quality
        )

    @ieee754
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

        Args:
            remote_time_us: the sender's time stamp, logged as it is.
            time_ms: the time of the sample in ms since boot, corrected for transport.
            pos: metres, NED or FRD.
            attitude: body to earth; neither normalised nor checked.
            posErr: metres.
            angErr: radians.
            reset_counter: 0..255.
            quality: -1 failed, 0 unknown, 1 worst .. 100 best.

        Source: AP_VisualOdom::handle_pose_estimate, the overload with a quaternion.
        """
        driver = self._active_driver()
        if driver is None:
            return self._refusal()
        return driver.handle_pose_estimate(
            remote_time_us, time_ms, pos, attitude, posErr, angErr, reset_counter, quality
        )

    @ieee754
    def handle_vision_speed_estimate(
        self,
        remote_time_us: int,
        time_ms: int,
        vel: Vector3f,
        reset_counter: int,
        quality: int,
        vel_err: np.float32 = NO_ERR,
    ) -> Verdict:
        """Handle a velocity in m/s NED and its error, 0 for unknown (AP_VisualOdom::handle_vision_speed_estimate)."""
        driver = self._active_driver()
        if driver is None:
            return self._refusal()
        return driver.handle_vision_speed_estimate(remote_time_us, time_ms, vel, reset_counter, quality, vel_err)

    def request_align_yaw_to_ahrs(self) -> None:
        """Request yaw alignment at the next pose (AP_VisualOdom::request_align_yaw_to_ahrs)."""
        driver = self._active_driver()
        if driver is not None:
            driver.request_align_yaw_to_ahrs()

    def align_position_to_ahrs(self, align_xy: bool, align_z: bool) -> None:
        """Request position alignment at the next pose, while another source gives the position.

        Source: AP_VisualOdom::align_position_to_ahrs.
        """
        driver = self._active_driver()
        if driver is not None:
            driver.align_position_to_ahrs(align_xy, align_z)

    @ieee754
    def pre_arm_check(self) -> str | None:
        """Return the text of a failed check without its prefix, or None (AP_VisualOdom::pre_arm_check)."""
        if not self.enabled():
            return None
        if self._driver is None:
            return "out of memory"
        if not self.healthy():
            return "not healthy"
        return self._driver.pre_arm_check()
