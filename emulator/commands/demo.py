# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""``viso demo``: everything at once, without hardware."""

from pathlib import Path
from typing import Annotated

import typer

from emulator.console import err, out, progress, verdict_rows
from emulator.demo import END_S, Demo, DemoResult
from emulator.errors import InputError
from emulator.filter_report import aiding_rows, filter_rows, tables_of
from emulator.log_files import LogStore

_PLOT_HINT = "no plot: matplotlib is missing; install it with: pip install 'viso[plot]'"


def _save_plot(result: DemoResult, path: Path) -> Path | None:
    try:
        from emulator.demo_plot import save_plot
    except ModuleNotFoundError as error:
        if error.name is None or not error.name.startswith("matplotlib"):
            raise
        err.print(_PLOT_HINT)
        return None
    try:
        save_plot(result, path)
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}") from error
    return path


def demo(
    seed: Annotated[int, typer.Option(help="Seed of all noise; the same seed gives the same log.", min=0)] = 1,
    log_dir: Annotated[Path, typer.Option(help="Where the log and the plot go.")] = Path("logs"),
    plot: Annotated[bool, typer.Option(help="Draw what happened, if matplotlib is there.")] = True,
    as_json: Annotated[bool, typer.Option("--json", help="Print the outcome as JSON.")] = False,
) -> None:
    """Fly a scripted figure of eight in virtual time, seen by a simulated camera that sends ODOMETRY.

    The autopilot refuses to arm before the data comes, aligns its yaw, arms, and navigates by the camera: its filter, a
    model of EKF3, fuses what it is given. It withholds low quality and the second after a reset from the filter, which
    then follows the camera's jump; it notices a dropout; the filter's gate rejects a second of wrong places. The
    DataFlash log holds the filter's inputs and estimates.

    Example: viso demo --seed 1
    """
    # Opened ahead of the run, so that a place that cannot be written to is told at once.
    log_file = LogStore(log_dir).open_next()
    run = Demo(seed, lambda: log_file)
    with progress("flying", int(END_S)) as bar:
        result = run.run(lambda time_s: bar.update(bar.task_ids[0], completed=time_s))
    if log_file.reason:
        raise InputError(log_file.reason)
    picture = _save_plot(result, log_file.path.with_suffix(".png")) if plot else None
    counts, filter_counts = run.vehicle.endpoint.verdict_counts(), run.vehicle.ahrs.ext_nav_counts
    if as_json:
        texts = [{"time_s": time_s, "severity": severity, "text": text} for time_s, severity, text in result.texts]
        files = {"log": str(log_file.path), "plot": None if picture is None else str(picture)}
        told = {"filter": filter_rows(filter_counts), "aiding": aiding_rows(result.aiding)}
        out.print_json(data={**files, "texts": texts, "verdicts": verdict_rows(counts), **told})
        return
    out.print("What the autopilot said:")
    for time_s, severity, text in result.texts:
        out.print(f"{time_s:7.2f} s  ({severity}) {text}")
    out.print(*tables_of(counts, filter_counts))
    out.print(f"log:  {log_file.path}")
    if picture is not None:
        out.print(f"plot: {picture}")
