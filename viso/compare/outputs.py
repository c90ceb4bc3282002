# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Comparisons for people: tables for the terminal, and one HTML page that needs nothing but itself."""

import os
from collections.abc import Iterator, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Final

from rich.table import Column, Table
from rich.text import Text

from viso.compare.comparison import Comparison
from viso.compare.estimates import EstimateComparison
from viso.firmware.releases import PROFILES
from viso.report import html

_HEAD: Final = ("recording", "kind", "firmware", "messages", "records", "fields", "differ")
_FIELDS_HEAD: Final = ("field", "differs", "first in", "recorded", "ours", "unit")

Comparisons = Mapping[str, Comparison]
"""Comparisons of a recording, by the profile that viso had."""


def _summary_row(one: Comparison) -> tuple[str, ...]:
    counts = one.messages, one.records, one.fields, len(one.differences)
    return str(one.path), one.kind, one.firmware, *map(str, counts)


def _field_rows(one: Comparison) -> Iterator[tuple[str, ...]]:
    for field, (count, first) in one.by_field.items():
        yield field, str(count), first.place, first.recorded, first.ours, first.unit


def _short_names(paths: Sequence[Path]) -> dict[Path, str]:
    """Return the names of files from the folder on that all are in."""
    folder = os.path.commonpath([path.absolute().parent for path in paths])
    return {path: str(path.absolute().relative_to(folder)) for path in paths}


def summary_table(comparisons: Sequence[Comparison]) -> Table:
    """Return a table with a row for each comparison."""
    numbers = (Column(name, justify="right") for name in _HEAD[3:])
    table = Table(Column(_HEAD[0], overflow="fold"), *_HEAD[1:3], *numbers, title="Recordings against viso")
    names = _short_names([one.path for one in comparisons])
    for one in comparisons:
        _, *cells, differ = _summary_row(one)
        table.add_row(names[one.path], *cells, Text(differ, "green" if one.passed else "red"))
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
    names = _short_names([one.path for comparisons in found for one in comparisons.values()])
    columns = (Column(name, justify="right") for name in PROFILES)
    table = Table(Column("differ", overflow="fold"), *columns, title="By firmware")
    for comparisons in found:
        path = next(iter(comparisons.values())).path
        table.add_row(names[path], *(str(len(one.differences)) for one in comparisons.values()))
    return table


def estimate_table(title: str, comparison: EstimateComparison) -> Table:
    """Return a table with a row for each check of a core's estimates."""
    table = Table("", "against the log", "target", "", title=title)
    for check in comparison.checks:
        mark = Text("") if not check.target else Text("ok", "green") if check.passed else Text("missed", "red")
        table.add_row(check.what, check.figure, check.target, mark)
    return table


def make_page(comparisons: Sequence[Comparison], version: str) -> str:
    """Return the page of comparisons, one for each recording and profile."""
    failed = sum(not one.passed for one in comparisons)
    kind, badge = ("bad", "differs") if failed else ("good", "equal")
    summary = f"{failed} of {len(comparisons)} comparisons differ" if failed else "Nothing differs"
    rows = map(_summary_row, comparisons)
    body = [
        "<h1>An autopilot's recordings against viso</h1>",
        f'<section class="verdict {kind}"><span class="tag">{badge}</span> <strong>{summary}.</strong></section>',
        html.table(_HEAD, rows, (3, 4, 5, 6), ("" if one.passed else "trouble" for one in comparisons)),
    ]
    for one in comparisons:
        if not one.passed or one.notes:
            body.append(f"<h2>{escape(f'{one.path} as {one.firmware}')}</h2>")
        body += [f'<p class="soft">{escape(note)}</p>' for note in one.notes]
        if not one.passed:
            body.append(html.table(_FIELDS_HEAD, _field_rows(one), (1,)))
    body.append(f'<p class="soft">Made by viso {escape(version)}.</p>')
    return html.document("Recordings against viso", body)
