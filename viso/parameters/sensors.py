# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Parameters of sensors, AHRS, clock and battery, in list order.

What decides which sources the EKF has is read here; the rest is what ground stations ask for by name when they
connect: QGroundControl and MAVProxy for the compasses and the accelerometer's offsets, Mission Planner for the ids of
devices.

Types, defaults and order: the ``var_info`` tables of Compass, AP_InertialSensor, AP_AHRS, AP_BattMonitor, AP_RTC,
AP_GPS, AP_Scheduler, AP_RangeFinder_Params and AP_OpticalFlow.
"""

from collections.abc import Mapping
from typing import Final

from ap_core.param_info import ParamFlag, ParamInfo, ParamType
from ap_core.rotations import Rotation
from viso.parameters.copter import FLOAT, INT8, INT16, INT32

VECTOR3F: Final = ParamType.VECTOR3F

_ZERO: Final = (0.0, 0.0, 0.0)
_ONE: Final = (1.0, 1.0, 1.0)
_OFF_ON: Final = {0: "Disabled", 1: "Enabled"}
_NO_YES: Final = {0: "No", 1: "Yes"}
_GPS_USE: Final = {0: "No", 1: "Position", 2: "Position and height"}
_EKF_TYPE: Final = {0: "DCM", 2: "EKF2", 3: "EKF3", 10: "Simulation", 11: "External"}
_BATTERY: Final = {0: "Disabled", 3: "Analog voltage", 4: "Analog voltage and current"}
_GPS_TYPE: Final = {0: "None", 1: "Auto", 2: "uBlox", 5: "NMEA", 14: "MAVLink"}
_GPS_SWITCH: Final = {0: "The primary one", 1: "The best", 2: "A blend", 4: "The primary one if it has a fix"}
_FIRST_OR_SECOND: Final = {0: "The first", 1: "The second"}
_ORIENTATION: Final = {int(rotation): rotation.name for rotation in Rotation}
_RANGE_TYPE: Final = {0: "None", 1: "Analog", 10: "MAVLink", 100: "Simulation"}
_RANGE_FUNCTION: Final = {0: "Linear", 1: "Inverted", 2: "Hyperbolic"}
_SIDES: Final = ("Forward", "Forward-Right", "Right", "Back-Right", "Back", "Back-Left", "Left", "Forward-Left")
_DIRECTIONS: Final = {**dict(enumerate(_SIDES)), int(Rotation.PITCH_90): "Up", int(Rotation.PITCH_270): "Down"}
_FLOW_TYPE: Final = {0: "None", 5: "MAVLink", 10: "Simulation"}


def _compass_offset(name: str, which: str) -> ParamInfo:
    return ParamInfo(name, VECTOR3F, _ZERO, f"Hard iron of the {which} compass", "mGauss", (-400.0, 400.0))


def _compass_id(name: str, which: str) -> ParamInfo:
    return ParamInfo(name, INT32, 0, f"Device id of the {which} compass, 0 for none")


def _compass_use(name: str, which: str) -> ParamInfo:
    return ParamInfo(name, INT8, 1, f"Use the {which} compass for yaw", values=_OFF_ON)


def _enabling(
    name: str, default: int, text: str, values: Mapping[int, str], *, reboot_required: bool = True
) -> ParamInfo:
    return ParamInfo(name, INT8, default, text, "", None, values, ParamFlag.ENABLE, reboot_required=reboot_required)


COMPASS: Final = (
    _compass_offset("OFS", "first"),
    _compass_use("USE", "first"),
    _compass_offset("OFS2", "second"),
    _compass_offset("OFS3", "third"),
    _compass_id("DEV_ID", "first"),
    _compass_id("DEV_ID2", "second"),
    _compass_id("DEV_ID3", "third"),
    _compass_use("USE2", "second"),
    _compass_use("USE3", "third"),
    ParamInfo("ENABLE", INT8, 1, "Look for compasses", values=_OFF_ON, reboot_required=True),
)


def _imu_position(number: int) -> ParamInfo:
    return ParamInfo(f"_POS{number}", VECTOR3F, _ZERO, f"Place of IMU {number} on the vehicle", "m", (-5.0, 5.0))


def _accelerometer(name: str, which: str) -> tuple[ParamInfo, ParamInfo]:
    return (
        ParamInfo(f"_{name}SCAL", VECTOR3F, _ONE, f"Scale of the {which} accelerometer", "", (0.8, 1.2)),
        ParamInfo(f"_{name}OFFS", VECTOR3F, _ZERO, f"Offset of the {which} accelerometer", "m/s/s", (-3.5, 3.5)),
    )


INS: Final = (
    *_accelerometer("ACC", "first"),
    *_accelerometer("ACC2", "second"),
    *_accelerometer("ACC3", "third"),
    *(_imu_position(number) for number in (1, 2, 3)),
    ParamInfo("_GYR_ID", INT32, 0, "Device id of the first gyro, 0 for none"),
    ParamInfo("_ACC_ID", INT32, 0, "Device id of the first accelerometer, 0 for none"),
)

AHRS: Final = (
    ParamInfo("GPS_GAIN", FLOAT, 1.0, "How much GPS corrects DCM's attitude", "", (0.0, 1.0)),
    ParamInfo("GPS_USE", INT8, 1, "What DCM takes from GPS", values=_GPS_USE),
    ParamInfo("YAW_P", FLOAT, 0.2, "How fast DCM follows its source of yaw", "", (0.1, 0.4)),
    ParamInfo("RP_P", FLOAT, 0.2, "How fast DCM follows the accelerometers", "", (0.1, 0.4)),
    ParamInfo("WIND_MAX", INT8, 0, "Difference of airspeed and ground speed that is believed", "m/s", (0.0, 127.0)),
    ParamInfo("TRIM", VECTOR3F, _ZERO, "Tilt of the autopilot in the frame", "rad", (-0.1745, 0.1745)),
    ParamInfo(
        "ORIENTATION", INT8, 0, "Rotation of the autopilot in the frame", values=_ORIENTATION, reboot_required=True
    ),
    ParamInfo("COMP_BETA", FLOAT, 0.1, "Crossover of airspeed and GPS in DCM's velocity", "", (0.001, 0.5)),
    ParamInfo("GPS_MINSATS", INT8, 6, "Satellites that DCM asks for", "", (0.0, 10.0)),
    ParamInfo("EKF_TYPE", INT8, 3, "Which estimator the vehicle uses", values=_EKF_TYPE),
    ParamInfo(
        "OPTIONS",
        INT16,
        0,
        "Bits: 0 and 1 when planes may fall back to DCM; since February 2026: 3 keep the origin, 4 use it without GPS",
    ),
)

BATTERY: Final = (_enabling("MONITOR", 0, "Kind of battery monitor", _BATTERY),)

RTC: Final = (
    ParamInfo("_TYPES", INT8, 1, "Who may set the clock, bits: 0 GPS, 1 SYSTEM_TIME, 2 hardware"),
    ParamInfo("_TZ_MIN", INT16, 0, "Local time less UTC", "min", (-720.0, 840.0)),
)

GPS: Final = (
    ParamInfo("AUTO_SWITCH", INT8, 1, "Which of several GPS is used", values=_GPS_SWITCH),
    ParamInfo("PRIMARY", INT8, 0, "The GPS that is used unless another is better", values=_FIRST_OR_SECOND),
)
GPS1: Final = (_enabling("TYPE", 1, "Kind of GPS", _GPS_TYPE),)
GPS2: Final = (_enabling("TYPE", 0, "Kind of the second GPS", _GPS_TYPE),)

SCHEDULER: Final = (
    ParamInfo("LOOP_RATE", INT16, 400, "Passes of the main loop", "Hz", (50.0, 400.0), reboot_required=True),
)

RANGE_FINDERS: Final = 2
"""How many range finders have parameters; the firmware has ten, of which its estimator uses the first two."""


def _range_finder(least: ParamInfo, most: ParamInfo, clearance: ParamInfo) -> tuple[ParamInfo, ...]:
    return (
        _enabling("TYPE", 0, "Kind of range finder", _RANGE_TYPE),
        ParamInfo("PIN", INT8, -1, "Pin of an analog range finder, -1 for none; the simulated one is on 0"),
        ParamInfo("SCALING", FLOAT, 3.0, "Range of a voltage", "m/V"),
        ParamInfo("OFFSET", FLOAT, 0.0, "Voltage of no range", "V"),
        ParamInfo("FUNCTION", INT8, 0, "How a voltage means a range", values=_RANGE_FUNCTION),
        least,
        most,
        ParamInfo("RMETRIC", INT8, 1, "Whether the voltage depends on the supply", values={0: "No", 1: "Yes"}),
        clearance,
        ParamInfo("POS", VECTOR3F, _ZERO, "Place of the range finder on the vehicle", "m", (-5.0, 5.0)),
        ParamInfo("ORIENT", INT8, int(Rotation.PITCH_270), "Where it looks", values=_DIRECTIONS),
    )


RANGE_FINDER: Final = _range_finder(
    ParamInfo("MIN", FLOAT, 0.2, "Shortest range that counts", "m"),
    ParamInfo("MAX", FLOAT, 7.0, "Longest range that counts", "m"),
    ParamInfo("GNDCLR", FLOAT, 0.1, "Range on the ground", "m", (0.05, 1.5)),
)
RANGE_FINDER_IN_CM: Final = _range_finder(
    ParamInfo("MIN_CM", INT16, 20, "Shortest range that counts", "cm"),
    ParamInfo("MAX_CM", INT16, 700, "Longest range that counts", "cm"),
    ParamInfo("GNDCLEAR", INT8, 10, "Range on the ground", "cm", (5.0, 127.0)),
)


TERRAIN: Final = (
    _enabling("ENABLE", 1, "Ask for terrain data, which none here takes", _OFF_ON, reboot_required=False),
)


def _flow_scale(axis: str) -> ParamInfo:
    text = f"Correction of flow about the {axis} axis, per mille"
    return ParamInfo(f"_F{axis}SCALER", INT16, 0, text, "", (-800.0, 800.0))


FLOW: Final = (
    _enabling("_TYPE", 0, "Kind of flow sensor", _FLOW_TYPE),
    _flow_scale("X"),
    _flow_scale("Y"),
    ParamInfo("_ORIENT_YAW", INT16, 0, "How far the sensor is turned to the right", "cdeg", (-17999.0, 18000.0)),
    ParamInfo("_POS", VECTOR3F, _ZERO, "Place of the sensor on the vehicle", "m", (-5.0, 5.0)),
)
FLOW_WITH_OPTIONS: Final = (
    *FLOW,
    ParamInfo("_OPTIONS", INT16, 0, "Bits: 0 roll and pitch of the sensor are stabilised, as on a gimbal"),
)
"""Since 2025-07-22."""


def _simulation(speedup: float) -> tuple[ParamInfo, ...]:
    return (ParamInfo("SPEEDUP", FLOAT, speedup, "Vehicle seconds in one second, for `viso sitl`"),)


# The simulator's own clock (SITL/SITL.cpp); what is not positive leaves it as the command line says.
SIMULATION: Final = _simulation(1.0)
SIMULATION_IN_4_6: Final = _simulation(-1.0)


def _simulated_gps(
    enabling: ParamInfo, glitch: str = "GLTCH", lock_time: str = "LCKTIME", drift: str = "DRFTALT"
) -> tuple[ParamInfo, ...]:
    return (
        enabling,
        ParamInfo("LAG_MS", INT16, 100, "How old solutions are when they come", "ms"),
        ParamInfo("NUMSATS", INT8, 10, "How many satellites it has"),
        ParamInfo(glitch, VECTOR3F, _ZERO, "Added to latitude and longitude in degrees, and to the height in m"),
        ParamInfo("HZ", INT8, 5, "How often a solution comes", "Hz"),
        ParamInfo(drift, FLOAT, 0.0, "Amplitude of a drift of the height, of a period of 5 minutes", "m"),
        ParamInfo("NOISE", FLOAT, 0.0, "Amplitude of an error of the height, of a period of 13 s", "m"),
        ParamInfo(lock_time, INT16, 0, "It has no fix until so long after boot", "s"),
        ParamInfo("ALT_OFS", INT16, 0, "Added to the height", "m"),
        ParamInfo("ACC", FLOAT, 0.3, "Accuracy of its positions, as it reports", "m"),
        ParamInfo("VERR", VECTOR3F, _ZERO, "Largest random error of the velocity, north, east, down", "m/s"),
    )


# The simulator's own GPS (SITL/SIM_GPS.cpp), which ``viso serve --imu fly`` has with GPS1_TYPE 1.
SIMULATED_GPS_IN_4_6: Final = _simulated_gps(
    ParamInfo("DISABLE", INT8, 0, "It has no fix", values=_NO_YES), "GLITCH", "LOCKTIME", "DRIFTALT"
)
SECOND_SIMULATED_GPS_IN_4_6: Final = _simulated_gps(ParamInfo("DISABLE", INT8, 1, "It is silent", values=_NO_YES))
SIMULATED_GPS: Final = _simulated_gps(_enabling("ENABLE", 1, "It has a fix", _NO_YES, reboot_required=False))
"""Since 2025."""
SECOND_SIMULATED_GPS: Final = _simulated_gps(_enabling("ENABLE", 0, "It is there", _NO_YES, reboot_required=False))

# Other sensors of the simulator (SITL/SITL.cpp, SITL_Baro.cpp).
SIMULATED_WIND: Final = (
    ParamInfo("WIND_SPD", FLOAT, 0.0, "Speed of the wind", "m/s"),
    ParamInfo("WIND_DIR", FLOAT, 180.0, "Where it comes from", "deg"),
)
SIMULATED_WIND_TYPE: Final = (ParamInfo("WIND_T", INT8, 0, "How it grows with the height"),)
SIMULATED_COUNTS: Final = (
    ParamInfo("IMU_COUNT", INT8, 2, "How many IMUs there are", "", (1.0, 3.0), reboot_required=True),
    ParamInfo("BARO_COUNT", INT8, 2, "How many barometers there are", "", (0.0, 2.0), reboot_required=True),
)


def _simulated_barometer(noise_m: float) -> tuple[ParamInfo, ...]:
    return (
        ParamInfo("RND", FLOAT, noise_m, "Largest random error of the height", "m"),
        ParamInfo("DRIFT", FLOAT, 0.0, "How fast the height drifts", "m/s"),
        ParamInfo("DISABLE", INT8, 0, "It has no data", values=_NO_YES),
        ParamInfo("GLITCH", FLOAT, 0.0, "Added to the height", "m"),
        ParamInfo("FREEZE", INT8, 0, "It repeats the last height", values=_NO_YES),
        ParamInfo("DELAY", INT16, 0, "How old heights are", "ms", (0.0, 500.0)),
    )


# FIRMWARE PARITY: the firmware's default of its noise is 0.2 m; the simulator's file of defaults makes it 0.
FIRST_SIMULATED_BAROMETER: Final = _simulated_barometer(0.0)
SECOND_SIMULATED_BAROMETER: Final = _simulated_barometer(0.2)


# The simulator's own flow sensor and range finder, with FLOW_TYPE 10 and RNGFNDn_TYPE 1 and 100 (SITL/SITL.cpp).
SIMULATED_GROUND_SENSORS: Final = (
    ParamInfo("SONAR_ROT", INT8, int(Rotation.PITCH_270), "Where the range finder looks", values=_ORIENTATION),
    ParamInfo("SONAR_GLITCH", FLOAT, 0.0, "How likely its voltage is that of the longest range", "", (0.0, 1.0)),
    ParamInfo("SONAR_RND", FLOAT, 0.0, "Largest random error of its range", "m"),
    ParamInfo("SONAR_SCALE", FLOAT, 12.1212, "Range of its voltage", "m/V"),
    ParamInfo("FLOW_ENABLE", INT8, 0, "The flow sensor measures", values={0: "No", 1: "Yes"}),
    ParamInfo("TERRAIN", INT8, 1, "The ground is that of terrain data, of which there are none", values=_OFF_ON),
    ParamInfo("FLOW_RATE", INT16, 10, "How often it does", "Hz"),
    ParamInfo("FLOW_DELAY", INT8, 0, "How many measurements late flow is", "", (0.0, 20.0)),
)
SIMULATED_PLACES: Final = (
    ParamInfo("SONAR_POS", VECTOR3F, _ZERO, "Where the range finder is on the vehicle", "m"),
    ParamInfo("FLOW_POS", VECTOR3F, _ZERO, "Where the flow sensor is on the vehicle", "m"),
)
SIMULATED_FLOW_NOISE: Final = (ParamInfo("FLOW_RND", FLOAT, 0.05, "Largest random error of flow", "rad/s"),)
"""In a later table of the firmware."""

# The simulator's own camera (SITL/SIM_Vicon.cpp): ``viso serve --imu fly --vision vicon``.
VICON_IN_4_6: Final = (
    ParamInfo("POS", VECTOR3F, _ZERO, "Where the markers are on the vehicle, forward, right, down", "m"),
    ParamInfo("GLIT", VECTOR3F, _ZERO, "Added to the position, north, east, down", "m"),
    ParamInfo("FAIL", INT8, 0, "The camera sends nothing", values={0: "No", 1: "Yes"}),
    ParamInfo("YAW", INT16, 0, "Where the camera's x axis points, from north to the right", "deg"),
    ParamInfo("YAWERR", INT16, 0, "Added to the yaw", "deg"),
    ParamInfo(
        "TMASK",
        INT8,
        3,
        "What it sends, bits: 0 VISION_POSITION_ESTIMATE, 1 VISION_SPEED_ESTIMATE, 2 VICON_POSITION_ESTIMATE, "
        "3 VISION_POSITION_DELTA, 4 ODOMETRY",
    ),
    ParamInfo("VGLI", VECTOR3F, _ZERO, "Added to the velocity, north, east, down", "m/s"),
)
VICON: Final = (
    *VICON_IN_4_6,
    ParamInfo("P_SD", FLOAT, 0.0, "Noise of the position, standard deviation", "m"),
    ParamInfo("V_SD", FLOAT, 0.0, "Noise of the velocity, standard deviation", "m/s"),
    ParamInfo("RATE", INT16, 50, "How often it looks, 0 never", "Hz"),
)
VICON_WITH_QUALITY: Final = (
    *VICON,
    ParamInfo("QUAL", INT8, 50, "Quality that ODOMETRY tells: -1 failed, 0 unknown, 1 to 100", "%"),
)
"""Since 2026-01-24."""
