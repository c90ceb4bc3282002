# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How the estimator navigates (AP_NavEKF3/AP_NavEKF3_core.h, AidingMode)."""

from enum import Enum


class AidingMode(Enum):
    """At a constant position, by absolute position, or by relative motion."""

    NONE = "none"
    ABSOLUTE = "absolute"
    RELATIVE = "relative"
