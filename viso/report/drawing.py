# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the figures share: colours that stand on light and dark ground, and how they become files or part of a page."""

import io
import re
import textwrap
from collections.abc import Sequence
from typing import Any, Final

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from viso.estimators.series import Array

VISION: Final = "#e07b00"
EKF: Final = "#2f7fd0"
WITHHELD: Final = "#d83a3a"
GATE: Final = "#d83a3a"
GREEN: Final = "#2c9a4b"
VIOLET: Final = "#8f5fc4"
MUTED: Final = "#7a828c"
AXES: Final = (EKF, VISION, GREEN)
"""North, east, down."""

WIDTH_IN: Final = 10.0
MANY: Final = 1500
"""More points than these become a picture within an SVG, which would be slow to show otherwise."""

_PDF_PAGE_IN: Final = (10.0, 7.0)
_PDF_COLUMNS: Final = 105
_PDF_ROWS: Final = 24
_INK: Final = "#010203"  # in a page its style sheet takes the place of this colour
_RC: Final[dict[Any, Any]] = {
    "font.size": 9.5,
    "font.family": "DejaVu Sans",
    "text.color": _INK,
    "axes.edgecolor": MUTED,
    "axes.labelcolor": _INK,
    "axes.titlesize": 10,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.facecolor": "none",
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.unicode_minus": True,
    "grid.color": MUTED,
    "grid.alpha": 0.25,
    "xtick.color": _INK,
    "ytick.color": _INK,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "svg.fonttype": "path",
    "savefig.dpi": 130,
}


def style() -> Any:
    """Return a context in which figures are drawn and saved."""
    return matplotlib.rc_context(_RC)


def new_figure(height_in: float) -> Figure:
    """Return an empty figure as wide as all of them."""
    return Figure(figsize=(WIDTH_IN, height_in), layout="constrained")


def plain(text: str) -> str:
    """Return a text of the log with every character that the font may lack as a question mark."""
    return "".join(char if char.isprintable() and ord(char) < 0x250 else "?" for char in text)


def dots(axes: Any, x: Array, y: Array, colour: str, label: str, size: float = 3.0) -> None:
    """Draw a dot for each pair of finite numbers; nothing, and no legend, without any."""
    known = np.isfinite(x) & np.isfinite(y)
    if known.any():
        many = bool(known.sum() > MANY)
        axes.plot(x[known], y[known], ".", color=colour, ms=size, mew=0, label=label, rasterized=many)


def line(axes: Any, x: Array, y: Array, colour: str, label: str, width: float = 1.2) -> None:
    """Draw a line, broken where a number is missing; nothing, and no legend, without any number."""
    if np.isfinite(y).any():
        axes.plot(x, y, color=colour, lw=width, label=label, rasterized=len(x) > 20 * MANY)


def shade(axes: Any, spans: Sequence[tuple[float, float]], colour: str, label: str, alpha: float = 0.16) -> None:
    """Shade stretches of time behind everything else; one entry in the legend."""
    if spans:
        bars = [(start, end - start) for start, end in spans]
        across = axes.get_xaxis_transform()
        axes.broken_barh(bars, (0, 1), transform=across, color=colour, alpha=alpha, lw=0, zorder=0, label=label)


def broken_at(x: Array, values: Array, times_s: Array) -> tuple[Array, Array]:
    """Return a curve with a hole before the first record at or after each time, so that no line is drawn across."""
    at = np.searchsorted(x, times_s)
    return np.insert(x, at, np.nan), np.insert(values, at, np.nan, axis=0)


def no_flatter_than(axes: Any, span: float) -> None:
    """Widen the vertical scale to at least so much, so that noise does not look like an event."""
    low, high = axes.get_ylim()
    if high - low < span:
        axes.set_ylim((low + high - span) / 2, (low + high + span) / 2)


def level(axes: Any, value: float, colour: str, text: str, above: bool = True) -> None:
    """Draw a level across, named at its right end, above the line or below it."""
    axes.axhline(value, color=colour, lw=1, ls="--", zorder=1)
    axes.annotate(
        text, (1, value), xycoords=("axes fraction", "data"), xytext=(-4, 2 if above else -2),
        textcoords="offset points", ha="right", va="bottom" if above else "top", color=colour, fontsize=8.5,
    )  # fmt: skip


def legend(axes: Any, columns: int = 4) -> None:
    """Put a legend above the axes, at the right of the title, if there is anything to name."""
    handles, _ = axes.get_legend_handles_labels()
    if handles:
        axes.legend(
            loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=columns, borderaxespad=0.1, handlelength=1.4,
            columnspacing=1.2, markerscale=2.5,
        )  # fmt: skip


def saved(figure: Figure, form: str, ground: str = "white") -> bytes:
    """Return a figure as a file of a form, png or svg."""
    data = io.BytesIO()
    metadata = {"Date": None} if form == "svg" else None
    figure.savefig(data, format=form, facecolor=ground, metadata=metadata)
    return data.getvalue()


def as_pdf(title: str, lines: Sequence[str], figures: Sequence[Figure]) -> bytes:
    """Return a document: lines of any length on pages of their own, each with the title, then each figure on one."""
    from matplotlib.backends.backend_pdf import PdfPages

    rows = [row for line in lines for row in textwrap.wrap(plain(line), _PDF_COLUMNS) or [""]]
    data = io.BytesIO()
    with PdfPages(data, metadata={"Title": plain(title), "CreationDate": None}) as pages:
        for start in range(0, len(rows), _PDF_ROWS):
            figure = Figure(figsize=_PDF_PAGE_IN)
            figure.text(0.07, 0.93, plain(title), fontsize=14, weight="bold", va="top", parse_math=False)
            text = "\n".join(rows[start : start + _PDF_ROWS])
            figure.text(0.07, 0.88, text, fontsize=10, va="top", linespacing=1.5, parse_math=False)
            pages.savefig(figure, facecolor="white")
        for figure in figures:
            pages.savefig(figure, facecolor="white")
    return data.getvalue()


def as_inline_svg(figure: Figure, name: str, title: str) -> str:
    """Return a figure as an element of a page, whose style sheet gives the colour of texts: var(--ink).

    Its ids begin with its name, which no other figure of the page has. The title must not hold markup.
    """
    with matplotlib.rc_context({"svg.hashsalt": name}):
        text = saved(figure, "svg", "none").decode()
    text = text[text.index("<svg") :]
    text = re.sub(r"\s*<metadata>.*?</metadata>", "", text, count=1, flags=re.DOTALL)
    text = re.sub(r"\s*<!--.*?-->", "", text, flags=re.DOTALL)
    # Groups are named alike in every figure, and nothing refers to them; letters are referred to.
    text = re.sub(r'<g id="[^"]*">', "<g>", text)
    text = re.sub(r'(id="|href="#)(DejaVuSans)', rf"\1{name}-\2", text)
    text = text.replace(_INK, "var(--ink)")
    head = f'<svg role="img" aria-label="{title}"'
    return head + re.sub(r'^(<svg[^>]*?) width="[^"]*"', r"\1", re.sub(r' height="[\d.]+pt"', "", text, count=1))[4:]
