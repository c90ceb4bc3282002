# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a report takes out of a DataFlash log, of the firmware or of this project."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from ap_core.dataflash_columns import LogColumns
from viso.estimators.series import Array, Series, number_in, numbers_of, series_of
from viso.logs.event_names import ERR_EKF_PRIMARY, EV_ARMED, EV_DISARMED, error_text, event_text
from viso.logs.recorded import read_columns, read_kinds

# Labels that older firmware spelled otherwise stand second.
_LABELS: Final[Mapping[str, tuple[tuple[str, ...], ...]]] = MappingProxyType(
    {
        "VISP": tuple(
            (label, *{"R": ("Roll",), "P": ("Pitch",), "Y": ("Yaw",)}.get(label, ()))
            for label in ["RTimeUS", "CTimeMS", "PX", "PY", "PZ", "R", "P", "Y", "PErr", "AErr", "Rst", "Ign", "Q"]
        ),
        "VISV": tuple((label,) for label in ["RTimeUS", "CTimeMS", "VX", "VY", "VZ", "VErr", "Rst", "Ign", "Q"]),
        "VISO": tuple((label,) for label in ["dt", "PosDX", "PosDY", "PosDZ", "AngDX", "AngDY", "AngDZ", "conf"]),
        "XKF1": tuple((label,) for label in ["C", "Roll", "Pitch", "Yaw", "VN", "VE", "VD", "PN", "PE", "PD"]),
        "XKF3": tuple((label,) for label in ["C", "IVN", "IVE", "IVD", "IPN", "IPE", "IPD", "IYAW"]),
        "XKF4": tuple((label,) for label in ["C", "SV", "SP", "SH", "SM", "OFN", "OFE", "FS", "TS", "SS", "PI"]),
    }
)
_SPOKEN: Final = ("MSG", "EV", "ERR", "MODE", "ARM", "PARM")
_PER_CORE: Final = ("XKF1", "XKF3", "XKF4")
_PROGRESS_EVERY: Final = 500


@dataclass(frozen=True, slots=True)
class Happening:
    """Something that a log tells at a time.

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
        xkf1, xkf3, xkf4: what the EKF made of it, of the core shown.
        cores_shown: whose records those are: the primary core's where the log has them, else the first core's.
        unseen_primary_s: for how long the primary core was one whose records the log does not have.
        happenings: texts, events, errors, modes and arming, in order.
        parameters: in the order of the log.
        left_out: how many records had a time that cannot be.
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

    def parameter(self, name: str) -> float | None:
        """Return the last value of a parameter; None if the log has none."""
        return next((one.value for one in reversed(self.parameters) if one.name == name), None)

    @property
    def vision(self) -> tuple[Series, Series, Series]:
        """The three kinds of records of external navigation."""
        return self.visp, self.visv, self.viso


def read_material(path: Path, on_progress: Callable[[float], None]) -> Material:
    """Read a log (.BIN or .BIN.xz).

    Args:
        path: the log.
        on_progress: is called now and then with how much of it has been read, in percent.

    Raises:
        InputError: if it cannot be read.
    """
    columns = read_columns(path)
    told = read_kinds(path, columns, _SPOKEN, lambda log: _collect(log, on_progress))
    return _material(path.name, columns, told)


def _taken(record: Any, mode_name: str) -> Happening | LoggedParameter | None:
    kind = record.get_type()
    time_us = number_in(record, "TimeUS")
    if not math.isfinite(time_us):
        return None
    if kind != "PARM":
        return _happening(kind, record, time_us * 1e-6, mode_name)
    name, value = str(getattr(record, "Name", "")), number_in(record, "Value")
    return LoggedParameter(time_us * 1e-6, name, value, number_in(record, "Default"))


def _happening(kind: str, record: Any, time_s: float, mode_name: str) -> Happening:
    if kind == "MSG":
        return Happening(time_s, "text", str(getattr(record, "Message", "")))
    if kind == "MODE":
        return Happening(time_s, "mode", mode_name, _whole(record, "ModeNum"))
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


def _collect(log: Any, on_progress: Callable[[float], None]) -> list[Happening | LoggedParameter | None]:
    told = []
    while (record := log.recv_match(type=list(_SPOKEN))) is not None:
        told.append(_taken(record, str(log.flightmode)))
        if len(told) % _PROGRESS_EVERY == 0:
            on_progress(float(log.percent))
    return told


def _table(log: LogColumns, kind: str) -> Array:
    """Return TimeUS and the numbers of a kind of records, a row each."""
    columns = log.columns(kind) if kind in log.types else {}
    count = log.counts.get(kind, 0)
    return np.column_stack([numbers_of(columns, labels, count) for labels in (("TimeUS",), *_LABELS[kind])])


def _material(name: str, log: LogColumns, told: Sequence[Happening | LoggedParameter | None]) -> Material:
    series, left_out = {}, 0
    for kind, all_labels in _LABELS.items():
        series[kind], lost = series_of(_table(log, kind), [labels[0] for labels in all_labels])
        left_out += lost
    shown, cores, unseen_s = _of_primary_core({kind: series[kind] for kind in _PER_CORE})
    return Material(
        name=name,
        counts=dict(sorted(log.counts.items())),
        visp=series["VISP"],
        visv=series["VISV"],
        viso=series["VISO"],
        xkf1=shown["XKF1"],
        xkf3=shown["XKF3"],
        xkf4=shown["XKF4"],
        cores_shown=cores,
        unseen_primary_s=unseen_s,
        happenings=tuple(sorted((one for one in told if isinstance(one, Happening)), key=lambda one: one.time_s)),
        parameters=tuple(one for one in told if isinstance(one, LoggedParameter)),
        left_out=left_out,
    )


def _of_primary_core(series: dict[str, Series]) -> tuple[dict[str, Series], tuple[int, ...], float]:
    """Return the records of the core that the autopilot flew with, where the log has them; else of the first core.

    Logs without a column C have one core.
    """
    status = series["XKF4"]
    cores = np.nan_to_num(status["C"])
    logged = {int(core) for one in series.values() for core in np.nan_to_num(one["C"])}
    if not logged:
        return series, (), 0.0
    first = min(logged)
    primary = np.nan_to_num(status["PI"], nan=first)
    seen = np.isin(primary, list(logged))
    chosen = np.where(seen, primary, first)
    kept = {}
    for kind, one in series.items():
        wanted = first if not len(status) else chosen[_latest(status.time_s, one.time_s)]
        kept[kind] = one.where(np.nan_to_num(one["C"]) == wanted)
    shown = {int(core) for one in kept.values() for core in np.nan_to_num(one["C"])}
    of_first = cores == first
    steps_s = np.diff(status.time_s[of_first], append=status.time_s[of_first][-1:])
    return kept, tuple(sorted(shown)), float(steps_s[~seen[of_first]].sum())


def _latest(known_s: Any, at_s: Any) -> Any:
    """Return which of the known times is the latest up to each time, or the first one."""
    return np.maximum(np.searchsorted(known_s, at_s, side="right") - 1, 0)


def position_moves(xkf4: Series) -> tuple[Array, Array]:
    """Return when the EKF moved its position at once, in s [N], and by how much, m north and east [N, 2]."""
    moved, core = xkf4.matrix("OFN", "OFE"), np.nan_to_num(xkf4["C"])
    changed = np.isfinite(moved[1:]).all(axis=1) & (moved[1:] != moved[:-1]).any(axis=1) & (core[1:] == core[:-1])
    at = np.flatnonzero(changed) + 1
    return xkf4.time_s[at], moved[at]


def armed_spans(material: Material, end_s: float) -> list[tuple[float, float]]:
    """Return from when to when the vehicle was armed, in s, by ARM records and events."""
    states = {("arming", 1): True, ("arming", 0): False, ("event", EV_ARMED): True, ("event", EV_DISARMED): False}
    spans: list[tuple[float, float]] = []
    since: float | None = None
    for one in material.happenings:
        armed, time_s = states.get((one.kind, one.number)), one.time_s
        if armed is None:
            continue
        if armed and since is None:
            since = time_s
        if not armed and since is not None:
            spans.append((since, time_s))
            since = None
    return spans if since is None else [*spans, (since, max(since, end_s))]
