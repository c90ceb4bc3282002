# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The log records of sensors that MAVLink messages feed (AP_GPS/LogStructure.h, AP_Logger/LogStructure.h)."""

from typing import Final

from ap_core.log_structure import LogStructure

GPS: Final = LogStructure(
    94,
    "GPS",
    "QBBIHBcLLeffffB",
    "TimeUS,I,Status,GMS,GWk,NSats,HDop,Lat,Lng,Alt,Spd,GCrs,VZ,Yaw,U",
    "s#-s-S-DUmnhnh-",
    "F--C-0BGGB000--",
)
GPA: Final = LogStructure(
    95,
    "GPA",
    "QBCCCCfBIHeHH",
    "TimeUS,I,VDop,HAcc,VAcc,SAcc,YAcc,VV,SMS,Delta,AEl,RTCMFU,RTCMFD",
    "s#-mmnd-ssm--",
    "F-BBBB0-CCB--",
)
OF: Final = LogStructure(180, "OF", "QBffff", "TimeUS,Qual,flowX,flowY,bodyX,bodyY", "s-EEEE", "F-0000")

LOG_STRUCTURE_FROM_GPS: Final = (GPS, GPA)
