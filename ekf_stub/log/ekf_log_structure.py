# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Records of what a filter core estimates (AP_NavEKF3/LogStructure.h)."""

from typing import Final

from ap_core.log_structure import LogStructure

XKF1: Final = LogStructure(
    44,
    "XKF1",
    "QBccCfffffffccce",
    "TimeUS,C,Roll,Pitch,Yaw,VN,VE,VD,dPD,PN,PE,PD,GX,GY,GZ,OH",
    "s#ddhnnnnmmmkkkm",
    "F-BBB0000000BBBB",
)
XKF2: Final = LogStructure(
    45,
    "XKF2",
    "QBccccchhhhhhfff",
    "TimeUS,C,AX,AY,AZ,VWN,VWE,MN,ME,MD,MX,MY,MZ,IDX,IDY,IS",
    "s#---nnGGGGGGoor",
    "F----BBCCCCCC000",
)
XKF3: Final = LogStructure(
    46,
    "XKF3",
    "QBcccccchhhccff",
    "TimeUS,C,IVN,IVE,IVD,IPN,IPE,IPD,IMX,IMY,IMZ,IYAW,IVT,RErr,ErSc",
    "s#nnnmmmGGGd?--",
    "F-BBBBBBCCCBB00",
)
XKF4: Final = LogStructure(
    47,
    "XKF4",
    "QBcccccfffHBIHb",
    "TimeUS,C,SV,SP,SH,SM,SVT,errRP,OFN,OFE,FS,TS,SS,GPS,PI",
    "s#------mm-----",
    "F-------??-----",
)
XKF5: Final = LogStructure(
    48,
    "XKF5",
    "QBBhhhcccCCfff",
    "TimeUS,C,NI,FIX,FIY,AFI,HAGL,offset,RI,rng,Herr,eAng,eVel,ePos",
    "s#----m???mrnm",
    "F-----BBBBB000",
)
XKFD: Final = LogStructure(49, "XKFD", "QBffffff", "TimeUS,C,IX,IY,IZ,IVX,IVY,IVZ", "s#------", "F-------")
XKFM: Final = LogStructure(50, "XKFM", "QBBffff", "TimeUS,C,OGNM,GLR,ALR,GDR,ADR", "s#-----", "F------")
XKFS: Final = LogStructure(
    51, "XKFS", "QBBBBBBBBB", "TimeUS,C,MI,BI,GI,AI,SS,GPS_GTA,GPS_CHK_WAIT,MAG_FUSION", "s#--------", "F---------"
)
XKQ: Final = LogStructure(52, "XKQ", "QBffff", "TimeUS,C,Q1,Q2,Q3,Q4", "s#????", "F-????")
XKTV: Final = LogStructure(54, "XKTV", "QBff", "TimeUS,C,TVS,TVD", "s#rr", "F-00")
XKV1: Final = LogStructure(
    55,
    "XKV1",
    "QBffffffffffff",
    "TimeUS,C,V00,V01,V02,V03,V04,V05,V06,V07,V08,V09,V10,V11",
    "s#------------",
    "F-------------",
)
XKV2: Final = LogStructure(
    56,
    "XKV2",
    "QBffffffffffff",
    "TimeUS,C,V12,V13,V14,V15,V16,V17,V18,V19,V20,V21,V22,V23",
    "s#------------",
    "F-------------",
)
XKY0: Final = LogStructure(
    57,
    "XKY0",
    "QBffffffffffff",
    "TimeUS,C,YC,YCS,Y0,Y1,Y2,Y3,Y4,W0,W1,W2,W3,W4",
    "s#hdhhhhh-----",
    "F-000000000000",
)
XKY1: Final = LogStructure(
    58,
    "XKY1",
    "QBffffffffff",
    "TimeUS,C,IVN0,IVN1,IVN2,IVN3,IVN4,IVE0,IVE1,IVE2,IVE3,IVE4",
    "s#nnnnnnnnnn",
    "F-0000000000",
)

LOG_STRUCTURE_FROM_EKF3: Final = (XKF1, XKF2, XKF3, XKF4, XKF5, XKFD, XKFM, XKFS, XKQ, XKTV, XKV1, XKV2, XKY0, XKY1)
