# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What another firmware would have made of a stream: errors and innovations, beside what any comparison tells."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Final, NamedTuple

from rich.table import Column, Table

from ap_visualodom.log_structure import VISP
from viso.replay.feed import ReplayedMessage
from viso.replay.run import ReplayOutcome
from viso.vehicle.outcomes.watch import UNITS, Innovations

_POS: Final = VISP.fields.index("PErr")
_ANG: Final = VISP.fields.index("AErr")

Errors = tuple[float, float]
"""What a pose was given to the filter with: position error in m, attitude error in rad."""


class ErrorChange(NamedTuple):
    """Poses of one type of message whose errors differ.

    ``messages`` counts them, ``first`` is the number of the first of them, from 1; ``before`` and ``after`` are its
    errors in m and rad.
    """

    type: str
    messages: int
    first: int
    before: Errors
    after: Errors


def error_changes(before: ReplayOutcome, after: ReplayOutcome) -> list[ErrorChange]:
    """Return whose errors differ between two replays of one stream that have kept their messages, by type."""
    found: dict[str, ErrorChange] = {}
    for number, (first, second) in enumerate(zip(before.messages, after.messages, strict=True), 1):
        pairs = zip(_errors(first), _errors(second), strict=False)
        different = next((pair for pair in pairs if repr(pair[0]) != repr(pair[1])), None)
        if different is None:
            continue
        known = found.get(first.type, ErrorChange(first.type, 0, number, *different))
        found[first.type] = known._replace(messages=known.messages + 1)
    return [found[name] for name in sorted(found)]


def _errors(message: ReplayedMessage) -> Iterator[Errors]:
    return ((float(values[_POS]), float(values[_ANG])) for name, values in message.records if name == VISP.name)


def error_table(changes: Sequence[ErrorChange]) -> Table:
    """Return the table of them."""
    numbers = [Column(name, justify="right") for name in ("messages", "first", "before", "after")]
    table = Table("message", *numbers, title="Errors of poses that differ: of position in m, of attitude in rad")
    for change in changes:
        both = (f"{pos:.4g}, {ang:.4g}" for pos, ang in (change.before, change.after))
        table.add_row(change.type, str(change.messages), str(change.first), *both)
    return table


class InnovationChange(NamedTuple):
    """How far samples of a kind were off from what the filter expected, where that differs; a model's.

    ``rms_before`` and ``rms_after`` are in the unit of the kind, ``ratio_...`` is the worst, of which 1 is at the gate.
    """

    kind: str
    rejected_before: int
    rejected_after: int
    rms_before: float
    rms_after: float
    ratio_before: float
    ratio_after: float


def innovation_changes(before: ReplayOutcome, after: ReplayOutcome) -> list[InnovationChange]:
    """Return the kinds of sample whose innovations differ between two replays; none where no filter was watched."""
    sides = before.innovations or {}, after.innovations or {}
    return [change for kind in sorted({*sides[0], *sides[1]}) if (change := _innovation_change(kind, *sides))]


def _innovation_change(
    kind: str, before: Mapping[str, Innovations], after: Mapping[str, Innovations]
) -> InnovationChange | None:
    first, second = before.get(kind, Innovations()), after.get(kind, Innovations())
    if first == second:
        return None
    ratios = first.worst_ratio, second.worst_ratio
    return InnovationChange(kind, first.rejected, second.rejected, first.rms, second.rms, *ratios)


def innovation_change_rows(changes: Sequence[InnovationChange]) -> list[dict[str, object]]:
    """Return them for machine-readable output."""
    return [{**change._asdict(), "unit": UNITS[change.kind], "model": True} for change in changes]


def innovation_change_table(changes: Sequence[InnovationChange]) -> Table:
    """Return the table of them: before and after in one cell."""
    numbers = [Column(name, justify="right") for name in ("rejected", "rms", "worst ratio")]
    table = Table("sample", *numbers, title="Innovations that differ, before and after (a model's)")
    for change in changes:
        rejected = f"{change.rejected_before}, {change.rejected_after}"
        rms = f"{change.rms_before:.4g}, {change.rms_after:.4g} {UNITS[change.kind]}"
        table.add_row(change.kind, rejected, rms, f"{change.ratio_before:.3g}, {change.ratio_after:.3g}")
    return table
