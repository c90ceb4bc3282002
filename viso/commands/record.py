# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""``viso record``: a scenario played to a running autopilot, and recorded."""

from contextlib import closing
from pathlib import Path
from typing import Annotated, Final

import typer

from mav_handlers.links import open_link
from viso.errors import InputError, file_errors
from viso.firmware.releases import REFERENCE, Firmware
from viso.options.checks import within
from viso.options.firmware import firmware_of
from viso.options.outputs import Output
from viso.recording.driving import RealDriver, record_viso
from viso.recording.outputs import version_text, write_recording
from viso.recording.recorder import Recorder
from viso.recording.scenario import SCENARIOS, read_scenario
from viso.terminal.console import err, out
from viso.terminal.signals import stop_on_signal

VISO: Final = "viso"


def _viso_firmware(master: str) -> Firmware | None:
    """Return the release that ``viso`` or ``viso:FIRMWARE`` names; None of any other link."""
    scheme, colon, name = master.partition(":")
    if scheme != VISO:
        return None
    return firmware_of(name, "--master viso:") if colon else REFERENCE


def record(
    scenario_name: Annotated[
        str | None, typer.Argument(help=f"A file, or one of: {', '.join(SCENARIOS)}.", metavar="SCENARIO")
    ] = None,
    master: Annotated[
        str | None,
        typer.Option(
            help="Link to the autopilot, as of viso serve; viso or viso:FIRMWARE is a vehicle of this program's own in "
            "virtual time.",
            metavar="LINK",
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="The folder for the recording's files.", metavar="DIR"),
        Output.PLACE,
    ] = None,
    allow_armed: Annotated[bool, typer.Option("--allow-armed", help="Record a vehicle that is armed.")] = False,
    speedup: Annotated[
        float | None,
        typer.Option(help="Seconds of the autopilot in one second; default what its clock tells."),
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
    firmware = _viso_firmware(master)
    with file_errors(f"-o {output}"):
        output.mkdir(parents=True, exist_ok=True)
    recorder = Recorder(scenario, allow_armed=allow_armed, on_progress=err.print)
    with stop_on_signal() as stop:
        if firmware is not None:
            record_viso(recorder, firmware, lambda: len(stop))
        else:
            with closing(open_link(master)) as link:
                RealDriver(recorder, link, lambda: len(stop), speedup=speedup).run()
                if (why := link.stats.unreached) and recorder.recording.problems:
                    recorder.recording.problems[0] += f" ({why})"
    recording = recorder.recording
    if recording.version is None:
        raise InputError(f"--master {master}: {recording.problems[0]}")
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
