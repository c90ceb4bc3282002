# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Layouts of DataFlash records, and the packing of values into records.

A record is ``A3 95``, the message id and the fields without padding, little endian, in the order of the
format string. The layouts that every vehicle has, the units and the multipliers are tables at the end;
libraries keep their own layouts beside their code.

Source: AP_Logger/LogStructure.h, AP_AHRS/LogStructure.h.
"""

import math
import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Final

import numpy as np

from ap_core.fmath import f32
from ap_core.log_field import DIRECT, FLOAT_TYPES, FORMATS, SCALES, Converter, LogValue, scaled

HEAD_BYTE1: Final = 0xA3
HEAD_BYTE2: Final = 0x95
MAX_MSG_TYPE: Final = 254  # the firmware keeps 255 for later extension
TIME_LABEL: Final = "TimeUS"

_HEADER: Final = struct.Struct("<BBB")
_MAX_LENGTH: Final = 255
_MAX_NAME: Final = 4
_MAX_FIELDS: Final = 16
_MAX_LABELS: Final = 64
_MAX_PLAIN: Final = 1e30  # limit for fast packing: ten million times this value still is a float32


@dataclass(frozen=True)
class LogStructure:
    """The layout of one type of record (LogStructure.h, struct LogStructure).

    ``labels`` are comma separated; ``format``, ``units`` and ``multipliers`` hold one character a field. Raises
    ValueError if the layout does not fit what FMT and FMTU records can describe.
    """

    msg_type: int
    name: str
    format: str
    labels: str
    units: str
    multipliers: str

    def __post_init__(self) -> None:
        problem = self._problem()
        if problem:
            raise ValueError(f"log structure {self.name!r}: {problem}")

    def _problem(self) -> str | None:
        checks = (
            (0 <= self.msg_type <= MAX_MSG_TYPE, f"message id {self.msg_type} is not in 0..{MAX_MSG_TYPE}"),
            (1 <= len(self.name) <= _MAX_NAME, f"the name needs 1 to {_MAX_NAME} characters"),
            (1 <= len(self.format) <= _MAX_FIELDS, f"{len(self.format)} fields, 1 to {_MAX_FIELDS} fit"),
            (len(self.labels) <= _MAX_LABELS, f"labels are longer than {_MAX_LABELS} characters"),
            ((self.name + self.labels).isascii(), "name and labels must be ASCII"),
            (self._counts_agree(), "labels, format, units and multipliers differ in number"),
            (len(set(self.fields)) == len(self.fields), "labels are not unique"),
            (all(self.fields), "a label is empty"),
            (set(self.format) <= FORMATS.keys(), f"unknown character in format {self.format!r}"),
            (set(self.units) <= _UNIT_IDS, f"unknown unit in {self.units!r}"),
            (set(self.multipliers) <= _MULTIPLIER_IDS, f"unknown multiplier in {self.multipliers!r}"),
        )
        problem = next((text for holds, text in checks if not holds), None)
        if problem is None and self.length > _MAX_LENGTH:
            return f"a record of {self.length} bytes, {_MAX_LENGTH} fit"
        return problem

    def _counts_agree(self) -> bool:
        return len(self.fields) == len(self.format) == len(self.units) == len(self.multipliers)

    @cached_property
    def fields(self) -> tuple[str, ...]:
        """The labels, one by one."""
        return tuple(self.labels.split(","))

    @cached_property
    def length(self) -> int:
        """Bytes of a record, the three header bytes included."""
        return _HEADER.size + self._body.size

    @cached_property
    def _body(self) -> struct.Struct:
        return struct.Struct("<" + "".join(FORMATS[char][0] for char in self.format))

    @cached_property
    def _direct(self) -> Callable[..., bytes] | None:
        """The packer of stored numbers; None for a layout with texts."""
        codes = [DIRECT.get(char) for char in self.format]
        if None in codes:
            return None
        return partial(struct.Struct("<3s" + "".join(filter(None, codes))).pack, self._header)

    @cached_property
    def _converters(self) -> tuple[Converter, ...]:
        return tuple(FORMATS[char][1] for char in self.format)

    @cached_property
    def _header(self) -> bytes:
        return _HEADER.pack(HEAD_BYTE1, HEAD_BYTE2, self.msg_type)

    def pack(self, values: Sequence[LogValue]) -> bytes:
        """Return a whole record holding ``values``, one for each field.

        Integers are raw, in ``c``, ``C``, ``e``, ``E`` and ``L`` fields too. Floats there are physical values: times
        100 (``L``: degrees, times 1e7), truncated towards zero; other integer fields truncate them. Values out of range
        wrap; NaN and infinity convert as on x86-64. ``float32`` values keep their bits in ``f`` fields. Text is
        cut to its field and padded with NUL. Raises ValueError if the number of values is wrong, or text and numbers
        are mixed up.
        """
        direct = self._direct
        if direct is not None:
            try:
                # The usual record is packed at once: numbers, none of them large or NaN.
                if math.hypot(*values) < _MAX_PLAIN:  # type: ignore[arg-type]  # noqa: TID251  # text is a TypeError
                    return direct(*(self._with_scaled(values) if self._scales else values))
            except (TypeError, IndexError, OverflowError, struct.error):
                pass
        return self._pack_each(values)

    def _with_scaled(self, values: Sequence[LogValue]) -> list[LogValue]:
        """Return plain numbers, with the floats of integer fields converted to stored integers where they fit."""
        raw = list(values)
        for index, scale, single_scale in self._scales:
            value = raw[index]
            if type(value) is f32:  # the most frequent types
                raw[index] = int(value * single_scale)
            elif type(value) is not int and isinstance(value, FLOAT_TYPES):
                raw[index] = math.trunc(scaled(value, scale))
        return raw

    @cached_property
    def _scales(self) -> tuple[tuple[int, int, np.float32], ...]:
        scales = ((index, SCALES[char]) for index, char in enumerate(self.format) if char in SCALES)
        return tuple((index, scale, f32(scale)) for index, scale in scales)

    def _pack_each(self, values: Sequence[LogValue]) -> bytes:
        if len(values) != len(self._converters):
            raise ValueError(f"{self.name}: {len(values)} values for {len(self._converters)} fields")
        try:
            return self._header + self._body.pack(
                *[convert(value) for convert, value in zip(self._converters, values, strict=True)]
            )
        except (TypeError, struct.error) as error:
            raise ValueError(f"{self.name}: {error} in {values!r}") from None


UNITS: Final[tuple[tuple[str, str], ...]] = (
    ("-", ""),
    ("?", "UNKNOWN"),
    ("A", "A"),
    ("a", "Ah"),
    ("d", "deg"),
    ("b", "B"),
    ("B", "B/s"),
    ("k", "deg/s"),
    ("D", "deglatitude"),
    ("e", "deg/s/s"),
    ("E", "rad/s"),
    ("G", "Gauss"),
    ("h", "degheading"),
    ("i", "A.s"),
    ("J", "W.s"),
    ("l", "l"),
    ("L", "rad/s/s"),
    ("m", "m"),
    ("n", "m/s"),
    ("o", "m/s/s"),
    ("O", "degC"),
    ("%", "%"),
    ("S", "satellites"),
    ("s", "s"),
    ("t", "N.m"),
    ("q", "rpm"),
    ("r", "rad"),
    ("U", "deglongitude"),
    ("u", "ppm"),
    ("v", "V"),
    ("P", "Pa"),
    ("w", "Ohm"),
    ("W", "Watt"),
    ("X", "W.h"),
    ("y", "l/s"),
    ("Y", "us"),
    ("z", "Hz"),
    ("#", "instance"),
)
"""Unit characters and their labels, in the order of the log; ``#`` marks the instance of a record."""

# The firmware's constants are single precision, so its doubles carry float32 values.
MULTIPLIERS: Final[tuple[tuple[str, float], ...]] = tuple(
    (char, float(np.float32(factor)))
    for char, factor in (
        ("-", 0.0),
        ("?", 1.0),
        ("2", 1e2),
        ("1", 1e1),
        ("0", 1e0),
        ("A", 1e-1),
        ("B", 1e-2),
        ("C", 1e-3),
        ("D", 1e-4),
        ("E", 1e-5),
        ("F", 1e-6),
        ("G", 1e-7),
        ("I", 1e-9),
        ("!", 3.6),
        ("/", 3600.0),
    )
)
"""Multiplier characters and their values, in the order of the log; 0 stands for "do not scale"."""

_UNIT_IDS: Final = frozenset(char for char, _ in UNITS)
_MULTIPLIER_IDS: Final = frozenset(char for char, _ in MULTIPLIERS)

QUIET_NAN: Final[np.float32] = np.uint32(0x7FC04152).view(np.float32)
"""The NaN for "no value" (AP_Logger::quiet_nanf): PARM.Default of changes, AHR2.Alt while unknown."""

FMT: Final = LogStructure(128, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns", "-b---", "-----")
UNIT: Final = LogStructure(117, "UNIT", "QbZ", "TimeUS,Id,Label", "s--", "F--")
FMTU: Final = LogStructure(116, "FMTU", "QBNN", "TimeUS,FmtType,UnitIds,MultIds", "s---", "F---")
MULT: Final = LogStructure(118, "MULT", "Qbd", "TimeUS,Id,Mult", "s--", "F--")
PARM: Final = LogStructure(32, "PARM", "QNff", "TimeUS,Name,Value,Default", "s---", "F---")
MSG: Final = LogStructure(59, "MSG", "QZ", "TimeUS,Message", "s-", "F-")
MAVC: Final = LogStructure(
    78,
    "MAVC",
    "QBBBBBHffffiifBB",
    "TimeUS,TS,TC,SS,SC,Fr,Cmd,P1,P2,P3,P4,X,Y,Z,Res,WL",
    "s---------------",
    "F---------------",
)
MODE: Final = LogStructure(120, "MODE", "QMBB", "TimeUS,Mode,ModeNum,Rsn", "s---", "F---")
AHR2: Final = LogStructure(
    70, "AHR2", "QccCfLLffff", "TimeUS,Roll,Pitch,Yaw,Alt,Lat,Lng,Q1,Q2,Q3,Q4", "sddhmDU----", "FBBB0GG----"
)
ATT: Final = LogStructure(
    72, "ATT", "QffffffB", "TimeUS,DesRoll,Roll,DesPitch,Pitch,DesYaw,Yaw,AEKF", "sddddhh-", "F000000-"
)
ORGN: Final = LogStructure(73, "ORGN", "QBLLe", "TimeUS,Type,Lat,Lng,Alt", "s#DUm", "F-GGB")
POS: Final = LogStructure(74, "POS", "QLLfff", "TimeUS,Lat,Lng,Alt,RelHomeAlt,RelOriginAlt", "sDUmmm", "FGG000")
DSF: Final = LogStructure(177, "DSF", "QIHIIII", "TimeUS,Dp,Blk,Bytes,FMn,FMx,FAv", "s--b---", "F--0---")
MAV: Final = LogStructure(183, "MAV", "QBHHHBHHI", "TimeUS,chan,txp,rxp,rxdp,flags,ss,tf,mgs", "s#----s-s", "F-000-C-C")
EV: Final = LogStructure(181, "EV", "QB", "TimeUS,Id", "s-", "F-")
ARM: Final = LogStructure(186, "ARM", "QBIBB", "TimeUS,ArmState,ArmChecks,Forced,Method", "s----", "F----")
ERR: Final = LogStructure(184, "ERR", "QBB", "TimeUS,Subsys,ECode", "s--", "F--")
VER: Final = LogStructure(
    206,
    "VER",
    "QBHBBBBIZHBBII",
    "TimeUS,BT,BST,Maj,Min,Pat,FWT,GH,FWS,APJ,BU,FV,IMI,ICI",
    "s-------------",
    "F-------------",
)

COMMON_STRUCTURES: Final[tuple[LogStructure, ...]] = (
    *(FMT, UNIT, FMTU, MULT, PARM, MSG, MAVC, MODE, AHR2),
    *(ATT, ORGN, POS, DSF, MAV, EV, ARM, ERR, VER),
)
"""Layouts that no single library owns, in the order of the firmware's table."""
