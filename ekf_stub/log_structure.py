# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Replay records of the external navigation calls (AP_DAL/LogStructure.h)."""

from typing import Final

from ap_core.log_structure import LogStructure

RVOH: Final = LogStructure(152, "RVOH", "fffIBB", "OX,OY,OZ,Del,H,Ena", "------", "------")
REPH: Final = LogStructure(
    156, "REPH", "fffffffffIIH", "PX,PY,PZ,Q1,Q2,Q3,Q4,PEr,AEr,TS,RT,D", "------------", "------------"
)
REVH: Final = LogStructure(158, "REVH", "ffffIH", "VX,VY,VZ,Er,TS,D", "------", "------")
RBOH: Final = LogStructure(
    160, "RBOH", "ffffffffIfffH", "Q,DPX,DPY,DPZ,DAX,DAY,DAZ,DT,TS,OX,OY,OZ,D", "-------------", "-------------"
)

LOG_STRUCTURE_FROM_EKF_STUB: Final = (RVOH, REPH, REVH, RBOH)
