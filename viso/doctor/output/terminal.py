# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Findings for people."""

import textwrap
from collections.abc import Iterator, Sequence
from typing import Final

from rich.table import Column, Table
from rich.text import Text

from ap_core.verdict import VerdictKind
from viso.doctor.checks.check import Finding, Severity
from viso.doctor.checks.phrases import at, how_often
from viso.doctor.output.summary import Summary
from viso.vehicle.outcomes import OutcomeKind

_STYLES: Final = {Severity.ERROR: "bold red", Severity.WARNING: "bold yellow", Severity.NOTE: "bold blue"}
_INDENT: Final = "    "
_NARROWEST: Final = 40
_OUTCOMES: Final = (VerdictKind.ACCEPTED, VerdictKind.IGNORED, VerdictKind.DROPPED)


def finding_lines(finding: Finding, width: int | None) -> Iterator[Text]:
    """Yield a finding's lines: title, evidence, what the autopilot does, what to do, and an empty line.

    Lines are broken at ``width``, unless it is None.
    """
    yield Text.assemble(
        (f"{finding.severity.value} {finding.code}", _STYLES[finding.severity]), (f"  {finding.title}", "bold")
    )
    numbers = finding.messages_text
    for part in (
        f"{finding.witness.value}: {finding.evidence}{f' [{numbers}]' if numbers else ''}",
        f"autopilot: {finding.firmware} [{finding.source}]",
        f"fix: {finding.fix}",
    ):
        broken = [part] if width is None else textwrap.wrap(part, max(width - len(_INDENT), _NARROWEST))
        yield from (Text(f"{_INDENT}{line}") for line in broken)
    yield Text()


def count_text(findings: Sequence[Finding]) -> str:
    """Return how many findings there are of each severity."""
    if not findings:
        return "nothing was found"
    counts = [(severity, sum(finding.severity is severity for finding in findings)) for severity in Severity]
    return ", ".join(f"{count} {severity.value}{'s' if count > 1 else ''}" for severity, count in counts if count)


def summary_table(summary: Summary) -> Table:
    """Return a table of the outcomes of the messages of external navigation."""
    right = [Column(name, justify="right") for name in ("per second", *(outcome.value for outcome in _OUTCOMES))]
    table = Table("message", *right, title="What the autopilot would do")
    for name in sorted({name for name, _ in summary.outcomes}):
        counts = [str(summary.outcomes.get((name, outcome), 0)) for outcome in _OUTCOMES]
        rate = f"{summary.rate_hz[name]:.1f}" if name in summary.rate_hz else ""
        table.add_row(name, rate, *counts)
    return table


def summary_lines(summary: Summary) -> list[str]:
    """Return the rest of a summary in a few sentences."""
    if not summary.outcomes:
        lines = ["There is no external navigation to try."]
        return lines if summary.own is None else [*lines, _own_line(summary)]
    if summary.healthy_from_us is None:
        lines = ["The sensor would never be healthy."]
    else:
        unhealthy = f", and unhealthy {how_often(summary.unhealthy)}" if summary.unhealthy else ""
        lines = [f"The sensor would be healthy from {at(summary.healthy_from_us)} on{unhealthy}."]
    lines += [_aiding_line(summary), _own_line(summary)]
    for kind in sorted({kind for kind, _ in summary.samples}):
        counts = [(outcome, summary.samples.get((kind, outcome), 0)) for outcome in OutcomeKind]
        lines.append(
            f"{kind} samples: " + ", ".join(f"{count} {outcome.value}" for outcome, count in counts if count) + "."
        )
    for lags in summary.lags:
        lines.append(
            f"{lags.sender}: later than the quickest around them by {lags.median_ms:.0f} ms (median), "
            f"{lags.p99_ms:.0f} ms (one in a hundred), {lags.worst_ms:.0f} ms (worst)."
        )
    return lines


def _aiding_line(summary: Summary) -> str:
    if summary.aiding_from_us is None:
        return "The filter (a model) would never navigate by it."
    end = "" if summary.aiding_until_us is None else f" until {at(summary.aiding_until_us)}"
    return f"The filter (a model) would navigate by it from {at(summary.aiding_from_us)} on{end}."


def _own_line(summary: Summary) -> str:
    own = summary.own
    if own is None:
        return "What the vehicle's own filter made of it is not recorded: nothing here is compared with a real flight."
    by = {name: f" ({source})" for name, source in own.sources.items()}
    ratios = ", ".join(f"{name} {value:.2f}{by.get(name, '')}" for name, value in own.worst.items())
    return (
        f"The vehicle's own filter ({own.witness.value}, {own.record}) navigated by external navigation for "
        f"{own.positioned_s:.1f} of {own.running_s:.1f} s; largest test ratios: {ratios or 'none recorded'}."
    )
