# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The estimator's log records: what it was given (AP_DAL/LogStructure.h), and what it made of it."""

from typing import Final

from ap_core.log_structure import LogStructure
from ekf_stub.log.ekf_log_structure import LOG_STRUCTURE_FROM_EKF3
from ekf_stub.log.replay_log_structure import LOG_STRUCTURE_OF_FRAMES

RVOH: Final = LogStructure(152, "RVOH", "fffIBB", "OX,OY,OZ,Del,H,Ena", "------", "------")
ROFH: Final = LogStructure(
    155, "ROFH", "ffffIffffB", "FX,FY,GX,GY,Tms,PX,PY,PZ,HgtOvr,Qual", "----------", "----------"
)
REPH: Final = LogStructure(
    156, "REPH", "fffffffffIIH", "PX,PY,PZ,Q1,Q2,Q3,Q4,PEr,AEr,TS,RT,D", "------------", "------------"
)
REVH: Final = LogStructure(158, "REVH", "ffffIH", "VX,VY,VZ,Er,TS,D", "------", "------")
RBOH: Final = LogStructure(
    160, "RBOH", "ffffffffIfffH", "Q,DPX,DPY,DPZ,DAX,DAY,DAZ,DT,TS,OX,OY,OZ,D", "-------------", "-------------"
)

LOG_STRUCTURE_FROM_EKF_STUB: Final = (*LOG_STRUCTURE_OF_FRAMES, RVOH, ROFH, REPH, REVH, RBOH, *LOG_STRUCTURE_FROM_EKF3)
