# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The differences between releases of AP_VisualOdom: one function for each behaviour, and each release's choice."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from ap_core.vector3 import Vector3f

Axes = tuple[bool, bool]
"""Whether the horizontal axes are included, and whether the vertical one is."""


def axes_requested(align_xy: bool, align_z: bool) -> Axes:
    """Return all axes that a request to align position names.

    Source: AP_VisualOdom_IntelT265.h, align_position_to_ahrs(bool, bool).
    """
    return align_xy, align_z


def no_axes(_align_xy: bool, _align_z: bool) -> Axes:
    """Return no axes: the base class has the code for alignment, but nothing sets its flags.

    Source: AP_VisualOdom_Backend.cpp, align_position_to_ahrs.
    """
    return False, False


def position_as_scaled(position: Vector3f) -> Vector3f:
    """Return the MAV backend's position unchanged (AP_VisualOdom_MAV::handle_pose_estimate)."""
    return position


def position_with_correction(position: Vector3f) -> Vector3f:
    """Return the MAV backend's position plus a correction that is always zero: a negative zero becomes positive.

    Source: AP_VisualOdom_MAV::handle_pose_estimate, with the correction of the base class.
    """
    return position + Vector3f()


def vel_err_of_parameter(_vel_err: np.float32, vel_noise: np.float32, _consume: bool) -> np.float32:
    """Return VISO_VEL_M_NSE; the velocity's own error is ignored."""
    return vel_noise


def vel_err_of_message(vel_err: np.float32, vel_noise: np.float32, consume: bool) -> np.float32:
    """Return the velocity's own error, at least VISO_VEL_M_NSE if the velocity is used.

    Source: AP_VisualOdom_MAV::handle_vision_speed_estimate, since 2026-03-20. NaN counts as less than any number.
    """
    return np.fmax(vel_err, vel_noise) if consume else vel_err


@dataclass(frozen=True, slots=True)
class VisualOdomRelease:
    """The behaviour of a release.

    Attributes:
        axes_to_align: takes the axes of a request to align position, returns those aligned at the next pose. T265 and
            VOXL only; the MAV backend never aligns.
        mav_position: takes a scaled position (m) of the MAV backend, returns the position to pass on.
        mav_vel_err: takes the error of a velocity (m/s), VISO_VEL_M_NSE and whether the MAV backend uses the velocity;
            returns the error to pass on.
    """

    axes_to_align: Callable[[bool, bool], Axes]
    mav_position: Callable[[Vector3f], Vector3f]
    mav_vel_err: Callable[[np.float32, np.float32, bool], np.float32] = vel_err_of_parameter


STABLE_4_6: Final = VisualOdomRelease(axes_requested, position_as_scaled)
JULY_2025: Final = STABLE_4_6
FEBRUARY_2026: Final = VisualOdomRelease(no_axes, position_with_correction)
STABLE_4_7: Final = FEBRUARY_2026
APRIL_2026: Final = VisualOdomRelease(no_axes, position_with_correction, vel_err_of_message)
