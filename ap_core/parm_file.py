# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Parameter files (.parm, .param, .params) as ArduPilot reads them and ground stations write them.

Source of the format: AP_Param/AP_Param.cpp, parse_param_line. MAVProxy and Mission Planner write this format;
QGroundControl writes vehicle, component, name, value and type.
"""

import re
from dataclasses import dataclass
from typing import Final

import numpy as np

from ap_core.param_info import MAX_NAME_SIZE, to_f32

_SEPARATORS: Final = ", =\t\r"
_WORDS: Final = re.compile(f"[^{_SEPARATORS}]+")
_DECIMAL: Final = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_HEXADECIMAL: Final = re.compile(r"0[xX][0-9a-fA-F]{1,32}")
_NOT_FINITE: Final = re.compile(r"[+-]?(inf|infinity|nan)", re.ASCII | re.IGNORECASE)
_OF_QGROUNDCONTROL: Final = re.compile(r"\s*\d+\s+\d+\s+[A-Za-z]\w*\s+\S+\s+\d+\s*$", re.ASCII)
_AUTOPILOT: Final = "1"  # MAV_COMP_ID_AUTOPILOT1
_SHOWN_CHARACTERS: Final = 60


class ParmFileError(ValueError):
    """A line of a parameter file that cannot be read; the text is one line with file name and line number."""

    def __init__(self, source: str, line_number: int, text: str, reason: str) -> None:
        super().__init__(f"{source}:{line_number}: {reason}: {text[:_SHOWN_CHARACTERS]!r}")
        self.source = source
        self.line_number = line_number
        self.text = text
        self.reason = reason


@dataclass(frozen=True, slots=True)
class ParmLine:
    """One parameter of a file; ``line_number`` counts from 1."""

    name: str
    value: np.float32
    line_number: int
    read_only: bool = False


def parse_parm(text: str, source: str) -> list[ParmLine]:
    """Read ``NAME value``, ``NAME,value`` and ``NAME=value`` lines with ``#`` comments, in file order.

    Lines of QGroundControl are ``vehicle component NAME value type``; those of components other than the autopilot are
    skipped. A third word ``@READONLY`` marks a parameter read-only, other words after the value are ignored, as in the
    firmware. Numbers are decimal, or hexadecimal with 0x. A byte order mark and CR LF line ends are accepted.

    Args:
        text: the file's contents.
        source: the file's name, for error messages.

    Raises:
        ParmFileError: a missing, unreadable or non-finite value, or a name of more than 16 characters.
    """
    lines = text.removeprefix("\ufeff").split("\n")
    parsed = (_parse_line(line, source, number) for number, line in enumerate(lines, start=1))
    return [line for line in parsed if line is not None]


def _parse_line(line: str, source: str, number: int) -> ParmLine | None:
    words = _WORDS.findall(line.split("#", 1)[0])
    if not words:
        return None
    # FIRMWARE PARITY: the firmware skips such lines silently, and reads the leading digits of a bad number (0 if there
    # are none). A person who edits a file is better served by an error.
    if _OF_QGROUNDCONTROL.match(line):
        if words[1] != _AUTOPILOT:
            return None
        words = words[2:4]
    name = words[0]
    if len(name) > MAX_NAME_SIZE:
        raise ParmFileError(source, number, line, f"name longer than {MAX_NAME_SIZE} characters")
    if len(words) == 1:
        raise ParmFileError(source, number, line, "missing value")
    value = _parse_number(words[1])
    if value is None:
        raise ParmFileError(source, number, line, "bad number")
    if not np.isfinite(value):
        raise ParmFileError(source, number, line, "value is not finite")
    return ParmLine(name, value, number, read_only=words[2:3] == ["@READONLY"])


def _parse_number(word: str) -> np.float32 | None:
    if _HEXADECIMAL.fullmatch(word):
        return to_f32(float(int(word, 16)))
    if _DECIMAL.fullmatch(word) or _NOT_FINITE.fullmatch(word):
        return to_f32(float(word))
    return None
