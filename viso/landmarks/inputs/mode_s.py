# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Raw Mode-S frames as text, one a line, decoded by pyModeS (the extra ``landmarks``).

A frame is 28 hexadecimal digits (14 in the short ones, which hold no position): alone, as ``*...;`` (AVR), as
``@`` with 12 digits of the receiver's counter before it (AVR with MLAT stamps), or after its time in s and a comma or a
space. Positions come as pairs of even and odd frames, 10 s apart at most; an aircraft's first positions are held back
until three agree.
"""

import re
from typing import Any, Final

from viso.extras import pip_install
from viso.landmarks.inputs.base import LARGEST_S, NO_TIME, NOT_ICAO, InputFileError, LineReader, Refused
from viso.landmarks.inputs.held import HeldReports
from viso.landmarks.types import Event

MISSING_EXTRA: Final = f"raw Mode-S frames are decoded with pyModeS; install it with: {pip_install('landmarks')}"
COUNTER_HZ: Final = 12e6
"""The frequency of the receivers' time stamp counter."""
LONG_DIGITS: Final = 28
EXTENDED_SQUITTER: Final = 17
NON_TRANSPONDER: Final = 18
GNSS_ALTITUDES: Final = range(20, 23)
_LINE: Final = re.compile(
    r"""(?:(?P<time>\d+(?:\.\d+)?)[,\s]\s*)? ["']?
        (?: \*(?P<avr>[0-9a-f]+); | @(?P<counter>[0-9a-f]{12})(?P<stamped>[0-9a-f]+); | (?P<plain>[0-9a-f]+) )
        ["']? (?:,.*)?""",
    re.ASCII | re.IGNORECASE | re.VERBOSE,
)


class ModeSReader(LineReader):
    """Makes a report of each position, with the aircraft's velocity from the 15 s before.

    A frame's time is that in the line if there is one, or else that of arrival, or else the receiver's counter, which
    runs from its start. Frames that only complete others, such as the first of a pair, are not refused.

    Raises InputFileError if pyModeS is missing.
    """

    def __init__(self) -> None:
        try:
            import pyModeS
        except ModuleNotFoundError as error:
            raise InputFileError(MISSING_EXTRA) from error
        super().__init__()
        self._frame_of: Any = pyModeS.Message
        self._decoder: Any = pyModeS.PipeDecoder()
        self._held = HeldReports()

    def _events(self, line: str, arrival_s: float | None) -> list[Event]:
        digits, t_s = _parsed(line.strip(), arrival_s)
        first = int(digits[:2], 16)
        kind, variant = first >> 3, first & 7
        if len(digits) != LONG_DIGITS or kind not in (EXTENDED_SQUITTER, NON_TRANSPONDER):
            raise Refused("not an ADS-B frame")
        if kind == NON_TRANSPONDER and variant != 0:
            raise Refused(NOT_ICAO)
        # The decoder would pair a damaged frame with a sound one.
        if not self._frame_of(digits).crc_valid:
            raise Refused("a frame with a bad checksum")
        decoded = self._decoder.decode(digits, timestamp=t_s)
        icao = str(decoded["icao"])
        if decoded.get("bds") == "0,9":
            self._take_motion(t_s, icao, decoded)
        elif decoded.get("bds") == "0,6":
            raise Refused("a position on the surface")
        elif decoded.get("bds") == "0,5":
            return self._take_position(t_s, icao, decoded)
        return []

    def _take_motion(self, t_s: float, icao: str, decoded: Any) -> None:
        speed_kt, track_deg = decoded.get("groundspeed"), decoded.get("track")
        if speed_kt is not None and track_deg is not None:
            rate_ft_min = decoded.get("vertical_rate") or 0.0
            self._held.motion(t_s, icao, float(speed_kt), float(track_deg), float(rate_ft_min))

    def _take_position(self, t_s: float, icao: str, decoded: Any) -> list[Event]:
        altitude_ft = decoded.get("altitude")
        if altitude_ft is not None:
            is_baro = decoded.get("typecode") not in GNSS_ALTITUDES
            self._held.altitude(t_s, icao, float(altitude_ft), is_baro=is_baro)
        latitude_deg, longitude_deg = decoded.get("latitude"), decoded.get("longitude")
        if latitude_deg is None or longitude_deg is None:
            return []
        return [self._held.report(t_s, icao, float(latitude_deg), float(longitude_deg))]


def is_frame(line: str) -> bool:
    """Return whether a line looks like a frame."""
    match = _LINE.fullmatch(line.strip())
    return match is not None and len(_digits(match)) in (LONG_DIGITS // 2, LONG_DIGITS)


def _digits(match: re.Match[str]) -> str:
    return match["avr"] or match["stamped"] or match["plain"]


def _parsed(line: str, arrival_s: float | None) -> tuple[str, float]:
    """Return the digits of the frame and its time."""
    match = _LINE.fullmatch(line)
    if match is None or not is_frame(line):
        raise Refused("not a Mode-S frame")
    if match["time"] is not None:
        t_s = float(match["time"])
    elif arrival_s is not None:
        t_s = arrival_s
    elif match["counter"] is not None:
        t_s = int(match["counter"], 16) / COUNTER_HZ
    else:
        raise Refused(NO_TIME)
    if not abs(t_s) <= LARGEST_S:
        raise Refused("time is out of range")
    return _digits(match).upper(), t_s
