# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where releases of AP_VisualOdom differ: one strategy for each such place, and which of them a release has."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from ap_core.vector3 import Vector3f

Axes = tuple[bool, bool]
"""Whether something concerns the horizontal axes, and whether the vertical one."""


def axes_requested(align_xy: bool, align_z: bool) -> Axes:
    """Return the axes of a request to align position: all that it names.

    Source: AP_VisualOdom_IntelT265.h, align_position_to_ahrs(bool, bool).
    """
    return align_xy, align_z


def no_axes(_align_xy: bool, _align_z: bool) -> Axes:
    """Return no axes, whatever a request names: the base class has the code, and nothing sets its flags.

    Source: AP_VisualOdom_Backend.cpp, align_position_to_ahrs.
    """
    return False, False


def position_as_scaled(position: Vector3f) -> Vector3f:
    """Return the MAV backend's position as it is (AP_VisualOdom_MAV::handle_pose_estimate)."""
    return position


def position_with_correction(position: Vector3f) -> Vector3f:
    """Return the MAV backend's position plus a correction that always is zero: a negative zero becomes positive.

    Source: AP_VisualOdom_MAV::handle_pose_estimate, with the correction of the base class.
    """
    return position + Vector3f()


@dataclass(frozen=True, slots=True)
class VisualOdomRelease:
    """What a release does.

    Attributes:
        axes_to_align: takes the axes of a request to align position, returns those that are aligned at the next pose;
            of the T265 and VOXL backend, as the MAV backend aligns in no release.
        mav_position: takes a scaled position (m) of the MAV backend, returns what is made of it.
    """

    axes_to_align: Callable[[bool, bool], Axes]
    mav_position: Callable[[Vector3f], Vector3f]


REFERENCE: Final = VisualOdomRelease(axes_requested, position_as_scaled)
"""The library of October 2025, and of 4.6."""
