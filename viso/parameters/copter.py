# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Parameters of the vehicle itself: modes, failsafes, arming, radio channels.

There is no flight controller here that would obey most of them. They are there because ground stations ask for them
by name when they connect: QGroundControl for the radio's channels and the flight modes, MAVProxy for the mode channel.

Types, defaults and order: ArduCopter/Parameters.cpp, ArduCopter/Parameters.h and the ``var_info`` tables of AP_Arming,
RC_Channel and RCMapper.
"""

from collections.abc import Mapping
from typing import Final

from ap_core.param_info import ParamFlag, ParamInfo, ParamType

INT8: Final = ParamType.INT8
INT16: Final = ParamType.INT16
INT32: Final = ParamType.INT32
FLOAT: Final = ParamType.FLOAT

_OFF_ON: Final = {0: "Disabled", 1: "Enabled"}
_FRAME_CLASS: Final = {
    0: "Undefined",
    1: "Quad",
    2: "Hexa",
    3: "Octa",
    4: "OctaQuad",
    5: "Y6",
    6: "Heli",
    7: "Tri",
    8: "SingleCopter",
    9: "CoaxCopter",
    10: "BiCopter",
    11: "Heli_Dual",
    12: "DodecaHexa",
    13: "HeliQuad",
    14: "Deca",
    15: "Scripting Matrix",
    16: "6DoF Scripting",
    17: "Dynamic Scripting Matrix",
}
_FRAME_TYPE: Final = {
    0: "Plus",
    1: "X",
    2: "V",
    3: "H",
    4: "V-Tail",
    5: "A-Tail",
    10: "Y6B",
    11: "Y6F",
    12: "BetaFlightX",
    13: "DJIX",
    14: "ClockwiseX",
    15: "I",
    18: "BetaFlightXReversed",
    19: "Y4",
}
_EKF_ACTION_IN_4_6: Final = {1: "Land if position needed", 2: "AltHold if position needed", 3: "Land always"}
_EKF_ACTION: Final = {0: "Report", **_EKF_ACTION_IN_4_6}
_GCS_ACTION: Final = {0: "None", 1: "RTL", 3: "SmartRTL or RTL", 4: "SmartRTL or Land", 5: "Land", 7: "Brake or Land"}
_RADIO_ACTION: Final = {0: "None", 1: "RTL", 3: "Land", 4: "SmartRTL or RTL", 5: "SmartRTL or Land", 7: "Brake or Land"}
_DEAD_RECKONING_ACTION: Final = {0: "None", 1: "Land", 2: "RTL", 3: "SmartRTL or RTL", 4: "SmartRTL or Land"}
_RUDDER: Final = {0: "No", 1: "Arm", 2: "Arm and disarm"}
_NEED_LOCATION: Final = {0: "No", 1: "Yes"}
_MODES: Final = {
    0: "Stabilize",
    1: "Acro",
    2: "AltHold",
    3: "Auto",
    4: "Guided",
    5: "Loiter",
    6: "RTL",
    7: "Circle",
    9: "Land",
    11: "Drift",
    13: "Sport",
    14: "Flip",
    15: "AutoTune",
    16: "PosHold",
    17: "Brake",
    18: "Throw",
    19: "Avoid_ADSB",
    20: "Guided_NoGPS",
    21: "Smart_RTL",
    22: "FlowHold",
    23: "Follow",
    24: "ZigZag",
    25: "SystemID",
    26: "Heli_Autorotate",
}
_SWITCHED_MODES: Final = {**_MODES, 27: "Auto RTL", 28: "Turtle"}
_MODE_CHANNELS: Final = {0: "None", **{number: f"Channel {number}" for number in range(5, 16)}}

FORMAT_VERSION: Final = (ParamInfo("FORMAT_VERSION", INT16, 120, "Version of the stored parameters' layout"),)

_PWM: Final = (800.0, 2200.0)
_NUMBER_OF_MODES: Final = 6

MODES: Final = (
    ParamInfo("FS_GCS_ENABLE", INT8, 0, "What to do when the ground station is lost", values=_GCS_ACTION),
    ParamInfo("GPS_HDOP_GOOD", INT16, 140, "Dilution x 100 at which arming still trusts a GPS", "", (100.0, 900.0)),
    ParamInfo("FS_THR_ENABLE", INT8, 1, "What to do when the radio is lost", values=_RADIO_ACTION),
    ParamInfo("FS_THR_VALUE", INT16, 975, "Throttle below which the radio counts as lost", "PWM", (910.0, 1100.0)),
    ParamInfo("THR_DZ", INT16, 100, "Dead zone about the throttle stick's middle, of 1000", "PWM", (0.0, 300.0)),
    *(
        ParamInfo(f"FLTMODE{number}", INT8, 0, f"Mode of switch position {number}", values=_SWITCHED_MODES)
        for number in range(1, _NUMBER_OF_MODES + 1)
    ),
    ParamInfo("FLTMODE_CH", INT8, 5, "Radio channel of the mode switch", values=_MODE_CHANNELS),
    ParamInfo("INITIAL_MODE", INT8, 0, "Mode after start-up", values=_MODES),
    ParamInfo("LOG_BITMASK", INT32, 180222, "Which kinds of records are logged, a bit each"),
    # FIRMWARE PARITY: the firmware's default is 1, that of the simulator 0, as its FRAME_CLASS is 1.
    ParamInfo("FRAME_TYPE", INT8, 0, "Arrangement of the arms", values=_FRAME_TYPE, reboot_required=True),
)
"""What stands before the ARMING_ group."""

ARMING: Final = (
    ParamInfo("ACCTHRESH", FLOAT, 0.75, "How far accelerometers may differ", "m/s/s", (0.25, 3.0)),
    ParamInfo("RUDDER", INT8, 2, "What the rudder stick may do", values=_RUDDER),
    ParamInfo("MIS_ITEMS", INT32, 0, "Which mission items there have to be, a bit each"),
    ParamInfo("CHECK", INT32, 1, "Which checks precede arming, bits: 0 all, 10 logging, 18 visual odometry, ..."),
    ParamInfo("OPTIONS", INT32, 0, "Bits: 0 do not show pre-arm failures, 1 do not announce arming"),
    ParamInfo("MAGTHRESH", INT16, 100, "How far the compass may be from the world model", "mGauss", (0.0, 500.0)),
    ParamInfo("NEED_LOC", INT8, 0, "Whether arming takes an absolute position", values=_NEED_LOCATION),
)


def _failsafe(ekf_action: Mapping[int, str]) -> tuple[ParamInfo, ...]:
    return (
        ParamInfo("DISARM_DELAY", INT8, 10, "Time on the ground until disarming, 0 is never", "s", (0.0, 127.0)),
        ParamInfo("FS_EKF_ACTION", INT8, 1, "What to do when the EKF fails", values=ekf_action),
        ParamInfo("FS_EKF_THRESH", FLOAT, 0.8, "Variance that counts as an EKF failure: 0.6 strict, 1 relaxed"),
        ParamInfo("FS_CRASH_CHECK", INT8, 1, "Disarm after a crash", values=_OFF_ON),
    )


FAILSAFE: Final = _failsafe(_EKF_ACTION)
"""What stands after the ARMING_ group."""

FAILSAFE_IN_4_6: Final = _failsafe(_EKF_ACTION_IN_4_6)
"""The same in 4.6, whose FS_EKF_ACTION has no 0."""

RCMAP: Final = tuple(
    ParamInfo(name, INT8, channel, f"Radio channel of {name.lower()}", "", (1.0, 16.0), reboot_required=True)
    for channel, name in enumerate(("ROLL", "PITCH", "THROTTLE", "YAW"), start=1)
)

# FIRMWARE PARITY: the firmware's default is 0, no frame, and its simulator's file of defaults makes it 1. There is
# no set-up step here that would ask.
FRAME_CLASS: Final = (
    ParamInfo("FRAME_CLASS", INT8, 1, "Kind of multicopter", values=_FRAME_CLASS, reboot_required=True),
)

MISSION: Final = (
    ParamInfo("TOTAL", INT16, 0, "How many mission items there are, home among them", flags=ParamFlag.READ_ONLY),
    ParamInfo("RESTART", INT8, 0, "Where AUTO begins", values={0: "Where it was left", 1: "With the first item"}),
    ParamInfo("OPTIONS", INT16, 0, "Bits: 0 forget the mission at start-up, 2 go on after a landing, 3 jump once only"),
)

NUMBER_OF_CHANNELS: Final = 16
_DEAD_ZONES_US: Final = {1: 20, 2: 20, 3: 30, 4: 20}
_OPTIONS: Final = {0: "Do Nothing", 80: "Viso Align", 90: "EKF Source Set"}


def rc_channel(number: int) -> tuple[ParamInfo, ...]:
    """Return the rows of RCn_; the dead zones of sticks are those of Copter::default_dead_zones."""
    return (
        ParamInfo("MIN", INT16, 1100, "Pulse at one end of the stick", "PWM", _PWM),
        ParamInfo("TRIM", INT16, 1500, "Pulse in the stick's middle", "PWM", _PWM),
        ParamInfo("MAX", INT16, 1900, "Pulse at the other end of the stick", "PWM", _PWM),
        ParamInfo("REVERSED", INT8, 0, "Turn the stick's direction round", values=_OFF_ON),
        ParamInfo("DZ", INT16, _DEAD_ZONES_US.get(number, 0), "Dead zone about the middle", "PWM", (0.0, 200.0)),
        ParamInfo("OPTION", INT16, 0, "What the channel's switch does", values=_OPTIONS),
    )


RECEIVER: Final = (
    ParamInfo("RC_OVERRIDE_TIME", FLOAT, 3.0, "How long RC_CHANNELS_OVERRIDE holds, -1 for ever", "s", (0.0, 120.0)),
)

FENCE: Final = (ParamInfo("ENABLE", INT8, 0, "Keep within a fence, which is not done here", values=_OFF_ON),)

LATE_FAILSAFE: Final = (
    ParamInfo("FS_VIBE_ENABLE", INT8, 1, "Fly on with vibration that the EKF cannot take", values=_OFF_ON),
    ParamInfo("FS_OPTIONS", INT32, 16, "When to carry on in spite of a failsafe, a bit each"),
    ParamInfo("FS_GCS_TIMEOUT", FLOAT, 5.0, "Silence until the ground station counts as lost", "s", (2.0, 120.0)),
    ParamInfo("FS_DR_ENABLE", INT8, 2, "What to do while position is dead reckoning", values=_DEAD_RECKONING_ACTION),
    ParamInfo("FS_DR_TIMEOUT", INT16, 30, "Dead reckoning until position counts as lost", "s", (0.0, 120.0)),
    ParamInfo("FS_EKF_FILT", FLOAT, 5.0, "Filter on the variances of the EKF failsafe", "Hz", (0.0, 10.0)),
)
"""What stands in the vehicle's second table, after the radio's channels."""
