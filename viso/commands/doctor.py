# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""``viso doctor``: what the autopilot would do with a stream, and what to change."""

import json
import time
from contextlib import closing
from pathlib import Path
from typing import Annotated, Final

import typer

from mav_handlers.links import LINKS, open_link
from viso.dds.poses import PoseTopic, live_topic_of
from viso.doctor import Evidence, Finding, Severity, VehicleData, all_checks, diagnose, gather
from viso.doctor.checks.causes import probable_cause
from viso.doctor.evidence.live import heard_on_link, heard_on_topic, stream_of_topic
from viso.doctor.evidence.vehicle_data import vehicle_of_log
from viso.doctor.output.machine_formats import as_json, as_junit, as_sarif
from viso.doctor.output.summary import summarise
from viso.doctor.output.terminal import count_text, finding_lines, summary_lines, summary_table
from viso.errors import InputError
from viso.extras import installed_version
from viso.files.text_files import write_text
from viso.geometry.frame_change import PRESETS as AXES
from viso.streams.heard import firmware_of_recording
from viso.streams.readers import FORMATS
from viso.streams.recorded_poses import FORMS_AS_RECORDED, check_form
from viso.streams.sessions import one_session
from viso.streams.stream_kinds import Stream, TrajectoryOptions, read_whole_stream
from viso.streams.trajectory import axes_of
from viso.terminal.ahrs import heading_in_rad
from viso.terminal.console import err, out, progress
from viso.terminal.options import DomainOption, RecordedFirmwareOption, firmware_of
from viso.terminal.outputs import Output
from viso.terminal.process import stop_on_signal
from viso.terminal.settings import PRESET_HELP, STRICT_HELP, load_settings, preset_files, read_assignment

EXIT_FINDINGS: Final = 1
_LONGEST_S: Final = 86_400.0
_TRAJECTORY: Final = TrajectoryOptions()


def doctor(
    source: Annotated[
        str,
        typer.Argument(
            help="A telemetry log (.tlog), a DataFlash log (.BIN), a capture (.jsonl), packed or not, a trajectory "
            "(TUM, EuRoC, KITTI and others, bags of ROS 1 and 2, MCAP), or what to listen to: a link, such as "
            "udpin:0.0.0.0:14550, or a topic of ROS 2, such as ros2:/odom.",
            metavar="FILE_OR_LINK",
        ),
    ],
    fail_on: Annotated[Severity, typer.Option(help="Exit with 1 if there is a finding as bad as this.")] = (
        Severity.ERROR
    ),
    as_json_text: Annotated[bool, typer.Option("--json", help="Print findings and summary as JSON.")] = False,
    sarif: Annotated[
        Path | None, typer.Option(help="Write findings here as SARIF 2.1.0.", metavar="FILE"), Output.FILE
    ] = None,
    junit: Annotated[
        Path | None, typer.Option(help="Write findings here as JUnit XML.", metavar="FILE"), Output.FILE
    ] = None,
    seconds: Annotated[float, typer.Option(help="How long to listen to a link or a topic.")] = 20.0,
    domain: DomainOption = 0,
    preset: Annotated[str | None, typer.Option(help=PRESET_HELP, metavar="NAME")] = None,
    defaults: Annotated[list[Path] | None, typer.Option(help="Parameter file; repeatable.", metavar="FILE")] = None,
    param: Annotated[list[str] | None, typer.Option(help="NAME=VALUE; repeatable, wins over files.")] = None,
    strict: Annotated[bool, typer.Option("--strict", help=STRICT_HELP)] = False,
    firmware: RecordedFirmwareOption = None,
    attitude: Annotated[
        Path | None,
        typer.Option(help="Take the vehicle's own attitude from this log (.BIN, packed or not).", metavar="LOG"),
    ] = None,
    baud: Annotated[
        int | None,
        typer.Option(help="Rate of the UART whose transport time is modelled, 0 for none; captures default to 115200."),
    ] = None,
    heading: Annotated[
        float, typer.Option(help="Where the vehicle points at first in degrees, if its attitude is not known.")
    ] = 0.0,
    filter_seconds: Annotated[
        float, typer.Option(help="For how long to run the filter, a model, over external navigation; it takes long.")
    ] = 120.0,
    lead: Annotated[
        float, typer.Option(help="Seconds from boot to the first message, if the file does not have it.")
    ] = (30.0),
    session: Annotated[
        int | None,
        typer.Option(help="Which one, from 1, if the autopilot was rebooted; default that with most to look at."),
    ] = None,
    axes: Annotated[
        str, typer.Option(help=f"Of a trajectory or a topic: WORLD/BODY, such as ENU/FLU, or {', '.join(AXES)}.")
    ] = _TRAJECTORY.axes,
    topic: Annotated[str | None, typer.Option(help="Of a bag; default the only one with poses.")] = None,
    form: Annotated[
        str | None,
        typer.Option(
            "--as",
            help=f"What a trajectory or topic is sent as: {', '.join(FORMS_AS_RECORDED)}; default the one that "
            "carries what it holds.",
        ),
    ] = None,
    format_name: Annotated[
        str | None, typer.Option("--format", help=f"Of a trajectory, if not to be found out: {', '.join(FORMATS)}.")
    ] = None,
    times: Annotated[Path | None, typer.Option(help="File with the times of KITTI's poses.", metavar="FILE")] = None,
) -> None:
    """Report what the autopilot would do with a stream of external navigation, and what to change.

    The stream is tried on the autopilot in virtual time, on a vehicle that moves as it says. Parameters are those
    given, else those of the recording, else a set-up that fits the stream. What the autopilot itself says in the
    recording, its attitude above all, is compared with the stream. Each finding has a code, which the doctor's page
    explains.

    A trajectory, a bag or a topic is sent as it stands, with all that may be wrong with it; what it does not hold, such
    as how messages crossed a link, is passed over. If the autopilot was rebooted within a recording, one session
    is looked at, and a note says which.

    Exit code 1: there is an error (see --fail-on).

    Example: seq -f '%g 0 0 -1 0 0 0 1' 0 .05 9 > poses.tum && viso doctor poses.tum
    """
    if not 0 <= lead <= 4e9:
        raise InputError(f"--lead {lead:g}: not a time in seconds")
    if not 0 < seconds <= _LONGEST_S:
        raise InputError(f"--seconds {seconds:g}: not between 0 and a day")
    if not filter_seconds >= 0:
        raise InputError(f"--filter-seconds {filter_seconds:g}: not a time in seconds")
    heading_rad = heading_in_rad(heading)
    chosen = None if firmware is None else firmware_of(firmware)
    files = [*preset_files(preset), *(defaults or [])]
    for text in param or []:
        read_assignment(text)
    trajectory = TrajectoryOptions(format_name=format_name, topic=topic, times=times, axes=axes)
    live_topic = live_topic_of(source)
    if live_topic is not None:
        check_form(form)
        axes_of(axes)
        stream = _hear(live_topic, domain, seconds, int(lead * 1e6), axes, form)
    elif _is_link(source):
        stream = _listen(source, seconds, int(lead * 1e6))
    else:
        with progress(f"reading {source}", None):
            stream = read_whole_stream(Path(source), int(lead * 1e6), trajectory, form)
    try:
        stream = one_session(stream, session)
    except ValueError as error:
        raise InputError(f"--session {session}: {error}") from error
    profile = firmware_of_recording(stream, chosen).firmware
    params = load_settings(files, param or [], links=1, strict=strict, firmware=profile)
    rate = (stream.baud if baud is None else baud) or None
    if rate is not None and rate < 0:
        raise InputError(f"--baud {baud}: not a rate")
    vehicle = _vehicle_of(attitude, Path(source))
    with progress("trying the stream", len(stream.messages)) as show:
        evidence = gather(
            stream,
            params=params,
            vehicle=vehicle,
            firmware=chosen,
            baud=rate,
            heading_rad=heading_rad,
            filter_s=filter_seconds,
            on_progress=show,
        )
    checks = all_checks()
    findings = diagnose(evidence, checks)
    if sarif is not None:
        _write(sarif, json.dumps(as_sarif(source, installed_version(), checks, findings), indent=1) + "\n")
    if junit is not None:
        _write(junit, as_junit(source, checks, findings, fail_on))
    if as_json_text:
        out.print_json(data=as_json(evidence, summarise(evidence), findings))
    else:
        _print(evidence, findings)
    if any(finding.severity.at_least(fail_on) for finding in findings):
        raise typer.Exit(EXIT_FINDINGS)


def _is_link(source: str) -> bool:
    scheme, colon, _ = source.partition(":")
    return not Path(source).is_file() and (source.startswith("/dev/") or (bool(colon) and scheme in LINKS))


def _listen(connection: str, seconds: float, lead_us: int) -> Stream:
    with closing(open_link(connection)) as link:
        with stop_on_signal() as signals, progress(f"listening to {connection}", int(seconds)) as show:
            stream = heard_on_link(link, lead_us, seconds, time.monotonic, lambda: bool(signals), show)
        if why := link.stats.unreached:
            raise InputError(f"{connection}: {why}")
    return stream


def _hear(name: str, domain: int, seconds: float, lead_us: int, axes: str, form: str | None) -> Stream:
    with closing(PoseTopic(name, domain)) as topic:
        with stop_on_signal() as signals, progress(f"listening to {name}", int(seconds)) as show:
            heard = heard_on_topic(topic, seconds, time.time_ns, lambda: bool(signals), show)
        return stream_of_topic(topic, heard, lead_us, axes, form)


def _vehicle_of(log: Path | None, source: Path) -> VehicleData:
    """Return the vehicle's data in a log; without a log, those in the source if it is one."""
    vehicle = vehicle_of_log(source if log is None else log)
    if log is not None and vehicle.attitude is None:
        raise InputError(f"{log}: not a DataFlash log with ATT records")
    return vehicle


def _print(evidence: Evidence, findings: list[Finding]) -> None:
    for note in evidence.notes:
        err.print(f"note: {note}")
    cause = probable_cause(findings)
    if cause is not None:
        out.print(f"probable cause: {cause}\n", soft_wrap=True)
    first = [] if cause is None else [cause.finding]
    for finding in [*first, *(one for one in findings if one not in first)]:
        for line in finding_lines(finding, out.width if out.is_terminal else None):
            out.print(line)
    summary = summarise(evidence)
    out.print(str(evidence.set_up.judged_by))
    if summary.outcomes:
        out.print(summary_table(summary))
    for sentence in summary_lines(summary):
        out.print(sentence)
    out.print(f"{evidence.stream.name}: {count_text(findings)}")


def _write(path: Path, text: str) -> None:
    with write_text(path) as file:
        file.write(text)
