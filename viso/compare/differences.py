# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The comparer: recorded values against ours, field by field, within the table of tolerances.

The caller first aligns both sides by place (the line of a capture, the time of a log's record), as rows of a place or
as columns over time.
"""

import difflib
import math
from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby, zip_longest
from typing import Any, Final, NamedTuple, TypeVar

import numpy as np

from viso.compare.tolerances import ANGLES, UNITS, Tolerance
from viso.estimators.series import Array, wrapped_deg

ABSENT: Final = "nothing"
"""The placeholder for a value that one side does not have."""

Side = TypeVar("Side", float, Array)

Tolerances = Mapping[str, Tolerance]
"""Tolerances by field; a field without one must be equal."""

_LEAST: Final = 1e-12  # below it no share of a value counts


class Row(NamedTuple):
    """A record, message or result: its name, empty for properties of the place, and its values by label."""

    record: str
    values: Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class Difference:
    """A field that differs at a place: a line, a time since boot, an exchange or a message's number.

    ``field`` is ``RECORD.Label`` or a kind of text; a missing value is ``ABSENT``.
    """

    place: str
    field: str
    recorded: str
    ours: str
    unit: str = ""

    def __str__(self) -> str:
        unit = self.unit and f" {self.unit}"
        start = f"{self.place}: {self.field}: "
        if ABSENT in (self.recorded, self.ours):
            return start + (f"only ours: {self.ours}" if self.recorded == ABSENT else f"only recorded: {self.recorded}")
        return f"{start}{self.recorded}{unit} recorded, {self.ours}{unit} of ours"


# Values


def apart(field: str, recorded: Side, ours: Side) -> Side:
    """Return ours less the recorded value or column; angles differ by -180 to 180 deg."""
    difference: Side = ours - recorded
    return wrapped_deg(difference) if field in ANGLES else difference


def is_equal(field: str, recorded: Any, ours: Any, tolerance: Tolerance | None = None) -> bool:
    """Return whether two values of a field are equal, or no farther apart than allowed.

    float32 values without a tolerance are compared bit by bit, and lists element by element.
    """
    if isinstance(recorded, np.float32) and isinstance(ours, np.float32) and recorded.tobytes() == ours.tobytes():
        return True
    if isinstance(recorded, list | tuple) and isinstance(ours, list | tuple):
        return len(recorded) == len(ours) and all(
            is_equal(field, *pair, tolerance) for pair in zip(recorded, ours, strict=True)
        )
    if tolerance is None:
        return not isinstance(recorded, np.float32) and bool(recorded == ours)
    if not all(isinstance(value, int | float | np.float32) for value in (recorded, ours)):
        return bool(recorded == ours)
    before, after = float(recorded), float(ours)
    if tolerance.is_share:
        if math.isnan(before) and math.isnan(after):
            return True
        return math.isclose(before, after, rel_tol=tolerance.within, abs_tol=_LEAST)
    return abs(apart(field, before, after)) <= tolerance.within


def shown(value: Any) -> str:
    """Return a value as it is printed."""
    if isinstance(value, list | tuple):
        return " ".join(map(shown, value))
    return f"{value:.9g}" if isinstance(value, np.float32) else str(value)


def row_differences(
    place: str,
    recorded: Sequence[Row],
    ours: Sequence[Row],
    tolerances: Tolerances,
    *,
    units: Mapping[str, str],
    names: str = "records",
) -> Iterator[Difference]:
    """Yield what differs at a place: in the names of its rows, called ``names``, or else in their values."""
    sides = [[row.record for row in rows if row.record] for rows in (recorded, ours)]
    if sides[0] != sides[1]:
        yield Difference(place, names, *map(_listed, sides))
        return
    for theirs, mine in zip(recorded, ours, strict=True):
        for label in {**theirs.values, **mine.values}:
            before, after = theirs.values.get(label, ABSENT), mine.values.get(label, ABSENT)
            field = f"{theirs.record}.{label}" if theirs.record and label else theirs.record or label
            if not is_equal(field, before, after, tolerances.get(field)):
                yield Difference(place, field, shown(before), shown(after), units.get(field, ""))


def _listed(names: Sequence[str]) -> str:
    runs = ((name, len(list(run))) for name, run in groupby(names))
    return ", ".join(name if count == 1 else f"{count} {name}" for name, count in runs) or "none"


# Columns over time


@dataclass(frozen=True, slots=True)
class Error:
    """The error of a column against the recorded one, in its unit: root mean square and maximum."""

    rms: float
    worst: float

    def is_within(self, tolerance: Tolerance) -> bool:
        """Return whether both are within the limits."""
        return self.rms <= tolerance.rms and self.worst <= tolerance.within


def error_of(differences: Array) -> Error:
    """Return the error of differences; 0 without any."""
    if not differences.size:
        return Error(0.0, 0.0)
    return Error(float(np.sqrt(np.mean(differences**2))), float(np.abs(differences).max()))


def column_differences(
    field: str, instance: int, time_s: Array, recorded: Array, ours: Array, tolerances: Tolerances
) -> Iterator[Difference]:
    """Yield where a column of one instance of a record differs; if only the rms is too large, the worst record."""
    record, _, label = field.partition(".")
    tolerance = tolerances.get(field, Tolerance("", (), "", "", within=0.0))
    differences = np.abs(apart(field, recorded, ours))
    beyond = ~(differences <= tolerance.within)
    if not error_of(differences).rms <= tolerance.rms:
        beyond[np.argmax(differences)] = True
    for index in np.flatnonzero(beyond):
        before, after = f"{recorded[index]:.9g}", f"{ours[index]:.9g}"
        yield Difference(f"{time_s[index]:.3f} s", f"{record}[{instance}].{label}", before, after, UNITS[field])


# Sequences


def aligned(recorded: Sequence[Hashable], ours: Sequence[Hashable]) -> Iterator[tuple[bool, range, range]]:
    """Yield the stretches in which two sequences are equal or not, as ranges of their indices."""
    matcher = difflib.SequenceMatcher(None, recorded, ours, autojunk=False)
    for kind, start, end, our_start, our_end in matcher.get_opcodes():
        yield kind == "equal", range(start, end), range(our_start, our_end)


def sequence_differences(place: str, field: str, recorded: Sequence[str], ours: Sequence[str]) -> Iterator[Difference]:
    """Yield replaced, missing and additional elements of two sequences."""
    for are_equal, theirs, mine in aligned(recorded, ours):
        for index, our_index in zip_longest(theirs, mine) if not are_equal else ():
            values = (
                ABSENT if number is None else side[number] for number, side in ((index, recorded), (our_index, ours))
            )
            yield Difference(place, field, *values)
