# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the vehicle's own estimate moved at once, and where its origin and its GPS were."""

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from ap_core.dataflash_columns import LogColumns
from mav_handlers.wire.messages import GPS_GLOBAL_ORIGIN, GPS_RAW_INT, LOCAL_POSITION_NED, Message
from viso.doctor.evidence.tracks import Floats, Ints
from viso.logs.filter_records import FilterRecords, rows_of
from viso.logs.recorded import first_origin

MOVED_M: Final = 0.5
"""A smaller step of a position is no move: a correction by samples is spread over several records."""
TURNED_DEG: Final = 10.0
"""A smaller step of the yaw is a correction."""
_ACCELERATION_M_S2: Final = 15.0
_TURN_DEG_S: Final = 360.0
_LONGEST_STEP_S: Final = 0.6
_FIX_3D: Final = 3
_M_OF_DEGREE: Final = 111_318.845
_AT_FIX_M: Final = 1.0
_NEAR_US: Final = 2_000_000


@dataclass(frozen=True, slots=True)
class Move:
    """A step of the estimate that no motion explains: the last record before it and the first one after it.

    Attributes:
        before_us, after_us: their times, us since boot.
        before, after: north, east and down in m, yaw in deg; NaN where it is not recorded.
        level_m, down_m, yaw_deg: the step without what velocity explains.
    """

    before_us: int
    after_us: int
    before: tuple[float, float, float, float]
    after: tuple[float, float, float, float]
    level_m: float
    down_m: float
    yaw_deg: float


@dataclass(frozen=True, slots=True)
class Origin:
    """The first origin of the estimate: when it was heard or logged, its place, and whether a fix was there."""

    time_us: int
    lat_deg: float
    lng_deg: float
    alt_m: float
    is_of_gps: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Fixes:
    """The 3D fixes of a GPS: N times, N x 2 latitude and longitude, N accuracies in m (NaN unknown)."""

    time_us: Ints
    place_deg: Floats
    accuracy_m: Floats

    def __len__(self) -> int:
        return len(self.time_us)


NO_FIXES: Final = Fixes(np.zeros(0, np.int64), np.zeros((0, 2)), np.zeros(0))


def moves_of(time_us: Ints, ned_m: Floats, velocity: Floats, yaw_deg: Floats) -> tuple[Move, ...]:
    """Return the moves in N records of an estimate: N x 3 positions and velocities, N yaws."""
    dt = np.diff(time_us) * 1e-6
    usable = (dt > 0) & (dt <= _LONGEST_STEP_S)
    off = np.diff(ned_m, axis=0) - 0.5 * (velocity[1:] + velocity[:-1]) * dt[:, None]
    allowed = MOVED_M + 0.5 * _ACCELERATION_M_S2 * dt**2
    level, down = np.linalg.norm(off[:, :2], axis=1), off[:, 2]
    turn = (np.diff(yaw_deg) + 180.0) % 360.0 - 180.0
    before = np.concatenate([turn[:1], turn[:-1]]) if len(turn) else turn
    turned = np.minimum(np.abs(turn), np.abs(turn - before))
    found = usable & ((level > allowed) | (np.abs(down) > allowed) | (turned > TURNED_DEG + 0.5 * _TURN_DEG_S * dt**2))
    table = np.column_stack([ned_m, yaw_deg]).tolist()
    return tuple(
        Move(
            int(time_us[at]),
            int(time_us[at + 1]),
            tuple(table[at]),
            tuple(table[at + 1]),
            float(level[at]),
            float(down[at]),
            float(turn[at]),
        )
        for at in np.flatnonzero(found).tolist()
    )


def moves_in(records: FilterRecords) -> tuple[Move, ...]:
    """Return the moves of the core that a logged vehicle flew with."""
    state = records.state
    if len(state) < 2:
        return ()
    core = np.nan_to_num(state["C"])
    moves = moves_of(
        np.asarray(np.rint(state.time_s * 1e6), dtype=np.int64),
        state.matrix("PN", "PE", "PD"),
        np.nan_to_num(state.matrix("VN", "VE", "VD")),
        state["Yaw"],
    )
    changed_us = set(np.rint(state.time_s[1:][core[1:] != core[:-1]] * 1e6).astype(np.int64).tolist())
    return tuple(move for move in moves if move.after_us not in changed_us)


def fixes_in(log: LogColumns) -> Fixes:
    """Return the fixes in a log."""
    rows = [row for row in rows_of(log, "GPS", "Status", "Lat", "Lng") if row[1] >= _FIX_3D]
    if not rows:
        return NO_FIXES
    table = np.array(rows, dtype=np.float64)
    accuracy = np.array(list(rows_of(log, "GPA", "HAcc")), dtype=np.float64).reshape(-1, 2)
    latest = np.searchsorted(accuracy[:, 0], table[:, 0], side="right")
    known = np.concatenate([[np.nan], accuracy[:, 1]])[latest]
    return Fixes(table[:, 0].astype(np.int64), table[:, 2:4], known)


def origin_in(log: LogColumns, fixes: Fixes) -> Origin | None:
    """Return the first origin of the EKF in a log."""
    if (origin := first_origin(log)) is None:
        return None
    time_us, lat_deg, lng_deg, alt_m = origin
    return _origin(int(time_us), lat_deg, lng_deg, alt_m, fixes)


def odometry_in(log: LogColumns) -> Floats:
    """Return N x 2, time in us and size of the innovation in m/s, of the deltas that a logged filter used (XKFD)."""
    rows = [
        (time_us, math.hypot(x, y, z))
        for time_us, core, x, y, z in rows_of(log, "XKFD", "C", "IX", "IY", "IZ")
        if not core
    ]
    return np.array(rows, dtype=np.float64).reshape(-1, 2)


def _origin(time_us: int, lat: float, lng: float, alt: float, fixes: Fixes) -> Origin:
    near = np.abs(fixes.time_us - time_us) < _NEAR_US
    apart = (fixes.place_deg[near] - (lat, lng)) * (_M_OF_DEGREE, _M_OF_DEGREE * math.cos(math.radians(lat)))
    return Origin(time_us, lat, lng, alt, bool((np.linalg.norm(apart, axis=1) < _AT_FIX_M).any()))


class EstimateListener:
    """Collects what one autopilot reports of its position, its origin and its GPS."""

    MESSAGES: Final = ("LOCAL_POSITION_NED", "GPS_RAW_INT", "GPS_GLOBAL_ORIGIN")

    def __init__(self) -> None:
        self._rows: list[tuple[int, float, float, float, float, float, float, float]] = []
        self._fixes: list[tuple[int, float, float, float]] = []
        self._origin: tuple[int, float, float, float] | None = None

    def take(self, time_us: int, message: Message | None) -> None:
        """Take a message that came at a time in us since boot."""
        if isinstance(message, LOCAL_POSITION_NED):
            m = message
            self._rows.append((m.time_boot_ms * 1000, m.x, m.y, m.z, m.vx, m.vy, m.vz, time_us))
        elif isinstance(message, GPS_RAW_INT) and message.fix_type >= _FIX_3D:
            accuracy = message.h_acc * 1e-3 if message.h_acc else math.nan
            self._fixes.append((time_us, message.lat * 1e-7, message.lon * 1e-7, accuracy))
        elif isinstance(message, GPS_GLOBAL_ORIGIN) and self._origin is None:
            place = message.latitude * 1e-7, message.longitude * 1e-7, message.altitude * 1e-3
            self._origin = (time_us, *place)

    @property
    def fixes(self) -> Fixes:
        """The fixes that were heard."""
        if not self._fixes:
            return NO_FIXES
        table = np.array(self._fixes, dtype=np.float64)
        return Fixes(table[:, 0].astype(np.int64), table[:, 1:3], table[:, 3])

    @property
    def origin(self) -> Origin | None:
        """The first origin that was heard."""
        return None if self._origin is None else _origin(*self._origin, self.fixes)

    @property
    def moves(self) -> tuple[Move, ...]:
        """The moves of the position that was heard; its yaw is not compared."""
        if len(self._rows) < 2:
            return ()
        table = np.array(self._rows, dtype=np.float64)
        table = table[np.isfinite(table).all(axis=1)]
        by_boot = moves_of(table[:, 0].astype(np.int64), table[:, 1:4], table[:, 4:7], np.full(len(table), np.nan))
        arrived_us = dict(
            zip(table[:, 0].astype(np.int64).tolist(), table[:, 7].astype(np.int64).tolist(), strict=True)
        )
        return tuple(_at_arrival(move, arrived_us) for move in by_boot)


def _at_arrival(move: Move, arrived_us: dict[int, int]) -> Move:
    return replace(move, before_us=arrived_us[move.before_us], after_us=arrived_us[move.after_us])
