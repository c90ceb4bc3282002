# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the vehicle was, by something that does not navigate by the stream itself.

A position that the autopilot's filter made of the stream agrees with it whatever the stream says, and proves nothing:
only a GPS's own fixes, a simulator's truth, or a filter that takes nothing from external navigation count.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from ap_core.dataflash_columns import LogColumns
from mav_handlers.wire.messages import GLOBAL_POSITION_INT, GPS_RAW_INT, LOCAL_POSITION_NED, Message
from viso.doctor.measures.tracks import Floats, Ints
from viso.logs.filter_records import parameters_in
from viso.logs.recorded import table_of

EXTNAV: Final = 6
_FEWEST: Final = 20
_FIX_3D: Final = 3
_LATLON_TO_M: Final = 0.011131884502145034  # of a 1e-7 degree of latitude, as in AP_Common/Location.h
_CORE: Final = 0
_SOURCES: Final = tuple(
    f"EK3_SRC{number}_{name}" for number in (1, 2, 3) for name in ("POSXY", "VELXY", "POSZ", "VELZ")
)
Place = tuple[float, float, float, float]
"""us, north or latitude, east or longitude, down or altitude."""


@dataclass(frozen=True, slots=True, eq=False)
class PositionSeries:
    """The vehicle's place over time.

    Attributes:
        origin: what tells it, such as GPS_RAW_INT.
        time_us: N, us since boot.
        ned_m: N x 3, from wherever it counts.
    """

    origin: str
    time_us: Ints
    ned_m: Floats


def ned_of_degrees(places: Floats) -> Floats:
    """Return N x 3 m north, east and down of the first, of latitude and longitude in degrees and altitude in m."""
    first = places[0]
    scale = _LATLON_TO_M * 1e7
    north, east = (places[:, :2] - first[:2]).T * scale
    return np.column_stack((north, east * np.cos(np.radians(first[0])), first[2] - places[:, 2]))


def sources_of(values: Iterable[tuple[str, float]]) -> dict[str, float]:
    """Return parameters by name, of values in the order of time; a source that was the stream once remains so."""
    params: dict[str, float] = {}
    for name, value in values:
        if params.get(name) != EXTNAV or name not in _SOURCES:
            params[name] = value
    return params


def is_independent(params: Mapping[str, float]) -> bool:
    """Tell whether the filter's position is known to take nothing from external navigation."""
    return "EK3_SRC1_POSXY" in params and all(params.get(name) != EXTNAV for name in _SOURCES)


class PositionListener:
    """Collects what one autopilot's messages say of its place."""

    def __init__(self) -> None:
        self._places: dict[str, list[Place]] = {"GPS_RAW_INT": [], "GLOBAL_POSITION_INT": [], "LOCAL_POSITION_NED": []}

    def take(self, time_us: int, message: Message | None) -> None:
        """Take a message that came at a time in us since boot."""
        if isinstance(message, GPS_RAW_INT) and message.fix_type >= _FIX_3D:
            self._add("GPS_RAW_INT", time_us, message.lat * 1e-7, message.lon * 1e-7, message.alt * 1e-3)
        elif isinstance(message, GLOBAL_POSITION_INT):
            self._add("GLOBAL_POSITION_INT", time_us, message.lat * 1e-7, message.lon * 1e-7, message.alt * 1e-3)
        elif isinstance(message, LOCAL_POSITION_NED):
            self._add("LOCAL_POSITION_NED", time_us, message.x, message.y, message.z)

    def _add(self, name: str, time_us: int, *place: float) -> None:
        north, east, down = place
        self._places[name].append((float(time_us), north, east, down))

    def told(self, params: Mapping[str, float]) -> PositionSeries | None:
        """Return the best that does not depend on the stream, by the autopilot's parameters; None if nothing is."""
        return _best(self._places, params)


def _best(places: Mapping[str, Sequence[Place] | Floats], params: Mapping[str, float]) -> PositionSeries | None:
    """Return the first series that counts: those of ``_FILTERED`` only if the filter is independent of the stream."""
    for name, rows in places.items():
        if len(rows) < _FEWEST or (name in _FILTERED and not is_independent(params)):
            continue
        table = np.array(rows, dtype=np.float64)
        table = table[np.isfinite(table).all(axis=1)]
        if len(table) < _FEWEST:
            continue
        ned_m = table[:, 1:] if name in _LOCAL else ned_of_degrees(table[:, 1:])
        return PositionSeries(name, table[:, 0].astype(np.int64), ned_m)
    return None


_LOCAL: Final = frozenset({"LOCAL_POSITION_NED", "XKF1"})
_FILTERED: Final = frozenset({"GLOBAL_POSITION_INT", "LOCAL_POSITION_NED", "POS", "XKF1"})


def _places(log: LogColumns, kind: str, labels: Sequence[str], only: tuple[str, Callable[[Any], Any]] | None) -> Floats:
    """Return time and place of the records of a type, those only whose field passes a test; none without all fields."""
    wanted = ("TimeUS", *labels) if only is None else ("TimeUS", *labels, only[0])
    layout = log.types.get(kind)
    if layout is None or not set(wanted) <= set(layout.labels):
        return np.zeros((0, 4))
    table = table_of(log, kind, wanted)
    return table[:, :4] if only is None else table[only[1](table[:, 4])][:, :4]


def position_in(log: LogColumns) -> PositionSeries | None:
    """Return where a log says that the vehicle was: SIM, GPS, or POS and XKF1 if its parameters allow it."""
    of_earth = "Lat", "Lng", "Alt"
    places = {
        "SIM": _places(log, "SIM", of_earth, None),
        "GPS": _places(log, "GPS", of_earth, ("Status", lambda status: status >= _FIX_3D)),
        "POS": _places(log, "POS", of_earth, None),
        "XKF1": _places(log, "XKF1", ("PN", "PE", "PD"), ("C", lambda core: core == _CORE)),
    }
    return _best(places, sources_of((name, value) for _, name, value in parameters_in(log)))
