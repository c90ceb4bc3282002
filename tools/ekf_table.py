# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Measure how near the filter comes to recorded logs, as a table in Markdown, a row a log.

The table goes to standard output, or with --page between the lines `<!-- measured: ekf -->` and `<!-- end -->` of a
page. Without names the logs of the tests are measured. It takes seconds for each minute of a log.
"""

import argparse
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

from tools.measured_page import render, replace
from viso.compare.estimates import EstimateComparison, compare_estimates
from viso.compare.tolerances import end_s, kind_of_log, log_name
from viso.errors import InputError
from viso.replay.ekf.run import replay_ekf
from viso.terminal.console import progress

LOGS: Final = Path(__file__).resolve().parent.parent / "tests" / "data" / "logs"
HEAD: Final = (
    "log",
    "north, east: mm rms (worst)",
    "down: mm rms",
    "velocity: mm/s rms",
    "roll, pitch: deg rms",
    "yaw: deg rms",
    "innovations: mm, mm/s rms",
    "TS, SS equal",
    "texts equal, within",
    "targets",
)


def _largest_rms(comparison: EstimateComparison, *labels: str) -> float:
    return max(comparison.errors[label].rms for label in labels)


def row(name: str, comparison: EstimateComparison) -> tuple[str, ...]:
    """Return a row: where a cell stands for several quantities, it holds the largest figure."""
    worst = max(comparison.errors[label].worst for label in ("PN", "PE"))
    texts = comparison.texts
    return (
        f"`{name}`",
        f"{1e3 * _largest_rms(comparison, 'PN', 'PE'):.1f} ({1e3 * worst:.1f})",
        f"{1e3 * _largest_rms(comparison, 'PD'):.1f}",
        f"{1e3 * _largest_rms(comparison, 'VN', 'VE', 'VD'):.1f}",
        f"{_largest_rms(comparison, 'Roll', 'Pitch'):.3f}",
        f"{_largest_rms(comparison, 'Yaw'):.3f}",
        f"{1e3 * _largest_rms(comparison, 'IPN', 'IPE', 'IPD'):.1f}, "
        f"{1e3 * _largest_rms(comparison, 'IVN', 'IVE', 'IVD'):.1f}",
        f"{100 * comparison.equal['TS']:.1f} %, {100 * comparison.equal['SS']:.1f} %",
        f"no, {texts}" if texts.differences else f"yes, {texts.worst_s:.3f} s",
        "met" if comparison.passed else "missed",
    )


def rows(logs: Sequence[Path]) -> Iterator[tuple[str, ...]]:
    """Run the filter over logs, one after the other.

    Raises:
        InputError: a log cannot be used.
    """
    with progress("filtering", len(logs)) as show:
        for number, log in enumerate(logs, 1):
            replay = replay_ekf(log, until_s=end_s(log))
            yield row(log_name(log), compare_estimates(replay, kind_of_log(log)))
            show(number)


def main(arguments: Sequence[str]) -> int:
    """Measure; return 2 when a file cannot be used."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("logs", nargs="*", type=Path, default=sorted(LOGS.glob("*.BIN.xz")), metavar="LOG")
    parser.add_argument("--page", type=Path, help="put the table there")
    options = parser.parse_args(arguments)
    try:
        page = None if options.page is None else options.page.read_text(encoding="utf-8")
        if page is not None:
            replace(page, "ekf", "")  # before the long run
        table = render(HEAD, rows(options.logs))
        if page is None:
            print(table, end="")
        else:
            options.page.write_text(replace(page, "ekf", table), encoding="utf-8")
    except (InputError, OSError) as error:
        print(f"ekf_table: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
