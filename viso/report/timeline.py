# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The figure of what happened when: states as bars, texts and events as a cascade."""

import re
from collections.abc import Sequence
from typing import Any, Final

from matplotlib.figure import Figure

from ekf_stub.reports import FilterFlag
from viso.estimators.series import spans_of
from viso.report import drawing
from viso.report.drawing import EKF, GREEN, MUTED, VIOLET, VISION, WITHHELD, plain
from viso.report.facts import Facts
from viso.report.flight_data import Happening, Material

MOST_TEXTS: Final = 36
_LONGEST_TEXT: Final = 64
_FLAGS: Final = (
    ("attitude", FilterFlag.ATTITUDE),
    ("horizontal velocity", FilterFlag.HORIZ_VEL),
    ("horizontal position", FilterFlag.HORIZ_POS_REL | FilterFlag.HORIZ_POS_ABS),
    ("height", FilterFlag.VERT_POS),
    ("constant position", FilterFlag.CONST_POS_MODE),
)
_COLOURS: Final = {"text": MUTED, "event": EKF, "error": MUTED, "mode": VIOLET, "arming": GREEN}
_TELLING: Final = ("EKF", "VisOdom", "AHRS", "ailsafe")

Bars = list[tuple[str, Sequence[tuple[float, float]], str]]


def draw_timeline(material: Material, facts: Facts) -> Figure | None:
    """Return the figure; None without anything to show."""
    bars = _bars(material, facts)
    happenings, left_out = chosen(material.happenings)
    if not bars and not happenings:
        return None
    heights = [0.26 * (len(bars) + 1.6), 0.19 * (len(happenings) + 2)]
    figure = drawing.new_figure(0.5 + sum(heights))
    states, texts = figure.subplots(2, 1, sharex=True, height_ratios=heights)
    _draw_bars(states, bars)
    _draw_modes(states, material, facts, len(bars))
    states.set(yticks=range(len(bars) + 1), yticklabels=[*(name for name, _, _ in bars), "mode"])
    states.set_ylim(len(bars) + 0.6, -0.6)
    states.set_title("States")
    _draw_texts(texts, happenings, facts)
    texts.set_title(f"Texts and events ({left_out} more in the table)" if left_out else "Texts and events")
    texts.set_xlim(facts.start_s, max(facts.end_s, facts.start_s + 1.0))
    texts.set_xlabel("seconds since boot")
    return figure


def _bars(material: Material, facts: Facts) -> Bars:
    bars: Bars = []
    if facts.armed:
        bars.append(("armed", facts.armed, GREEN))
    status = material.xkf4
    if len(status):
        for name, flags in _FLAGS:
            colour = VISION if flags == FilterFlag.CONST_POS_MODE else EKF
            bars.append((f"EKF: {name}", spans_of(status.time_s, facts.own.flags & int(flags) != 0), colour))
        bars.append(("a test ratio over 1", facts.over_gate, WITHHELD))
    if facts.measurements:
        bars.append(("vision silent", facts.gaps, WITHHELD))
        source = material.stamped
        bars.append(("vision withheld", spans_of(source.time_s, source["Ign"] > 0), WITHHELD))
    return bars


def _draw_bars(axes: Any, bars: Bars) -> None:
    for row, (_, spans, colour) in enumerate(bars):
        axes.broken_barh([(start, end - start) for start, end in spans], (row - 0.34, 0.68), color=colour, lw=0.8)
    axes.grid(axis="y", visible=False)


def _draw_modes(axes: Any, material: Material, facts: Facts, row: int) -> None:
    modes: list[Happening] = []
    for happening in material.happenings:
        if happening.kind == "mode" and not (modes and modes[-1].text == happening.text):
            modes.append(happening)
    ends = [*(mode.time_s for mode in modes[1:]), facts.end_s][: len(modes)]
    span_s = max(facts.end_s - facts.start_s, 1.0)
    for number, (mode, end_s) in enumerate(zip(modes, ends, strict=True)):
        width_s = end_s - mode.time_s
        alpha = 0.3 if number % 2 else 0.18
        axes.broken_barh([(mode.time_s, width_s)], (row - 0.4, 0.8), color=VIOLET, alpha=alpha, lw=0)
        text = plain(mode.text)
        if width_s / span_s > 0.013 * len(text):
            axes.text(mode.time_s + width_s / 2, row, text, ha="center", va="center", fontsize=8, parse_math=False)


def chosen(happenings: Sequence[Happening]) -> tuple[list[Happening], int]:
    """Return what there is room for, in order, and how many were left out: first what is about the EKF and vision."""
    if len(happenings) <= MOST_TEXTS:
        return list(happenings), 0
    said: set[str] = set()
    ranks = []
    for happening in happenings:
        sentence = re.sub(r"[\d.]+", "#", happening.text)
        ranks.append(max(_rank(happening), 1 if sentence in said and happening.kind == "text" else 0))
        said.add(sentence)
    kept = sorted(sorted(range(len(happenings)), key=lambda number: (ranks[number], number))[:MOST_TEXTS])
    return [happenings[number] for number in kept], len(happenings) - MOST_TEXTS


def _rank(happening: Happening) -> int:
    """Return a rank: 0 is nearest to external navigation, and texts of further cores of the EKF come last."""
    if happening.kind == "text":
        of_another_core = re.search(r"IMU[1-9]", happening.text) is not None
        return 3 if of_another_core else 0 if any(word in happening.text for word in _TELLING) else 2
    return 1 if happening.kind == "event" or (happening.kind == "error" and not happening.is_trouble) else 0


def _draw_texts(axes: Any, happenings: Sequence[Happening], facts: Facts) -> None:
    middle_s = (facts.start_s + facts.end_s) / 2
    for row, happening in enumerate(happenings):
        colour = WITHHELD if happening.is_trouble else _COLOURS[happening.kind]
        axes.plot([happening.time_s], [row], "o", color=colour, ms=4, clip_on=False)
        left = happening.time_s <= middle_s
        label = happening.text if happening.kind == "text" else f"{happening.kind}: {happening.text}"
        text = plain(label if len(label) <= _LONGEST_TEXT else label[: _LONGEST_TEXT - 3] + "...")
        axes.annotate(
            f"{text}  {happening.time_s:.1f}" if not left else f"{happening.time_s:.1f}  {text}",
            (happening.time_s, row), xytext=(7 if left else -7, 0), textcoords="offset points", parse_math=False,
            ha="left" if left else "right", va="center", fontsize=8, color=None if happening.kind == "text" else colour,
        )  # fmt: skip
    axes.set_ylim(len(happenings) - 0.3, -0.8)
    axes.set_yticks([])
    axes.spines["left"].set_visible(False)
