# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Snapshots of dump1090 and readsb: ``aircraft.json``, its copies over time, and those of older versions.

Speeds are in kt, altitudes in ft, rates in ft/min. ``alt_baro`` is pressure altitude or "ground"; without it
``alt_geom`` above the ellipsoid is used. Older versions call them ``altitude``, ``speed``, ``vert_rate``.
"""

from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

from viso.documents import parsed_json
from viso.landmarks.inputs.base import (
    LARGEST_S,
    NO_POSITION,
    NO_TIME,
    InputFileError,
    LineReader,
    Refused,
    counted,
    icao_of,
    not_null_island,
    number,
    optional_number,
)
from viso.landmarks.inputs.lines import file_lines
from viso.landmarks.types import AircraftReport, Event

SAME_POSITION_S: Final = 0.25
"""Two snapshots give the time of one position with a difference below this, as they round to 0.1 s."""


class Dump1090Reader(LineReader):
    """Makes a report of each new position in a snapshot, which is read as a whole and may have line ends inside.

    Times are UTC, by ``now`` less the age of the position; snapshots without ``now`` have the time of their arrival.
    """

    def __init__(self, refused: Counter[str] | None = None) -> None:
        super().__init__(refused)
        self._last: dict[str, AircraftReport] = {}

    def _events(self, line: str, arrival_s: float | None) -> list[Event]:
        return self.take_snapshot(json_record(line), arrival_s)

    def take_snapshot(self, snapshot: object, arrival_s: float | None = None) -> list[Event]:
        """Return the reports of a parsed snapshot. Raises Refused if it is invalid."""
        # The first dump1090 sent the list of aircraft alone.
        if isinstance(snapshot, list):
            snapshot = {"aircraft": snapshot}
        rows = snapshot.get("aircraft") if isinstance(snapshot, dict) else None
        if not isinstance(snapshot, dict) or not isinstance(rows, list):
            raise Refused("no list of aircraft")
        now_s = number(snapshot, "now", LARGEST_S) if "now" in snapshot else arrival_s
        if now_s is None:
            raise Refused(NO_TIME)
        events: list[Event] = []
        for row in rows:
            with counted(self.refused):
                report = self._report(row, now_s)
                if self._is_new(report):
                    self._last[report.icao] = report
                    events.append(report)
        return events

    def _is_new(self, report: AircraftReport) -> bool:
        last = self._last.get(report.icao)
        if last is None or report.t_s - last.t_s > SAME_POSITION_S:
            return True
        moved = (report.latitude_deg, report.longitude_deg) != (last.latitude_deg, last.longitude_deg)
        return moved and report.t_s >= last.t_s

    def _report(self, row: object, now_s: float) -> AircraftReport:
        if not isinstance(row, dict):
            raise Refused("an aircraft that is no object")
        icao = icao_of(row.get("hex"))
        if row.get("lat") is None or row.get("lon") is None:
            raise Refused(NO_POSITION)
        latitude_deg, longitude_deg = number(row, "lat"), number(row, "lon")
        not_null_island(latitude_deg, longitude_deg)
        altitude_ft, is_baro = self._altitude(row)
        return AircraftReport(
            now_s - (self._first(row, "seen_pos", "seen") or 0.0),
            icao,
            latitude_deg,
            longitude_deg,
            altitude_ft,
            self._first(row, "gs", "speed") or 0.0,
            self._first(row, "track") or 0.0,
            self._first(row, "baro_rate", "geom_rate", "vert_rate") or 0.0,
            is_baro,
        )

    def _altitude(self, row: Mapping[str, Any]) -> tuple[float | None, bool]:
        for key, is_baro in (("alt_baro", True), ("altitude", True), ("alt_geom", False)):
            if row.get(key) != "ground" and (altitude_ft := optional_number(row, key, self.refused)) is not None:
                return altitude_ft, is_baro
        return None, True

    def _first(self, row: Mapping[str, Any], *keys: str) -> float | None:
        values = (optional_number(row, key, self.refused) for key in keys)
        return next((value for value in values if value is not None), None)


class Dump1090Folder:
    """A folder of snapshots, a file each or one a line, which are taken in the order of their ``now``."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._reader = Dump1090Reader()
        self.refused = self._reader.refused

    def events(self) -> Iterator[Event]:
        """Yield the reports. Raises InputFileError if a file cannot be read, or there are no snapshots."""
        for snapshot in self._snapshots():
            events: list[Event] = []
            with counted(self.refused):
                events = self._reader.take_snapshot(snapshot)
            yield from events

    def _snapshots(self) -> list[Any]:
        files = sorted(self._path.glob("*.json*"))
        snapshots = [snapshot for file in files for snapshot in self._of_file(file) if _is_snapshot(snapshot)]
        if not snapshots:
            raise InputFileError(f"{self._path}: no snapshots of aircraft (*.json)")
        return sorted(snapshots, key=lambda snapshot: float(snapshot["now"]))

    def _of_file(self, path: Path) -> Iterator[Any]:
        lines = list(file_lines(path))
        try:
            yield parsed_json("".join(lines))
        except ValueError:
            for line in filter(str.strip, lines):
                with counted(self.refused):
                    yield json_record(line)


def _is_snapshot(snapshot: Any) -> bool:
    # Its neighbours, receiver.json and stats.json, are not snapshots.
    now = snapshot.get("now") if isinstance(snapshot, dict) else None
    return isinstance(now, int | float) and abs(now) <= LARGEST_S and "aircraft" in snapshot


def json_record(text: str) -> Any:
    """Return the value of a JSON text. Raises Refused if it is invalid."""
    try:
        return parsed_json(text)
    except ValueError:
        raise Refused("not JSON") from None
