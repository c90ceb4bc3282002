# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Figures as tables, as JSON, and beside those of another commit."""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

from rich.table import Column, Table

from viso.bench.about import about
from viso.bench.measure import Figure
from viso.bench.memory import MemoryPoint
from viso.bench.table import BENCHES
from viso.errors import InputError

Figures = Mapping[str, Sequence[Figure]]

_TITLES: Final = ("in a second", "us each", "typically", "95 %", "turns", "ratio")
NOTE: Final = (
    "Best of the rounds, in us; typically: their median; 95 % take no longer; turns: of a loop of plain Python; "
    "ratio: to what stands beside it, both in their best round."
)


def _number(value: float) -> str:
    return f"{value:,.0f}" if value >= 1000 else f"{value:.3g}"


def table_of(figures: Figures) -> Table:
    """Return the figures as a table."""
    table = Table("bench", "what", *(Column(title, justify="right") for title in _TITLES))
    for name, measured in figures.items():
        for figure in measured:
            costs = (figure.cost_us, figure.typical_cost_us, figure.slow_cost_us, figure.turns)
            ratio = "" if figure.ratio is None else f"{figure.ratio:.2f}"
            table.add_row(name, figure.name, f"{_number(figure.per_second)} {figure.unit}", *map(_number, costs), ratio)
    return table


def ratio_notes(figures: Figures) -> Iterator[str]:
    """Yield what the ratios compare with, a line a bench."""
    for name in figures:
        if BENCHES[name].beside:
            yield f"ratio of {name}: to {BENCHES[name].beside}"


def memory_table(points: Sequence[MemoryPoint]) -> Table:
    """Return what memory there was after some minutes, as a table."""
    titles = ("minutes", "resident MiB", "blocks", "traced MiB", "log MiB")
    table = Table(*(Column(title, justify="right") for title in titles))
    for point in points:
        resident, traced = ("" if mib is None else f"{mib:.2f}" for mib in (point.rss_mib, point.traced_mib))
        table.add_row(str(point.minute), resident, f"{point.blocks:,}", traced, f"{point.log_mib:.1f}")
    return table


def data_of(figures: Figures, memory: Sequence[MemoryPoint] = ()) -> dict[str, object]:
    """Return the figures with where they come from, for JSON."""
    benches = {name: [asdict(figure) for figure in measured] for name, measured in figures.items()}
    return {**about(), "benches": benches, "memory": [asdict(point) for point in memory]}


def read_data(path: Path) -> Any:
    """Return what :func:`data_of` once gave, out of a file.

    Raises:
        InputError: the file cannot be read, or is no such data.
    """
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: {error}") from error
    try:
        for measured in data["benches"].values():
            for figure in measured:
                float(figure["turns"]), float(figure["cost_us"]), str(figure["name"])
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise InputError(f"{path}: benches: not what viso bench --json writes: {error!r}") from error
    return data


def comparison_table(old: Any, new: Any) -> Table:
    """Return how many times as fast each thing is as it was, by turns of the loop of plain Python."""
    title = f"{_commit(old)} then, {_commit(new)} now"
    right = [Column(name, justify="right") for name in ("turns then", "turns now", "times as fast")]
    table = Table("bench", "what", *right, title=title)
    for name, measured in new["benches"].items():
        before = {figure["name"]: figure for figure in old["benches"].get(name, [])}
        for figure in measured:
            if figure["name"] in before:
                then, now = before[figure["name"]]["turns"], figure["turns"]
                table.add_row(name, figure["name"], _number(then), _number(now), f"{then / now:.2f}")
    return table


def _commit(data: Any) -> str:
    return str(data.get("commit") or "no commit")[:10]
