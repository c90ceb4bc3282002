# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What happened when, ours beside a log's: texts, changes of a value, resets."""

import difflib
import re
from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from typing import Final, TypeVar

from ekf_stub.inputs.inertial import Array
from viso.compare.ekf.targets import MOVED_STEP_M, PRINTED_STEP, WITHIN_S

T = TypeVar("T")

_NUMBER: Final = re.compile(r"-?\d+\.\d+")
_ROUNDING: Final = 1e-6


@dataclass(frozen=True, slots=True)
class Event:
    """Something that happened.

    Attributes:
        time_s: when, since boot.
        key: what has to be the same for another event to be the same.
        text: what to call it.
        numbers: what has to be nearly the same.
    """

    time_s: float
    key: Hashable
    text: str
    numbers: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class Differences:
    """What differs between two sequences of events, and how many both have, the worst of them so far apart.

    There is a line for each thing that is missing, too many, changed, or at another time.
    """

    lines: tuple[str, ...]
    matched: int
    worst_s: float


def changes(time_s: Array, values: Sequence[T], *, with_first: bool = False) -> list[tuple[float, T]]:
    """Return when a value changes, and to what; ``with_first`` says whether the first counts as a change."""
    times = time_s.tolist()
    first = [(times[0], values[0])] if with_first and times else []
    return first + [(times[i], values[i]) for i in range(1, len(times)) if values[i] != values[i - 1]]


def compare_texts(ours: Sequence[tuple[float, str]], recorded: Sequence[tuple[float, str]]) -> Differences:
    """Compare texts: the same words in the same order, the same numbers but for rounding, at the same times."""
    return _compare(text_events(ours), text_events(recorded), PRINTED_STEP)


def compare_values(
    label: str, ours: Sequence[tuple[float, float]], recorded: Sequence[tuple[float, float]]
) -> Differences:
    """Compare changes of an integer: the same values in the same order, at the same times."""
    first, second = (
        [Event(time_s, value, f"{label} {int(value):#x}") for time_s, value in side] for side in (ours, recorded)
    )
    return _compare(first, second, step=0.0)


def compare_moves(
    ours: Sequence[tuple[float, tuple[float, float]]], recorded: Sequence[tuple[float, tuple[float, float]]]
) -> Differences:
    """Compare resets of position: as many, by as much (m north and east), at the same times."""
    text = "moved by {:.2f}, {:.2f} m"
    first, second = ([Event(time_s, None, text.format(*by), by) for time_s, by in side] for side in (ours, recorded))
    return _compare(first, second, step=MOVED_STEP_M)


def text_events(texts: Sequence[tuple[float, str]]) -> list[Event]:
    """Return texts as events: the numbers in a text may differ a little."""
    return [
        Event(time_s, _NUMBER.sub("#", text), repr(text), tuple(map(float, _NUMBER.findall(text))))
        for time_s, text in texts
    ]


def matched(
    ours: Sequence[Event], recorded: Sequence[Event]
) -> tuple[list[tuple[Event, Event]], list[tuple[Event | None, Event | None]]]:
    """Return which of our events are which of the recorded ones, and those that only one side has, ours first."""
    keys = [event.key for event in ours], [event.key for event in recorded]
    matcher = difflib.SequenceMatcher(None, keys[0], keys[1], autojunk=False)
    pairs: list[tuple[Event, Event]] = []
    alone: list[tuple[Event | None, Event | None]] = []
    for kind, our_start, our_end, start, end in matcher.get_opcodes():
        if kind == "equal":
            pairs += zip(ours[our_start:our_end], recorded[start:end], strict=True)
        else:
            alone += [(event, None) for event in ours[our_start:our_end]]
            alone += [(None, event) for event in recorded[start:end]]
    return pairs, alone


def _compare(ours: Sequence[Event], recorded: Sequence[Event], step: float) -> Differences:
    """Match events by their keys, then compare their times, and their numbers to within a step."""
    pairs, alone = matched(ours, recorded)
    lines = [
        f"{event.time_s:.3f} s: only {whose}: {event.text}"
        for both in alone
        for whose, event in zip(("ours", "the log's"), both, strict=True)
        if event is not None
    ]
    lines += [
        f"{theirs.time_s:.3f} s: {theirs.text}; ours at {our.time_s:.3f} s: {our.text}"
        for our, theirs in pairs
        if not agree(our, theirs, step, WITHIN_S)
    ]
    worst_s = max((abs(our.time_s - theirs.time_s) for our, theirs in pairs), default=0.0)
    return Differences(tuple(lines), len(pairs), worst_s)


def agree(our: Event, theirs: Event, step: float, within_s: float) -> bool:
    """Return whether two events are the same: their numbers to within a step, their times to within some seconds."""
    numbers = zip(our.numbers, theirs.numbers, strict=True)
    is_near = all(abs(mine - other) <= step + _ROUNDING for mine, other in numbers)
    return is_near and abs(our.time_s - theirs.time_s) <= within_s
