# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""``viso bench``: how fast it is here."""

import math
import time
from pathlib import Path
from typing import Annotated

import typer

from viso.bench.measure import Figure, measure
from viso.bench.memory import MemoryPoint, run
from viso.bench.report import (
    NOTE,
    Figures,
    comparison_table,
    data_of,
    memory_table,
    ratio_notes,
    read_data,
    table_of,
)
from viso.bench.table import BENCHES
from viso.errors import InputError
from viso.terminal.console import out, progress


def _chosen(names: list[str]) -> list[str]:
    for name in names:
        if name not in BENCHES:
            raise InputError(f"{name}: no such bench; there are {', '.join(BENCHES)}")
    return [name for name in BENCHES if not names or name in names]


def _measure_memory(minutes: int, *, trace: bool) -> list[MemoryPoint]:
    points: list[MemoryPoint] = []
    with progress("filling memory", minutes) as bar:

        def note(point: MemoryPoint) -> None:
            points.append(point)
            bar.advance(bar.task_ids[0])

        run(minutes, note, trace=trace)
    return points


def _show(figures: Figures, points: list[MemoryPoint]) -> None:
    if figures:
        out.print(table_of(figures))
        out.print(NOTE)
    for note in ratio_notes(figures):
        out.print(note)
    if points:
        out.print(memory_table(points))


def bench(
    names: Annotated[
        list[str] | None,
        typer.Argument(help="Any of " + ", ".join(BENCHES) + "; all by default.", metavar="[BENCH]..."),
    ] = None,
    seconds: Annotated[float, typer.Option(help="For how long each bench is run, once it is prepared.")] = 3.0,
    memory_minutes: Annotated[
        int,
        typer.Option(
            "--memory",
            help="In place of the benches, send a vehicle 200 messages a second for so many minutes of its time, and "
            "tell what memory there is; 60 take some minutes.",
            metavar="MINUTES",
        ),
    ] = 0,
    trace: Annotated[
        bool, typer.Option("--trace", help="With --memory, also trace what is allocated: takes four times as long.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the figures as JSON.")] = False,
    old: Annotated[
        Path | None, typer.Option("--compare", help="Also compare with figures of an earlier --json.", metavar="JSON")
    ] = None,
) -> None:
    """Measure how fast the emulator runs on this machine: a vehicle in virtual time, and its parts.

    Time is that of the processor, of which one core is used; for startup it is that of the clock on the wall. "turns"
    compares a cost with a loop of plain Python measured in between, so that figures of different machines, or of a busy
    one, may be compared.

    VISO_KERNEL=numba in the environment has the filter's arithmetic compiled (extra numba). The JSON has the machine,
    the versions and the commit, and may be kept to be compared with.

    Example: viso bench codec --seconds 0.1
    """
    if not 0 <= seconds < math.inf:
        raise InputError(f"--seconds {seconds}: not a time")
    if memory_minutes < 0:
        raise InputError(f"--memory {memory_minutes}: not a number of minutes")
    before = None if old is None else read_data(old)
    figures: dict[str, list[Figure]] = {}
    chosen = _chosen(names or []) if names or not memory_minutes else []
    with progress("measuring", len(chosen)) as bar:
        for name in chosen:
            clock = time.perf_counter if BENCHES[name].waits else time.process_time
            figures[name] = measure(BENCHES[name], seconds, clock)
            bar.advance(bar.task_ids[0])
    points = _measure_memory(memory_minutes, trace=trace) if memory_minutes else []
    data = data_of(figures, points)
    if as_json:
        out.print_json(data=data)
        return
    _show(figures, points)
    if before is not None:
        out.print(comparison_table(before, data))
