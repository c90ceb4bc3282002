# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Parameters of how the vehicle flies, which the model of its flight controller obeys (``--imu fly``).

Types, defaults: ArduCopter/Parameters.cpp and the ``var_info`` tables of AC_WPNav, AC_Loiter, AC_AttitudeControl.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

from ap_core.param_info import ParamInfo, ParamType
from viso.parameters.conversion import Rename, Renames, metres_of_centimetres
from viso.parameters.copter import FLOAT, INT8, INT16, INT32

_YAW: Final = {0: "As it is", 1: "Next waypoint", 2: "Next waypoint but in RTL", 3: "Along the course"}
_CENTI: Final = 0.01


class _Row(NamedTuple):
    """A parameter of October 2025, in hundredths, and what it is called in whole units since April 2026."""

    name: str
    type: ParamType
    default: float
    later: str
    text: str
    unit: str


_IN_HUNDREDTHS: Final = (
    _Row("WPNAV_SPEED", FLOAT, 1000.0, "WP_SPD", "Horizontal speed on the way to a target", "m/s"),
    _Row("WPNAV_SPEED_UP", FLOAT, 250.0, "WP_SPD_UP", "Climb rate on the way to a target", "m/s"),
    _Row("WPNAV_SPEED_DN", FLOAT, 150.0, "WP_SPD_DN", "Descent rate on the way to a target", "m/s"),
    _Row("WPNAV_ACCEL", FLOAT, 250.0, "WP_ACC", "Horizontal acceleration on the way to a target", "m/s/s"),
    _Row("WPNAV_ACCEL_Z", FLOAT, 100.0, "WP_ACC_Z", "Vertical acceleration on the way to a target", "m/s/s"),
    _Row("LOIT_SPEED", FLOAT, 1250.0, "LOIT_SPEED_MS", "Horizontal speed of LOITER", "m/s"),
    _Row("LOIT_ACC_MAX", FLOAT, 500.0, "LOIT_ACC_MAX_M", "Horizontal acceleration of LOITER", "m/s/s"),
    _Row("PILOT_SPEED_UP", INT16, 250, "PILOT_SPD_UP", "Climb rate of the throttle stick", "m/s"),
    _Row("PILOT_SPEED_DN", INT16, 0, "PILOT_SPD_DN", "Its descent rate, 0 as its climb rate", "m/s"),
    _Row("LAND_SPEED", INT16, 50, "LAND_SPD_MS", "Descent rate of the last part of landing", "m/s"),
    _Row("LAND_SPEED_HIGH", INT16, 0, "LAND_SPD_HIGH_MS", "Descent rate before, 0 as WPNAV_SPEED_DN", "m/s"),
    _Row("LAND_ALT_LOW", INT16, 1000, "LAND_ALT_LOW_M", "Height at which the last part of landing begins", "m"),
    _Row("RTL_ALT", INT32, 1500, "RTL_ALT_M", "Height above home at which RTL returns", "m"),
    _Row("RTL_CLIMB_MIN", INT16, 0, "RTL_CLIMB_MIN_M", "By how much RTL climbs at least", "m"),
    _Row("ANGLE_MAX", INT16, 3000, "ATC_ANGLE_MAX", "Largest lean angle", "deg"),
    _Row("ATC_SLEW_YAW", FLOAT, 6000.0, "ATC_RATE_WPY_MAX", "Largest rate of turn on the way to a target", "deg/s"),
)
_ALIKE: Final = (
    ParamInfo("RTL_CONE_SLOPE", FLOAT, 3.0, "RTL returns no higher than its way home times this", "", (0.5, 10.0)),
    ParamInfo("RTL_LOIT_TIME", INT32, 5000, "How long RTL waits above home", "ms", (0.0, 60000.0)),
    ParamInfo("GUID_TIMEOUT", FLOAT, 3.0, "How long GUIDED obeys a velocity or rate that is not repeated", "s"),
    ParamInfo("WP_YAW_BEHAVIOR", INT8, 2, "Where the vehicle looks on its way", values=_YAW),
)


class FlyingParameters(NamedTuple):
    """The parameters of a release that say how the vehicle flies.

    Attributes:
        rows: of the table.
        names: what each is called, by its name of October 2025.
        factor: what makes m, m/s, m/s/s, degrees and degrees per second of those that are in hundredths there.
    """

    rows: Sequence[ParamInfo]
    names: dict[str, str]
    factor: float


REFERENCE: Final = FlyingParameters(
    (*(ParamInfo(row.name, row.type, row.default, row.text, f"c{row.unit}") for row in _IN_HUNDREDTHS), *_ALIKE),
    {row.name: row.name for row in _IN_HUNDREDTHS},
    _CENTI,
)
"""Up to the master of February 2026."""

APRIL_2026: Final = FlyingParameters(
    (*(ParamInfo(row.later, FLOAT, _CENTI * row.default, row.text, row.unit) for row in _IN_HUNDREDTHS), *_ALIKE),
    {row.name: row.later for row in _IN_HUNDREDTHS},
    1.0,
)

RENAMES: Final[Renames] = {row.name: Rename(row.later, metres_of_centimetres) for row in _IN_HUNDREDTHS}
"""What April 2026 calls otherwise."""
