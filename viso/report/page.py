# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""One HTML page that needs nothing but itself: no script, no other file, no network."""

import math
from collections.abc import Mapping, Sequence
from html import escape
from typing import Final

import numpy as np

from viso.estimators.series import total_s
from viso.files.html import document, table
from viso.geometry.errors import rms
from viso.report.facts import Facts
from viso.report.figures import FigureKind
from viso.report.flight_data import Material
from viso.report.parameters import ChangedParameter
from viso.report.summary import Level, Summary

_CLASSES: Final = {Level.GOOD: "good", Level.UNJUDGED: "unjudged", Level.WARNING: "warning", Level.BAD: "bad"}
_CHAPTERS: Final = (("verdicts", "Outcomes"), ("texts", "Texts and events"), ("parameters", "Parameters"))


def make_page(
    material: Material, facts: Facts, summary: Summary, drawn: Mapping[FigureKind, str | None], version: str
) -> str:
    """Return the page, with figures as SVG elements; they are None where the log has nothing for them."""
    name = escape(material.name)
    body = [
        f"<h1>External navigation in {name}</h1>",
        _verdict(summary),
        f'<p class="soft">{escape(str(facts.judged_by))}</p>',
        _numbers(facts),
        _contents(drawn),
        *(_figure(kind, svg) for kind, svg in drawn.items()),
        _verdicts(facts),
        _texts(material),
        _parameters(facts),
        _about(material, summary, version),
    ]
    return document(f"{material.name}: external navigation", body)


def _verdict(summary: Summary) -> str:
    items = "".join(
        f'<li class="{_CLASSES[remark.level]}"><span class="tag">{remark.level.badge}</span>{escape(remark.text)}</li>'
        for remark in summary.remarks
    )
    listed = f'<ul class="remarks">{items}</ul>' if items else ""
    return (
        f'<section class="verdict {_CLASSES[summary.level]}"><span class="tag">{summary.level.badge}</span> '
        f"<strong>{escape(summary.sentence)}</strong>{listed}</section>"
    )


def _numbers(facts: Facts) -> str:
    cards = [(f"{facts.end_s - facts.start_s:.0f} s", "of log"), (str(facts.measurements), "records of vision")]
    if facts.armed:
        cards.append((f"{total_s(facts.armed):.0f} s", "armed"))
    if len(facts.arrivals_s) > 1:
        cards.append((f"{np.diff(facts.arrivals_s).max() * 1e3:.0f} ms", "longest time between records"))
    if facts.measurements:
        cards.append((str(facts.withheld), "withheld from the EKF"))
    known = facts.lag_ms[np.isfinite(facts.lag_ms)]
    if len(known):
        cards.append((f"{np.median(known):.0f} ms", "lag on arrival, middle"))
    if not math.isnan(facts.worst_ratio):
        cards.append((f"{facts.worst_ratio:.2f}", "largest test ratio (gate 1)"))
    cards += _difference_cards(facts)
    return (
        '<div class="numbers">' + "".join(f"<div><b>{value}</b><span>{text}</span></div>" for value, text in cards)
    ) + "</div>"


def _difference_cards(facts: Facts) -> list[tuple[str, str]]:
    found = facts.differences
    inside = np.zeros(len(found.time_s), dtype=np.bool_)
    for start, end in facts.positioned:
        inside |= (found.time_s >= start) & (found.time_s <= end)
    horizontal = np.hypot(found.pos_ned[:, 0], found.pos_ned[:, 1])[inside]
    known = horizontal[np.isfinite(horizontal)]
    return [(f"{rms(known):.2f} m", "vision against EKF, rms in plan")] if len(known) else []


def _contents(drawn: Mapping[FigureKind, str | None]) -> str:
    links = [*((kind.name, kind.title) for kind in drawn), *_CHAPTERS, ("about", "What is not here")]
    return "<nav>" + "\n".join(f'<a href="#{name}">{escape(title)}</a>' for name, title in links) + "</nav>"


def _figure(kind: FigureKind, svg: str | None) -> str:
    heading = f'<h2 id="{kind.name}">{escape(kind.title)}</h2>'
    if svg is None:
        return f'{heading}\n<p class="soft">{escape(kind.absent)}</p>'
    caption = f"<figcaption>{escape(kind.caption)}</figcaption>"
    return f'{heading}\n<figure><div class="scroll">{svg}</div>{caption}</figure>'


def _verdicts(facts: Facts) -> str:
    head = ("record", "content", "records", "rate, Hz", "withheld: low quality", "after a reset", "otherwise", "given")
    rows = [
        (
            kind.record,
            kind.content,
            str(kind.records),
            f"{kind.rate_hz:.1f}",
            *map(str, kind.withheld_for.values()),
            str(kind.records - kind.withheld) if kind.given is None else f"{kind.given} by replay records",
        )
        for kind in facts.kinds
    ]
    resets = table(
        ("time, s", "by", "what"), [(f"{reset.time_s:.3f}", reset.by, reset.what) for reset in facts.resets], (0,)
    )
    return (
        '<h2 id="verdicts">Outcomes</h2>\n'
        + table(head, rows, (2, 3, 4, 5, 6, 7))
        + '\n<p class="soft">A record is a message that the driver took. Messages that were dropped before, for their '
        "frames or their checksum, are in no log. Given is what went to the EKF, which may pass it over when it comes "
        "within 20 ms of the one before, or reject it, as the test ratios show.</p>\n"
        + (f"<details><summary>{len(facts.resets)} resets</summary>{resets}</details>" if facts.resets else "")
    )


def _texts(material: Material) -> str:
    head, happenings = '<h2 id="texts">Texts and events</h2>\n', material.happenings
    if not happenings:
        return f'{head}<p class="soft">None.</p>'
    rows = ((f"{happening.time_s:.3f}", happening.kind, happening.text) for happening in happenings)
    classes = ("trouble" if happening.is_trouble else happening.kind for happening in happenings)
    listed = table(("time, s", "kind", "what"), rows, (0,), classes)
    return f"{head}<details open><summary>{len(happenings)} of them</summary>{listed}</details>"


def _parameters(facts: Facts) -> str:
    changed = facts.parameters.changed
    head = '<h2 id="parameters">Parameters that differ from defaults</h2>\n'
    if not facts.parameters.known:
        return f'{head}<p class="soft">The log has no parameters.</p>'
    near = [parameter for parameter in changed if parameter.about_vision]
    far = [parameter for parameter in changed if not parameter.about_vision]
    others = f"<details><summary>{len(far)} others</summary>{_parameter_table(far)}</details>" if far else ""
    first = _parameter_table(near) if near else '<p class="soft">None about external navigation or the EKF.</p>'
    source = (
        "A default of the log may itself be from a file of defaults. That of the firmware is from this program's table."
    )
    return f'{head}{first}\n{others}\n<p class="soft">{source}</p>'


def _parameter_table(rows: Sequence[ChangedParameter]) -> str:
    def cells(parameter: ChangedParameter) -> tuple[str, ...]:
        defaults = [
            "" if math.isnan(value) else f"{value:.7g}" for value in (parameter.log_default, parameter.firmware_default)
        ]
        changes = ", ".join(f"{value:.7g} at {time_s:.1f} s" for time_s, value in parameter.changes)
        return parameter.name, f"{parameter.value:.7g}", *defaults, changes

    head = ("parameter", "value", "default in the log", "of the firmware", "set while logging")
    return table(head, map(cells, rows), (1, 2, 3))


def _about(material: Material, summary: Summary, version: str) -> str:
    absent = "".join(f"<li>{escape(text)}</li>" for text in summary.absent)
    counts = table(("record", "count"), [(name, str(count)) for name, count in material.counts.items()], (1,))
    return (
        f'<h2 id="about">What is not here</h2>\n<ul>{absent}</ul>\n'
        f"<details><summary>All records of the log</summary>{counts}</details>\n"
        f'<p class="soft">Made by viso {escape(version)} from {escape(material.name)}. '
        "Times are seconds since boot.</p>"
    )
