# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the filter of a logged vehicle wrote down: XKF1, XKF3 and XKF4, or EKF2's NKF records of older logs."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from ap_core.dataflash_columns import LogColumns
from viso.estimators.series import Array, Series, numbers_of, series_of

STATE: Final = "1"
INNOVATIONS: Final = "3"
STATUS: Final = "4"
EKF2: Final = "NKF"
EKF3: Final = "XKF"
_LABELS: Final[Mapping[str, tuple[str, ...]]] = MappingProxyType(
    {
        STATE: ("C", "Roll", "Pitch", "Yaw", "VN", "VE", "VD", "PN", "PE", "PD"),
        INNOVATIONS: ("C", "IVN", "IVE", "IVD", "IPN", "IPE", "IPD", "IYAW"),
        STATUS: ("C", "SV", "SP", "SH", "SM", "OFN", "OFE", "FS", "TS", "SS", "PI"),
    }
)


@dataclass(frozen=True, slots=True)
class FilterRecords:
    """Records of a filter, of the core that the autopilot flew with where the log has them, else of the first core.

    Attributes:
        prefix: of the names of the records: XKF or NKF.
        state, innovations, status: the records 1, 3 and 4.
        every_status: the records 4 of all cores.
        cores_shown: whose records the first three are.
        unseen_primary_s: for how long the primary core was one whose records the log does not have.
        left_out: how many records had a time that cannot be.
    """

    prefix: str
    state: Series
    innovations: Series
    status: Series
    every_status: Series
    cores_shown: tuple[int, ...]
    unseen_primary_s: float
    left_out: int


def table_with(log: LogColumns, kind: str, labels: tuple[tuple[str, ...], ...]) -> Array:
    """Return TimeUS and fields of a kind of records, a row each; NaN for what the log lacks.

    Each of ``labels`` has those that a field may have, the newest first.
    """
    if kind not in log.types:
        return np.zeros((0, 1 + len(labels)))
    wanted = ["TimeUS", *(label for one in labels for label in one)]
    columns = log.columns(kind, [label for label in wanted if label in log.types[kind].labels])
    count = log.counts.get(kind, 0)
    return np.column_stack([numbers_of(columns, one, count) for one in (("TimeUS",), *labels)])


def rows_of(log: LogColumns, kind: str, *labels: str) -> Iterator[tuple[Any, ...]]:
    """Yield the time in us and fields of the records of a kind; nothing if the log lacks the kind or a field."""
    wanted = ("TimeUS", *labels)
    if log.counts.get(kind) and set(wanted) <= set(log.types[kind].labels):
        columns = log.columns(kind, wanted)
        yield from zip(*(columns[label].tolist() for label in wanted), strict=True)


def parameters_in(log: LogColumns) -> Iterator[tuple[float, str, float]]:
    """Yield the time in us, name and value of each PARM record."""
    for time_us, name, value in rows_of(log, "PARM", "Name", "Value"):
        yield float(time_us), str(name), float(value)


def logs_while_armed_alone(log: LogColumns) -> bool:
    """Return whether a log holds nothing of a vehicle that is not armed, by its LOG_DISARMED."""
    return any(name == "LOG_DISARMED" and value == 0 for _, name, value in parameters_in(log))


def _prefix(log: LogColumns) -> str:
    """Return which filter the vehicle flew with, of those that the log has records of."""
    has2, has3 = (bool(log.counts.get(prefix + STATUS)) for prefix in (EKF2, EKF3))
    if has2 and has3:
        return EKF2 if next((v for _, name, v in parameters_in(log) if name == "AHRS_EKF_TYPE"), 3.0) == 2.0 else EKF3
    return EKF2 if has2 else EKF3


def filter_records_in(log: LogColumns) -> FilterRecords:
    """Return what the filter of a logged vehicle wrote down; empty series where it wrote nothing."""
    prefix, series, left_out = _prefix(log), {}, 0
    for number, labels in _LABELS.items():
        series[number], lost = series_of(table_with(log, prefix + number, tuple((label,) for label in labels)), labels)
        left_out += lost
    shown, cores, unseen_s = _of_primary_core(series)
    return FilterRecords(
        prefix, shown[STATE], shown[INNOVATIONS], shown[STATUS], series[STATUS], cores, unseen_s, left_out
    )


def _of_primary_core(series: dict[str, Series]) -> tuple[dict[str, Series], tuple[int, ...], float]:
    """Return the records of the core that the autopilot flew with, where the log has them; else of the first core.

    Logs without a column C have one core.
    """
    status = series[STATUS]
    cores = np.nan_to_num(status["C"])
    logged = {int(core) for one in series.values() for core in np.nan_to_num(one["C"])}
    if not logged:
        return series, (), 0.0
    first = min(logged)
    primary = np.nan_to_num(status["PI"], nan=first)
    is_logged = np.isin(primary, list(logged))
    chosen = np.where(is_logged, primary, first)
    kept = {}
    for kind, one in series.items():
        wanted = first if not len(status) else chosen[_latest(status.time_s, one.time_s)]
        kept[kind] = one.where(np.nan_to_num(one["C"]) == wanted)
    shown = {int(core) for one in kept.values() for core in np.nan_to_num(one["C"])}
    of_first = cores == first
    steps_s = np.diff(status.time_s[of_first], append=status.time_s[of_first][-1:])
    return kept, tuple(sorted(shown)), float(steps_s[~is_logged[of_first]].sum())


def _latest(known_s: Any, at_s: Any) -> Any:
    """Return which of the known times is the latest up to each time, or the first one."""
    return np.maximum(np.searchsorted(known_s, at_s, side="right") - 1, 0)
