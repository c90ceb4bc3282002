# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What an estimator says of itself (AP_NavEKF/AP_Nav_Common.h, nav_filter_status)."""

from enum import IntFlag
from typing import NamedTuple


class FilterFlag(IntFlag):
    """Bits of nav_filter_status, which are those of EKF_STATUS_REPORT as far as that has them."""

    ATTITUDE = 1 << 0
    HORIZ_VEL = 1 << 1
    VERT_VEL = 1 << 2
    HORIZ_POS_REL = 1 << 3
    HORIZ_POS_ABS = 1 << 4
    VERT_POS = 1 << 5
    TERRAIN_ALT = 1 << 6
    CONST_POS_MODE = 1 << 7
    PRED_HORIZ_POS_REL = 1 << 8
    PRED_HORIZ_POS_ABS = 1 << 9
    UNINITIALISED = 1 << 10
    GPS_GLITCHING = 1 << 15


class FilterStatus(NamedTuple):
    """Flags and the square roots of test ratios of the primary core; 1.0 is at the gate."""

    flags: FilterFlag
    velocity_variance: float = 0.0
    pos_horiz_variance: float = 0.0
    pos_vert_variance: float = 0.0
    compass_variance: float = 0.0
    terrain_alt_variance: float = 0.0
    airspeed_variance: float = 0.0
