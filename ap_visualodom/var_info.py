# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The VISO_ parameters (AP_VisualOdom.cpp, AP_VisualOdom::var_info)."""

from enum import IntEnum
from typing import Final

from ap_core.param import ParamFlag, ParamInfo, ParamType

GROUP_PREFIX: Final = "VISO"


class VisualOdom_Type(IntEnum):
    """The backend that receives external navigation: the values of VISO_TYPE (AP_VisualOdom.h)."""

    NONE = 0
    MAV = 1
    IntelT265 = 2
    VOXL = 3


VAR_INFO: Final = (
    ParamInfo(
        "_TYPE",
        ParamType.INT8,
        0,
        "Backend that receives external navigation",
        values={0: "None", 1: "MAVLink", 2: "IntelT265", 3: "VOXL(ModalAI)"},
        flags=ParamFlag.ENABLE,
        reboot_required=True,
    ),
    ParamInfo(
        "_POS",
        ParamType.VECTOR3F,
        (0.0, 0.0, 0.0),
        "Camera position from the vehicle's centre: forward, right, down; the EKF corrects for it",
        unit="m",
        range=(-5, 5),
    ),
    ParamInfo(
        "_ORIENT",
        ParamType.INT8,
        0,
        "Camera mounting; turns deltas of every backend and the attitude of a T265 or VOXL",
        values={0: "Forward", 2: "Right", 4: "Back", 6: "Left", 24: "Up", 25: "Down"},
    ),
    ParamInfo("_SCALE", ParamType.FLOAT, 1.0, "Factor on positions; velocities are left as they are"),
    ParamInfo(
        "_DELAY_MS",
        ParamType.INT16,
        10,
        "Age of a measurement when it arrives, over and above the transport",
        unit="ms",
        range=(0, 250),
    ),
    ParamInfo(
        "_VEL_M_NSE",
        ParamType.FLOAT,
        0.1,
        "Velocity noise given to the EKF, whatever the message says",
        unit="m/s",
        range=(0.05, 5.0),
    ),
    ParamInfo(
        "_POS_M_NSE",
        ParamType.FLOAT,
        0.2,
        "Least position noise given to the EKF",
        unit="m",
        range=(0.1, 10.0),
    ),
    ParamInfo(
        "_YAW_M_NSE",
        ParamType.FLOAT,
        0.2,
        "Least attitude noise given to the EKF",
        unit="rad",
        range=(0.05, 1.0),
    ),
    ParamInfo(
        "_QUAL_MIN",
        ParamType.INT8,
        0,
        "Samples of lower quality are withheld from the EKF; -1 lets even failed ones through",
        unit="%",
        range=(-1, 100),
    ),
)
"""In the firmware's order; ``AP_VisualOdom._read_params`` reads their values."""
