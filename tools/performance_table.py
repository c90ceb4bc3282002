# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Measure how fast everything is, as tables in Markdown.

They go to standard output, or with --page between the lines `<!-- measured: NAME -->` and `<!-- end -->` of a page, of
which there are three: where, performance and targets. The benches take a minute or two. Memory is told of a file that
`viso bench --memory 60 --json` has written, which takes longer.
"""

import argparse
import os
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Final, NamedTuple

from tools.measured_page import render, replace
from viso.bench.about import about
from viso.bench.growth import TIMES, name_of
from viso.bench.measure import Figure, measure
from viso.bench.report import read_data
from viso.bench.startup import FIRST_ACCEPTED
from viso.bench.table import BENCHES
from viso.errors import InputError
from viso.terminal.console import progress
from viso.vehicle.kernels import KERNEL_VARIABLE, NUMBA, PLAIN

HEAD: Final = ("bench", "what", "in a second", "us each", "95 %", "ratio")
TARGET_HEAD: Final = ("what", "target", "measured", "")
ON_BOTH_KERNELS: Final = ("loop", "ekf_step")
NOT_HERE: Final = ("vio",)  # has a page of its own
FLAT_SHARE: Final = 0.01
_SETTLED: Final = 10  # minutes after which nothing may grow

Measured = Mapping[tuple[str, str], Sequence[Figure]]
"""Figures by bench and kernel."""


class Target(NamedTuple):
    """What is wanted of a figure: ``value`` takes it, ``limit`` and ``unit`` say what it is held to."""

    what: str
    bench: str
    part: str
    kernel: str
    value: Callable[[Figure], float | None]
    limit: float
    unit: str
    at_least: bool = False

    def is_met(self, value: float) -> bool:
        """Tell whether a value is good enough."""
        return value >= self.limit if self.at_least else value <= self.limit

    def text(self) -> str:
        """Return the limit."""
        return f"{'at least' if self.at_least else 'at most'} {self.limit:,g}{self.unit}"


_CAMERA: Final = "yaw of the camera"
TARGETS: Final = (
    Target(
        "ODOMETRY, bytes to records, by pymavlink's parse",
        *("message", "ODOMETRY with covariance", PLAIN),
        lambda figure: figure.ratio,
        4.0,
        " times",
    ),
    Target("vehicle with filter, compiled", "loop", _CAMERA, NUMBA, lambda figure: figure.per_second, 90.0, "x", True),
    Target("vehicle with filter, plain", "loop", _CAMERA, PLAIN, lambda figure: figure.per_second, 90.0, "x", True),
    Target("100 times the messages", "growth", name_of(TIMES[-1]), PLAIN, lambda figure: figure.ratio, 1.1, ""),
    Target("start to first accepted", "startup", FIRST_ACCEPTED, PLAIN, lambda figure: figure.cost_us / 1e6, 0.7, " s"),
    Target(
        "log as columns, times as fast as DFReader",
        *("log", "read", PLAIN),
        lambda figure: None if figure.ratio is None else 1 / figure.ratio,
        20.0,
        " times",
        True,
    ),
)


def _number(value: float) -> str:
    return f"{value:,.0f}" if value >= 1000 else f"{value:.3g}"


def measure_one(name: str, kernel: str, seconds: float) -> list[Figure]:
    """Measure a bench on a kernel, which this process keeps."""
    os.environ[KERNEL_VARIABLE] = kernel
    clock = time.perf_counter if BENCHES[name].waits else time.process_time
    return measure(BENCHES[name], seconds, clock)


def measure_apart(name: str, kernel: str, seconds: float) -> list[Figure]:
    """Measure a bench in a process of its own, as `viso bench NAME` is.

    An interpreter fits itself to the types that it has met: a kernel that comes second in a process is slower.
    """
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as process:
        return process.submit(measure_one, name, kernel, seconds).result()


def measure_all(seconds: float) -> Measured:
    """Measure all benches, and those with a filter on both kernels."""
    chosen = [(name, PLAIN) for name in BENCHES if name not in NOT_HERE] + [(name, NUMBA) for name in ON_BOTH_KERNELS]
    measured = {}
    with progress("measuring", len(chosen)) as bar:
        for name, kernel in chosen:
            measured[name, kernel] = measure_apart(name, kernel, seconds)
            bar.advance(bar.task_ids[0])
    return measured


def figure_rows(measured: Measured) -> Iterator[tuple[str, ...]]:
    """Yield a row a figure."""
    for (bench, kernel), figures in measured.items():
        name = bench if kernel == PLAIN else f"{bench}, {kernel}"
        for figure in figures:
            ratio = "" if figure.ratio is None else f"{figure.ratio:.3g}"
            costs = _number(figure.cost_us), _number(figure.slow_cost_us)
            yield name, figure.name, f"{_number(figure.per_second)} {figure.unit}", *costs, ratio


def target_rows(measured: Measured, memory: Sequence[Any]) -> Iterator[tuple[str, ...]]:
    """Yield a row a target."""
    for target in TARGETS:
        figures = {figure.name: figure for figure in measured.get((target.bench, target.kernel), ())}
        value = target.value(figures[target.part]) if target.part in figures else None
        if value is None:
            yield target.what, target.text(), "not measured", ""
        else:
            mark = "met" if target.is_met(value) else "missed"
            yield target.what, target.text(), f"{_number(value)}{target.unit}", mark
    yield _memory_row(memory)


def _memory_row(memory: Sequence[Any]) -> tuple[str, ...]:
    row = ("an hour at 200 Hz, what Python keeps", f"flat within {FLAT_SHARE:.0%} after {_SETTLED} minutes")
    settled = [point["blocks"] for point in memory if point["minute"] >= _SETTLED]
    if not settled:
        return *row, "not measured", ""
    spread, last = max(settled) / min(settled) - 1, memory[-1]
    resident = [f"{point['rss_mib']:.0f}" for point in (memory[_SETTLED - 1], last) if point["rss_mib"] is not None]
    text = (
        f"{min(settled):,} to {max(settled):,} blocks, resident {' to '.join(resident) or '?'} MiB, "
        f"log {last['log_mib']:.0f} MiB, {last['minute']} minutes"
    )
    return *row, text, "met" if spread <= FLAT_SHARE else "missed"


def where_rows() -> Iterator[tuple[str, ...]]:
    """Yield what the figures were measured on."""
    told: dict[str, Any] = about()
    yield "machine", f"{told['machine']['processor']}, {told['machine']['cores']} cores"
    yield "versions", ", ".join(f"{name} {version}" for name, version in told["versions"].items())
    yield "commit", str(told["commit"])[:10]


def main(arguments: Sequence[str]) -> int:
    """Measure; return 2 when a file cannot be used."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--page", type=Path, help="put the tables there")
    parser.add_argument("--memory", type=Path, help="what viso bench --memory 60 --json has written")
    parser.add_argument("--seconds", type=float, default=5.0, help="for how long each bench is run")
    options = parser.parse_args(arguments)
    try:
        memory = [] if options.memory is None else read_data(options.memory)["memory"]
        page = "" if options.page is None else options.page.read_text(encoding="utf-8")
        for name in ("where", "performance", "targets") if options.page is not None else ():
            replace(page, name, "")  # before the long run
        measured = measure_all(options.seconds)
        tables = {
            "where": render(("", ""), where_rows()),
            "performance": render(HEAD, figure_rows(measured)),
            "targets": render(TARGET_HEAD, target_rows(measured, memory)),
        }
        if options.page is None:
            print("\n".join(tables.values()), end="")
            return 0
        for name, table in tables.items():
            page = replace(page, name, table)
        options.page.write_text(page, encoding="utf-8")
    except (InputError, OSError) as error:
        print(f"performance_table: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
