# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the backends do with a stretch of samples over which nothing changes but the samples.

The scalar backend stays the definition, and the holder of all state: its own methods turn and shift arrays, and what
is left to do here is the trigonometry, the tests and the state after the stretch.
"""

from typing import Protocol

import numpy as np

from ap_core.clock import VirtualClock
from ap_core.dataflash_dtype import Column
from ap_core.fmath import RAD_TO_DEG
from ap_core.fmath_arrays import Floats, wrap_360_array
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ap_visualodom.ap_visualodom import AP_VisualOdom
from ap_visualodom.ap_visualodom_backend import AP_VisualOdom_Backend
from ap_visualodom.ap_visualodom_intelt265 import VISUALODOM_RESET_IGNORE_DURATION_MS, AP_VisualOdom_IntelT265
from ap_visualodom.ap_visualodom_mav import AP_VisualOdom_MAV
from ap_visualodom.batch_samples import Poses
from ap_visualodom.ports import Ahrs
from ap_visualodom.visualodom_type import VisualOdom_Type


class StraightBackend(Protocol):
    """A backend on a straight stretch."""

    driver: AP_VisualOdom_Backend

    def turns(self, poses: Poses) -> Column:
        """Tell of each row whether it changes more state than a stretch may; is_turn tells it of the first one."""

    def is_turn(self, reset_counter: int) -> bool:
        """Tell whether the next pose, with this reset counter, is such a row."""

    def first_aligned(self, time_us: Column, clock: VirtualClock) -> int:
        """Return the first of poses at these times that the backend will be aligned at; if at none, their number."""

    def position(self, pos: Vector3f) -> Vector3f:
        """Return what is made of positions (arrays, m)."""

    def attitude(self, attitude: Quaternion) -> Quaternion:
        """Return what is made of attitudes (arrays)."""

    def velocity(self, vel: Vector3f) -> Vector3f:
        """Return what is made of velocities (arrays, m/s)."""

    def yaw_deg(self, yaw_rad: Floats) -> Floats:
        """Return yaw as it is logged."""

    def settled_from(self, now_ms: Column) -> int:
        """Return from which sample on, by the times of all, none is withheld for a reset; note when that is over."""

    def note_last_pose(self, pos: Vector3f, attitude: Quaternion, reset_counter: int) -> None:
        """Take the last pose (numbers), as it was made."""

    def attitude_made_of(self, given: Quaternion) -> Quaternion:
        """Return the attitude that the scalar backend has just made of one."""


class StraightMAV:
    """The MAV backend: no sample changes what it does with the next."""

    def __init__(self, driver: AP_VisualOdom_MAV, frontend: AP_VisualOdom) -> None:
        self.driver: AP_VisualOdom_Backend = driver
        self._frontend = frontend

    def turns(self, poses: Poses) -> Column:
        """Return none."""
        return np.zeros(len(poses), np.bool_)

    def is_turn(self, reset_counter: int) -> bool:
        """Return that it is not."""
        return False

    def first_aligned(self, time_us: Column, clock: VirtualClock) -> int:
        """Return that none is."""
        return len(time_us)

    def position(self, pos: Vector3f) -> Vector3f:
        """Scale."""
        return self._frontend.release.mav_position(pos * self._frontend.get_pos_scale())

    def attitude(self, attitude: Quaternion) -> Quaternion:
        """Pass on."""
        return attitude

    def velocity(self, vel: Vector3f) -> Vector3f:
        """Pass on."""
        return vel

    def yaw_deg(self, yaw_rad: Floats) -> Floats:
        """Convert to -180..180."""
        return yaw_rad * RAD_TO_DEG

    def settled_from(self, now_ms: Column) -> int:
        """Return that all are."""
        return 0

    def note_last_pose(self, pos: Vector3f, attitude: Quaternion, reset_counter: int) -> None:
        """Forget it."""

    def attitude_made_of(self, given: Quaternion) -> Quaternion:
        """Return the one given."""
        return given


class StraightIntelT265:
    """The IntelT265 and VOXL backend, between its resets and alignments."""

    def __init__(self, driver: AP_VisualOdom_IntelT265, frontend: AP_VisualOdom) -> None:
        self.driver: AP_VisualOdom_Backend = driver
        self._t265 = driver
        self._frontend = frontend

    @property
    def _is_voxl(self) -> bool:
        return self._frontend.get_type() == VisualOdom_Type.VOXL

    def turns(self, poses: Poses) -> Column:
        """Return where the reset counter differs from that of the pose before."""
        counter = poses.reset_counter
        return np.concatenate((np.zeros(min(1, len(counter)), np.bool_), counter[1:] != counter[:-1]))

    def is_turn(self, reset_counter: int) -> bool:
        """Tell whether the reset counter differs from the last one that the backend saw."""
        driver = self._t265
        return reset_counter != (driver._voxl_reset_counter_last if self._is_voxl else driver._pos_reset_counter_last)

    def first_aligned(self, time_us: Column, clock: VirtualClock) -> int:
        """Ask the AHRS at the time of each pose, as long as an alignment is pending, what the backend would ask."""
        driver = self._t265
        questions = [_gives_yaw] if driver._align_yaw else []
        questions += [_gives_position] if driver._align_posxy or driver._align_posz else []
        for number, one_us in enumerate(time_us.tolist() if questions else ()):
            clock.set_us(one_us)
            if any(gives(driver._ahrs) for gives in questions):
                return number
        return len(time_us)

    def position(self, pos: Vector3f) -> Vector3f:
        """Scale, turn and shift."""
        return self._t265.rotate_and_correct_position(pos * self._frontend.get_pos_scale())

    def attitude(self, attitude: Quaternion) -> Quaternion:
        """Turn."""
        return self._t265.rotate_attitude(attitude)

    def velocity(self, vel: Vector3f) -> Vector3f:
        """Turn."""
        return self._t265.rotate_velocity(vel)

    def yaw_deg(self, yaw_rad: Floats) -> Floats:
        """Convert to 0..360."""
        return wrap_360_array(yaw_rad * RAD_TO_DEG)

    def settled_from(self, now_ms: Column) -> int:
        """Return the first sample that comes more than a second after the reset; forget the reset then."""
        start_ms = self._t265._pos_reset_ignore_start_ms
        if self._is_voxl or start_ms == 0:
            return 0
        over = (now_ms - np.uint32(start_ms)) > VISUALODOM_RESET_IGNORE_DURATION_MS
        first = int(np.argmax(over))
        if not over[first]:
            return len(now_ms)
        self._t265._pos_reset_ignore_start_ms = 0
        return first

    def note_last_pose(self, pos: Vector3f, attitude: Quaternion, reset_counter: int) -> None:
        """Keep it for the pre-arm check, and for the next reset of a VOXL camera."""
        self._t265._attitude_last = attitude
        self._t265.record_voxl_position_and_reset_count(pos, reset_counter)

    def attitude_made_of(self, given: Quaternion) -> Quaternion:
        """Return what it kept of it."""
        return self._t265._attitude_last


def _gives_yaw(ahrs: Ahrs) -> bool:
    # As in AP_VisualOdom_IntelT265::align_yaw_to_ahrs.
    return not ahrs.using_extnav_for_yaw() and ahrs.initialised() and ahrs.dcm_yaw_initialised()


def _gives_position(ahrs: Ahrs) -> bool:
    return ahrs.get_relative_position_NED_origin_float() is not None


def straight_backend(frontend: AP_VisualOdom) -> StraightBackend | None:
    """Return the frontend's backend for stretches, or None while it has none, or is switched off."""
    driver = frontend._active_driver()
    if isinstance(driver, AP_VisualOdom_IntelT265):
        return StraightIntelT265(driver, frontend)
    if isinstance(driver, AP_VisualOdom_MAV):
        return StraightMAV(driver, frontend)
    return None
