# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which sensor feeds what, by the EK3_SRCn parameters (AP_NavEKF/AP_NavEKF_Source.cpp)."""

from enum import IntEnum
from typing import Final

SETS: Final = 3


class SourceXY(IntEnum):
    """EK3_SRCn_POSXY and EK3_SRCn_VELXY."""

    NONE = 0
    GPS = 3
    BEACON = 4
    OPTFLOW = 5
    EXTNAV = 6
    WHEEL_ENCODER = 7


class SourceZ(IntEnum):
    """EK3_SRCn_POSZ and EK3_SRCn_VELZ."""

    NONE = 0
    BARO = 1
    RANGEFINDER = 2
    GPS = 3
    BEACON = 4
    EXTNAV = 6


class SourceYaw(IntEnum):
    """EK3_SRCn_YAW."""

    NONE = 0
    COMPASS = 1
    GPS = 2
    GPS_COMPASS_FALLBACK = 3
    EXTNAV = 6
    GSF = 8


ROWS: Final = ("POSXY", "VELXY", "POSZ", "VELZ", "YAW")
EXTNAV: Final = 6  # in every row
