# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The vehicle's position and height, from sources that do not navigate by the stream itself.

A position that the autopilot's filter computed from the stream agrees with the stream in any case. So only these count:
a simulator's truth, a GPS's own fixes, a barometer, or a filter that takes nothing from external navigation.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from ap_core.dataflash_columns import LogColumns
from ekf_stub.ahrs.sources import EXTNAV, SETS
from mav_handlers.wire.messages import (
    EKF_STATUS_REPORT,
    GLOBAL_POSITION_INT,
    GPS_RAW_INT,
    HEARTBEAT,
    LOCAL_POSITION_NED,
    SCALED_PRESSURE,
    SIM_STATE,
    SIMSTATE,
    VFR_HUD,
    Message,
)
from viso.doctor.evidence.tracks import Bools, Floats, Ints, timed
from viso.logs.filter_records import parameters_in
from viso.logs.recorded import table_of

SOURCE_SETS: Final = range(1, SETS + 1)
"""The numbers of the sets of sources, as in the names of parameters."""

EKF3: Final = 3
_FEWEST: Final = 20
_FIX_3D: Final = 3
_LATLON_TO_M: Final = 0.011131884502145034  # of a 1e-7 degree of latitude, as in AP_Common/Location.h
_CORE: Final = 0
_OF_PATH: Final = ("POSXY", "VELXY", "POSZ", "VELZ")
_OF_HEIGHT: Final = ("POSZ", "VELZ")
_SOURCES: Final = tuple(f"EK3_SRC{number}_{name}" for number in SOURCE_SETS for name in (*_OF_PATH, "YAW"))
# Of XKF4.SS and EKF_STATUS_REPORT.flags.
_HORIZONTAL: Final = 1 << 3 | 1 << 4
_CONSTANT: Final = 1 << 7
_NOISE_M: Final[Mapping[str, float]] = {
    "SIM": 0.05,
    "SIM_STATE": 0.05,
    "SIMSTATE": 0.05,
    "GPS": 1.5,
    "GPS_RAW_INT": 1.5,
}
_FILTER_NOISE_M: Final = 0.5
_MM: Final = 1e-3
MAV_TYPE_SUBMARINE: Final = 12  # MAV_TYPE: its first barometer is inside the hull
_SIMULATED_M: Final = 0.05
_BARO_M: Final = 1.5
Place = tuple[float, float, float, float]
"""us, north or latitude, east or longitude, down or altitude."""


@dataclass(frozen=True, slots=True, eq=False)
class PositionSeries:
    """The vehicle's position over time.

    Attributes:
        origin: the record or message, such as GPS_RAW_INT.
        time_us: N, us since boot.
        ned_m: N x 3, from an arbitrary origin; NaN for down where it is not known.
        noise_m: how much it wanders while the vehicle stands.
    """

    origin: str
    time_us: Ints
    ned_m: Floats
    noise_m: float = _FILTER_NOISE_M


@dataclass(frozen=True, slots=True, eq=False)
class LevelSeries:
    """The vehicle's height over time, from a source other than the stream.

    Attributes:
        origin: the record or message, such as BARO.
        time_us: N, us since boot.
        down_m: N, from an arbitrary origin.
        noise_m: how much it wanders while the vehicle keeps its height.
    """

    origin: str
    time_us: Ints
    down_m: Floats
    noise_m: float


def ned_of_degrees(places: Floats) -> Floats:
    """Return N x 3 m north, east and down of the first row, from N x 3 latitude and longitude in deg, altitude in m."""
    first = places[0]
    scale = _LATLON_TO_M * 1e7
    north, east = (places[:, :2] - first[:2]).T * scale
    return np.column_stack((north, east * np.cos(np.radians(first[0])), first[2] - places[:, 2]))


def sources_of(values: Iterable[tuple[str, float]]) -> dict[str, float]:
    """Return parameters by name, from values in the order of time; a source that was the stream once remains so."""
    params: dict[str, float] = {}
    for name, value in values:
        if params.get(name) != EXTNAV or name not in _SOURCES:
            params[name] = value
    return params


def is_independent(
    params: Mapping[str, float], names: Sequence[str] = _OF_PATH, sets: Iterable[int] = SOURCE_SETS
) -> bool:
    """Return whether, in some source sets, external navigation is known to be none of the named sources."""
    used = [params.get(f"EK3_SRC{number}_{name}") for number in sets for name in names]
    return "EK3_SRC1_POSXY" in params and EXTNAV not in used


def follows_yaw(params: Mapping[str, float]) -> bool:
    """Return whether the autopilot's yaw may come from external navigation."""
    by_filter = params.get("AHRS_EKF_TYPE", EKF3) == EKF3
    return by_filter and any(params.get(f"EK3_SRC{number}_YAW") == EXTNAV for number in SOURCE_SETS)


class PositionListener:
    """Collects what one autopilot reports about its position and height."""

    MESSAGES: Final = (
        "GPS_RAW_INT",
        "GLOBAL_POSITION_INT",
        "LOCAL_POSITION_NED",
        "EKF_STATUS_REPORT",
        "SIM_STATE",
        "SIMSTATE",
        "HEARTBEAT",
        "SCALED_PRESSURE",
        "VFR_HUD",
    )

    def __init__(self) -> None:
        self._places: dict[str, list[Place]] = {name: [] for name in _PLACES}
        self._levels: dict[str, list[tuple[float, float]]] = {"SIM_STATE": [], "SCALED_PRESSURE": [], "VFR_HUD": []}
        self._accuracy_m: list[float] = []
        self._navigates, self._is_in_air = True, True

    def take(self, time_us: int, message: Message | None) -> None:
        """Take a message that came at a time in us since boot."""
        if isinstance(message, GPS_RAW_INT) and message.fix_type >= _FIX_3D:
            self._add("GPS_RAW_INT", time_us, message.lat * 1e-7, message.lon * 1e-7, message.alt * 1e-3)
            if message.h_acc:
                self._accuracy_m.append(message.h_acc * _MM)
        elif isinstance(message, GLOBAL_POSITION_INT) and self._navigates:
            self._add("GLOBAL_POSITION_INT", time_us, message.lat * 1e-7, message.lon * 1e-7, message.alt * 1e-3)
        elif isinstance(message, LOCAL_POSITION_NED) and self._navigates:
            self._add("LOCAL_POSITION_NED", time_us, message.x, message.y, message.z)
        elif isinstance(message, EKF_STATUS_REPORT):
            self._navigates = bool(message.flags & _HORIZONTAL) and not message.flags & _CONSTANT
        elif isinstance(message, SIM_STATE):
            exact = message.lat_int or message.lon_int
            place = (message.lat_int * 1e-7, message.lon_int * 1e-7) if exact else (message.lat, message.lon)
            self._add("SIM_STATE", time_us, *place, message.alt)
            self._levels["SIM_STATE"].append((time_us, -message.alt))
        elif isinstance(message, SIMSTATE):
            self._add("SIMSTATE", time_us, message.lat * 1e-7, message.lng * 1e-7, np.nan)
        elif isinstance(message, HEARTBEAT):
            self._is_in_air = message.type != MAV_TYPE_SUBMARINE
        elif isinstance(message, SCALED_PRESSURE) and self._is_in_air:
            self._levels["SCALED_PRESSURE"].append((time_us, message.press_abs))
        elif isinstance(message, VFR_HUD):
            self._levels["VFR_HUD"].append((time_us, -message.alt))

    def _add(self, name: str, time_us: int, *place: float) -> None:
        north, east, down = place
        self._places[name].append((float(time_us), north, east, down))

    def position(self, params: Mapping[str, float]) -> PositionSeries | None:
        """Return the best position that, by the parameters, does not depend on the stream; None if there is none."""
        accuracy_m = float(np.median(self._accuracy_m)) if self._accuracy_m else 0.0
        return _best(self._places, params, accuracy_m)

    def level(self, params: Mapping[str, float]) -> LevelSeries | None:
        """Return the best height that does not depend on the stream; None if there is none."""
        levels = {name: np.array(rows, np.float64).reshape(-1, 2) for name, rows in self._levels.items()}
        pressure = levels["SCALED_PRESSURE"]
        pressure = pressure[pressure[:, 1] > 0]
        if len(pressure):
            pressure[:, 1] = -_STANDARD_M * (1 - (pressure[:, 1] / pressure[0, 1]) ** _STANDARD_POWER)
        return _best_level({**levels, "SCALED_PRESSURE": pressure}, params)


_PLACES: Final = ("SIM_STATE", "SIMSTATE", "GPS_RAW_INT", "GLOBAL_POSITION_INT", "LOCAL_POSITION_NED")
# Of the standard atmosphere: height by a share of the pressure below.
_STANDARD_M: Final = 44330.0
_STANDARD_POWER: Final = 0.1903
_PRIMARY: Final[Mapping[str, tuple[str, ...]]] = {
    "BARO": ("BARO_PRIMARY", "GND_PRIMARY"),
    "GPS": ("GPS_PRIMARY",),
    "GPA": ("GPS_PRIMARY",),
}
_LOCAL: Final = frozenset({"LOCAL_POSITION_NED", "XKF1"})
_FILTERED: Final = frozenset({"GLOBAL_POSITION_INT", "LOCAL_POSITION_NED", "POS"})
_FILTERED_LEVELS: Final = frozenset({"VFR_HUD", "XKF1"})


def _best(
    places: Mapping[str, Sequence[Place] | Floats], params: Mapping[str, float], accuracy_m: float = 0.0
) -> PositionSeries | None:
    """Return the first series that counts: those of ``_FILTERED`` only if the filter is independent of the stream."""
    for name, rows in places.items():
        if len(rows) < _FEWEST or (name in _FILTERED and not is_independent(params)):
            continue
        table = np.array(rows, dtype=np.float64)
        table = timed(table[np.isfinite(table[:, :3]).all(axis=1)])
        if name not in _LOCAL:  # of latitude and longitude 0 nothing is known yet
            table = table[np.any(table[:, 1:3] != 0, axis=1)]
        if len(table) < _FEWEST:
            continue
        ned_m = table[:, 1:] if name in _LOCAL else ned_of_degrees(table[:, 1:])
        noise_m = _NOISE_M.get(name, _FILTER_NOISE_M)
        if name.startswith("GPS"):
            noise_m = max(noise_m, accuracy_m)
        return PositionSeries(name, table[:, 0].astype(np.int64), ned_m, noise_m)
    return None


def _best_level(levels: Mapping[str, Floats], params: Mapping[str, float]) -> LevelSeries | None:
    for name, table in levels.items():
        kept = timed(table[np.isfinite(table).all(axis=1)])
        if len(kept) < _FEWEST or (name in _FILTERED_LEVELS and not is_independent(params, _OF_HEIGHT)):
            continue
        noise_m = _SIMULATED_M if name.startswith("SIM") else _BARO_M
        return LevelSeries(name, kept[:, 0].astype(np.int64), kept[:, 1], noise_m)
    return None


def _places(log: LogColumns, kind: str, labels: Sequence[str], only: tuple[str, Callable[[Any], Any]] | None) -> Floats:
    """Return times and fields of the records of a type whose field passes a test; none if a field is missing."""
    wanted = ("TimeUS", *labels) if only is None else ("TimeUS", *labels, only[0])
    layout = log.types.get(kind)
    if layout is None or not set(wanted) <= set(layout.labels):
        return np.zeros((0, 1 + len(labels)))
    table = table_of(log, kind, wanted)
    chosen = _is_primary(log, kind, len(table)) & (True if only is None else only[1](table[:, -1]))
    return np.asarray(table[chosen][:, : 1 + len(labels)], dtype=np.float64)


def _is_primary(log: LogColumns, kind: str, count: int) -> Bools:
    """Return which records of a type are of the primary sensor, by its field I if it has one."""
    if not count or "I" not in log.types[kind].labels:
        return np.ones(count, dtype=np.bool_)
    number = log.columns(kind, ["I"])["I"]
    chosen = next((value for _, name, value in parameters_in(log) if name in _PRIMARY.get(kind, ())), number.min())
    return np.asarray(number == (chosen if chosen in number else number.min()), dtype=np.bool_)


def _filter_places(log: LogColumns, params: Mapping[str, float]) -> Floats:
    """Return times and positions of the first core while it navigated by other sources than the stream."""
    table = _places(log, "XKF1", ("PN", "PE", "PD"), ("C", lambda core: core == _CORE))
    if not len(table):
        return table
    flags = _at(_states(log, "XKF4"), table[:, 0])
    navigates = (flags & _HORIZONTAL != 0) & (flags & _CONSTANT == 0)
    sets = _states(log, "XKFS")
    independent = [number for number in SOURCE_SETS if is_independent(params, sets=(number,))]
    if len(sets):
        navigates &= np.isin(_at(sets, table[:, 0]) + 1, independent)
    elif len(independent) < len(SOURCE_SETS):
        return table[:0]
    return np.asarray(table[navigates], dtype=np.float64)


def _states(log: LogColumns, kind: str) -> Floats:
    return _places(log, kind, ("SS",), ("C", lambda core: core == _CORE))


def _at(states: Floats, time_us: Floats) -> Ints:
    """Return the latest state at some times; 0 before the first."""
    latest = np.searchsorted(states[:, 0], time_us, side="right")
    return np.asarray(np.concatenate([[0], states[:, 1]])[latest], dtype=np.int64)


def position_in(log: LogColumns) -> PositionSeries | None:
    """Return the position in a log: by SIM, GPS, or XKF1 and POS if the parameters allow it."""
    of_earth = "Lat", "Lng", "Alt"
    params = params_in(log)
    accuracy = _places(log, "GPA", ("HAcc",), None)[:, 1]
    places = {
        "SIM": _places(log, "SIM", of_earth, None),
        "GPS": _places(log, "GPS", of_earth, ("Status", lambda status: status >= _FIX_3D)),
        "XKF1": _filter_places(log, params),
        "POS": _places(log, "POS", of_earth, None) if not log.counts.get("XKF4") else np.zeros((0, 4)),
    }
    return _best(places, params, float(np.median(accuracy)) if len(accuracy) else 0.0)


def level_in(log: LogColumns) -> LevelSeries | None:
    """Return the height in a log: by a simulator's truth, a barometer, or a filter that does not use the stream."""
    levels = {
        "SIM": _places(log, "SIM", ("Alt",), None),
        "BARO": _places(log, "BARO", ("Alt",), None),
    }
    for table in levels.values():
        table[:, 1] *= -1
    levels["XKF1"] = _places(log, "XKF1", ("PD",), ("C", lambda core: core == _CORE))
    return _best_level(levels, params_in(log))


def truth_in(log: LogColumns) -> Floats | None:
    """Return time, roll, pitch and yaw in degrees, N x 4, by a simulator; None for a log of a real flight."""
    truth = timed(_places(log, "SIM", ("Roll", "Pitch", "Yaw"), None))
    return truth if len(truth) >= _FEWEST else None


def params_in(log: LogColumns) -> dict[str, float]:
    """Return the parameters of a log; a source that was the stream once remains so."""
    return sources_of((name, value) for _, name, value in parameters_in(log))
