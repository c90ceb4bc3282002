# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The log records of sensors that MAVLink messages feed, and what releases lay out otherwise.

Source: AP_GPS/LogStructure.h, AP_Logger/LogStructure.h, AP_Logger/LogFile.cpp.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

from ap_core.log_field import LogValue
from ap_core.log_structure import MSG, LogStructure
from ekf_stub.log.replay_log_structure import RFRN, RRNH, RRNI

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
RFND: Final = LogStructure(114, "RFND", "QBfBBb", "TimeUS,Instance,Dist,Stat,Orient,Quality", "s#m--%", "F-0---")
OF: Final = LogStructure(180, "OF", "QBffff", "TimeUS,Qual,flowX,flowY,bodyX,bodyY", "s-EEEE", "F-0000")

LOG_STRUCTURE_FROM_GPS: Final = (GPS, GPA)

MSG_NUMBERED: Final = LogStructure(59, "MSG", "QBBZ", "TimeUS,ID,Seq,Message", "s---", "F---")
"""MSG since 2025-12-17: a text has a number, and its pieces of 64 characters count from 0."""


@dataclass(frozen=True, slots=True)
class LogRelease:
    """Where releases differ in their logs.

    Attributes:
        message: layout of MSG.
        message_head: takes how many texts there were before, returns what precedes the text itself in MSG.
        filter_version: VER.FV, the version of the estimators (AP_FILTER_VERSION).
        layouts: what it lays out otherwise besides, by their names.
        shifts: ids of the reference, in ascending order, each with by how much ids from there up to the next are
            greater in this release: records that it has more come before them.
        fills_odometry: RBOH, the replay record of a body odometry, has the camera's place and delay.
        has_index_of_aux_function: AUXF tells which channel or link ran an auxiliary function.
    """

    message: LogStructure
    message_head: Callable[[int], tuple[LogValue, ...]]
    filter_version: int
    shifts: tuple[tuple[int, int], ...] = ()
    layouts: tuple[LogStructure, ...] = ()
    fills_odometry: bool = False
    has_index_of_aux_function: bool = True

    def own(self, structure: LogStructure) -> LogStructure:
        """Return a layout as this release has it, with its own id."""
        own = next((layout for layout in (self.message, *self.layouts) if layout.name == structure.name), structure)
        shift = next((shift for first, shift in reversed(self.shifts) if own.msg_type >= first), 0)
        return replace(own, msg_type=own.msg_type + shift) if shift else own


def no_head(_texts_before: int) -> tuple[LogValue, ...]:
    """Return nothing: MSG has a text alone (AP_Logger_Backend::Write_Message)."""
    return ()


def number_and_piece(texts_before: int) -> tuple[LogValue, ...]:
    """Return ID, which counts the texts from 1 to 255 again and again, and Seq, which is 0: no text has two pieces.

    Source: AP_Logger.h, get_MSG_id.
    """
    return texts_before % 255 + 1, 0


PLAIN_TEXTS: Final = LogRelease(MSG, no_head, 2)
"""The master of July 2025."""

_RANGES_IN_CM: Final = (
    replace(RFND, format="QBCBBb", multipliers="F-B---"),
    replace(RRNH, format="hhB", units="???", multipliers="???"),
    replace(RRNI, format="fffHBBB", units="------#", multipliers="-------"),
)
STABLE_4_6: Final = LogRelease(
    MSG,
    no_head,
    2,
    layouts=(*_RANGES_IN_CM, replace(RFRN, units="DUm????????")),
    has_index_of_aux_function=False,
)
"""4.6, which has ranges in whole centimetres."""

_MODE_ID, _FMT_ID, _RTER_ID, _LANDING_ID, _VER_ID = 120, 128, 161, 110, 206

NUMBERED_TEXTS: Final = LogRelease(MSG_NUMBERED, number_and_piece, 3, ((_MODE_ID, 1), (_FMT_ID, 0), (_RTER_ID, 1)))
"""The master of February 2026, which has RTC before MODE and RTER at the end of the replay records."""

STABLE_4_7: Final = replace(NUMBERED_TEXTS, fills_odometry=True)

APRIL_2026: Final = LogRelease(
    MSG_NUMBERED,
    number_and_piece,
    3,
    ((_LANDING_ID, 1), (_MODE_ID, 2), (_FMT_ID, 0), (_RTER_ID, 1), (_VER_ID, 2)),
    fills_odometry=True,
)
"""The master of April 2026, which has PIDW after PIDE and SPOL before VER besides."""
