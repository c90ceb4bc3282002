# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Lines of BaseStation (SBS-1), as dump1090 and its kin send them on TCP port 30003.

Type, transmission type, session, aircraft, address, flight, date and time of generation, date and time of logging,
callsign, altitude (ft), ground speed (kt), track (deg), latitude, longitude, vertical rate (ft/min), squawk, alert,
emergency, ident, on the ground; fields that a transmission type does not have are empty. 1 is the callsign, 2 a
position on
the surface, 3 one in the air, 4 a velocity, 5 to 7 altitudes, 8 none of these. Altitudes are pressure altitudes; the
few aircraft that send a geometric one with their position cannot be told from the others.

Times are those of generation. Their time zone is the receiver's and not in the line, so it must be given.
"""

import math
import re
from datetime import UTC, datetime
from typing import Final

from viso.landmarks.inputs.base import NO_POSITION, NO_TIME, LineReader, Refused, icao_of, not_null_island
from viso.landmarks.inputs.held import HeldReports
from viso.landmarks.types import Event

FIELDS: Final = 22
OTHER_TYPES: Final = frozenset({"SEL", "ID", "AIR", "STA", "CLK"})
_ALTITUDE, _SPEED, _TRACK, _LATITUDE, _LONGITUDE, _RATE = 11, 12, 13, 14, 15, 16
_GROUND: Final = 21
_STAMP: Final = re.compile(r"(\d{4})/(\d{1,2})/(\d{1,2}) (\d{1,2}):(\d{2}):(\d{2})(?:\.(\d{1,6}))?", re.ASCII)
# The last field of which a type makes use.
_LAST_FIELD: Final = {"1": 10, "2": 15, "3": 15, "4": 16, "5": 11, "6": 11, "7": 11, "8": 4}


class Sbs1Reader(LineReader):
    """Makes a report of each position, with the aircraft's altitude and velocity from the 15 s before.

    Times are UTC; lines without date and time have that of their arrival. The offset is how far the receiver's clock is
    ahead of UTC, by its zone.
    """

    def __init__(self, utc_offset_s: float = 0.0) -> None:
        super().__init__()
        self._utc_offset_s = utc_offset_s
        self._held = HeldReports()

    def _events(self, line: str, arrival_s: float | None) -> list[Event]:
        fields = line.strip().split(",")
        if fields[0] != "MSG":
            if fields[0] in OTHER_TYPES:
                return []
            raise Refused("not a BaseStation line")
        kind = fields[1] if len(fields) > 1 else ""
        if kind not in _LAST_FIELD:
            raise Refused("unknown transmission type" if len(fields) >= FIELDS else "incomplete line")
        # The last field of a truncated line may have lost digits; a field followed by another has not.
        if len(fields) < min(FIELDS, _LAST_FIELD[kind] + 2):
            raise Refused("incomplete line")
        if kind in "18":
            return []
        icao, t_s = icao_of(fields[4]), self._time_s(fields, arrival_s)
        if kind in "234":
            self._take_motion(t_s, icao, fields)
        if kind != "4":
            self._take_altitude(t_s, icao, fields)
        return [self._position(t_s, icao, fields)] if kind in "23" else []

    def _position(self, t_s: float, icao: str, fields: list[str]) -> Event:
        latitude_deg, longitude_deg = _number(fields, _LATITUDE), _number(fields, _LONGITUDE)
        if latitude_deg is None or longitude_deg is None:
            raise Refused(NO_POSITION)
        not_null_island(latitude_deg, longitude_deg)
        return self._held.report(t_s, icao, latitude_deg, longitude_deg)

    def _take_altitude(self, t_s: float, icao: str, fields: list[str]) -> None:
        on_ground = len(fields) > _GROUND and fields[_GROUND] not in ("", "0")
        altitude_ft = _number(fields, _ALTITUDE)
        if on_ground or fields[1] == "2":
            self._held.altitude(t_s, icao, None)
        elif altitude_ft is not None:
            self._held.altitude(t_s, icao, altitude_ft)

    def _take_motion(self, t_s: float, icao: str, fields: list[str]) -> None:
        speed_kt, track_deg = _number(fields, _SPEED), _number(fields, _TRACK)
        if speed_kt is None or track_deg is None:
            return
        rate_ft_min = _number(fields, _RATE) if len(fields) > _RATE + 1 else None
        self._held.motion(t_s, icao, speed_kt, track_deg, rate_ft_min or 0.0)

    def _time_s(self, fields: list[str], arrival_s: float | None) -> float:
        stamp = f"{fields[6]} {fields[7]}"
        if stamp == " ":
            if arrival_s is None:
                raise Refused(NO_TIME)
            return arrival_s
        match = _STAMP.fullmatch(stamp)
        if match is None:
            raise Refused("bad date or time")
        *parts, fraction = match.groups("0")
        try:
            seconds = datetime(*map(int, parts), tzinfo=UTC).timestamp()  # type: ignore[misc, arg-type]
        except ValueError:
            raise Refused("bad date or time") from None
        return seconds + float(f"0.{fraction}") - self._utc_offset_s


def _number(fields: list[str], index: int) -> float | None:
    """Return the number of a field, None if it is empty."""
    if not fields[index].strip():
        return None
    try:
        value = float(fields[index])
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise Refused("a field that is no number")
    return value
