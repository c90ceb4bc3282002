# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The rules by which AP_VisualOdom decides about a sample."""

from typing import Final

from ap_core.verdict import Rule, Verdict, VerdictKind, dropped

CONSUMED: Final = Verdict(
    VerdictKind.ACCEPTED,
    Rule("consumed", "handed to the EKF", "AP_VisualOdom backends, handle_pose_estimate and its siblings"),
)
DISABLED: Final = dropped("viso_disabled", "VISO_TYPE is 0", "AP_VisualOdom.cpp, AP_VisualOdom::enabled")
NO_BACKEND: Final = dropped(
    "no_backend",
    "VISO_TYPE names no backend, or was set after boot: reboot needed",
    "AP_VisualOdom.cpp, AP_VisualOdom::init",
)
QUALITY_BELOW_MIN: Final = Verdict(
    VerdictKind.IGNORED,
    Rule(
        "quality_below_min",
        "quality is below VISO_QUAL_MIN",
        "AP_VisualOdom_MAV.cpp and AP_VisualOdom_IntelT265.cpp, handle_pose_estimate",
    ),
)
RESET_SETTLING: Final = Verdict(
    VerdictKind.IGNORED,
    Rule(
        "reset_settling",
        "a position reset was seen within the last 1000 ms",
        "AP_VisualOdom_IntelT265.cpp, should_consume_sensor_data",
    ),
)

VERDICTS: Final = (CONSUMED, DISABLED, NO_BACKEND, QUALITY_BELOW_MIN, RESET_SETTLING)
