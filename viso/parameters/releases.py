# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Parameters that releases name, type or place otherwise than others: those of links, ids and arming checks.

Types, defaults and order: ArduCopter/Parameters.cpp, GCS_MAVLink/GCS_MAVLink_Parameters.cpp and AP_Arming.cpp of each.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Final, NamedTuple

import numpy as np

from ap_core.param_group import ParamGroup
from ap_core.param_info import ParamFlag, ParamInfo, ParamType
from ekf_stub.core.params import FUSE_ALL_VELOCITIES
from viso.parameters import copter, flying, sensors
from viso.parameters.conversion import (
    Rename,
    Renames,
    check_instead_of_skip,
    hundredfold,
    hundredth,
    skip_instead_of_check,
)
from viso.parameters.copter import FLOAT, INT8, INT16, INT32
from viso.parameters.ekf3 import FLOW_LIMIT, FLOW_LIMIT_LATER
from viso.parameters.flying import FlyingParameters

MAX_LINKS: Final = 8
"""How many MAVLink links the firmware can have (GCS_MAVLink.h, MAVLINK_COMM_NUM_BUFFERS)."""

SR_LINKS: Final = 7
"""How many links have parameters in 4.6, open or not; more only where there are more links here."""

CHECKS_TO_SKIP: Final = (1 << 21) - 2
"""The bits of all checks in ARMING_SKIPCHK."""


class RangeUnit(NamedTuple):
    """What the limits of a range finder are called, and how many metres their unit is.

    A release that has them in centimetres cuts the range itself to whole ones, for its estimator and its log.
    """

    least: str
    most: str
    clearance: str
    metres: np.float32
    is_cm: bool


_METRES: Final = RangeUnit("MIN", "MAX", "GNDCLR", np.float32(1), is_cm=False)
_CENTIMETRES: Final = RangeUnit("MIN_CM", "MAX_CM", "GNDCLEAR", np.float32(0.01), is_cm=True)

LinkGroups = Callable[[int], list[ParamGroup]]
"""Takes the number of links, returns the groups."""


@dataclass(frozen=True, slots=True)
class ParameterRelease:
    """Which parameters a release has where releases differ.

    Attributes:
        early: top-level entries that follow FORMAT_VERSION.
        early_links: groups that precede AHRS_.
        second_table: rows of the vehicle's second table that precede FRAME_CLASS.
        late_links: groups that end the list.
        port_options: type of SERIALn_OPTIONS.
        arming: the ARMING_ group.
        arming_check: which of its rows says what is checked.
        enabled_checks: takes that row's value, returns the checks to make as ARMING_CHECK has them; bit 0 is all.
        more_ahrs: rows that end the AHRS_ group.
        more_stat: rows that end the STAT_ group.
        flow_limit: what the limit of optical flow rates is called in the EK3_ group.
        flow: the FLOW group.
        source_options: the default of EK3_SRC_OPTIONS.
        range_finder: the group of a range finder.
        range_unit: in what that is.
        flying: how the vehicle flies.
        vicon: the group of the simulator's own camera.
        simulated_gps_prefix, simulated_gps: that of its GPS.
        second_simulated_gps: that of its second GPS.
        simulation: the rows of its clock.
        failsafe: top-level entries that follow the ARMING_ group.
    """

    early: Sequence[ParamInfo]
    early_links: LinkGroups
    second_table: Sequence[ParamInfo]
    late_links: LinkGroups
    port_options: ParamType
    arming: Sequence[ParamInfo]
    arming_check: str
    enabled_checks: Callable[[int], int]
    more_ahrs: Sequence[ParamInfo] = ()
    more_stat: Sequence[ParamInfo] = ()
    flow_limit: str = FLOW_LIMIT
    flow: Sequence[ParamInfo] = sensors.FLOW
    source_options: int = 0
    range_finder: Sequence[ParamInfo] = sensors.RANGE_FINDER
    range_unit: RangeUnit = _METRES
    flying: FlyingParameters = flying.IN_CENTIMETRES
    vicon: Sequence[ParamInfo] = sensors.VICON
    simulated_gps_prefix: str = "SIM_GPS1_"
    simulated_gps: Sequence[ParamInfo] = sensors.SIMULATED_GPS
    second_simulated_gps: Sequence[ParamInfo] = sensors.SECOND_SIMULATED_GPS
    simulation: Sequence[ParamInfo] = sensors.SIMULATION
    failsafe: Sequence[ParamInfo] = copter.FAILSAFE


_MAV_IDS: Final = (
    ParamInfo("_SYSID", INT16, 1, "System id of this vehicle", "", (1.0, 255.0)),
    ParamInfo("_GCS_SYSID", INT16, 255, "System id of the ground station in charge", "", (1.0, 255.0)),
)
_GCS_SYSID_HI: Final = ParamInfo(
    "_GCS_SYSID_HI", INT16, 0, "The last of several such ids, of which MAV_GCS_SYSID is the first", "", (0.0, 255.0)
)
_MAV_BEHAVIOUR: Final = (
    ParamInfo("_OPTIONS", INT16, 0, "Bits: 0 obey only the ground station in charge"),
    ParamInfo("_TELEM_DELAY", INT8, 0, "Silence of telemetry radios after start-up", "s", (0.0, 30.0)),
)

STREAM_NAMES: Final = (
    "_RAW_SENS",
    "_EXT_STAT",
    "_RC_CHAN",
    "_RAW_CTRL",
    "_POSITION",
    "_EXTRA1",
    "_EXTRA2",
    "_EXTRA3",
    "_PARAMS",
    "_ADSB",
)
"""Row names of the stream rates of a link, in the order of the firmware's streams."""

_STREAMS: Final = tuple(
    ParamInfo(name, INT16, 0, "Rate of this stream group", "Hz", (0.0, 50.0), reboot_required=True)
    for name in STREAM_NAMES
)
_MAV_LINK: Final = (
    *_STREAMS,
    ParamInfo("_OPTIONS", INT16, 0, "Bits: 1 forward nothing, 2 ignore stream requests", reboot_required=True),
    # The firmware's default is 0, and its start sets 1.
    ParamInfo("_OPTIONSCNV", INT8, 1, "Whether options of older firmware were taken over", flags=ParamFlag.HIDDEN),
)


def _no_links(_number_of_links: int) -> list[ParamGroup]:
    return []


def _check_links(number_of_links: int) -> None:
    if number_of_links > MAX_LINKS:
        raise ValueError(f"link {number_of_links}: there are parameters for links 1 to {MAX_LINKS}")


def _mav_groups(rows: Sequence[ParamInfo], number_of_links: int) -> list[ParamGroup]:
    _check_links(number_of_links)
    prefixes = (f"MAV{number}" for number in range(1, number_of_links + 1))
    links = (ParamGroup(prefix, _MAV_LINK, top_level_prefix="MAV") for prefix in prefixes)
    return [ParamGroup("MAV", rows, top_level_prefix="MAV"), *links]


_mav_links: Final = partial(_mav_groups, (*_MAV_IDS, *_MAV_BEHAVIOUR))
_mav_links_with_range: Final = partial(_mav_groups, (*_MAV_IDS, _GCS_SYSID_HI, *_MAV_BEHAVIOUR))


# Up to 4.6

_SYSID: Final = (
    ParamInfo("SYSID_THISMAV", INT16, 1, "System id of this vehicle", "", (1.0, 255.0)),
    ParamInfo("SYSID_MYGCS", INT16, 255, "System id of the ground station in charge", "", (1.0, 255.0)),
    ParamInfo("TELEM_DELAY", INT8, 0, "Silence of telemetry radios after start-up", "s", (0.0, 30.0)),
)
_SYSID_ENFORCE: Final = (
    ParamInfo("SYSID_ENFORCE", INT8, 0, "Obey only the ground station in charge", values={0: "No", 1: "Yes"}),
)


def _sr_links(number_of_links: int) -> list[ParamGroup]:
    _check_links(number_of_links)
    prefixes = (f"SR{index}" for index in range(max(SR_LINKS, number_of_links)))
    return [ParamGroup(prefix, _STREAMS, top_level_prefix=prefix) for prefix in prefixes]


# What is checked before arming


def checks_to_make(value: int) -> int:
    """Return ARMING_CHECK as it is."""
    return value


def checks_not_skipped(value: int) -> int:
    """Return the checks that ARMING_SKIPCHK leaves (AP_Arming::get_enabled_checks)."""
    return ~value & CHECKS_TO_SKIP


_SKIPCHK: Final = ParamInfo(
    "SKIPCHK", INT32, 0, "Which checks arming does without, bits: 10 logging, 18 visual odometry, ...; -1 all"
)
_ARMING_LATER: Final = (*(row for row in copter.ARMING if row.name != "CHECK"), _SKIPCHK)

# Since the second half of 2025

_ORIGIN: Final = (
    ParamInfo("ORIGIN_LAT", FLOAT, 0.0, "Latitude of the last origin", "deg", (-90.0, 90.0)),
    ParamInfo("ORIGIN_LON", FLOAT, 0.0, "Longitude of the last origin", "deg", (-180.0, 180.0)),
    ParamInfo("ORIGIN_ALT", FLOAT, 0.0, "Altitude of the last origin above mean sea level", "m"),
)
_FLIGHTS: Final = (
    ParamInfo("_FLTCNT", INT32, 0, "How many flights so far"),
    ParamInfo("_DISTFLWN", FLOAT, 0.0, "Distance flown so far", "m"),
)

# How what is stored is carried over


def _renamed_ranges() -> Iterator[tuple[str, Rename]]:
    for number in range(1, sensors.RANGE_FINDERS + 1):
        for name in ("MIN", "MAX"):
            yield f"RNGFND{number}_{name}_CM", Rename(f"RNGFND{number}_{name}", hundredth, hundredfold)
        yield f"RNGFND{number}_GNDCLEAR", Rename(f"RNGFND{number}_GNDCLR", hundredth, hundredfold)


def _renamed_streams() -> Iterator[tuple[str, Rename]]:
    for index in range(MAX_LINKS):
        for row in STREAM_NAMES:
            yield f"SR{index}{row}", Rename(f"MAV{index + 1}{row}")


ALL_RENAMES: Final[Renames] = {
    "GPS_TYPE": Rename("GPS1_TYPE"),
    "SYSID_THISMAV": Rename("MAV_SYSID"),
    "SYSID_MYGCS": Rename("MAV_GCS_SYSID"),
    "SYSID_ENFORCE": Rename("MAV_OPTIONS"),
    "TELEM_DELAY": Rename("MAV_TELEM_DELAY"),
    **dict(_renamed_streams()),
    **dict(_renamed_ranges()),
    "ARMING_CHECK": Rename("ARMING_SKIPCHK", skip_instead_of_check, check_instead_of_skip),
    f"EK3_{FLOW_LIMIT}": Rename(f"EK3_{FLOW_LIMIT_LATER}"),
    **flying.RENAMES,
}
"""What later releases call otherwise, by the earlier name."""


JULY_2025: Final = ParameterRelease(
    (),
    _no_links,
    (),
    _mav_links,
    INT32,
    copter.ARMING,
    "CHECK",
    checks_to_make,
)

STABLE_4_6: Final = ParameterRelease(
    _SYSID,
    _sr_links,
    _SYSID_ENFORCE,
    _no_links,
    INT16,
    copter.ARMING,
    "CHECK",
    checks_to_make,
    source_options=FUSE_ALL_VELOCITIES,
    range_finder=sensors.RANGE_FINDER_IN_CM,
    range_unit=_CENTIMETRES,
    vicon=sensors.VICON_IN_4_6,
    simulated_gps_prefix="SIM_GPS_",
    simulated_gps=sensors.SIMULATED_GPS_IN_4_6,
    second_simulated_gps=sensors.SECOND_SIMULATED_GPS_IN_4_6,
    simulation=sensors.SIMULATION_IN_4_6,
    failsafe=copter.FAILSAFE_IN_4_6,
)

FEBRUARY_2026: Final = ParameterRelease(
    (),
    _no_links,
    (),
    _mav_links_with_range,
    INT32,
    _ARMING_LATER,
    "SKIPCHK",
    checks_not_skipped,
    _ORIGIN,
    _FLIGHTS,
    FLOW_LIMIT_LATER,
    sensors.FLOW_WITH_OPTIONS,
    flying=flying.IN_METRES,
    vicon=sensors.VICON_WITH_QUALITY,
)

STABLE_4_7: Final = replace(FEBRUARY_2026, flying=flying.ALL_IN_METRES)
APRIL_2026: Final = STABLE_4_7
