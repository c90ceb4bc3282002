# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What an injector has done, as tables and for machine-readable output."""

import math

from rich.table import Column, Table

from viso.faults import Entry, Tally


def when(entry: Entry) -> str:
    """Return when an entry happens, in words."""
    if entry.once:
        return f"once from {entry.start_s:g} s"
    return f"from {entry.start_s:g} s" if entry.end_s == math.inf else f"{entry.start_s:g} to {entry.end_s:g} s"


def entry_table(tally: Tally) -> Table:
    """Return a table of what each entry has done."""
    counts = [Column(head, justify="right") for head in ("met", "happened to", "lost", "added")]
    table = Table("", "fault", "when", *counts, "passed over", title="What the faults did")
    for row in tally.entries:
        figures = map(str, (row.met, row.done, row.lost, row.added))
        reasons = ", ".join(f"{count} {reason}" for reason, count in sorted(row.passed_over.items()))
        table.add_row(str(row.number), row.entry.kind, when(row.entry), *figures, reasons)
    return table


def summary_line(tally: Tally) -> str:
    """Return the outcome of all frames, in a line."""
    received = sum(tally.received.values())
    waiting = f", {tally.waiting} were still held back at the end" if tally.waiting else ""
    return (
        f"{received} frames received, {tally.added} added, {tally.lost} lost, {tally.passed_on} passed on{waiting}; "
        f"{tally.changed} changed"
    )


def tally_as_dict(tally: Tally) -> dict[str, object]:
    """Return the same for machine-readable output."""
    return {
        "received": dict(tally.received),
        "added": tally.added,
        "lost": tally.lost,
        "passed_on": tally.passed_on,
        "waiting": tally.waiting,
        "changed": tally.changed,
        "entries": [
            {
                "entry": row.number,
                "kind": row.entry.kind,
                "when": when(row.entry),
                "met": row.met,
                "done": row.done,
                "lost": row.lost,
                "added": row.added,
                "passed_over": dict(row.passed_over),
            }
            for row in tally.entries
        ],
    }
