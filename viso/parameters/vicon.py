# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Parameters of the simulator's own camera (SITL/SIM_Vicon.cpp): ``viso serve --imu fly --vision vicon``."""

from typing import Final

from ap_core.param_info import ParamInfo
from viso.parameters.copter import FLOAT, INT8, INT16
from viso.parameters.sensors import VECTOR3F

_ZERO: Final = (0.0, 0.0, 0.0)

VICON: Final = (
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
    ParamInfo("P_SD", FLOAT, 0.0, "Noise of the position, standard deviation", "m"),
    ParamInfo("V_SD", FLOAT, 0.0, "Noise of the velocity, standard deviation", "m/s"),
    ParamInfo("RATE", INT16, 50, "How often it looks, 0 never", "Hz"),
)
VICON_QUALITY: Final = ParamInfo("QUAL", INT8, 50, "Quality that ODOMETRY tells: -1 failed, 0 unknown, 1 to 100", "%")
"""Since February 2026."""
