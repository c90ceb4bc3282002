# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Aircraft reports from separate messages: each position is combined with the still fresh altitude and velocity."""

import math
from dataclasses import dataclass
from typing import Final

from viso.landmarks.types import AircraftReport

HELD_S: Final = 15.0
"""An altitude or velocity older than this is not combined with a position."""
_UNTOLD: Final = (0.0, 0.0, 0.0)  # speed, heading and vertical rate


@dataclass(slots=True)
class _Aircraft:
    """When it was heard of, and since when it has told which altitude (in ft, barometric or not) and which motion."""

    heard_s: float = -math.inf
    altitude: tuple[float, float | None, bool] = (-math.inf, None, True)
    motion: tuple[float, tuple[float, float, float]] = (-math.inf, _UNTOLD)


class HeldReports:
    """The last altitude and motion of every recently heard aircraft."""

    def __init__(self) -> None:
        self._aircraft: dict[str, _Aircraft] = {}

    def altitude(self, t_s: float, icao: str, altitude_ft: float | None, *, is_baro: bool = True) -> None:
        """Store an altitude; None for an aircraft on the ground, or if unknown."""
        self._of(t_s, icao).altitude = t_s, altitude_ft, is_baro

    def motion(self, t_s: float, icao: str, speed_kt: float, heading_deg: float, vertical_rate_ft_min: float) -> None:
        """Store a velocity."""
        self._of(t_s, icao).motion = t_s, (speed_kt, heading_deg, vertical_rate_ft_min)

    def report(self, t_s: float, icao: str, latitude_deg: float, longitude_deg: float) -> AircraftReport:
        """Return the report of a position. Raises ValueError as that does."""
        aircraft = self._of(t_s, icao)
        altitude_s, altitude_ft, is_baro = aircraft.altitude
        motion_s, motion = aircraft.motion
        if abs(t_s - altitude_s) > HELD_S:
            altitude_ft, is_baro = None, True
        if abs(t_s - motion_s) > HELD_S:
            motion = _UNTOLD
        return AircraftReport(t_s, icao, latitude_deg, longitude_deg, altitude_ft, *motion, is_baro)

    def _of(self, t_s: float, icao: str) -> _Aircraft:
        if icao not in self._aircraft:
            self._aircraft = {k: v for k, v in self._aircraft.items() if abs(t_s - v.heard_s) <= HELD_S}
            self._aircraft[icao] = _Aircraft()
        aircraft = self._aircraft[icao]
        aircraft.heard_s = t_s
        return aircraft
