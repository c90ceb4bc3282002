# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""``viso bench``: how fast it is here."""

import math
import time
from collections.abc import Mapping
from dataclasses import asdict
from typing import Annotated

import typer
from rich.table import Column, Table

from emulator.bench.measure import Figure, measure
from emulator.bench.table import BENCHES
from emulator.console import out, progress
from emulator.errors import InputError


def _chosen(names: list[str]) -> list[str]:
    for name in names:
        if name not in BENCHES:
            raise InputError(f"{name}: no such bench; there are {', '.join(BENCHES)}")
    return [name for name in BENCHES if not names or name in names]


def _number(value: float) -> str:
    return f"{value:,.0f}" if value >= 1000 else f"{value:.3g}"


def _show(figures: Mapping[str, list[Figure]]) -> None:
    titles = ("in a second", "us each", "typically", "95 %", "turns")
    table = Table("bench", "what", *(Column(title, justify="right") for title in titles))
    for name, measured in figures.items():
        for figure in measured:
            costs = (figure.cost_us, figure.typical_cost_us, figure.slow_cost_us, figure.turns)
            table.add_row(name, figure.name, f"{_number(figure.per_second)} {figure.unit}", *map(_number, costs))
    out.print(table)
    out.print(
        "Best of the rounds, in us; typically: their median; 95 % take no longer; turns: of a loop of plain Python."
    )


def bench(
    names: Annotated[
        list[str] | None,
        typer.Argument(help="Any of " + ", ".join(BENCHES) + "; all by default.", metavar="[BENCH]..."),
    ] = None,
    seconds: Annotated[float, typer.Option(help="For how long each bench is run, once it is prepared.")] = 3.0,
    as_json: Annotated[bool, typer.Option("--json", help="Print the figures as JSON.")] = False,
) -> None:
    """Measure how fast the emulator runs on this machine: a vehicle in virtual time, and its parts.

    Time is that of the processor, of which one core is used. "turns" compares a cost with a loop of plain Python
    measured in between, so that figures of different machines, or of a busy one, may be compared.

    Example: viso bench codec --seconds 0.1
    """
    if not 0 <= seconds < math.inf:
        raise InputError(f"--seconds {seconds}: not a time")
    figures: dict[str, list[Figure]] = {}
    chosen = _chosen(names or [])
    with progress("measuring", len(chosen)) as bar:
        for name in chosen:
            figures[name] = measure(BENCHES[name], seconds, time.process_time)
            bar.advance(bar.task_ids[0])
    if as_json:
        out.print_json(data={name: [asdict(figure) for figure in measured] for name, measured in figures.items()})
    else:
        _show(figures)
