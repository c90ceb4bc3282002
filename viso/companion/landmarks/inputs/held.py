# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What an aircraft tells piece by piece: each report of a position takes along what is still fresh of the rest."""

from dataclasses import dataclass
from typing import Final

from viso.companion.landmarks.types import AircraftReport

HELD_S: Final = 15.0
"""An altitude or velocity older than this says nothing of a position any more."""


@dataclass(slots=True)
class _Aircraft:
    altitude_s: float = float("-inf")
    altitude_ft: float | None = None
    is_baro: bool = True
    motion_s: float = float("-inf")
    speed_kt: float = 0.0
    heading_deg: float = 0.0
    vertical_rate_ft_min: float = 0.0
    heard_s: float = float("-inf")


class HeldReports:
    """The last altitude and motion of every aircraft that was heard of lately."""

    def __init__(self) -> None:
        self._aircraft: dict[str, _Aircraft] = {}

    def altitude(self, t_s: float, icao: str, altitude_ft: float | None, *, is_baro: bool = True) -> None:
        """Take an altitude; None for an aircraft on the ground, or one that does not know."""
        aircraft = self._of(t_s, icao)
        aircraft.altitude_s, aircraft.altitude_ft, aircraft.is_baro = t_s, altitude_ft, is_baro

    def motion(self, t_s: float, icao: str, speed_kt: float, heading_deg: float, vertical_rate_ft_min: float) -> None:
        """Take a velocity."""
        aircraft = self._of(t_s, icao)
        aircraft.motion_s, aircraft.speed_kt, aircraft.heading_deg = t_s, speed_kt, heading_deg
        aircraft.vertical_rate_ft_min = vertical_rate_ft_min

    def report(self, t_s: float, icao: str, latitude_deg: float, longitude_deg: float) -> AircraftReport:
        """Return the report of a position. Raises ValueError as that does."""
        aircraft = self._of(t_s, icao)
        fresh = abs(t_s - aircraft.altitude_s) <= HELD_S
        moves = abs(t_s - aircraft.motion_s) <= HELD_S
        return AircraftReport(
            t_s,
            icao,
            latitude_deg,
            longitude_deg,
            aircraft.altitude_ft if fresh else None,
            aircraft.speed_kt if moves else 0.0,
            aircraft.heading_deg if moves else 0.0,
            aircraft.vertical_rate_ft_min if moves else 0.0,
            aircraft.is_baro if fresh else True,
        )

    def _of(self, t_s: float, icao: str) -> _Aircraft:
        if icao not in self._aircraft:
            self._aircraft = {k: v for k, v in self._aircraft.items() if abs(t_s - v.heard_s) <= HELD_S}
            self._aircraft[icao] = _Aircraft()
        aircraft = self._aircraft[icao]
        aircraft.heard_s = t_s
        return aircraft
