# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""``viso record``: a scenario played to a running autopilot, and recorded."""

from pathlib import Path
from typing import Annotated

import typer

from viso.errors import InputError, file_errors, within
from viso.recording.driving import MASTER_HELP, record_at
from viso.recording.outputs import version_text, write_recording
from viso.recording.scenario import SCENARIOS, read_scenario
from viso.terminal.console import err, out
from viso.terminal.outputs import Output
from viso.terminal.process import stop_on_signal


def record(
    scenario_name: Annotated[
        str | None, typer.Argument(help=f"A file, or one of: {', '.join(SCENARIOS)}.", metavar="SCENARIO")
    ] = None,
    master: Annotated[
        str | None,
        typer.Option(help=MASTER_HELP, metavar="LINK"),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="The folder for the recording's files.", metavar="DIR"),
        Output.PLACE,
    ] = None,
    allow_armed: Annotated[bool, typer.Option("--allow-armed", help="Record a vehicle that is armed.")] = False,
    speedup: Annotated[
        float | None,
        typer.Option(help="Seconds of the autopilot in one second; default as its clock runs."),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print what was written as JSON.")] = False,
) -> None:
    """Play a scenario to a running autopilot and record what it does, in the formats that viso replay and doctor read.

    Parameters are set, and restored at the end, whatever ends it; Ctrl-C ends the steps, a second one the download of
    the log. What is not complete is kept and says why; the exit code is then 1. Without SCENARIO they are listed.

    Example: viso record mav --master viso:4.6 -o recordings
    """
    if scenario_name is None:
        for name in SCENARIOS:
            out.print(f"{name}: {read_scenario(name).about}")
        return
    scenario = read_scenario(scenario_name)
    within("--speedup", speedup, 0.01, 1000)
    if master is None:
        raise InputError("--master: missing; the link to the autopilot")
    if output is None:
        raise InputError("-o: missing; the folder for the recording's files")
    with file_errors(f"-o {output}"):
        output.mkdir(parents=True, exist_ok=True)
    with stop_on_signal() as stop:
        recording = record_at(
            master,
            scenario,
            lambda: len(stop),
            on_progress=err.print,
            allow_armed=allow_armed,
            speedup=speedup,
        )
    names = write_recording(output, recording)
    if as_json:
        out.print_json(
            data={
                "firmware": version_text(recording),
                "complete": not recording.problems,
                "problems": recording.problems,
                "files": [str(output / name) for name in names],
            }
        )
    else:
        out.print(f"{scenario.name}: {len(recording.sent)} messages, {version_text(recording)}")
        for name in names:
            out.print(f"{output / name}")
    for problem in recording.problems:
        err.print(f"incomplete: {problem}")
    if recording.problems:
        raise typer.Exit(1)
