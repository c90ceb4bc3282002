# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""``viso replay``: feed a recorded stream to the vehicle in virtual time."""

import json
from contextlib import nullcontext
from pathlib import Path
from typing import Annotated

import typer

from emulator.ahrs_source import (
    AhrsChoice,
    AhrsOption,
    HeadingOption,
    ImuErrorOption,
    ImuOption,
    ImuSeedOption,
    ahrs_maker,
)
from emulator.console import err, out, progress, verdict_rows, verdict_table
from emulator.errors import InputError
from emulator.filter_report import (
    aiding_rows,
    aiding_table,
    filter_rows,
    innovation_rows,
    innovation_table,
    tables_of,
)
from emulator.filter_watch import FilterWatch
from emulator.presets import PRESET_HELP, preset_files
from emulator.replay import Replay
from emulator.settings import load_settings
from emulator.single_log import SingleLog
from emulator.streams import read_stream
from emulator.text_files import write_text
from emulator.vehicle import Vehicle, VehicleConfig


def replay(
    stream_file: Annotated[
        Path, typer.Argument(help="A capture (.jsonl, .jsonl.gz) or a telemetry log (.tlog).", metavar="STREAM")
    ],
    with_filter: Annotated[
        bool, typer.Option("--ekf", help="Tell what the filter makes of the stream; then --imu is follow by default.")
    ] = False,
    imu: ImuOption = None,
    imu_error: ImuErrorOption = None,
    imu_seed: ImuSeedOption = 0,
    ahrs: AhrsOption = None,
    log: Annotated[Path | None, typer.Option(help="Write the DataFlash log here.", metavar="OUT.BIN")] = None,
    records: Annotated[
        Path | None, typer.Option(help="Write a line a message here (.gz compresses).", metavar="OUT.jsonl")
    ] = None,
    preset: Annotated[str | None, typer.Option(help=PRESET_HELP, metavar="NAME")] = None,
    defaults: Annotated[list[Path] | None, typer.Option(help="Parameter file; repeatable.", metavar="FILE")] = None,
    param: Annotated[list[str] | None, typer.Option(help="NAME=VALUE; repeatable, wins over files.")] = None,
    allow_unknown: Annotated[bool, typer.Option(help="Pass over unknown names in parameter files.")] = False,
    baud: Annotated[
        int | None,
        typer.Option(help="Rate of the UART whose transport time is modelled, 0 for none; captures default to 115200."),
    ] = None,
    heading: HeadingOption = 0.0,
    lead: Annotated[float, typer.Option(help="Seconds from boot to the first message of a .tlog.")] = 30.0,
    as_json: Annotated[bool, typer.Option("--json", help="Print the counts as JSON.")] = False,
) -> None:
    """Feed a recorded stream to the autopilot at its arrival times, and tell what became of each message.

    Without --ahrs, --imu and --ekf the vehicle stands still, level, with the given heading. A line of --records holds
    arrival_us, type, out (the VISO, VISP and VISV records, floats as hex bits) and verdict.

    With --ekf the vehicle moves as the stream says, as far as a vehicle can, and it is told what the filter, a model of
    EKF3, makes of each sample, how far off samples are, and when it navigates. A line of --records then has filter as
    well: what became of the message's samples.

    Example: viso replay tests/data/captures/mav.jsonl.gz --ekf --log out.BIN
    """
    if not 0 <= lead <= 4e9:
        raise InputError(f"--lead {lead}: not a time in seconds")
    stream = read_stream(stream_file, int(lead * 1e6))
    files = [*preset_files(preset), *(defaults or [])]
    settings = {**stream.params, **load_settings(files, param or [], links=1, allow_unknown=allow_unknown)}
    rate = (stream.baud if baud is None else baud) or None
    if rate is not None and rate < 0:
        raise InputError(f"--baud {baud}: not a rate")
    if with_filter and ahrs is not None:
        raise InputError("--ekf and --ahrs: a vehicle that follows a log has no filter")
    choice = AhrsChoice(ahrs, imu, imu_error, imu_seed, heading)
    make_ahrs = ahrs_maker(choice, "follow" if with_filter else "bench")
    # Last of all, as it replaces what is there.
    log_file = None if log is None else SingleLog(log)
    open_log = None if log_file is None else log_file.open
    vehicle = Vehicle(VehicleConfig(make_ahrs, defaults=settings, open_log=open_log))
    watch = FilterWatch(vehicle) if with_filter else None
    texts: list[tuple[int, int, str]] = []
    vehicle.texts.on_text.append(lambda severity, text: texts.append((vehicle.clock.micros64(), severity, text)))
    try:
        with (
            nullcontext() if records is None else write_text(records) as sink,
            progress("replaying", len(stream.messages)) as bar,
        ):
            run = Replay(vehicle, stream, rate, watch)
            for message in run.run(lambda fed: bar.update(bar.task_ids[0], completed=fed)):
                if sink is not None:
                    sink.write(json.dumps(message.as_dict()) + "\n")
    finally:
        vehicle.close()
    if log_file is not None and log_file.failure:
        raise InputError(log_file.failure)
    counts = vehicle.endpoint.verdict_counts()
    for note in stream.notes:
        err.print(f"note: {note}")
    if vehicle.unknown_defaults:
        err.print(f"note: parameters of the recording without effect here: {', '.join(vehicle.unknown_defaults)}")
    if as_json:
        rows = [{"time_us": time_us, "severity": severity, "text": text} for time_us, severity, text in texts]
        told = {} if watch is None else _filter_as_dict(vehicle, watch)
        out.print_json(data={"stream": stream.name, "verdicts": verdict_rows(counts), "texts": rows, **told})
        return
    for time_us, severity, text in texts:
        out.print(f"{time_us / 1e6:9.3f} s  ({severity}) {text}")
    if watch is None:
        out.print(verdict_table(counts))
        return
    out.print(*tables_of(counts, vehicle.ahrs.ext_nav_counts))
    if watch.innovations:
        out.print(innovation_table(watch.innovations))
    out.print(aiding_table(watch.aiding()))


def _filter_as_dict(vehicle: Vehicle, watch: FilterWatch) -> dict[str, object]:
    return {
        "filter": filter_rows(vehicle.ahrs.ext_nav_counts),
        "innovations": innovation_rows(watch.innovations),
        "aiding": aiding_rows(watch.aiding()),
    }
