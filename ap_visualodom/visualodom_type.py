# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The values of VISO_TYPE (AP_VisualOdom.h, AP_VisualOdom::VisualOdom_Type)."""

from enum import IntEnum


class VisualOdom_Type(IntEnum):
    """Which backend receives external navigation."""

    NONE = 0
    MAV = 1
    IntelT265 = 2
    VOXL = 3
