# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Figures of merit of two replays of one stream, side by side."""

from collections.abc import Iterator
from typing import Any, Final, NamedTuple

from rich.table import Column, Table

from viso.compare.figures import OBJECTIVES, Row
from viso.compare.significance import SIGMAS, surplus
from viso.vehicle.outcomes.watch import UNITS

_COMPARED: Final = (
    *(f"rms_{kind}" for kind in UNITS),
    *("nis", "worst_ratio", "rejected", "resets", "time_to_aiding_s", "aiding_share", "aiding_losses"),
    *("log_m", "ate_m"),
)


class Merit(NamedTuple):
    """A figure of both replays; None where one has none."""

    name: str
    before: float | None
    after: float | None


def merits(before: Row, after: Row) -> list[Merit]:
    """Return the figures that any of the two has."""
    found = (Merit(name, before[name], after[name]) for name in _COMPARED)
    return [merit for merit in found if (merit.before, merit.after) != (None, None)]


def merit_rows(before: Row, after: Row) -> list[dict[str, Any]]:
    """Return the same for machines; what is made of innovations with the difference and its deviation."""
    rows = []
    for merit in merits(before, after):
        found = surplus(after, before, merit.name)
        rows.append({**merit._asdict(), "unit": OBJECTIVES[merit.name].unit})
        if found is not None:
            rows[-1] |= {"surplus_of_squares": found.value, "sigma": found.sigma, "chance": found.is_chance}
    return rows


def merit_table(before: Row, after: Row, truth: str | None) -> Table:
    """Return the table for people; ``truth`` is what ``ate_m`` is the distance from."""
    right = Column("before", justify="right"), Column("after", justify="right")
    table = Table("figure", *right, "what it is", title="Figures of merit (the filter is a model)")
    for name, *both in merits(before, after):
        unit, what = OBJECTIVES[name].unit, OBJECTIVES[name].what
        shown = (("-" if value is None else f"{value:.4g} {unit}".rstrip()) for value in both)
        table.add_row(name, *shown, what.replace("the reference", truth) if truth else what)
    return table


def merit_lines(before: Row, after: Row) -> Iterator[str]:
    """Yield whether innovations are smaller than before, by more than chance."""
    found = surplus(after, before)
    if found is None or not before["nis"]:
        return
    share, sigma = (value / before["nis"] for value in found)
    how = "may be chance" if found.is_chance else f"beyond {SIGMAS:g} of these"
    yield f"innovations (nis) change by {share:+.1%}, with a deviation of {sigma:.1%}: {how}"
