# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tell how fast everything is, as tables in Markdown, of files that the benches have written.

They go to standard output, or with --page between the lines `<!-- measured: NAME -->` and `<!-- end -->` of a page, of
which there are three: where, performance and targets.
"""

import argparse
import json
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import pyperf

from tools.bench.table import BENCHES
from tools.measured_page import render, replace
from viso.errors import InputError

HEAD: Final = ("bench", "in a second", "us each", "95 %", "ratio")
TARGET_HEAD: Final = ("what", "target", "measured", "")
FLAT_SHARE: Final = 0.01
_SETTLED: Final = 10  # minutes after which nothing may grow


class Figure(NamedTuple):
    """How fast one thing is.

    Attributes:
        best_s: seconds for one, in the best round.
        slow_s: the same in the round that 95 % of all are not slower than.
        ratio: how many times as long one takes as what it is compared with, each in its best round; None where there is
            nothing to compare with.
    """

    best_s: float
    slow_s: float
    ratio: float | None = None


class Target(NamedTuple):
    """What is wanted of a figure: ``value`` takes it, ``limit`` and ``unit`` say what it is held to."""

    what: str
    bench: str
    value: Callable[[Figure], float | None]
    limit: float
    unit: str
    at_least: bool = False

    def is_met(self, value: float) -> bool:
        """Return whether a value is good enough."""
        return value >= self.limit if self.at_least else value <= self.limit

    def text(self) -> str:
        """Return the limit."""
        return f"{'at least' if self.at_least else 'at most'} {self.limit:,g}{self.unit}"


def _ratio(figure: Figure) -> float | None:
    return figure.ratio


def _per_second(figure: Figure) -> float:
    return 1 / figure.best_s


def _microseconds(figure: Figure) -> float:
    return figure.best_s * 1e6


def _seconds(figure: Figure) -> float:
    return figure.best_s


def _percent(figure: Figure) -> float:
    return 100 * figure.best_s


TARGETS: Final = (
    Target("filter, a frame of a core", "filter", _microseconds, 5.0, " us"),
    Target("filter, a frame of a core, interpreted", "filter-interpreted", _microseconds, 90.0, " us"),
    Target("vehicle with filter", "loop", _per_second, 200.0, "x", True),
    Target("vehicle with filter, interpreted", "loop-interpreted", _per_second, 45.0, "x", True),
    Target("vehicle with 2 IMUs that differ", "loop-2-imus", _per_second, 120.0, "x", True),
    Target("viso ekf, 100 s, two cores", "ekf", _seconds, 1.5, " s"),
    Target("viso ekf, by DFReader's time for the same log", "ekf", _ratio, 0.35, " times"),
    Target("viso doctor, 77 s", "doctor", _seconds, 1.8, " s"),
    Target("viso serve while nothing is sent, share of a core", "idle", _percent, 3.0, "%"),
    Target("ODOMETRY, bytes to records, by pymavlink's parse", "message", _ratio, 2.4, " times"),
    Target("100 times the messages", "growth", _ratio, 1.1, ""),
    Target("start to first accepted", "start", _seconds, 0.5, " s"),
    Target(
        "log as columns, times as fast as DFReader",
        "log",
        lambda figure: None if figure.ratio is None else 1 / figure.ratio,
        20.0,
        " times",
        True,
    ),
)


def figures_of(suite: pyperf.BenchmarkSuite) -> dict[str, Figure]:
    """Return the figures of a suite, in the order of the benches."""
    measured = {bench.get_name(): bench for bench in suite.get_benchmarks()}
    best_s = {name: min(bench.get_values()) for name, bench in measured.items()}
    return {
        name: Figure(
            best_s[name],
            measured[name].percentile(95),
            best_s[name] / best_s[row.beside] if row.beside in best_s else None,
        )
        for name, row in BENCHES.items()
        if name in measured
    }


def _number(value: float) -> str:
    return f"{value:,.0f}" if value >= 1000 else f"{value:.3g}"


def figure_rows(figures: Mapping[str, Figure]) -> Iterator[tuple[str, ...]]:
    """Yield a row a figure, but for those that are there only to be compared with."""
    compared = {BENCHES[name].beside for name in figures}
    for name, figure in figures.items():
        if name not in compared or BENCHES[name].beside:
            ratio = "" if figure.ratio is None else f"{figure.ratio:.3g}"
            costs = _number(figure.best_s * 1e6), _number(figure.slow_s * 1e6)
            yield name, f"{_number(1 / figure.best_s)} {BENCHES[name].unit}", *costs, ratio


def target_rows(figures: Mapping[str, Figure], memory: Sequence[Any]) -> Iterator[tuple[str, ...]]:
    """Yield a row a target."""
    for target in TARGETS:
        value = target.value(figures[target.bench]) if target.bench in figures else None
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
    text = (
        f"{min(settled):,} to {max(settled):,} blocks, resident {memory[_SETTLED - 1]['rss_mib']:.0f} to "
        f"{last['rss_mib']:.0f} MiB, log {last['log_mib']:.0f} MiB, {last['minute']} minutes"
    )
    return *row, text, "met" if spread <= FLAT_SHARE else "missed"


def where_rows(suite: pyperf.BenchmarkSuite) -> Iterator[tuple[str, ...]]:
    """Yield what the figures were measured on."""
    told = suite.get_metadata()
    yield "machine", f"{told.get('cpu_model_name', 'unknown')}, {told.get('cpu_count', '?')} cores"
    yield "versions", f"python {str(told['python_version']).split()[0]}, {told.get('packages', 'unknown')}"
    yield "commit", str(told.get("commit"))[:10]


def _suite(path: Path) -> pyperf.BenchmarkSuite:
    try:
        return pyperf.BenchmarkSuite.load(str(path))
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise InputError(f"{path}: not what python -m tools.bench -o writes: {error}") from error


def main(arguments: Sequence[str]) -> int:
    """Make the tables; return 2 when a file cannot be used."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("speed", type=Path, help="what python -m tools.bench -o has written")
    parser.add_argument("--memory", type=Path, help="what python -m tools.bench.memory 60 has printed")
    parser.add_argument("--page", type=Path, help="put the tables there")
    options = parser.parse_args(arguments)
    try:
        memory = [] if options.memory is None else json.loads(options.memory.read_text(encoding="utf-8"))
        suite = _suite(options.speed)
        figures = figures_of(suite)
        tables = {
            "where": render(("", ""), where_rows(suite)),
            "performance": render(HEAD, figure_rows(figures)),
            "targets": render(TARGET_HEAD, target_rows(figures, memory)),
        }
        if options.page is None:
            print("\n".join(tables.values()), end="")
            return 0
        page = options.page.read_text(encoding="utf-8")
        for name, table in tables.items():
            page = replace(page, name, table)
        options.page.write_text(page, encoding="utf-8")
    except (InputError, OSError, ValueError) as error:
        print(f"performance_table: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
