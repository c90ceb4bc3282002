# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Events over time in a log, compared with ours: texts, changes of a value, resets of position."""

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from typing import Any, Final, TypeVar

from viso.compare.differences import ABSENT, Difference, Tolerances, aligned
from viso.estimators.series import Array

T = TypeVar("T")
Timed = Sequence[tuple[float, T]]
"""Values, each with its time in s since boot."""

_ROUNDING: Final = 1e-6  # of a printed number that was read again


@dataclass(frozen=True, slots=True)
class Event:
    """An event at a time in s since boot.

    Attributes:
        key: equal for matching events.
        text: the event in words.
        numbers: values that may differ by a tolerance between matching events.
    """

    time_s: float
    key: Hashable
    text: str
    numbers: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class EventComparison:
    """What differs between two sequences of events.

    Attributes:
        differences: missing, additional, changed and shifted events.
        matched: the number of events that both have.
        worst_s: largest difference of their times.
    """

    differences: tuple[Difference, ...]
    matched: int
    worst_s: float

    def __str__(self) -> str:
        if self.differences:
            return f"{len(self.differences)} differ"
        return f"{self.matched} equal, within {self.worst_s:.3f} s"

    def as_dict(self) -> dict[str, Any]:
        """Return the comparison for machines."""
        return {"lines": list(map(str, self.differences)), "matched": self.matched, "worst_s": self.worst_s}


def changes(time_s: Array, values: Sequence[T], *, with_first: bool = False) -> list[tuple[float, T]]:
    """Return the times and new values of changes; with the first value, if that counts as a change."""
    times = time_s.tolist()
    first = [(times[0], values[0])] if with_first and times else []
    return first + [(times[i], values[i]) for i in range(1, len(times)) if values[i] != values[i - 1]]


def compare_texts(name: str, recorded: Timed[str], ours: Timed[str], tolerances: Tolerances) -> EventComparison:
    """Compare texts: the same in the same order, at the same times."""

    def event(time_s: float, text: str) -> Event:
        return Event(time_s, text, repr(text))

    within_s = tolerances["MSG.TimeUS"].within
    return _compare(name, [event(*text) for text in recorded], [event(*text) for text in ours], 0.0, within_s)


def compare_changes(field: str, recorded: Timed[float], ours: Timed[float], tolerances: Tolerances) -> EventComparison:
    """Compare changes of an integer: the same values in the same order, at the same times."""

    def event(time_s: float, value: float) -> Event:
        return Event(time_s, value, f"{int(value):#x}")

    within_s = tolerances["XKF4.TimeUS"].within
    return _compare(field, [event(*change) for change in recorded], [event(*change) for change in ours], 0.0, within_s)


def compare_moves(
    recorded: Timed[tuple[float, float]], ours: Timed[tuple[float, float]], tolerances: Tolerances
) -> EventComparison:
    """Compare resets of position, in m north and east: as many, as far, at the same times."""

    def event(time_s: float, by: tuple[float, float]) -> Event:
        return Event(time_s, None, "moved by {:.2f}, {:.2f} m".format(*by), by)

    step, within_s = tolerances["XKF4.OFN"].within, tolerances["XKF4.TimeUS"].within
    return _compare("reset", [event(*move) for move in recorded], [event(*move) for move in ours], step, within_s)


def _compare(
    name: str, recorded: Sequence[Event], ours: Sequence[Event], step: float, within_s: float
) -> EventComparison:
    """Align events by their keys, then compare their times, and their numbers to within a step."""
    pairs: list[tuple[Event, Event]] = []
    alone: list[tuple[Event | None, Event | None]] = []
    for are_equal, mine, theirs in aligned([event.key for event in ours], [event.key for event in recorded]):
        if are_equal:
            pairs += zip((recorded[i] for i in theirs), (ours[i] for i in mine), strict=True)
        else:
            alone += [(None, ours[i]) for i in mine]
            alone += [(recorded[i], None) for i in theirs]
    differ = [*alone, *(pair for pair in pairs if not _agree(*pair, step, within_s))]
    worst_s = max((abs(our.time_s - theirs.time_s) for theirs, our in pairs), default=0.0)
    return EventComparison(tuple(_difference(name, *pair) for pair in differ), len(pairs), worst_s)


def _agree(theirs: Event, our: Event, step: float, within_s: float) -> bool:
    numbers = zip(theirs.numbers, our.numbers, strict=True)
    are_near = all(abs(mine - other) <= step + _ROUNDING for other, mine in numbers)
    return are_near and abs(our.time_s - theirs.time_s) <= within_s


def _difference(name: str, theirs: Event | None, our: Event | None) -> Difference:
    if theirs is None or our is None:
        event = theirs or our
        assert event is not None
        values = (ABSENT, event.text) if theirs is None else (event.text, ABSENT)
        return Difference(f"{event.time_s:.3f} s", name, *values)
    times = (f"{event.text} at {event.time_s:.3f} s" for event in (theirs, our))
    return Difference(f"{theirs.time_s:.3f} s", name, *times)
