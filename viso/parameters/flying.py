# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Parameters of how the vehicle flies, which the model of its flight controller obeys (``--imu fly``).

Types, defaults: ArduCopter/Parameters.cpp and the ``var_info`` tables of AC_WPNav, AC_Loiter, AC_AttitudeControl,
ModeLand and ModeRTL. Releases have moved from hundredths to whole units, by and by and under new names.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import Final, NamedTuple

from ap_core.param_info import ParamInfo, ParamType
from viso.parameters.conversion import Rename, Renames, hundredfold, hundredth
from viso.parameters.copter import FLOAT, INT8, INT16, INT32

AFTER_FORMAT_VERSION: Final = "FORMAT_VERSION"
"""The spot after FORMAT_VERSION and what a release puts there."""
AFTER_INS: Final = "INS"
"""The spot after the INS group."""
AFTER_RC: Final = "RC"
"""The spot after the RC groups."""

_FIRST, _WAY, _LEAN, _LAST = AFTER_FORMAT_VERSION, "GPS_HDOP_GOOD", "DISARM_DELAY", "FS_EKF_FILT"
_YAW: Final = {0: "As it is", 1: "Next waypoint", 2: "Next waypoint but in RTL", 3: "Along the course"}
_RTL_FROM: Final = {0: "Home", 1: "Terrain"}
_CENTI: Final = 0.01


class _Row(NamedTuple):
    """A parameter in hundredths, with what it is called in whole units; and what stands before each."""

    name: str
    type: ParamType
    default: float
    spot: str
    later: str
    later_spot: str
    text: str
    unit: str

    def early(self) -> ParamInfo:
        return ParamInfo(self.name, self.type, self.default, self.text, f"c{self.unit}")

    def late(self) -> ParamInfo:
        return ParamInfo(self.later, FLOAT, _CENTI * self.default, self.text, self.unit)


_FIRST_MOVED: Final = (
    _Row("RTL_ALT", INT32, 1500, _FIRST, "RTL_ALT_M", _LAST, "Height above home at which RTL returns", "m"),
    _Row("RTL_CLIMB_MIN", INT16, 0, _FIRST, "RTL_CLIMB_MIN_M", _LAST, "By how much RTL climbs at least", "m"),
    _Row("LAND_SPEED", INT16, 50, _WAY, "LAND_SPD_MS", _LAST, "Descent rate of the last part of landing", "m/s"),
    _Row("LAND_SPEED_HIGH", INT16, 0, _WAY, "LAND_SPD_HIGH_MS", _LAST, "The same before that, 0 as in flight", "m/s"),
    _Row("LAND_ALT_LOW", INT16, 1000, AFTER_RC, "LAND_ALT_LOW_M", _LAST, "Where the last part of landing begins", "m"),
    _Row("LOIT_SPEED", FLOAT, 1250, AFTER_INS, "LOIT_SPEED_MS", AFTER_INS, "Horizontal speed in LOITER", "m/s"),
    _Row("LOIT_ACC_MAX", FLOAT, 500, AFTER_INS, "LOIT_ACC_MAX_M", AFTER_INS, "Acceleration in LOITER", "m/s/s"),
    _Row("ANGLE_MAX", INT16, 3000, _LEAN, "ATC_ANGLE_MAX", AFTER_INS, "Largest lean angle", "deg"),
)
_THEN_MOVED: Final = (
    _Row("WPNAV_SPEED", FLOAT, 1000, AFTER_INS, "WP_SPD", AFTER_INS, "Horizontal speed to a target", "m/s"),
    _Row("WPNAV_RADIUS", FLOAT, 200, AFTER_INS, "WP_RADIUS_M", AFTER_INS, "How near a waypoint counts as reached", "m"),
    _Row("WPNAV_SPEED_UP", FLOAT, 250, AFTER_INS, "WP_SPD_UP", AFTER_INS, "Climb rate to a target", "m/s"),
    _Row("WPNAV_SPEED_DN", FLOAT, 150, AFTER_INS, "WP_SPD_DN", AFTER_INS, "Descent rate to a target", "m/s"),
    _Row("WPNAV_ACCEL", FLOAT, 250, AFTER_INS, "WP_ACC", AFTER_INS, "Horizontal acceleration to a target", "m/s/s"),
    _Row("WPNAV_ACCEL_Z", FLOAT, 100, AFTER_INS, "WP_ACC_Z", AFTER_INS, "Vertical acceleration to a target", "m/s/s"),
    _Row("PILOT_SPEED_UP", INT16, 250, _WAY, "PILOT_SPD_UP", _LAST, "Climb rate of the throttle stick", "m/s"),
    _Row("PILOT_SPEED_DN", INT16, 0, AFTER_RC, "PILOT_SPD_DN", _LAST, "Its descent rate, 0 as its climb rate", "m/s"),
    _Row("ATC_SLEW_YAW", FLOAT, 6000, AFTER_INS, "ATC_RATE_WPY_MAX", AFTER_INS, "Rate of turn to a heading", "deg/s"),
)
_ALIKE: Final = (
    (_FIRST, ParamInfo("RTL_CONE_SLOPE", FLOAT, 3.0, "RTL returns no higher than its way times this", "", (0.5, 10.0))),
    (_FIRST, ParamInfo("RTL_LOIT_TIME", INT32, 5000, "How long RTL waits above home", "ms", (0.0, 60000.0))),
    (_FIRST, ParamInfo("RTL_ALT_TYPE", INT8, 0, "What RTL's height counts from: level ground here", values=_RTL_FROM)),
    (_WAY, ParamInfo("WP_YAW_BEHAVIOR", INT8, 2, "Where the vehicle looks on its way", values=_YAW)),
    (
        "FS_OPTIONS",
        ParamInfo("AUTO_OPTIONS", INT32, 0, "Bits of AUTO: 0 it can be armed in, 1 it lifts off without the throttle"),
    ),
    (
        "FS_GCS_TIMEOUT",
        ParamInfo("GUID_TIMEOUT", FLOAT, 3.0, "How long GUIDED obeys a velocity that is not repeated", "s"),
    ),
)
_ORDER: Final = (
    *("RTL_ALT", "RTL_ALT_M", "RTL_CONE_SLOPE", "RTL_CLIMB_MIN", "RTL_CLIMB_MIN_M", "RTL_LOIT_TIME", "RTL_ALT_TYPE"),
    *("WP_YAW_BEHAVIOR", "LAND_SPEED", "LAND_SPD_MS", "LAND_SPEED_HIGH", "LAND_SPD_HIGH_MS"),
    *("PILOT_SPEED_DN", "LAND_ALT_LOW", "LAND_ALT_LOW_M", "PILOT_SPEED_UP", "PILOT_SPD_UP", "PILOT_SPD_DN"),
    *(
        "WPNAV_SPEED",
        "WP_SPD",
        "WPNAV_RADIUS",
        "WP_RADIUS_M",
        "WPNAV_SPEED_UP",
        "WP_SPD_UP",
        "WPNAV_SPEED_DN",
        "WP_SPD_DN",
        "WPNAV_ACCEL",
        "WP_ACC",
    ),
    *("WPNAV_ACCEL_Z", "WP_ACC_Z", "LOIT_SPEED", "LOIT_SPEED_MS", "LOIT_ACC_MAX", "LOIT_ACC_MAX_M"),
    *("AUTO_OPTIONS", "ATC_SLEW_YAW", "ATC_ANGLE_MAX", "ATC_RATE_WPY_MAX", "ANGLE_MAX", "GUID_TIMEOUT"),
)
"""Of those that share a spot."""


class FlyingParameters(NamedTuple):
    """The parameters of a release that say how the vehicle flies.

    Attributes:
        spots: rows of the table, by the name of what they follow in it.
        sources: what each is called, by its name of July 2025, and how many m, m/s, m/s/s, degrees or degrees per
            second its unit is.
    """

    spots: Mapping[str, Sequence[ParamInfo]]
    sources: Mapping[str, tuple[str, float]]


def _parameters(early: Iterable[_Row], late: Iterable[_Row]) -> FlyingParameters:
    early, late = (*early,), (*late,)
    placed = [*_ALIKE, *((row.spot, row.early()) for row in early), *((row.later_spot, row.late()) for row in late)]
    spots: dict[str, list[ParamInfo]] = {}
    for spot, info in sorted(placed, key=lambda row: _ORDER.index(row[1].name)):
        spots.setdefault(spot, []).append(info)
    sources = {row.name: (row.name, _CENTI) for row in early}
    return FlyingParameters(spots, {**sources, **{row.name: (row.later, 1.0) for row in late}})


IN_CENTIMETRES: Final = _parameters((*_FIRST_MOVED, *_THEN_MOVED), ())
IN_METRES: Final = _parameters(_THEN_MOVED, _FIRST_MOVED)
ALL_IN_METRES: Final = _parameters((), (*_FIRST_MOVED, *_THEN_MOVED))

RENAMES: Final[Renames] = {row.name: Rename(row.later, hundredth, hundredfold) for row in (*_FIRST_MOVED, *_THEN_MOVED)}
"""What ``ALL_IN_METRES`` calls otherwise than ``IN_CENTIMETRES``."""
