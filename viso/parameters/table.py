# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The vehicle's own parameters, in the order in which a Copter lists them.

Types, defaults and order: ArduCopter/Parameters.cpp, AP_Vehicle/AP_Vehicle.cpp and the ``var_info`` tables of
AP_Stats, AP_Logger, AP_SerialManager and GCS_MAVLink. ``copter``, ``sensors``, ``ekf3`` and ``flying`` hold the others,
``releases`` those that depend on the release; AP_VisualOdom brings its own.

The firmware's count of SERIALn_ differs by board. Here there are those that every flight board has: USB and two
telemetry ports.
"""

from collections.abc import Sequence
from typing import Final

from ap_core.param_group import ParamGroup
from ap_core.param_info import ParamInfo, ParamType
from viso.parameters import copter, sensors
from viso.parameters.copter import FLOAT, INT8, INT16, INT32
from viso.parameters.ekf3 import EKF2, make_ekf3_group
from viso.parameters.flying import AFTER_FORMAT_VERSION, AFTER_INS, AFTER_RC
from viso.parameters.releases import STABLE_4_7, ParameterRelease

_OFF_ON: Final = {0: "Disabled", 1: "Enabled"}
_LOG_DISARMED: Final = {0: "No", 1: "Yes", 2: "Not with USB", 3: "Yes, discarded if never armed"}
_CONSOLE_PROTOCOL: Final = {1: "MAVLink 1", 2: "MAVLink 2"}
_PROTOCOL: Final = {-1: "None", **_CONSOLE_PROTOCOL, 5: "GPS", 23: "Radio", 28: "Scripting", 43: "High latency"}
_BAUD: Final = {
    1: "1200",
    2: "2400",
    4: "4800",
    9: "9600",
    19: "19200",
    38: "38400",
    57: "57600",
    111: "111100",
    115: "115200",
    230: "230400",
    256: "256000",
    460: "460800",
    500: "500000",
    921: "921600",
    1500: "1500000",
    2000: "2000000",
    12500000: "12500000",
}
_RATE: Final = (0.0, 1000.0)

_STAT: Final = (
    ParamInfo("_BOOTCNT", INT16, 0, "How often the autopilot has started"),
    ParamInfo("_FLTTIME", INT32, 0, "Time in flight so far", "s"),
    ParamInfo("_RUNTIME", INT32, 0, "Time running so far", "s"),
    ParamInfo("_RESET", INT32, 1, "When these were reset, since 2016; 0 resets them", "s"),
)

_LOG: Final = (
    ParamInfo("_BACKEND_TYPE", INT8, 1, "Where logs go, bits: 0 file, 1 MAVLink, 2 block"),
    ParamInfo("_FILE_BUFSIZE", INT16, 200, "Buffer before the log file", "KiB", (4.0, 200.0)),
    # FIRMWARE PARITY: the firmware's default is 0. Most sessions here never arm, and their log is the point.
    ParamInfo("_DISARMED", INT8, 1, "Log while disarmed", values=_LOG_DISARMED),
    ParamInfo("_REPLAY", INT8, 0, "Log what a replay of the estimator needs", values=_OFF_ON),
    ParamInfo("_FILE_DSRMROT", INT8, 0, "Start a new log file after disarming", values=_OFF_ON),
    ParamInfo("_MAV_BUFSIZE", INT8, 8, "Buffer before logging by MAVLink", "kB"),
    ParamInfo("_FILE_TIMEOUT", INT16, 5, "How long writing may fail until logging stops", "s"),
    ParamInfo("_FILE_MB_FREE", INT16, 500, "Space to keep free by deleting old logs", "MB", (2.0, 1000.0)),
    ParamInfo("_FILE_RATEMAX", FLOAT, 0.0, "Most records of a kind in files, 0 for no limit", "Hz", _RATE),
    ParamInfo("_MAV_RATEMAX", FLOAT, 0.0, "The same by MAVLink", "Hz", _RATE),
    ParamInfo("_BLK_RATEMAX", FLOAT, 0.0, "The same in block memory", "Hz", _RATE),
    ParamInfo("_DARM_RATEMAX", FLOAT, 0.0, "The same anywhere while disarmed", "Hz", _RATE),
    ParamInfo("_MAX_FILES", INT16, 500, "How many logs to keep", "", (2.0, 500.0), reboot_required=True),
)


_NO_PROTOCOL, _MAVLINK_2, _GPS = -1, 2, 5


def _port(number: int, protocol: int, baud: int) -> tuple[ParamInfo, ParamInfo]:
    speed = f"Speed of port {number}, in thousands of baud"
    return (
        ParamInfo(
            f"{number}_PROTOCOL", INT8, protocol, f"Protocol of port {number}", values=_PROTOCOL, reboot_required=True
        ),
        ParamInfo(f"{number}_BAUD", INT32, baud, speed, values=_BAUD),
    )


def _serial_options(number: int, kind: ParamType) -> ParamInfo:
    return ParamInfo(f"{number}_OPTIONS", kind, 0, f"Wiring of port {number}, a bit each", reboot_required=True)


def _serial(options: ParamType) -> tuple[ParamInfo, ...]:
    return (
        ParamInfo("0_BAUD", INT32, 115, "Speed of the USB port, in thousands of baud", values=_BAUD),
        ParamInfo("0_PROTOCOL", INT8, 2, "Protocol of the USB port", values=_CONSOLE_PROTOCOL, reboot_required=True),
        *_port(1, _MAVLINK_2, 57),
        *_port(2, _MAVLINK_2, 57),
        *_port(3, _GPS, 230),
        *_port(4, _GPS, 230),
        *_port(5, _NO_PROTOCOL, 57),
        *_port(6, _NO_PROTOCOL, 57),
        *(_serial_options(number, options) for number in range(1, 7)),
        *_port(7, _NO_PROTOCOL, 57),
        _serial_options(7, options),
    )


_RANGE_FINDERS: Final = range(1, sensors.RANGE_FINDERS + 1)


def _top_level(rows: Sequence[ParamInfo]) -> ParamGroup:
    return ParamGroup("", rows, ungrouped=True)


def _object(prefix: str, rows: Sequence[ParamInfo], top_level_prefix: str) -> ParamGroup:
    return ParamGroup(prefix, rows, top_level_prefix=top_level_prefix)


def make_groups(
    number_of_links: int, visual_odom: ParamGroup | None = None, release: ParameterRelease = STABLE_4_7
) -> list[ParamGroup]:
    """Return fresh groups with default values for a vehicle, in list order.

    Args:
        number_of_links: how many MAVn_ groups there are, one for each open link.
        visual_odom: AP_VisualOdom's group, which is put where the firmware lists it.
        release: whose parameters.

    Raises:
        ValueError: more links than the firmware has parameters for.
    """

    def flown(rows: Sequence[ParamInfo]) -> list[ParamInfo]:
        return [info for row in rows for info in (row, *release.flying.spots.get(row.name, ()))]

    return [
        _top_level(copter.FORMAT_VERSION),
        _top_level(release.early),
        _top_level(release.flying.spots[AFTER_FORMAT_VERSION]),
        _top_level(flown(copter.MODES)),
        _object("ARMING_", release.arming, "ARMING_"),
        _top_level(flown(release.failsafe)),
        _object("COMPASS_", sensors.COMPASS, "COMPASS_"),
        _object("INS", sensors.INS, "INS"),
        _top_level(release.flying.spots[AFTER_INS]),
        *release.early_links(number_of_links),
        _object("AHRS_", (*sensors.AHRS, *release.more_ahrs), "AHRS_"),
        _object("BATT_", sensors.BATTERY, "BATT"),
        _object("BRD_RTC", sensors.RTC, "BRD_"),
        _object("SIM_", (*sensors.SIMULATED_WIND, *sensors.SIMULATED_GROUND_SENSORS), "SIM_"),
        _object("SIM_", (*release.simulation, *sensors.SIMULATED_PLACES), "SIM_"),
        _object(release.simulated_gps_prefix, release.simulated_gps, "SIM_"),
        _object("SIM_GPS2_", release.second_simulated_gps, "SIM_"),
        _object("SIM_", sensors.SIMULATED_COUNTS, "SIM_"),
        _object("SIM_BARO_", sensors.FIRST_SIMULATED_BAROMETER, "SIM_"),
        _object("SIM_BAR2_", sensors.SECOND_SIMULATED_BAROMETER, "SIM_"),
        _object("SIM_VICON_", release.vicon, "SIM_"),
        _object("SIM_", (*sensors.SIMULATED_WIND_TYPE, *sensors.SIMULATED_FLOW_NOISE), "SIM_"),
        _object("GPS_", sensors.GPS, "GPS"),
        _object("GPS1_", sensors.GPS1, "GPS"),
        _object("GPS2_", sensors.GPS2, "GPS"),
        _object("SCHED_", sensors.SCHEDULER, "SCHED_"),
        _object("RCMAP_", copter.RCMAP, "RCMAP_"),
        _object("EK2_", EKF2, "EK2_"),
        make_ekf3_group(release.flow_limit, release.source_options),
        _object("MIS_", copter.MISSION, "MIS_"),
        *(_object(f"RNGFND{number}_", release.range_finder, "RNGFND") for number in _RANGE_FINDERS),
        _object("TERRAIN_", sensors.TERRAIN, "TERRAIN_"),
        _object("FLOW", release.flow, "FLOW"),
        _object("", (*release.second_table, *copter.FRAME_CLASS), ""),
        *(_object(f"RC{number}_", copter.rc_channel(number), "") for number in range(1, copter.NUMBER_OF_CHANNELS + 1)),
        _object("", copter.RECEIVER, ""),
        _object("", release.flying.spots.get(AFTER_RC, ()), ""),
        _object("", flown(copter.LATE_FAILSAFE), ""),
        *([] if visual_odom is None else [visual_odom]),
        _object("FENCE_", copter.FENCE, "FENCE_"),
        _object("STAT", (*_STAT, *release.more_stat), ""),
        _object("LOG", _LOG, ""),
        _object("SERIAL", _serial(release.port_options), ""),
        *release.late_links(number_of_links),
    ]
