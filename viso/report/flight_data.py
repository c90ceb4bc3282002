# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a report takes out of a DataFlash log, of the firmware or of this project."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from ap_core.dataflash_columns import LogColumns
from viso.doctor.evidence.vehicle_data import VehicleData, vehicle_in
from viso.errors import InputError
from viso.estimators.series import Array, Series, number_in, series_of
from viso.firmware.flown import FlownVersion, version_in
from viso.logs.event_names import ERR_EKF_PRIMARY, FlightModes, error_text, event_text
from viso.logs.filter_records import filter_records_in, parameters_in, table_with
from viso.logs.recorded import notes_of_lost, read_columns, records_in
from viso.streams.flight_log import read_flight_log
from viso.streams.stream import Stream

# Labels that older firmware spelled otherwise stand second.
_LABELS: Final[Mapping[str, tuple[tuple[str, ...], ...]]] = MappingProxyType(
    {
        "VISP": tuple(
            (label, *{"R": ("Roll",), "P": ("Pitch",), "Y": ("Yaw",)}.get(label, ()))
            for label in ["RTimeUS", "CTimeMS", "PX", "PY", "PZ", "R", "P", "Y", "PErr", "AErr", "Rst", "Ign", "Q"]
        ),
        "VISV": tuple((label,) for label in ["RTimeUS", "CTimeMS", "VX", "VY", "VZ", "VErr", "Rst", "Ign", "Q"]),
        "VISO": tuple((label,) for label in ["dt", "PosDX", "PosDY", "PosDZ", "AngDX", "AngDY", "AngDZ", "conf"]),
    }
)
_SPOKEN: Final = ("MSG", "EV", "ERR", "MODE", "ARM", "PARM")
_PROGRESS_EVERY: Final = 500


@dataclass(frozen=True, slots=True)
class Happening:
    """A text, a mode, an event or an error in a log.

    Attributes:
        time_s: since boot.
        kind: "text", "event", "error", "mode" or "arming".
        text: what it says.
        number: of an event, a mode (0 and 1 for arming), or the subsystem of an error; -1 of a text.
        code: of an error.
    """

    time_s: float
    kind: str
    text: str
    number: int = -1
    code: int = 0

    @property
    def is_trouble(self) -> bool:
        """Whether an error occurred, rather than ended; a new primary core of the EKF is one whatever its number."""
        return self.kind == "error" and (self.code != 0 or self.number == ERR_EKF_PRIMARY)


@dataclass(frozen=True, slots=True)
class LoggedParameter:
    """A PARM record; ``default`` is NaN where it has none."""

    time_s: float
    name: str
    value: float
    default: float


@dataclass(frozen=True, slots=True)
class Material:
    """What a log holds that a report is made of.

    Attributes:
        name: of the file.
        counts: how many records there are of each kind.
        visp, visv, viso: what external navigation brought.
        xkf1, xkf3, xkf4: what the EKF made of it, of the core shown; EKF2's NKF records in logs of that.
        cores_shown: whose records those are: the primary core's where the log has them, else the first core's.
        unseen_primary_s: for how long the primary core was one whose records the log does not have.
        happenings: texts, events, errors, modes and arming, in order.
        parameters: in the order of the log.
        left_out: how many records had a time that cannot be.
        lost: what the log lost, a line each.
        stream: the messages of external navigation behind the records; empty without any, or if they make no sense.
        vehicle: what the log says about the vehicle and its filter, as the doctor takes it.
    """

    name: str
    counts: Mapping[str, int]
    visp: Series
    visv: Series
    viso: Series
    xkf1: Series
    xkf3: Series
    xkf4: Series
    cores_shown: tuple[int, ...]
    unseen_primary_s: float
    happenings: tuple[Happening, ...]
    parameters: tuple[LoggedParameter, ...]
    left_out: int
    lost: tuple[str, ...]
    stream: Stream
    vehicle: VehicleData

    def parameter(self, name: str) -> float | None:
        """Return the last value of a parameter; None if the log has none."""
        return next((parameter.value for parameter in reversed(self.parameters) if parameter.name == name), None)

    @property
    def flown(self) -> FlownVersion | None:
        """The release that flew, by its own words; None if the log has none."""
        versions = (version_in(happening.text) for happening in self.happenings if happening.kind == "text")
        return next((version for version in versions if version is not None), None)

    @property
    def stamped(self) -> Series:
        """Poses, or velocities where there are none."""
        return self.visp if len(self.visp) else self.visv

    @property
    def vision(self) -> tuple[Series, Series, Series]:
        """The three kinds of records of external navigation."""
        return self.visp, self.visv, self.viso


def read_material(path: Path, on_progress: Callable[[float], None]) -> Material:
    """Read a log (.BIN, packed or not).

    Args:
        path: the log.
        on_progress: is called now and then with how much of it has been read, in percent.

    Raises:
        InputError: if it cannot be read.
    """
    columns = read_columns(path)
    return _material(path, columns, list(_items(columns, on_progress)))


def _stream(path: Path, columns: LogColumns) -> Stream:
    """Return the messages behind the records of external navigation; none where they make no sense."""
    if any(columns.counts.get(kind) for kind in _LABELS):
        with suppress(InputError):
            return read_flight_log(path)
    params: dict[str, float] = {}
    for _, name, value in parameters_in(columns):
        params.setdefault(name, value)
    return Stream(path.name, (), params)


def _taken(record: Any, modes: FlightModes) -> Happening | LoggedParameter | None:
    kind = record.get_type()
    time_us = number_in(record, "TimeUS")
    if not math.isfinite(time_us):
        return None
    if kind != "PARM":
        return _happening(kind, record, time_us * 1e-6, modes)
    name, value = str(getattr(record, "Name", "")), number_in(record, "Value")
    return LoggedParameter(time_us * 1e-6, name, value, number_in(record, "Default"))


def _happening(kind: str, record: Any, time_s: float, modes: FlightModes) -> Happening:
    if kind == "MSG":
        return Happening(time_s, "text", str(getattr(record, "Message", "")))
    if kind == "MODE":
        return Happening(time_s, "mode", modes.name(record), _whole(record, "ModeNum"))
    if kind == "EV":
        number = _whole(record, "Id")
        return Happening(time_s, "event", event_text(number), number)
    if kind == "ERR":
        subsystem, code = _whole(record, "Subsys"), _whole(record, "ECode")
        return Happening(time_s, "error", error_text(subsystem, code), subsystem, code)
    armed = _whole(record, "ArmState")
    return Happening(time_s, "arming", "armed" if armed else "disarmed", armed)


def _whole(record: Any, label: str) -> int:
    value = number_in(record, label)
    return int(value) if math.isfinite(value) else -1


def _items(log: LogColumns, on_progress: Callable[[float], None]) -> Iterator[Happening | LoggedParameter | None]:
    modes = FlightModes()
    kinds = (*_SPOKEN, "VER")
    count = sum(log.counts.get(kind, 0) for kind in kinds)
    for number, record in enumerate(records_in(log, kinds), 1):
        kind = record.get_type()
        if kind in ("MSG", "VER"):
            modes.take(record)
        if kind != "VER":
            yield _taken(record, modes)
        if number % _PROGRESS_EVERY == 0:
            on_progress(100.0 * number / count)


def _material(path: Path, log: LogColumns, items: Sequence[Happening | LoggedParameter | None]) -> Material:
    series, left_out = {}, 0
    for kind, all_labels in _LABELS.items():
        series[kind], lost = series_of(table_with(log, kind, all_labels), [labels[0] for labels in all_labels])
        left_out += lost
    of_filter = filter_records_in(log)
    return Material(
        name=path.name,
        counts=dict(sorted(log.counts.items())),
        visp=series["VISP"],
        visv=series["VISV"],
        viso=series["VISO"],
        xkf1=of_filter.state,
        xkf3=of_filter.innovations,
        xkf4=of_filter.status,
        cores_shown=of_filter.cores_shown,
        unseen_primary_s=of_filter.unseen_primary_s,
        happenings=tuple(sorted((item for item in items if isinstance(item, Happening)), key=lambda item: item.time_s)),
        parameters=tuple(item for item in items if isinstance(item, LoggedParameter)),
        left_out=left_out + of_filter.left_out,
        lost=tuple(notes_of_lost(log)),
        stream=_stream(path, log),
        vehicle=vehicle_in(path, log),
    )


_LEAST_MOVE_M: Final = 0.05
"""A smaller move is less than the noise of a position."""


def position_moves(xkf4: Series) -> tuple[Array, Array]:
    """Return when the EKF moved its position at once, in s [N], and by how much, m north and east [N, 2]."""
    moved, core = xkf4.matrix("OFN", "OFE"), np.nan_to_num(xkf4["C"])
    changed = np.isfinite(moved[1:]).all(axis=1) & (moved[1:] != moved[:-1]).any(axis=1) & (core[1:] == core[:-1])
    changed &= np.linalg.norm(moved[1:], axis=1) >= _LEAST_MOVE_M
    at = np.flatnonzero(changed) + 1
    return xkf4.time_s[at], moved[at]
