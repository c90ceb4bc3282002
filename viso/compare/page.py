# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Comparisons as one HTML page that needs nothing but itself."""

from collections.abc import Iterator, Sequence
from html import escape

from viso.compare.agreement import Comparison
from viso.report.html import document, table

HEAD = ("recording", "kind", "firmware", "messages", "records", "fields", "differ")
FIELDS_HEAD = ("field", "differs", "first in", "recorded", "ours", "unit")


def summary_row(one: Comparison) -> tuple[str, ...]:
    """Return the cells that sum up a comparison, as ``HEAD`` names them."""
    counts = one.messages, one.records, one.fields, len(one.differences)
    return str(one.path), one.kind, one.firmware, *map(str, counts)


def field_rows(one: Comparison) -> Iterator[tuple[str, ...]]:
    """Yield the cells of each field that differs, as ``FIELDS_HEAD`` names them."""
    for field, (count, first) in one.by_field.items():
        yield field, str(count), first.place, first.recorded, first.ours, first.unit


def make_page(comparisons: Sequence[Comparison], version: str) -> str:
    """Return the page of comparisons, one a recording and profile."""
    failed = sum(not one.passed for one in comparisons)
    kind, badge = ("bad", "differs") if failed else ("good", "equal")
    said = f"{failed} of {len(comparisons)} comparisons differ" if failed else "Nothing differs"
    body = [
        "<h1>An autopilot's recordings against viso</h1>",
        f'<section class="verdict {kind}"><span class="tag">{badge}</span> <strong>{said}.</strong></section>',
        table(
            HEAD, map(summary_row, comparisons), (3, 4, 5, 6), ("" if one.passed else "trouble" for one in comparisons)
        ),
    ]
    for one in comparisons:
        if not one.passed or one.notes:
            body.append(f"<h2>{escape(f'{one.path} as {one.firmware}')}</h2>")
        body += [f'<p class="soft">{escape(note)}</p>' for note in one.notes]
        if not one.passed:
            body.append(table(FIELDS_HEAD, field_rows(one), (1,)))
    body.append(f'<p class="soft">Made by viso {escape(version)}.</p>')
    return document("Recordings against viso", body)
