# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The filter's status flags (AP_NavEKF3/AP_NavEKF3_Control.cpp, updateFilterStatus)."""

from typing import final

from ekf_stub.core.aiding import ABSOLUTE, NO_AIDING


@final
class FilterState:
    """What the flags follow from.

    ``flow_is_valid`` is true while optical flow comes in or is known to be zero, ``ground_is_valid`` while the height
    above the ground is known, ``height_needs_origin`` while height comes from GPS and there is no origin.
    """

    def __init__(self) -> None:
        self.healthy = False
        self.tilt_aligned = False
        self.yaw_aligned = False
        self.uses_compass = False
        self.mode = NO_AIDING
        self.pos_timeout = False
        self.vel_timeout = False
        self.height_timeout = False
        self.has_vertical_velocity = False
        self.odometry_in_use = False
        self.flow_is_valid = False
        self.ground_is_valid = False
        self.height_needs_origin = False


def filter_flags(state: FilterState) -> int:
    """Return the flags that EKF_STATUS_REPORT has, as bits; none of a filter that is not healthy or not aligned."""
    absolute = state.mode == ABSOLUTE
    aligned = state.yaw_aligned or (not state.uses_compass and not absolute)
    if not (state.healthy and state.tilt_aligned and aligned):
        return 0
    aided = state.mode != NO_AIDING
    by_odometry, by_flow = aided and state.odometry_in_use, aided and state.flow_is_valid
    pos_abs = absolute and not state.pos_timeout
    pos_rel = pos_abs or by_odometry or (by_flow and state.ground_is_valid)
    flags = 1 << 0  # attitude
    if not (state.vel_timeout and state.pos_timeout) or by_odometry or by_flow:
        flags |= 1 << 1  # horizontal velocity
    if (state.has_vertical_velocity and not state.vel_timeout) or not state.height_timeout:
        flags |= 1 << 2  # vertical velocity
    if pos_rel:
        flags |= 1 << 3 | 1 << 8  # relative horizontal position, also as predicted for flight
    if pos_abs:
        flags |= 1 << 4 | 1 << 9  # absolute horizontal position, likewise
    if not state.height_timeout and not state.height_needs_origin:
        flags |= 1 << 5  # height
    if state.ground_is_valid:
        flags |= 1 << 6  # height above the ground
    if not aided:
        flags |= 1 << 7  # constant position
    return flags
