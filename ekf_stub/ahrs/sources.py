# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The source sets EK3_SRCn: what each row may name, and what it needs (AP_NavEKF/AP_NavEKF_Source.cpp)."""

from collections.abc import Callable, Iterator, Mapping
from enum import IntEnum
from typing import Final

from ekf_stub.core.params import EkfSources

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


BARO: Final = "Baro"
BEACON: Final = "Beacon"
COMPASS: Final = "Compass"
GPS: Final = "GPS"
OPTICAL_FLOW: Final = "OpticalFlow"
RANGEFINDER: Final = "RangeFinder"
VISUAL_ODOM: Final = "VisualOdom"
WHEEL_ENCODER: Final = "WheelEncoder"

SENSORS: Final = (BARO, BEACON, COMPASS, GPS, OPTICAL_FLOW, RANGEFINDER, VISUAL_ODOM, WHEEL_ENCODER)
"""In the order in which they are looked for."""

# What each row of a set may be, and the sensor that it takes. The compass alone takes none, for vehicles without one.
_POSITION_ROWS: Final[Mapping[str, Mapping[int, str | None]]] = {
    "POSXY": {
        SourceXY.NONE: None,
        SourceXY.GPS: GPS,
        SourceXY.BEACON: BEACON,
        SourceXY.EXTNAV: VISUAL_ODOM,
    },
    "VELXY": {
        SourceXY.NONE: None,
        SourceXY.GPS: GPS,
        SourceXY.OPTFLOW: OPTICAL_FLOW,
        SourceXY.EXTNAV: VISUAL_ODOM,
        SourceXY.WHEEL_ENCODER: WHEEL_ENCODER,
    },
    "POSZ": {
        SourceZ.NONE: None,
        SourceZ.BARO: BARO,
        SourceZ.RANGEFINDER: RANGEFINDER,
        SourceZ.GPS: GPS,
        SourceZ.BEACON: BEACON,
        SourceZ.EXTNAV: VISUAL_ODOM,
    },
    "VELZ": {SourceZ.NONE: None, SourceZ.GPS: GPS, SourceZ.EXTNAV: VISUAL_ODOM},
}
_YAW_ROW: Final[Mapping[str, Mapping[int, str | None]]] = {
    "YAW": {
        SourceYaw.NONE: None,
        SourceYaw.COMPASS: None,
        SourceYaw.GPS: None,
        SourceYaw.GPS_COMPASS_FALLBACK: COMPASS,
        SourceYaw.EXTNAV: VISUAL_ODOM,
        SourceYaw.GSF: GPS,
    },
}

ALLOWED: Final[Mapping[str, Mapping[int, str | None]]] = {**_POSITION_ROWS, **_YAW_ROW}
"""What each row of a set may be, and the sensor that it takes."""


def _rows(requires_position: bool) -> Iterator[tuple[int, str, Mapping[int, str | None]]]:
    rows = ALLOWED if requires_position else _YAW_ROW
    for index in range(SETS):
        for what, allowed in rows.items():
            yield index, what, allowed


def source_failure(sources: EkfSources, is_fitted: Callable[[str], bool], *, requires_position: bool) -> str | None:
    """Return what is wrong with the source sets, whichever is active, or None; the first failure wins.

    Args:
        sources: the source sets.
        is_fitted: says whether there is a sensor, by its name in ``SENSORS``.
        requires_position: whether position and velocity are looked at, too.
    """
    needed: set[str | None] = set()
    for index, what, allowed in _rows(requires_position):
        value = sources.value(index, what)
        if value not in allowed:
            return f"Check EK3_SRC{index + 1}_{what}"
        needed.add(allowed[value])
    absent = (sensor for sensor in SENSORS if sensor in needed and not is_fitted(sensor))
    return next((f"EK3 sources require {sensor}" for sensor in absent), None)
