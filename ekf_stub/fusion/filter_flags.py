# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The estimator's status flags (AP_NavEKF3/AP_NavEKF3_Control.cpp, updateFilterStatus)."""

from typing import NamedTuple

from ekf_stub.fusion.aiding import AidingMode
from ekf_stub.reports.filter_status import FilterFlag


class FilterState(NamedTuple):
    """What the flags follow from.

    ``flow_is_valid`` is true while optical flow comes in or is known to be zero, ``ground_is_valid`` while the height
    above the ground is known, ``height_needs_origin`` while height comes from GPS and there is no origin.
    """

    healthy: bool
    tilt_aligned: bool
    yaw_aligned: bool
    uses_compass: bool
    mode: AidingMode
    pos_timeout: bool
    vel_timeout: bool
    height_timeout: bool
    has_vertical_velocity: bool
    odometry_in_use: bool
    flow_is_valid: bool = False
    ground_is_valid: bool = False
    height_needs_origin: bool = False


def filter_flags(state: FilterState) -> FilterFlag:
    """Return the flags as EKF_STATUS_REPORT has them."""
    if not state.healthy:
        return FilterFlag.UNINITIALISED
    absolute = state.mode is AidingMode.ABSOLUTE
    aligned = state.yaw_aligned or (not state.uses_compass and not absolute)
    if not (state.tilt_aligned and aligned):
        return FilterFlag(0)
    aided = state.mode is not AidingMode.NONE
    by_odometry, by_flow = aided and state.odometry_in_use, aided and state.flow_is_valid
    pos_abs = absolute and not state.pos_timeout
    pos_rel = pos_abs or by_odometry or (by_flow and state.ground_is_valid)
    horiz_vel = not (state.vel_timeout and state.pos_timeout) or by_odometry or by_flow
    vert_vel = (state.has_vertical_velocity and not state.vel_timeout) or not state.height_timeout
    bits = (
        True,
        horiz_vel,
        vert_vel,
        pos_rel,
        pos_abs,
        not state.height_timeout and not state.height_needs_origin,
        state.ground_is_valid,
        state.mode is AidingMode.NONE,
        pos_rel,  # as predicted for flight
        pos_abs,
    )
    return FilterFlag(sum(1 << bit for bit, is_set in enumerate(bits) if is_set))
