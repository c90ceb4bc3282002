# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How a situation shows: values of XKF4.TS, XKF4.SS and EKF_STATUS_REPORT.flags, texts; and how soon it does."""

from typing import Final

POS_TIMEOUT, VEL_TIMEOUT, HEIGHT_TIMEOUT = 1, 2, 4
"""Bits of XKF4.TS."""

NOT_AIDED_TS: Final = 50
AIDED_TS: Final = 48
STICKY_TS: Final = 49
LOST_TS: Final = 51

PARKED_SS: Final = 0x100A7
AIDED_SS: Final = 0x1233F
REJECTED_SS: Final = 0x1033F
STICKY_SS: Final = 0x12027
STICKY_REJECTED_SS: Final = 0x10027
RELATIVE_SS: Final = 0x1012F

USING_GPS: Final = 1 << 13
"""Bit of XKF4.SS: a position has passed in the last 4 s, whoever measured it."""

REPORTED: Final = 0x3FF
"""The bits of XKF4.SS that EKF_STATUS_REPORT has too."""

PARKED_FLAGS: Final = 167
AIDED_FLAGS: Final = 831
STICKY_FLAGS: Final = 39
RELATIVE_FLAGS: Final = 303

EV_YAW_RESET: Final = 62
EV_SOURCE_SET_1, EV_SOURCE_SET_2 = 85, 86

AIDING, STOPPED = "is using external nav data", "stopped aiding"

FUSED_AFTER_S: Final = 0.07
"""A sample of 30 Hz is fused no later than this after it came."""

LOG_S: Final = 0.1
"""How often estimates are logged."""
