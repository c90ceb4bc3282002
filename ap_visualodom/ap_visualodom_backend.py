# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The base class of all backends (AP_VisualOdom/AP_VisualOdom_Backend.cpp)."""

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Final

import numpy as np

from ap_core.cint import float_of_u64, u32
from ap_core.fmath import f32
from ap_core.quaternion import Quaternion
from ap_core.rotations import rotate_vector
from ap_core.vector3 import Vector3f
from ap_core.verdict import Verdict
from ap_visualodom.ap_visualodom_logging import AP_VisualOdom_Logging
from ap_visualodom.verdicts import CONSUMED

if TYPE_CHECKING:
    from ap_visualodom.ap_visualodom import AP_VisualOdom

AP_VISUALODOM_TIMEOUT_MS: Final = 300
POS_ERR_MAX_M: Final = f32(100.0)
ANG_ERR_MAX_RAD: Final = f32(1.5)
NO_ERR: Final = f32(0.0)

_MICRO: Final = f32(1.0e-6)


class AP_VisualOdom_Backend(ABC):
    """A source of external navigation. All state starts at zero, as the firmware's zeroed allocation does."""

    def __init__(self, frontend: "AP_VisualOdom") -> None:
        self._frontend = frontend
        self._ahrs = frontend.ahrs
        self._clock = frontend.clock
        self._log = AP_VisualOdom_Logging(frontend.logger, frontend.clock)
        self._last_update_ms = 0
        self._last_reset_counter = 0
        self._reset_timestamp_ms = 0
        self._quality = 0

    def healthy(self) -> bool:
        """Return whether a message came within 300 ms; true in the first 300 ms after boot without any.

        Source: AP_VisualOdom_Backend::healthy.
        """
        return u32(self._clock.millis() - self._last_update_ms) < AP_VISUALODOM_TIMEOUT_MS

    def quality(self) -> int:
        """Return the last quality: -1 failed, 0 unknown, 1 worst .. 100 best."""
        return self._quality

    def handle_vision_position_delta_msg(
        self, time_delta_usec: int, angle_delta: Vector3f, position_delta: Vector3f, confidence: np.float32
    ) -> Verdict:
        """Handle a VISION_POSITION_DELTA: rad and m in the camera's body frame over ``time_delta_usec``.

        No gate applies, and quality is neither read nor changed.
        Source: AP_VisualOdom_Backend::handle_vision_position_delta_msg.
        """
        rot = self._frontend.get_orientation()
        angle_delta = rotate_vector(angle_delta, rot, self._frontend.errors)
        position_delta = rotate_vector(position_delta, rot, self._frontend.errors)

        now_ms = self._clock.millis()
        self._last_update_ms = now_ms

        time_delta_sec = float_of_u64(time_delta_usec) * _MICRO
        self._ahrs.writeBodyFrameOdom(
            confidence,
            position_delta,
            angle_delta,
            time_delta_sec,
            now_ms,
            self._frontend.get_delay_ms(),
            self._frontend.get_pos_offset(),
        )
        self._log.Write_VisualOdom(time_delta_sec, angle_delta, position_delta, confidence)
        return CONSUMED

    @abstractmethod
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
        """Handle a position (m) and attitude with their errors (m, rad)."""

    @abstractmethod
    def handle_vision_speed_estimate(
        self,
        remote_time_us: int,
        time_ms: int,
        vel: Vector3f,
        reset_counter: int,
        quality: int,
        vel_err: np.float32 = NO_ERR,
    ) -> Verdict:
        """Handle a velocity in m/s NED and its error, 0 for unknown."""

    def request_align_yaw_to_ahrs(self) -> None:  # noqa: B027  # the firmware's default does nothing
        """Request yaw alignment at the next pose; does nothing by default."""

    def align_position_to_ahrs(self, align_xy: bool, align_z: bool) -> None:  # noqa: B027  # as above
        """Request position alignment at the next pose; does nothing by default."""

    def pre_arm_check(self) -> str | None:
        """Return the text of a failed check, or None; no check by default."""
        return None

    def get_type(self) -> int:
        """Return the present VISO_TYPE (AP_VisualOdom_Backend::get_type)."""
        return self._frontend.get_type()

    def get_reset_timestamp_ms(self, reset_counter: int) -> int:
        """Return the time of the last reset in ms; a changed counter sets it to now.

        Source: AP_VisualOdom_Backend::get_reset_timestamp_ms.
        """
        if reset_counter != self._last_reset_counter:
            self._last_reset_counter = reset_counter
            self._reset_timestamp_ms = self._clock.millis()
        return self._reset_timestamp_ms
