# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The EK3_ parameters that matter to external navigation, in list order.

Types and Copter's defaults: AP_NavEKF3/AP_NavEKF3.cpp, AP_NavEKF3/AP_NavEKF3.h and AP_NavEKF/AP_NavEKF_Source.cpp.
"""

from typing import Final

from ap_core.param_group import ParamGroup
from ap_core.param_info import ParamFlag, ParamInfo, ParamType
from viso.parameters.copter import FLOAT, INT8, INT16, INT32

NUMBER_OF_SOURCE_SETS: Final = 3

_OFF_ON: Final = {0: "Disabled", 1: "Enabled"}
_GATE: Final = (100.0, 1000.0)
_DELAY: Final = (0.0, 250.0)
_MAG_CAL: Final = {
    0: "In flight",
    1: "While manoeuvring",
    2: "Never",
    3: "After the first climb",
    4: "Always",
    5: "External yaw (old)",
    6: "External yaw with compass fallback (old)",
}

_FLOW_USE: Final = {0: "Nothing", 1: "Navigation", 2: "Height of the ground"}
_POSXY: Final = {0: "None", 3: "GPS", 4: "Beacon", 6: "ExternalNav"}
_VELXY: Final = {0: "None", 3: "GPS", 4: "Beacon", 5: "OpticalFlow", 6: "ExternalNav", 7: "WheelEncoder"}
_POSZ: Final = {0: "None", 1: "Baro", 2: "RangeFinder", 3: "GPS", 4: "Beacon", 6: "ExternalNav"}
_VELZ: Final = {0: "None", 3: "GPS", 4: "Beacon", 6: "ExternalNav"}
_YAW: Final = {0: "None", 1: "Compass", 2: "GPS", 3: "GPS, else compass", 6: "ExternalNav", 8: "GSF"}


def _boot(
    name: str, kind: ParamType, default: int, text: str, unit: str = "", limits: tuple[float, float] | None = None
) -> ParamInfo:
    """Return a row whose value is only read when the filter starts."""
    return ParamInfo(name, kind, default, text, unit, limits, reboot_required=True)


EKF2: Final = (ParamInfo("ENABLE", INT8, 0, "Run EKF2", "", None, _OFF_ON, ParamFlag.ENABLE, reboot_required=True),)
"""The EK2_ group; nothing but its switch is there."""

_BEFORE_FLOW: Final = (
    ParamInfo("ENABLE", INT8, 1, "Run EKF3", "", None, _OFF_ON, ParamFlag.ENABLE, reboot_required=True),
    ParamInfo("VELNE_M_NSE", FLOAT, 0.3, "Noise of horizontal velocity", "m/s", (0.05, 5.0)),
    ParamInfo("VELD_M_NSE", FLOAT, 0.5, "Noise of vertical velocity", "m/s", (0.05, 5.0)),
    ParamInfo("VEL_I_GATE", INT16, 500, "Velocity gate, in percent of a sigma", "%", _GATE),
    ParamInfo("POSNE_M_NSE", FLOAT, 0.5, "Noise of horizontal position", "m", (0.1, 10.0)),
    ParamInfo("POS_I_GATE", INT16, 500, "Horizontal position gate, in percent of a sigma", "%", _GATE),
    ParamInfo("GLITCH_RAD", INT8, 25, "Position uncertainty that causes a reset", "m", (10.0, 100.0)),
    ParamInfo("ALT_M_NSE", FLOAT, 2.0, "Noise of barometric height", "m", (0.1, 100.0)),
    ParamInfo("HGT_I_GATE", INT16, 500, "Height gate, in percent of a sigma", "%", _GATE),
    _boot("HGT_DELAY", INT16, 60, "How late the barometer is", "ms", _DELAY),
    ParamInfo("MAG_M_NSE", FLOAT, 0.05, "Noise of the compass", "Gauss", (0.01, 0.5)),
    ParamInfo("MAG_CAL", INT8, 3, "When all three compass axes are fused", "", None, _MAG_CAL, reboot_required=True),
    ParamInfo("MAG_I_GATE", INT16, 300, "Compass gate, in percent of a sigma", "%", _GATE),
    ParamInfo("RNG_M_NSE", FLOAT, 0.5, "Noise of a range finder", "m", (0.1, 10.0)),
    ParamInfo("RNG_I_GATE", INT16, 500, "Range finder gate, in percent of a sigma", "%", _GATE),
)

_AFTER_FLOW: Final = (
    ParamInfo("FLOW_M_NSE", FLOAT, 0.25, "Noise of optical flow", "rad/s", (0.05, 1.0)),
    ParamInfo("FLOW_I_GATE", INT16, 300, "Optical flow gate, in percent of a sigma", "%", _GATE),
    _boot("FLOW_DELAY", INT8, 10, "How late optical flow is", "ms", _DELAY),
    ParamInfo("GYRO_P_NSE", FLOAT, 0.015, "Gyro process noise", "rad/s", (0.0001, 0.1)),
    ParamInfo("ACC_P_NSE", FLOAT, 0.35, "Accelerometer process noise", "m/s/s", (0.01, 1.0)),
    ParamInfo("GBIAS_P_NSE", FLOAT, 0.001, "Gyro bias process noise", "rad/s/s", (0.00001, 0.001)),
    ParamInfo("ABIAS_P_NSE", FLOAT, 0.02, "Accelerometer bias process noise", "m/s/s/s", (0.00001, 0.02)),
    ParamInfo("GPS_CHECK", INT8, 31, "What GPS is checked for before it is used, a bit each"),
    _boot("IMU_MASK", INT8, 3, "Which IMUs get a core, a bit each"),
    ParamInfo("CHECK_SCALE", INT16, 100, "Scale of the limits of these checks", "%", (50.0, 200.0)),
    ParamInfo("NOAID_M_NSE", FLOAT, 10.0, "Noise of the assumed position without aiding", "m", (0.5, 50.0)),
    ParamInfo("YAW_M_NSE", FLOAT, 0.5, "Noise of yaw", "rad", (0.05, 1.0)),
    ParamInfo("YAW_I_GATE", INT16, 300, "Yaw gate, in percent of a sigma", "%", _GATE),
    ParamInfo("TAU_OUTPUT", INT8, 25, "Time constant of the output predictor", "cs", (10.0, 50.0)),
    ParamInfo("MAGE_P_NSE", FLOAT, 0.001, "Process noise of the earth's magnetic field", "Gauss/s", (0.00001, 0.01)),
    ParamInfo("MAGB_P_NSE", FLOAT, 0.0001, "Process noise of the vehicle's magnetic field", "Gauss/s", (0.00001, 0.01)),
    ParamInfo("RNG_USE_HGT", INT8, -1, "Height below which a range finder tells it, of its reach", "%", (-1.0, 70.0)),
    ParamInfo("TERR_GRAD", FLOAT, 0.1, "Slope of the ground", "", (0.0, 0.2)),
    _boot("BCN_DELAY", INT8, 50, "How late range beacons are", "ms", _DELAY),
    ParamInfo("RNG_USE_SPD", FLOAT, 2.0, "Speed up to which a range finder tells the height", "m/s", (2.0, 6.0)),
    ParamInfo("ACC_BIAS_LIM", FLOAT, 1.0, "Limit of the accelerometer bias", "m/s/s", (0.5, 2.5)),
    _boot("OGN_HGT_MASK", INT8, 0, "How GPS corrects the origin's height, a bit each"),
    ParamInfo("VIS_VERR_MIN", FLOAT, 0.1, "Odometry velocity error at best quality", "m/s", (0.05, 0.5)),
    ParamInfo("VIS_VERR_MAX", FLOAT, 0.9, "Odometry velocity error at worst quality", "m/s", (0.5, 5.0)),
    ParamInfo("FLOW_USE", INT8, 1, "What optical flow is for", "", None, _FLOW_USE),
    ParamInfo("HRT_FILT", FLOAT, 2.0, "Crossover frequency of the height rate", "Hz", (0.1, 30.0)),
    ParamInfo("MAG_EF_LIM", INT16, 50, "Greatest error of the earth's field", "mGauss", (0.0, 500.0)),
    _boot("GSF_RUN_MASK", INT8, 3, "Which cores estimate yaw by GPS (GSF), a bit each"),
    ParamInfo("GSF_USE_MASK", INT8, 3, "Which of them use it, a bit each"),
    ParamInfo("GSF_RST_MAX", INT8, 2, "How often yaw may be reset by it in a flight", "", (1.0, 10.0)),
    ParamInfo("ERR_THRESH", FLOAT, 0.2, "By how much a core must be better than the one in use", "", (0.05, 1.0)),
    _boot(
        "AFFINITY", INT32, 0, "Of which sensors each core has its own: bits 0 GPS, 1 barometer, 2 compass, 3 airspeed"
    ),
)

_AFTER_SOURCES: Final = (
    ParamInfo("OGNM_TEST_SF", FLOAT, 2.0, "Scale of the test for standing still", "", (1.0, 10.0)),
    ParamInfo("PRIMARY", INT8, 0, "Core in use while disarmed", "", (0.0, 2.0)),
    ParamInfo("LOG_LEVEL", INT8, 0, "How little is logged, 0 is everything", "", (0.0, 3.0)),
    ParamInfo(
        "GPS_VACC_MAX", FLOAT, 0.0, "Vertical accuracy beyond which GPS is no source of height, 0 any", "m", (0.0, 10.0)
    ),
    ParamInfo("OPTIONS", INT32, 0, "Bits: 0 jamming expected, 1 lanes switched by hand"),
)


def _source_set(number: int) -> tuple[ParamInfo, ...]:
    """Return the rows of one source set, 1 to 3; only the first has sources besides the barometer."""
    first = number == 1
    name = f"SRC{number}_"
    return (
        ParamInfo(name + "POSXY", INT8, 3 if first else 0, "Horizontal position source", values=_POSXY),
        ParamInfo(name + "VELXY", INT8, 3 if first else 0, "Horizontal velocity source", values=_VELXY),
        ParamInfo(name + "POSZ", INT8, 1, "Height source", values=_POSZ),
        ParamInfo(name + "VELZ", INT8, 3 if first else 0, "Vertical velocity source", values=_VELZ),
        ParamInfo(name + "YAW", INT8, 1 if first else 0, "Yaw source", values=_YAW),
    )


FLOW_LIMIT: Final = "MAX_FLOW"
"""The limit of optical flow rates, up to 2025-07-24."""

FLOW_LIMIT_LATER: Final = "FLOW_MAX"
"""The same since."""


def make_ekf3_group(flow_limit: str = FLOW_LIMIT, source_options: int = 0) -> ParamGroup:
    """Return the EK3_ group with Copter's defaults.

    ``flow_limit`` is what the release calls that row, ``source_options`` its default of EK3_SRC_OPTIONS.
    """
    options = "Bits: 0 fuse all velocities, 1 align to optical flow, 3 a set per core"
    rows = (
        *_BEFORE_FLOW,
        ParamInfo(flow_limit, FLOAT, 2.5, "Greatest optical flow rate that is used", "rad/s", (1.0, 4.0)),
        *_AFTER_FLOW,
        *(row for number in range(1, NUMBER_OF_SOURCE_SETS + 1) for row in _source_set(number)),
        ParamInfo("SRC_OPTIONS", INT16, source_options, options),
        *_AFTER_SOURCES,
    )
    return ParamGroup("EK3_", rows, top_level_prefix="EK3_")
