# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What another firmware would have made of a stream: the errors that it works out, beside what any comparison tells."""

from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple

from rich.table import Column, Table

from ap_visualodom.log_structure import VISP
from emulator.replay import ReplayedMessage
from emulator.replay_run import ReplayOutcome

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


def error_rows(changes: Sequence[ErrorChange]) -> list[dict[str, object]]:
    """Return them for machine-readable output."""
    return [change._asdict() for change in changes]


def error_table(changes: Sequence[ErrorChange]) -> Table:
    """Return the table of them."""
    numbers = [Column(name, justify="right") for name in ("messages", "first", "before", "after")]
    table = Table("message", *numbers, title="Errors of poses that differ: of position in m, of attitude in rad")
    for change in changes:
        both = (f"{pos:.4g}, {ang:.4g}" for pos, ang in (change.before, change.after))
        table.add_row(change.type, str(change.messages), str(change.first), *both)
    return table
