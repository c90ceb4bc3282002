# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""``viso ekf``: run the filter over a log with replay records."""

import math
from pathlib import Path
from typing import Annotated

import typer

from viso.compare.estimates import EstimateComparison, compare_estimates
from viso.compare.events import compare_texts
from viso.compare.outputs import estimate_table
from viso.compare.tolerances import end_s, kind_of_log, tolerances_of
from viso.errors import InputError, file_errors
from viso.files.outputs import check_place
from viso.replay.ekf.run import EkfRun
from viso.replay.ekf.run import until as until_time
from viso.terminal.console import err, out, progress
from viso.terminal.options import RecordedFirmwareOption, firmware_of
from viso.terminal.outputs import Output

_FINDINGS = 1


def ekf(
    log: Annotated[Path, typer.Argument(help="A log with replay records (.BIN, packed or not).", metavar="LOG.BIN")],
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="Write the filter's log here.", metavar="OUT.BIN"),
        Output.PLACE,
    ] = None,
    until: Annotated[float | None, typer.Option(help="Seconds since boot at which to end.", metavar="S")] = None,
    firmware: RecordedFirmwareOption = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the comparison as JSON.")] = False,
    with_comparison: Annotated[
        bool, typer.Option("--compare/--no-compare", help="Compare with the log's own estimates.")
    ] = True,
    core: Annotated[int | None, typer.Option(help="The core to run alone; all by default.", min=0, metavar="N")] = None,
    check: Annotated[bool, typer.Option("--check", help="Exit code 1 when a target is missed.")] = False,
) -> None:
    """Run the filter over the replay records of a log (LOG_REPLAY), and compare it with the log's estimates.

    Each core is run with its own IMU and compared by itself; so is which of them is the primary one, and when.
    OUT.BIN has the parameters of the log, and the filter's texts, events and XKF records, these at the times of the
    log's own. Logs named bench_... are judged by when things happen, others by their estimates once aiding has started.
    The filter is that of the firmware that wrote the log, as far as that is known here.

    Example: viso demo --camera simulated && viso ekf logs/00000001.BIN -o out.BIN --until 10
    """
    if until is not None and not until > 0:
        raise InputError(f"--until {until}: not a time since boot")
    if output is not None:
        with file_errors(output):
            output.parent.mkdir(parents=True, exist_ok=True)
        check_place(output)
    chosen = None if firmware is None else firmware_of(firmware)
    run = EkfRun(log, until_s=math.inf if until is None else until, core=core, firmware=chosen)
    _run(run, output)
    for note in run.notes:
        err.print(f"note: {note}")
    comparisons = _compared(run, log) if with_comparison or check else {}
    if not comparisons:
        if check:
            raise InputError(f"{log}: no XKF records to compare with")
        if with_comparison:
            err.print(f"note: {log} has no XKF records to compare with")
        return
    recorded, ours = (until_time(texts, end_s(log)) for texts in (run.recorded_lanes, run.our_lanes))
    lanes = compare_texts("MSG", recorded, ours, tolerances_of(kind_of_log(log)))
    are_equal = core is not None or not lanes.differences
    passed = are_equal and all(comparison.passed for comparison in comparisons.values())
    assert run.judged_by is not None
    if as_json:
        of_cores = [
            {"core": number, "imu": run.imus[number], **found.as_dict()} for number, found in comparisons.items()
        ]
        about = {"log": str(log), **run.judged_by.as_dict(), "passed": passed}
        out.print_json(data={**about, "cores": of_cores, "lanes": None if core is not None else lanes.as_dict()})
    else:
        out.print(f"{log.name}: {run.judged_by}")
        for number, comparison in comparisons.items():
            name = f"{log.name}, core {number} (IMU {run.imus[number]})"
            _print(f"{name}: {comparison.records} records compared, firmware {run.judged_by.firmware.name}", comparison)
        if core is None and (lanes.differences or lanes.matched):
            out.print(f"changes of the primary core: {lanes}")
            for difference in lanes.differences:
                out.print(str(difference))
    if check and not passed:
        raise typer.Exit(_FINDINGS)


def _compared(run: EkfRun, log: Path) -> dict[int, EstimateComparison]:
    """Return the comparison of each core of which the log has estimates."""
    replays = {number: run.comparison(number) for number in run.imus}
    return {
        number: compare_estimates(replay.until(end_s(log)), kind_of_log(log))
        for number, replay in replays.items()
        if replay is not None
    }


def _run(run: EkfRun, output: Path | None) -> None:
    try:
        with progress("filtering", None) as show:
            run.run(show)
    except KeyboardInterrupt:
        if output is not None and not run.output.is_empty:
            run.output.save(output)
            err.print(f"note: interrupted; {output} ends at {run.time_s:.3f} s")
        raise
    if output is not None:
        run.output.save(output)


def _print(title: str, comparison: EstimateComparison) -> None:
    out.print(estimate_table(title, comparison))
    ours, recorded = ("never" if time_s is None else f"at {time_s:.3f} s" for time_s in comparison.aiding_s)
    out.print(f"aiding starts {ours}, the log's {recorded}")
    for difference in comparison.texts.differences:
        out.print(str(difference))
