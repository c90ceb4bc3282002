# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Replay records: what the estimator is given in each frame, and from outside in between (AP_DAL/LogStructure.h)."""

import struct
from collections.abc import Callable, Sequence
from functools import cached_property, partial
from typing import Final

from ap_core.log_field import LogValue
from ap_core.log_structure import HEAD_BYTE1, HEAD_BYTE2, LogStructure


class FrameStructure(LogStructure):
    """A layout whose values are nearly always numbers that fit: these are packed in one go.

    Several such records are written in each of 400 frames per second. Its format has only those characters that mean
    the same to ``struct``.
    """

    @cached_property
    def _whole(self) -> Callable[..., bytes]:
        return partial(struct.Struct("<3s" + self.format).pack, bytes((HEAD_BYTE1, HEAD_BYTE2, self.msg_type)))

    def pack(self, values: Sequence[LogValue]) -> bytes:
        """Return a whole record; what does not fit is treated as in any other record, ValueError included."""
        try:
            return self._whole(*values)
        except (struct.error, OverflowError):
            return super().pack(values)


RFRH: Final = FrameStructure(129, "RFRH", "QI", "TimeUS,TF", "s-", "F-")
RFRF: Final = FrameStructure(130, "RFRF", "BB", "FTypes,Slow", "--", "--")
RFRN: Final = FrameStructure(
    138, "RFRN", "IIIfIfffBBB", "HLat,HLon,HAlt,E2T,AM,TX,TY,TZ,VC,EKT,Flags", "DUm-bddd---", "GGB--------"
)
REV2: Final = FrameStructure(131, "REV2", "B", "Event", "-", "-")
RSO2: Final = FrameStructure(132, "RSO2", "III", "Lat,Lon,Alt", "DUm", "GGB")
REV3: Final = FrameStructure(134, "REV3", "B", "Event", "-", "-")
RSO3: Final = FrameStructure(135, "RSO3", "III", "Lat,Lon,Alt", "DUm", "GGB")
RISH: Final = FrameStructure(139, "RISH", "HBBfBB", "LR,PG,PA,LD,AC,GC", "------", "------")
RISI: Final = FrameStructure(
    140, "RISI", "ffffffffBB", "DVX,DVY,DVZ,DAX,DAY,DAZ,DVDT,DADT,Flags,I", "---------#", "----------"
)
RBRH: Final = FrameStructure(141, "RBRH", "BB", "Primary,NumInst", "--", "--")
RBRI: Final = FrameStructure(142, "RBRI", "IfBB", "LastUpdate,Alt,H,I", "---#", "----")
RRNH: Final = FrameStructure(143, "RRNH", "ffB", "GCl,MaxD,NumSensors", "mm-", "00-")
RRNI: Final = FrameStructure(144, "RRNI", "ffffBBB", "PX,PY,PZ,Dist,Orient,Status,I", "---m--#", "---0---")
RGPH: Final = FrameStructure(145, "RGPH", "BB", "NumInst,Primary", "--", "--")
RGPI: Final = FrameStructure(146, "RGPI", "ffffBBBB", "OX,OY,OZ,Lg,Flags,Stat,NSats,I", "-------#", "--------")
RGPJ: Final = FrameStructure(
    147,
    "RGPJ",
    "IffffffIiiiffHB",
    "TS,VX,VY,VZ,SA,Y,YA,YT,Lat,Lon,Alt,HA,VA,HD,I",
    "--------------#",
    "---------------",
)
RMGH: Final = FrameStructure(
    153, "RMGH", "fBBBBBBB", "Dec,Avail,NumInst,AutoDec,NumEna,LOE,C,FUsable", "--------", "--------"
)
RMGI: Final = FrameStructure(
    154, "RMGI", "IffffffBBBB", "LU,OX,OY,OZ,FX,FY,FZ,UFY,H,HSF,I", "----------#", "-----------"
)

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

LOG_STRUCTURE_OF_FRAMES: Final = (
    *(RFRH, RFRF, RFRN, REV2, RSO2, REV3, RSO3, RISH, RISI),
    *(RBRH, RBRI, RRNH, RRNI, RGPH, RGPI, RGPJ, RMGH, RMGI),
)
LOG_STRUCTURE_FROM_DAL: Final = (*LOG_STRUCTURE_OF_FRAMES, RVOH, ROFH, REPH, REVH, RBOH)
"""In the order of the firmware's table."""
