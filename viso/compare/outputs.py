# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Comparisons for people: tables and lines for the terminal, and one self-contained HTML page."""

import os
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Final

from rich.table import Column, Table
from rich.text import Text

from mav_handlers.wire.messages import VISION_POSITION_DELTA
from viso.compare.comparison import Comparison
from viso.compare.estimates import EstimateComparison
from viso.compare.merit import SIGMAS, merits, surplus
from viso.compare.two_replays import (
    SHOWN,
    CountChange,
    ErrorChange,
    InnovationChange,
    ReplayComparison,
    TextChange,
)
from viso.files import html
from viso.firmware.changes import differences_between
from viso.firmware.releases import PROFILES, Firmware
from viso.replay.figures import OBJECTIVES, Row
from viso.replay.run import ReplayOutcome
from viso.terminal.console import reason_of
from viso.vehicle.outcomes import RULES_BY_CODE, UNITS, basis, why

_HEAD: Final = ("recording", "kind", "firmware", "messages", "records", "fields", "differ")
_FIELDS_HEAD: Final = ("field", "differs", "first in", "recorded", "ours", "unit")

ROWS: Final = 20
"""The most texts and spans in a table."""

_NOTHING: Final = "-"
_NAMED: Final = 4
_TYPE_MAV: Final = 1
_PASSED_ON: Final = ", without effect: VISO_TYPE 1 passes poses on as they come"

Comparisons = Mapping[str, Comparison]
"""Comparisons of a recording, by the profile that viso had."""


def _summary_row(comparison: Comparison) -> tuple[str, ...]:
    counts = comparison.messages, comparison.records, comparison.fields, len(comparison.differences)
    return str(comparison.path), comparison.kind, comparison.firmware, *map(str, counts)


def _field_rows(comparison: Comparison) -> Iterator[tuple[str, ...]]:
    for field, (count, first) in comparison.by_field.items():
        yield field, str(count), first.place, first.recorded, first.ours, first.unit


def _short_names(paths: Sequence[Path]) -> dict[Path, str]:
    """Return the names of files relative to their common folder."""
    folder = os.path.commonpath([path.absolute().parent for path in paths])
    return {path: str(path.absolute().relative_to(folder)) for path in paths}


def summary_table(comparisons: Sequence[Comparison]) -> Table:
    """Return a table with a row for each comparison."""
    numbers = (Column(name, justify="right") for name in _HEAD[3:])
    table = Table(Column(_HEAD[0], overflow="fold"), *_HEAD[1:3], *numbers, title="Recordings against viso")
    names = _short_names([comparison.path for comparison in comparisons])
    for comparison in comparisons:
        _, *cells, differ = _summary_row(comparison)
        table.add_row(names[comparison.path], *cells, Text(differ, "green" if comparison.passed else "red"))
    return table


def field_table(comparison: Comparison) -> Table:
    """Return a table with a row for each field that differs."""
    title = f"{comparison.path} as {comparison.firmware}"
    table = Table(*(Column(name, overflow="fold") for name in _FIELDS_HEAD), title=title)
    for row in _field_rows(comparison):
        table.add_row(*row)
    return table


def firmware_table(found: Sequence[Comparisons]) -> Table:
    """Return a table of the number of differences with each profile, a row for each recording."""
    names = _short_names([comparison.path for comparisons in found for comparison in comparisons.values()])
    columns = (Column(name, justify="right") for name in PROFILES)
    table = Table(Column("differ", overflow="fold"), *columns, title="By firmware")
    for comparisons in found:
        path = next(iter(comparisons.values())).path
        table.add_row(names[path], *(str(len(comparison.differences)) for comparison in comparisons.values()))
    return table


def estimate_table(title: str, comparison: EstimateComparison) -> Table:
    """Return a table with a row for each check of a core's estimates."""
    table = Table("", "against the log", "target", "", title=title)
    for check in comparison.checks:
        mark = Text("") if not check.target else Text("ok", "green") if check.passed else Text("missed", "red")
        table.add_row(check.what, check.figure, check.target, mark)
    return table


# Two replays


def setting_lines(settings: Mapping[str, float], before: ReplayOutcome) -> Iterator[str]:
    """Yield what each setting changes, a line each."""
    for name, value in settings.items():
        line = f"{name}: {before.params[name]:g} -> {value:g}" if name in before.params else f"{name}: {value:g}"
        yield line + (_PASSED_ON if name == "VISO_ORIENT" and _is_passed_on(settings, before) else "")


def _is_passed_on(settings: Mapping[str, float], before: ReplayOutcome) -> bool:
    viso_type = settings.get("VISO_TYPE", before.params.get("VISO_TYPE"))
    has_deltas = any(name == VISION_POSITION_DELTA.__name__ for name, _, _ in before.verdicts)
    return viso_type == _TYPE_MAV and not has_deltas


def replay_tables(comparison: ReplayComparison, *, with_filter: bool) -> Iterator[Table | str]:
    """Yield the tables of what differs between two replays, and a line if no verdict does."""
    if comparison.verdicts:
        yield _verdict_table(comparison.verdicts)
    if comparison.samples:
        yield _sample_table(comparison.samples)
    if comparison.messages:
        yield _message_table(comparison)
    if comparison.texts:
        yield _text_table(comparison.texts)
    if comparison.aiding_before or comparison.aiding_after:
        yield _aiding_table(comparison)
    if not (comparison.verdicts or comparison.samples or comparison.messages):
        where = "" if with_filter else "; --ekf shows what the filter makes of it"
        yield f"no verdict differs{where}"
    if (flow := comparison.flow) is not None:
        sides = f"{flow.rms_before:.3g} rad/s before, {flow.rms_after:.3g} after (root mean square)"
        yield f"flow: {flow.measurements} of {flow.total} measurements differ: {sides}"
    if comparison.records:
        yield f"log records of {comparison.records} messages differ, first of message {comparison.first_record}"


def firmware_tables(comparison: ReplayComparison) -> Iterator[Table]:
    """Yield the tables of errors and innovations that differ between two replays, as other firmware makes them."""
    if comparison.errors:
        yield _error_table(comparison.errors)
    if comparison.innovations:
        yield _innovation_table(comparison.innovations)


def release_lines(before: Firmware, after: Firmware) -> Iterator[str]:
    """Yield what two releases are known to do otherwise, whether or not a stream shows it."""
    rows = [row.as_dict(before, after) | {"source": row.source} for row in differences_between(before, after)]
    yield f"known to differ between {before.name} and {after.name}{':' if rows else ': nothing but names and logs'}"
    yield from ("- {topic}, {what}: {before} -> {after} ({source})".format(**row) for row in rows)


def _count_columns(title: str, *names: str) -> Table:
    counts = (Column(name, justify="right") for name in ("before", "after"))
    return Table(*names, *counts, title=title)


def _verdict_table(changes: Sequence[CountChange]) -> Table:
    table = _count_columns("Verdicts of messages that differ in number", "message", "verdict", "why")
    for change in changes:
        table.add_row(change.name, change.outcome, reason_of(change.rule), str(change.before), str(change.after))
    return table


def _sample_table(changes: Sequence[CountChange]) -> Table:
    table = _count_columns(
        "Outcomes of samples in the filter that differ in number", "sample", "outcome", "why", "basis"
    )
    for change in changes:
        rule = RULES_BY_CODE[change.rule]
        table.add_row(change.name, change.outcome, why(rule), basis(rule), str(change.before), str(change.after))
    return table


def _message_table(comparison: ReplayComparison) -> Table:
    changes = comparison.messages
    title = f"Of {comparison.changed_messages} messages that fared otherwise, the first"
    right = Column("number", justify="right"), Column("time", justify="right")
    table = Table(*right, "message", "what", "before", "after", title=title)
    for change in changes[:SHOWN]:
        reasons = (reason or _NOTHING for reason in change.reasons())
        table.add_row(str(change.number), _seconds(change.arrival_us), change.type, change.what, *reasons)
    return table


def _text_table(changes: Sequence[TextChange]) -> Table:
    right = Column("before", justify="right"), Column("after", justify="right")
    table = Table(
        *right, "text", title="Texts that differ", caption=_more([f'"{change.text}"' for change in changes[ROWS:]])
    )
    for change in changes[:ROWS]:
        text = f"({change.severity}) {change.text}"
        table.add_row(_seconds(change.before_us), _seconds(change.after_us), text)
    return table


def _aiding_table(comparison: ReplayComparison) -> Table:
    right = Column("from", justify="right"), Column("to", justify="right")
    before, after = (
        [(span, when) for span in spans]
        for when, spans in (("before", comparison.aiding_before), ("after", comparison.aiding_after))
    )
    spans = sorted(before + after, key=lambda row: row[0].start_us)
    title = "By what the filter navigated in one of the two only (a model's)"
    caption = _more([f"by {span.mode.value} {when}" for span, when in spans[ROWS:]])
    table = Table(*right, "by", "when", title=title, caption=caption)
    for span, when in spans[:ROWS]:
        table.add_row(_seconds(span.start_us), _seconds(span.end_us), span.mode.value, when)
    return table


def _more(left_out: Sequence[str]) -> str | None:
    """Return the number of rows left out, and their most frequent kind."""
    if not left_out:
        return None
    kinds = Counter(left_out).most_common()
    named = ", ".join(f"{count} {what}" for what, count in kinds[:_NAMED])
    others = sum(count for _, count in kinds[_NAMED:])
    return f"and {len(left_out)} more: {named}{f', {others} others' if others else ''}"


def _seconds(time_us: int | None) -> str:
    return _NOTHING if time_us is None else f"{time_us / 1e6:.3f} s"


def _error_table(changes: Sequence[ErrorChange]) -> Table:
    numbers = [Column(name, justify="right") for name in ("messages", "first", "before", "after")]
    table = Table("message", *numbers, title="Errors of poses that differ: of position in m, of attitude in rad")
    for change in changes:
        both = (f"{pos:.4g}, {ang:.4g}" for pos, ang in (change.before, change.after))
        table.add_row(change.type, str(change.messages), str(change.first), *both)
    return table


def _innovation_table(changes: Sequence[InnovationChange]) -> Table:
    numbers = [Column(name, justify="right") for name in ("rejected", "rms", "worst ratio")]
    table = Table("sample", *numbers, title="Innovations that differ, before and after (a model's)")
    for kind, before, after in changes:
        rejected = f"{before.rejected}, {after.rejected}"
        rms = f"{before.rms:.4g}, {after.rms:.4g} {UNITS[kind]}"
        table.add_row(kind, rejected, rms, f"{before.worst_ratio:.3g}, {after.worst_ratio:.3g}")
    return table


def merit_table(before: Row, after: Row, truth: str | None) -> Table:
    """Return a table of figures of merit; ``truth`` is what ``ate_m`` is the distance from."""
    right = Column("before", justify="right"), Column("after", justify="right")
    table = Table("figure", *right, "what it is", title="Figures of merit (the filter is a model)")
    for name, *both in merits(before, after):
        unit, what = OBJECTIVES[name].unit, OBJECTIVES[name].what
        cells = (("-" if value is None else f"{value:.4g} {unit}".rstrip()) for value in both)
        table.add_row(name, *cells, what.replace("the reference", truth) if truth else what)
    return table


def merit_lines(before: Row, after: Row) -> Iterator[str]:
    """Yield lines on whether innovations are smaller than before by more than chance."""
    found = surplus(after, before)
    if found is None or not before["nis"]:
        return
    share, sigma = (value / before["nis"] for value in found)
    how = "may be chance" if found.is_chance else f"beyond {SIGMAS:g} of these"
    yield f"innovations (nis) change by {share:+.1%}, with a deviation of {sigma:.1%}: {how}"


# The page


def make_page(comparisons: Sequence[Comparison], version: str) -> str:
    """Return the page of comparisons, one for each recording and profile."""
    failed = sum(not comparison.passed for comparison in comparisons)
    kind, badge = ("bad", "differs") if failed else ("good", "equal")
    summary = f"{failed} of {len(comparisons)} comparisons differ" if failed else "Nothing differs"
    rows = map(_summary_row, comparisons)
    body = [
        "<h1>An autopilot's recordings against viso</h1>",
        f'<section class="verdict {kind}"><span class="tag">{badge}</span> <strong>{summary}.</strong></section>',
        html.table(_HEAD, rows, (3, 4, 5, 6), ("" if comparison.passed else "trouble" for comparison in comparisons)),
    ]
    for one in comparisons:
        body.append(f"<h2>{escape(f'{one.path} as {one.firmware}')}</h2>")
        body += [f'<p class="soft">{escape(note)}</p>' for note in (one.judged_as, *one.notes)]
        if not one.passed:
            body.append(html.table(_FIELDS_HEAD, _field_rows(one), (1,)))
    body.append(f'<p class="soft">Made by viso {escape(version)}.</p>')
    return html.document("Recordings against viso", body)
