# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Records of one kind as columns over time."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, TypeVar

import numpy as np
import numpy.typing as npt

from ap_core.dataflash_dtype import Column

Array = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]
Angles = TypeVar("Angles", float, Array)

IMPOSSIBLE_S: Final = 86_400.0
"""Records farther than this from the median of their kind have a damaged time."""


@dataclass(frozen=True, slots=True)
class Series:
    """Records of one kind, in the order of their times, s since boot.

    Columns are in the units of the log, and NaN where a record has no number.
    """

    time_s: Array
    columns: Mapping[str, Array]

    def __len__(self) -> int:
        return len(self.time_s)

    def __getitem__(self, label: str) -> Array:
        """Return a column; all NaN if the log has none of that label."""
        return self.columns.get(label, np.full(len(self), np.nan))

    def has(self, label: str) -> bool:
        """Return whether a column holds any number."""
        return bool(np.isfinite(self[label]).any())

    def matrix(self, *labels: str) -> Array:
        """Return columns side by side, [records, labels]."""
        return np.column_stack([self[label] for label in labels])

    def where(self, mask: Mask) -> "Series":
        """Return the records that a mask selects."""
        return Series(self.time_s[mask], {label: column[mask] for label, column in self.columns.items()})


def number_in(record: Any, *labels: str) -> float:
    """Return a field of a log's record under the first of its labels that holds a number; NaN without one."""
    for label in labels:
        try:
            return float(getattr(record, label))
        except (AttributeError, TypeError, ValueError):
            continue
    return float("nan")


def numbers_of(columns: Mapping[str, Column], labels: Sequence[str], count: int) -> Array:
    """Return the column under the first of its labels that holds numbers; all NaN without one."""
    for label in labels:
        column = columns.get(label)
        if column is not None and column.ndim == 1 and column.dtype.kind in "iuf":
            return column.astype(np.float64)
    return np.full(count, np.nan)


def rows_in_time(table: Array) -> Array:
    """Return rows of us and numbers ordered by time, without those whose time is damaged."""
    rows = table[np.isfinite(table[:, 0])]
    if len(rows):
        rows = rows[np.abs(rows[:, 0] - np.median(rows[:, 0])) < 1e6 * IMPOSSIBLE_S]
    return np.asarray(rows[np.argsort(rows[:, 0], kind="stable")], dtype=np.float64)


def series_of(rows: Sequence[Sequence[float]] | Array, labels: Sequence[str]) -> tuple[Series, int]:
    """Return rows of TimeUS and numbers as a series, and the number of rows left out for an impossible time."""
    table = np.array(rows, dtype=np.float64).reshape(-1, 1 + len(labels))
    kept = rows_in_time(table)
    columns = {label: kept[:, number] for number, label in enumerate(labels, 1)}
    return Series(kept[:, 0] * 1e-6, columns), int(len(table) - len(kept))


def wrapped_deg(angle_deg: Angles) -> Angles:
    """Return an angle or several within -180 to 180 deg."""
    wrapped: Angles = (angle_deg + 180.0) % 360.0 - 180.0
    return wrapped


def stretches_of(holds: Sequence[bool] | Mask) -> list[tuple[int, int]]:
    """Return the first index, and the one after the last, of each stretch in which a condition holds."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], holds, [False])).astype(np.int8)))
    return [(start, end) for start, end in edges.reshape(-1, 2).tolist()]


def spans_of(time_s: Sequence[float] | Array, holds: Sequence[bool] | Mask) -> list[tuple[float, float]]:
    """Return start and end, in s, of each stretch of records in which a condition holds.

    A stretch ends with the first record in which it no longer holds, or with the last one.
    """
    last = len(time_s) - 1
    return [(float(time_s[start]), float(time_s[min(end, last)])) for start, end in stretches_of(holds)]


def total_s(spans: Sequence[tuple[float, float]]) -> float:
    """Return the total length of stretches."""
    return sum(end - start for start, end in spans)


def overlap_s(first: Sequence[tuple[float, float]], second: Sequence[tuple[float, float]]) -> float:
    """Return the total overlap of two lists of stretches."""
    return sum(max(0.0, min(a[1], b[1]) - max(a[0], b[0])) for a in first for b in second)
