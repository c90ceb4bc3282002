# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""``viso ekf``: run the filter over a log with replay records."""

import math
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table
from rich.text import Text

from viso.ekf_runs import targets as ekf_targets
from viso.ekf_runs.comparison import Comparison, compare
from viso.ekf_runs.run import EkfRun
from viso.errors import InputError, file_errors
from viso.files.outputs import check_place
from viso.firmware.releases import Firmware
from viso.options.firmware import DEFAULT_FIRMWARE, FirmwareOption, firmware_of
from viso.options.outputs import Output
from viso.terminal.console import err, out, progress

_FINDINGS = 1


def ekf(
    log: Annotated[Path, typer.Argument(help="A log with replay records (.BIN, .BIN.xz).", metavar="LOG.BIN")],
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="Write the filter's log here.", metavar="OUT.BIN"),
        Output.PLACE,
    ] = None,
    until: Annotated[float | None, typer.Option(help="Seconds since boot at which to end.", metavar="S")] = None,
    firmware: FirmwareOption = DEFAULT_FIRMWARE,
    as_json: Annotated[bool, typer.Option("--json", help="Print the comparison as JSON.")] = False,
    with_comparison: Annotated[
        bool, typer.Option("--compare/--no-compare", help="Compare with the log's own estimates of core 0.")
    ] = True,
    check: Annotated[bool, typer.Option("--check", help="Exit code 1 when a target is missed.")] = False,
) -> None:
    """Run the filter over the replay records of a log (LOG_REPLAY), and tell how near it comes to the log's estimates.

    OUT.BIN has the parameters of the log, and the filter's texts, events and XKF records, these at the times of the
    log's own. Logs named bench_... are judged by when things happen, others by their estimates once aiding has started.
    All firmware that can be chosen has the same filter; which one it is meant to be is told with the comparison.

    Example: viso demo --camera simulated && viso ekf logs/00000001.BIN -o out.BIN --until 10
    """
    if until is not None and not until > 0:
        raise InputError(f"--until {until}: not a time since boot")
    if output is not None:
        with file_errors(output):
            output.parent.mkdir(parents=True, exist_ok=True)
        check_place(output)
    profile = firmware_of(firmware)
    run = EkfRun(log, until_s=math.inf if until is None else until)
    _run(run, output)
    replay = run.comparison() if with_comparison or check else None
    if replay is None:
        if check:
            raise InputError(f"{log}: no XKF records to compare with")
        if with_comparison:
            err.print(f"note: {log} has no XKF records to compare with")
        return
    comparison = compare(replay.until(ekf_targets.end_s(log)), bench=ekf_targets.is_bench(log))
    if as_json:
        out.print_json(
            data={"log": str(log), "firmware": profile.name, "passed": comparison.passed, **asdict(comparison)}
        )
    else:
        _show(log, comparison, profile)
    if check and not comparison.passed:
        raise typer.Exit(_FINDINGS)


def _run(run: EkfRun, output: Path | None) -> None:
    try:
        with progress("filtering", None) as bar:
            run.run(lambda frames, total: bar.update(bar.task_ids[0], completed=frames, total=total))
    except KeyboardInterrupt:
        if output is not None and not run.output.is_empty:
            run.output.save(output)
            err.print(f"note: interrupted; {output} ends at {run.time_s:.3f} s")
        raise
    if output is not None:
        run.output.save(output)


def _show(log: Path, comparison: Comparison, firmware: Firmware) -> None:
    title = f"{log.name}: {comparison.records} records compared, firmware {firmware.name}"
    table = Table("", "against the log", "target", "", title=title)
    for check in comparison.checks:
        mark = Text("") if not check.target else Text("ok", "green") if check.passed else Text("missed", "red")
        table.add_row(check.what, check.figure, check.target, mark)
    out.print(table)
    ours, recorded = ("never" if time_s is None else f"at {time_s:.3f} s" for time_s in comparison.aiding_s)
    out.print(f"aiding starts {ours}, the log's {recorded}")
    for line in comparison.texts.lines:
        out.print(f"text at {line}")
