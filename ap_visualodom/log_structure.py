# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The log records of AP_VisualOdom (AP_VisualOdom/LogStructure.h)."""

from typing import Final

from ap_core.log_structure import LogStructure

VISO: Final = LogStructure(
    167,
    "VISO",
    "Qffffffff",
    "TimeUS,dt,AngDX,AngDY,AngDZ,PosDX,PosDY,PosDZ,conf",
    "ssrrrmmm-",
    "FF000000-",
)
VISP: Final = LogStructure(
    168,
    "VISP",
    "QQIffffffffBBb",
    "TimeUS,RTimeUS,CTimeMS,PX,PY,PZ,R,P,Y,PErr,AErr,Rst,Ign,Q",
    "sssmmmddhmd--%",
    "FFC00000000--0",
)
VISV: Final = LogStructure(
    169,
    "VISV",
    "QQIffffBBb",
    "TimeUS,RTimeUS,CTimeMS,VX,VY,VZ,VErr,Rst,Ign,Q",
    "sssnnnn--%",
    "FFC0000--0",
)

LOG_STRUCTURE_FROM_VISUALODOM: Final = (VISO, VISP, VISV)
