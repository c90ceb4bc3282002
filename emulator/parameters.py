# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The vehicle's own parameters, in the order in which a Copter lists them.

Types, defaults and order: ArduCopter/Parameters.cpp and the ``var_info`` tables of AP_Arming, AP_AHRS, AP_RTC,
AP_Compass, AP_GPS, AP_OpticalFlow, AP_Logger, AP_SerialManager and GCS_MAVLink. EKF3's rows are in
``ekf3_parameters``; AP_VisualOdom brings its own.
"""

from collections.abc import Sequence
from typing import Final

from ap_core.param_group import ParamGroup
from ap_core.param_info import ParamFlag, ParamInfo, ParamType
from emulator.ekf3_parameters import make_ekf3_group

INT8: Final = ParamType.INT8
INT16: Final = ParamType.INT16
INT32: Final = ParamType.INT32
FLOAT: Final = ParamType.FLOAT
VECTOR3F: Final = ParamType.VECTOR3F

MAX_LINKS: Final = 8
"""How many MAVLink links the firmware can have (GCS_MAVLink.h, MAVLINK_COMM_NUM_BUFFERS)."""

_OFF_ON: Final = {0: "Disabled", 1: "Enabled"}
_FRAME_CLASS: Final = {0: "Undefined", 1: "Quad", 2: "Hexa", 3: "Octa", 4: "OctaQuad"}
_FRAME_TYPE: Final = {0: "Plus", 1: "X", 2: "V", 3: "H"}
_EKF_ACTION: Final = {0: "Report", 1: "Land if position needed", 2: "AltHold if position needed", 3: "Land always"}
_EKF_TYPE: Final = {0: "DCM", 2: "EKF2", 3: "EKF3", 10: "Simulation", 11: "External"}
_LOG_DISARMED: Final = {0: "No", 1: "Yes", 2: "Not with USB", 3: "Yes, discarded if never armed"}
_GPS_TYPE: Final = {0: "None", 1: "Auto", 2: "uBlox", 5: "NMEA", 14: "MAVLink"}
_FLOW_TYPE: Final = {0: "None", 5: "MAVLink", 10: "Simulation"}
_PROTOCOL: Final = {1: "MAVLink 1", 2: "MAVLink 2"}

_FORMAT_VERSION: Final = (ParamInfo("FORMAT_VERSION", INT16, 120, "Version of the stored parameters' layout"),)

_LOG_AND_FRAME: Final = (
    ParamInfo("LOG_BITMASK", INT32, 180222, "Which kinds of records are logged, a bit each"),
    ParamInfo("FRAME_TYPE", INT8, 1, "Arrangement of the arms", values=_FRAME_TYPE, reboot_required=True),
)

_ARMING: Final = (
    ParamInfo("CHECK", INT32, 1, "Which checks precede arming, a bit each; bit 0 means all"),
    ParamInfo("OPTIONS", INT32, 0, "Bits: 0 do not show pre-arm failures, 1 do not announce arming"),
)

_FAILSAFE: Final = (
    ParamInfo("DISARM_DELAY", INT8, 10, "Time on the ground until disarming, 0 is never", "s", (0.0, 127.0)),
    ParamInfo("FS_EKF_ACTION", INT8, 1, "What to do when the EKF fails", values=_EKF_ACTION),
    ParamInfo("FS_EKF_THRESH", FLOAT, 0.8, "Normalised variance that counts as an EKF failure"),
)

_COMPASS: Final = (
    ParamInfo("USE", INT8, 1, "Use the first compass for yaw", values=_OFF_ON),
    ParamInfo("ENABLE", INT8, 1, "Look for compasses", values=_OFF_ON, reboot_required=True),
)

_AHRS: Final = (
    ParamInfo("TRIM", VECTOR3F, (0.0, 0.0, 0.0), "Tilt of the autopilot in the frame", "rad", (-0.1745, 0.1745)),
    ParamInfo("ORIENTATION", INT8, 0, "Rotation of the autopilot in the frame", reboot_required=True),
    ParamInfo("EKF_TYPE", INT8, 3, "Which estimator the vehicle uses", values=_EKF_TYPE),
)

_RTC: Final = (ParamInfo("_TYPES", INT8, 1, "Who may set the clock, bits: 0 GPS, 1 SYSTEM_TIME, 2 hardware"),)

_GPS1: Final = (ParamInfo("TYPE", INT8, 1, "Kind of GPS", "", None, _GPS_TYPE, ParamFlag.ENABLE, reboot_required=True),)

_FLOW: Final = (
    ParamInfo("_TYPE", INT8, 0, "Kind of flow sensor", "", None, _FLOW_TYPE, ParamFlag.ENABLE, reboot_required=True),
)

# FIRMWARE PARITY: the firmware's default is 0, no frame, and its simulator's file of defaults makes it 1. There is
# no set-up step here that would ask.
_FRAME_CLASS_ROW: Final = (
    ParamInfo("FRAME_CLASS", INT8, 1, "Kind of multicopter", values=_FRAME_CLASS, reboot_required=True),
)

_LOG: Final = (
    ParamInfo("_BACKEND_TYPE", INT8, 1, "Where logs go, bits: 0 file, 1 MAVLink, 2 block"),
    ParamInfo("_FILE_BUFSIZE", INT16, 200, "Buffer before the log file", "KiB", (4.0, 200.0)),
    # FIRMWARE PARITY: the firmware's default is 0. Most sessions here never arm, and their log is the point.
    ParamInfo("_DISARMED", INT8, 1, "Log while disarmed", values=_LOG_DISARMED),
    ParamInfo("_REPLAY", INT8, 0, "Log what a replay of the estimator needs", values=_OFF_ON),
    ParamInfo("_FILE_DSRMROT", INT8, 0, "Start a new log file after disarming", values=_OFF_ON),
    ParamInfo("_FILE_MB_FREE", INT16, 500, "Space to keep free by deleting old logs", "MB", (2.0, 1000.0)),
    ParamInfo("_MAX_FILES", INT16, 500, "How many logs to keep", "", (2.0, 500.0), reboot_required=True),
)

_SERIAL: Final = (
    ParamInfo("0_BAUD", INT32, 115, "Speed of the first port, in thousands of baud"),
    ParamInfo("0_PROTOCOL", INT8, 2, "Protocol of the first port", values=_PROTOCOL, reboot_required=True),
)

_MAV: Final = (
    ParamInfo("_SYSID", INT16, 1, "System id of this vehicle", "", (1.0, 255.0)),
    ParamInfo("_GCS_SYSID", INT16, 255, "System id of the ground station in charge", "", (1.0, 255.0)),
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

_MAV_LINK: Final = (
    *(
        ParamInfo(name, INT16, 0, "Rate of this stream group", "Hz", (0.0, 50.0), reboot_required=True)
        for name in STREAM_NAMES
    ),
    ParamInfo("_OPTIONS", INT16, 0, "Bits: 1 forward nothing, 2 ignore stream requests", reboot_required=True),
    ParamInfo("_OPTIONSCNV", INT8, 0, "Whether options of older firmware were taken over", flags=ParamFlag.HIDDEN),
)


def _top_level(rows: Sequence[ParamInfo]) -> ParamGroup:
    return ParamGroup("", rows, ungrouped=True)


def _object(prefix: str, rows: Sequence[ParamInfo], top_level_prefix: str) -> ParamGroup:
    return ParamGroup(prefix, rows, top_level_prefix=top_level_prefix)


def make_link_group(number: int) -> ParamGroup:
    """Return the parameters of one MAVLink link, numbered from 1.

    Raises:
        ValueError: the firmware has no parameters for a link of that number.
    """
    if not 1 <= number <= MAX_LINKS:
        raise ValueError(f"link {number}: there are parameters for links 1 to {MAX_LINKS}")
    return _object(f"MAV{number}", _MAV_LINK, "MAV")


def make_groups(number_of_links: int, visual_odom: ParamGroup | None = None) -> list[ParamGroup]:
    """Return fresh groups with default values for a vehicle, in list order.

    Args:
        number_of_links: how many MAVn_ groups there are, one for each open link.
        visual_odom: AP_VisualOdom's group, which is put where the firmware lists it.

    Raises:
        ValueError: more links than the firmware has parameters for.
    """
    return [
        _top_level(_FORMAT_VERSION),
        _top_level(_LOG_AND_FRAME),
        _object("ARMING_", _ARMING, "ARMING_"),
        _top_level(_FAILSAFE),
        _object("COMPASS_", _COMPASS, "COMPASS_"),
        _object("AHRS_", _AHRS, "AHRS_"),
        _object("BRD_RTC", _RTC, "BRD_"),
        _object("GPS1_", _GPS1, "GPS"),
        make_ekf3_group(),
        _object("FLOW", _FLOW, "FLOW"),
        _object("", _FRAME_CLASS_ROW, ""),
        *([] if visual_odom is None else [visual_odom]),
        _object("LOG", _LOG, ""),
        _object("SERIAL", _SERIAL, ""),
        _object("MAV", _MAV, "MAV"),
        *(make_link_group(number) for number in range(1, number_of_links + 1)),
    ]
