# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the filter did, as tables for people and rows for machines, marked as a model's opinion where it is one."""

from collections.abc import Mapping, Sequence
from typing import Final

from rich.table import Column, Table
from rich.text import Text

from ekf_stub.reports import AidingMode
from viso.terminal.console import VerdictCounts, verdict_table
from viso.vehicle.outcomes import (
    UNITS,
    AidingSpan,
    FilterCounts,
    Innovations,
    OutcomeKind,
    basis,
    final_counts,
    is_model,
    outcome_kind,
    why,
)

_STYLES: Final = {
    OutcomeKind.FUSED: "green",
    OutcomeKind.RESET: "yellow",
    OutcomeKind.UNUSED: "",
    OutcomeKind.REJECTED: "red",
    OutcomeKind.LOST: "red",
    OutcomeKind.REFUSED: "red",
}
_MODES: Final = {
    AidingMode.NONE: "nothing (constant position)",
    AidingMode.ABSOLUTE: "absolute position",
    AidingMode.RELATIVE: "relative motion",
}


def filter_table(counts: FilterCounts) -> Table:
    """Return a table of what the filter did with how many samples, and whose opinion that is."""
    title = "Outcome of each sample in the filter"
    table = Table("sample", Column("count", justify="right"), "outcome", "why", "basis", title=title)
    for kind, rule, count in final_counts(counts):
        outcome = outcome_kind(rule)
        table.add_row(kind, str(count), Text(outcome.value, style=_STYLES[outcome]), why(rule), basis(rule))
    return table


def filter_rows(counts: FilterCounts) -> list[dict[str, object]]:
    """Return the same counts for machine-readable output."""
    return [
        {
            "kind": kind,
            "outcome": outcome_kind(rule).value,
            "rule": rule.code,
            "reason": rule.text,
            "count": count,
            "model": is_model(rule),
        }
        for kind, rule, count in final_counts(counts)
    ]


def tables_of(counts: VerdictCounts, filter_counts: FilterCounts) -> list[Table]:
    """Return the table of messages and, if anything has reached the filter, that of samples."""
    return [verdict_table(counts), *([filter_table(filter_counts)] if final_counts(filter_counts) else [])]


def innovation_table(innovations: Mapping[str, Innovations]) -> Table:
    """Return a table of how far samples were off from what the filter expected; a ratio of 1 is at the gate."""
    right = [Column(name, justify="right") for name in ("tested", "rejected", "rms", "worst", "worst ratio")]
    table = Table("sample", *right, title="Innovations of the samples that were tested (a model's)")
    for kind, of_kind in sorted(innovations.items()):
        share, unit = of_kind.rejected / of_kind.tested, UNITS[kind]
        figures = f"{of_kind.rms:.3f} {unit}", f"{of_kind.worst:.3f} {unit}", f"{of_kind.worst_ratio:.2f}"
        table.add_row(kind, str(of_kind.tested), f"{share:.1%}", *figures)
    return table


def innovation_rows(innovations: Mapping[str, Innovations]) -> list[dict[str, object]]:
    """Return the same for machine-readable output."""
    return [
        {
            "kind": kind,
            "unit": UNITS[kind],
            "tested": of_kind.tested,
            "rejected": of_kind.rejected,
            "rms": round(of_kind.rms, 6),
            "worst": round(of_kind.worst, 6),
            "worst_ratio": round(of_kind.worst_ratio, 4),
            "model": True,
        }
        for kind, of_kind in sorted(innovations.items())
    ]


def aiding_table(spans: Sequence[AidingSpan]) -> Table:
    """Return a table of when the filter navigated by what."""
    right = Column("from", justify="right"), Column("to", justify="right")
    table = Table(*right, "by", title="By what the filter navigated (a model's)")
    for span in spans:
        table.add_row(f"{span.start_us / 1e6:.3f} s", f"{span.end_us / 1e6:.3f} s", _MODES[span.mode])
    return table


def aiding_rows(spans: Sequence[AidingSpan]) -> list[dict[str, object]]:
    """Return the same for machine-readable output."""
    return [
        {"start_us": span.start_us, "end_us": span.end_us, "mode": span.mode.value, "model": True} for span in spans
    ]
