# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""``viso replay``: feed a recorded stream to the vehicle in virtual time."""

import json
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, NamedTuple

import typer

from ap_core.verdict import VerdictKind
from mav_handlers.handlers import VISION_MESSAGES
from viso.compare.merit import merit_rows
from viso.compare.outputs import (
    firmware_tables,
    merit_lines,
    merit_table,
    release_lines,
    replay_tables,
    setting_lines,
)
from viso.compare.two_replays import compare_replays
from viso.doctor.evidence.set_up import Assumed, fitting, vision_carried
from viso.doctor.evidence.vehicle_position import PositionSeries, position_in
from viso.errors import InputError
from viso.files.text_files import write_text
from viso.firmware.changes import differences_between
from viso.firmware.flown import JudgedBy
from viso.firmware.releases import Firmware
from viso.geometry.frame_change import PRESETS as AXES
from viso.logs.files import single_log
from viso.logs.recorded import read_columns
from viso.replay.agreement import own_yaw_line
from viso.replay.ahrs import ahrs_maker
from viso.replay.feed import ReplayedMessage
from viso.replay.figures import Judge, Row, timed_places
from viso.replay.observability import doubts
from viso.replay.run import ReplayOutcome, ReplaySetup, run_replay, why_nothing_fused
from viso.streams.heard import firmware_of_recording, params_heard, params_of_recording
from viso.streams.messages import FORMS
from viso.streams.readers import FORMATS
from viso.streams.stream_kinds import DATAFLASH_LOG, Stream, TrajectoryOptions, kind_of, read_stream
from viso.terminal import filter_report
from viso.terminal.ahrs import (
    AhrsChoice,
    AhrsOption,
    HeadingOption,
    ImuErrorOption,
    ImuOption,
    ImuSeedOption,
    of_stream,
)
from viso.terminal.console import VerdictCounts, err, out, progress, verdict_rows, verdict_table
from viso.terminal.options import RecordedFirmwareOption, firmware_of
from viso.terminal.outputs import Output
from viso.terminal.settings import (
    PRESET_HELP,
    STRICT_HELP,
    first_of,
    load_settings,
    needing_reboot,
    parse_assignments,
    preset_files,
)
from viso.vehicle.outcomes import FilterWatch
from viso.vehicle.sensors.inertial_sources import FLOWN
from viso.vehicle.vehicle import Vehicle

if TYPE_CHECKING:
    from viso.web.recording import ReplayRecorder

_TRAJECTORY: Final = TrajectoryOptions()


def replay(
    stream_file: Annotated[
        Path,
        typer.Argument(
            help="A capture (.jsonl), a telemetry log (.tlog), a DataFlash log (.BIN), packed or not, or a "
            "trajectory (TUM, EuRoC, KITTI and others, bags of ROS 1 and 2, MCAP).",
            metavar="STREAM",
        ),
    ],
    with_filter: Annotated[
        bool, typer.Option("--ekf", help="Show what the filter makes of the stream; then --imu is follow by default.")
    ] = False,
    changed: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            help="Replay twice, without and with this parameter, and show what differs; repeatable.",
            metavar="NAME=VALUE",
        ),
    ] = None,
    imu: ImuOption = None,
    imu_error: ImuErrorOption = None,
    imu_seed: ImuSeedOption = 0,
    ahrs: AhrsOption = None,
    log: Annotated[
        Path | None,
        typer.Option(help="Write the DataFlash log here, with --set that of the second run.", metavar="OUT.BIN"),
        Output.FILE,
    ] = None,
    records: Annotated[
        Path | None,
        typer.Option(
            help="Write a line a message here (.gz compresses), with --set of the second run.", metavar="OUT.jsonl"
        ),
        Output.FILE,
    ] = None,
    preset: Annotated[str | None, typer.Option(help=PRESET_HELP, metavar="NAME")] = None,
    defaults: Annotated[list[Path] | None, typer.Option(help="Parameter file; repeatable.", metavar="FILE")] = None,
    param: Annotated[list[str] | None, typer.Option(help="NAME=VALUE; repeatable, wins over files.")] = None,
    strict: Annotated[bool, typer.Option("--strict", help=STRICT_HELP)] = False,
    firmware: RecordedFirmwareOption = None,
    versus: Annotated[
        str | None,
        typer.Option(help="Replay twice, as --firmware and as this one, and show what differs.", metavar="PROFILE"),
    ] = None,
    baud: Annotated[
        int | None,
        typer.Option(
            help="Rate of the UART whose transport time is modelled, 0 for none; captures default to 115200, DataFlash "
            "logs to what they show."
        ),
    ] = None,
    heading: HeadingOption = 0.0,
    lead: Annotated[
        float, typer.Option(help="Seconds from boot to the first message, if the file does not have it.")
    ] = 30.0,
    form: Annotated[
        str, typer.Option("--as", "--message", help=f"What a trajectory is sent as: {', '.join(FORMS)}.")
    ] = _TRAJECTORY.form,
    format_name: Annotated[
        str | None, typer.Option("--format", help=f"Of a trajectory, if not to be found out: {', '.join(FORMATS)}.")
    ] = None,
    topic: Annotated[str | None, typer.Option(help="Of a bag; default the only one with poses.")] = None,
    times: Annotated[Path | None, typer.Option(help="File with the times of KITTI's poses.", metavar="FILE")] = None,
    axes: Annotated[
        str, typer.Option(help=f"Of a trajectory: WORLD/BODY, such as ENU/FLU, or {', '.join(AXES)}.")
    ] = _TRAJECTORY.axes,
    rate: Annotated[
        float | None, typer.Option(help="Interpolate a trajectory to this rate in Hz; default its own.")
    ] = None,
    web: Annotated[
        str | None,
        typer.Option(
            help="Show it on the page of the live view, with a slider; with --set or --versus the second run.",
            metavar="[HOST:]PORT",
        ),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the counts as JSON.")] = False,
) -> None:
    """Feed a recorded stream to the autopilot at its arrival times, and report the outcome of each message.

    Without --ahrs, --imu and --ekf the vehicle stands still, level, with the given heading. A line of --records holds
    arrival_us, type, out (the VISO, VISP and VISV records, floats as hex bits) and verdict.

    With --ekf the vehicle moves as the stream says, as far as a vehicle can. Parameters that neither the recording nor
    the command line has are assumed so that the stream can be used, and named; so is why nothing was fused. The
    output shows what the filter, a model of EKF3, makes of each sample, how far off samples are, and when it navigates.
    A line of --records then has filter as well: the outcome of the message's samples.

    With --imu log the vehicle does what the vehicle of a DataFlash log did, and the filter is watched as with --ekf: by
    replay records, else by IMU records, else by what the filter believed then; log:FILE takes another log than STREAM.

    With --set the stream is replayed twice, and what differs is shown: counts, the first messages that end otherwise,
    texts, and when the filter navigates; at the end, figures of merit of both. Both vehicles have their parameters from
    boot on. With --versus the two are different firmware, and the errors that they work out are compared as well, with
    --ekf the innovations too; what is known to differ between them is told at the end, and since when.

    A trajectory is sent as a companion computer would send it; viso play has more ways to do so, and writes a .tlog.

    Example: seq -f '%g 0 0 -1 0 0 0 1' 0 .05 9 > poses.tum && viso replay poses.tum --set VISO_QUAL_MIN=1
    """
    if not 0 <= lead <= 4e9:
        raise InputError(f"--lead {lead}: not a time in seconds")
    chosen = None if firmware is None else firmware_of(firmware)
    other = None if versus is None else firmware_of(versus, "--versus")
    if other is not None and changed:
        raise InputError("--set and --versus: one comparison at a time")
    options = TrajectoryOptions(form, format_name, topic, times, axes, rate)
    stream = read_stream(stream_file, int(lead * 1e6), options)
    judged_by = firmware_of_recording(stream, chosen)
    profile = judged_by.firmware
    files = [*preset_files(preset), *(defaults or [])]
    recorded = params_of_recording(stream)
    loaded = load_settings(files, [], links=1, strict=strict, firmware=profile)
    assigned = parse_assignments(param or [], "--param", links=1, firmware=profile)
    imu = of_stream(imu, stream_file)
    with_filter = with_filter or (imu or "").startswith(FLOWN)
    assumed = _assumed(stream, {*recorded, *loaded, *assigned}) if with_filter and ahrs is None else []
    recorded = {**recorded, **{parameter.name: parameter.value for parameter in assumed}}
    settings = {**recorded, **loaded, **assigned}
    changes = parse_assignments(changed or [], "--set", links=1, firmware=profile)
    uart_rate = (stream.baud if baud is None else baud) or None
    if uart_rate is not None and uart_rate < 0:
        raise InputError(f"--baud {baud}: not a rate")
    if with_filter and ahrs is not None:
        raise InputError("--ekf and --ahrs: a vehicle that follows a log has no filter")
    choice = AhrsChoice(ahrs, imu, imu_error, imu_seed, heading)
    make_ahrs = ahrs_maker(choice, "follow" if with_filter else "bench")
    setup = ReplaySetup(make_ahrs, uart_rate, with_filter, profile)
    runs = [_Run(settings, setup)]
    if changes:
        runs.append(_Run({**settings, **changes}, setup))
    elif other is not None:
        # Files are read again, because the other firmware may have other parameter names.
        loaded = load_settings(files, [], links=1, strict=strict, firmware=other)
        runs.append(_Run({**recorded, **loaded, **assigned}, replace(setup, firmware=other)))
    is_judged = changes and with_filter and kind_of(stream_file, options) == DATAFLASH_LOG
    truth = position_in(read_columns(stream_file)) if is_judged else None
    recorder = None if web is None else _recorder(stream.name)
    outcomes, judges = _run_all(stream, runs, log, records, truth, recorder)
    _note(stream, judged_by, outcomes[0], needing_reboot(changes, links=1, firmware=profile))
    if assumed:
        named = ", ".join(f"{parameter.name}={parameter.value:g}" for parameter in assumed)
        err.print(f"note: these parameters are not known; assumed so that the stream can be used: {named}")
    for line in judges[0].notes:
        err.print(f"note: {line}")
    if changes:
        figures = [judge.row(outcome) for judge, outcome in zip(judges, outcomes, strict=True)]
        used = imu or ("follow" if with_filter else "bench")
        merit = _Merit(
            (figures[0], figures[1]),
            None if truth is None else truth.origin,
            list(doubts(changes, used, judges[0].basis)),
        )
        _print_changes(stream, judged_by, changes, outcomes, judges, merit if with_filter else None, as_json=as_json)
    elif other is not None:
        _print_versus(stream, judged_by, other, outcomes, judges, as_json=as_json)
    elif as_json:
        out.print_json(data={"stream": stream.name, **judged_by.as_dict(), **_as_dict(outcomes[0], judges[0])})
    else:
        _print_outcome(outcomes[0])
        out.print(str(judged_by))
    if judges[0].basis is not None and imu is not None and not as_json:
        for line in _agreement_lines(judges, Path(imu.partition(":")[2])):
            out.print(line)
    if with_filter and (reason := why_nothing_fused(outcomes[-1])):
        err.print(f"note: nothing of external navigation was fused: {reason}")
    if log is not None and log.is_file() and not log.stat().st_size:
        raise InputError(f"{log}: nothing was logged, because the vehicle was never armed and LOG_DISARMED is 0")
    if web is not None and recorder is not None:
        from viso.web.live_view import show_recording

        show_recording(web, recorder.message(), err.print)


def _agreement_lines(judges: Sequence[Judge], log: Path) -> Iterator[str]:
    """Yield how near positions came to those of the log's own filter, a run after the other, and its yaw."""
    for when, judge in zip(("before: ", "after: ") if len(judges) > 1 else ("",), judges, strict=True):
        agreement = judge.agreement()
        if agreement is None:
            unknown = "not known, because the two never knew a position at the same time"
            yield f"{when}Agreement with the log's own filter: {unknown}."
        else:
            yield from (f"{when}{line}" for line in agreement.lines())
    if line := own_yaw_line(log):
        yield line


def _recorder(name: str) -> "ReplayRecorder":
    # Imported only when needed: the server is slow to import.
    from viso.web.recording import ReplayRecorder

    return ReplayRecorder(name)


def _assumed(stream: Stream, known: Collection[str]) -> list[Assumed]:
    """Return the assumptions about a vehicle whose recording lacks parameters."""
    tells_all = bool(stream.params) or params_heard(stream).has_all
    return [] if tells_all else fitting(vision_carried(stream), known)


class _Run(NamedTuple):
    """Parameters from boot on, and how to replay."""

    settings: Mapping[str, float]
    setup: ReplaySetup


class _Merit(NamedTuple):
    """Figures of merit of both runs, their ground truth, and their limits."""

    figures: tuple[Row, Row]
    truth: str | None
    doubts: Sequence[str]


def _run_all(
    stream: Stream,
    runs: Sequence[_Run],
    log: Path | None,
    records: Path | None,
    truth: PositionSeries | None,
    recorder: "ReplayRecorder | None",
) -> tuple[list[ReplayOutcome], list[Judge]]:
    """Replay a stream with each setting in turn; files are of the last run."""
    judges = [Judge(None if truth is None else timed_places(truth.time_us, truth.ned_m)) for _ in runs]
    with (
        nullcontext() if records is None else write_text(records) as sink,
        nullcontext() if log is None else single_log(log) as open_log,
        progress("replaying", len(stream.messages) * len(runs)) as show,
    ):

        def outcome_of(index: int, run: _Run) -> ReplayOutcome:
            judge, is_last = judges[index], index == len(runs) - 1

            def start(vehicle: Vehicle, watch: FilterWatch | None) -> None:
                judge.start(vehicle, watch)
                if recorder is not None and is_last:
                    recorder.start(vehicle, watch)

            def take(message: ReplayedMessage) -> None:
                judge.take_message(message)
                if sink is not None and is_last:
                    sink.write(json.dumps(message.as_dict()) + "\n")

            return run_replay(
                stream,
                run.settings,
                run.setup,
                open_log=open_log if is_last else None,
                on_message=take,
                on_progress=lambda fed: show(index * len(stream.messages) + fed),
                keep_messages=len(runs) > 1,
                on_start=start,
            )

        return [outcome_of(index, run) for index, run in enumerate(runs)], judges


def _note(stream: Stream, judged_by: JudgedBy, outcome: ReplayOutcome, at_boot: Sequence[str]) -> None:
    for note in (*stream.notes, *outcome.notes, *judged_by.notes):
        err.print(f"note: {note}")
    if outcome.unknown_params:
        err.print(f"note: parameters of the recording without effect here: {first_of(outcome.unknown_params)}")
    if at_boot:
        err.print(f"note: a vehicle must be rebooted for {', '.join(at_boot)}; here it boots with the new value")


def _as_dict(outcome: ReplayOutcome, judge: Judge) -> dict[str, object]:
    texts = [text._asdict() for text in outcome.texts]
    result: dict[str, object] = {"verdicts": verdict_rows(outcome.verdicts), "texts": texts}
    if outcome.innovations is not None and outcome.aiding is not None:
        result["filter"] = filter_report.filter_rows(outcome.filter_counts)
        result["innovations"] = filter_report.innovation_rows(outcome.innovations)
        result["aiding"] = filter_report.aiding_rows(outcome.aiding)
    if judge.basis is not None:
        agreement = judge.agreement()
        result["agreement"] = None if agreement is None else agreement.as_dict()
    return result


_MOST_ROWS: Final = 3  # that end alike


def _summed(verdicts: VerdictCounts) -> VerdictCounts:
    """Return counts with one row in place of many for what carries no external navigation and ends alike."""
    of_vision = {kind.__name__ for kind in VISION_MESSAGES}
    alike: dict[tuple[VerdictKind, str], list[str]] = {}
    for name, outcome, code in sorted(verdicts):
        if name not in of_vision:
            alike.setdefault((outcome, code), []).append(name)
    summed = Counter[tuple[str, VerdictKind, str]]()
    for (name, outcome, code), count in verdicts.items():
        names = alike.get((outcome, code), [])
        is_one_of_many = name not in of_vision and len(names) > _MOST_ROWS
        summed[f"{names[0]} and {len(names) - 1} others" if is_one_of_many else name, outcome, code] += count
    return summed


def _print_outcome(outcome: ReplayOutcome) -> None:
    for time_us, severity, text in outcome.texts:
        out.print(f"{time_us / 1e6:9.3f} s  ({severity}) {text}")
    verdicts = _summed(outcome.verdicts)
    if outcome.innovations is None or outcome.aiding is None:
        out.print(verdict_table(verdicts))
        return
    out.print(*filter_report.tables_of(verdicts, outcome.filter_counts))
    if outcome.innovations:
        out.print(filter_report.innovation_table(outcome.innovations))
    out.print(filter_report.aiding_table(outcome.aiding))


def _print_changes(
    stream: Stream,
    judged_by: JudgedBy,
    changes: Mapping[str, float],
    outcomes: Sequence[ReplayOutcome],
    judges: Sequence[Judge],
    merit: _Merit | None,
    *,
    as_json: bool,
) -> None:
    before, after = outcomes
    comparison = compare_replays(before, after)
    if as_json:
        both = {"before": _as_dict(before, judges[0]), "after": _as_dict(after, judges[1])}
        differs: dict[str, object] = {"differs": comparison.as_dict()}
        if merit is not None:
            differs |= {"figures": merit_rows(*merit.figures), "doubts": list(merit.doubts)}
        about = {"stream": stream.name, **judged_by.as_dict(), "set": dict(changes)}
        out.print_json(data={**about, **both, **differs})
        return
    for part in (*setting_lines(changes, before), *replay_tables(comparison, with_filter=before.aiding is not None)):
        out.print(part)
    if merit is not None:
        out.print(merit_table(*merit.figures, merit.truth))
        for line in (*merit_lines(*merit.figures), *merit.doubts):
            out.print(line)
    out.print(str(judged_by))


def _print_versus(
    stream: Stream,
    judged_by: JudgedBy,
    other: Firmware,
    outcomes: Sequence[ReplayOutcome],
    judges: Sequence[Judge],
    *,
    as_json: bool,
) -> None:
    before, after = outcomes
    comparison = compare_replays(before, after)
    names = [judged_by.firmware.name, other.name]
    if as_json:
        both = {"before": _as_dict(before, judges[0]), "after": _as_dict(after, judges[1])}
        differs = {
            **comparison.as_dict(),
            "errors": [change._asdict() for change in comparison.errors],
            "innovations": [change.as_dict() for change in comparison.innovations],
        }
        firmware = dict(zip(both, names, strict=True))
        known = [one.as_dict(judged_by.firmware, other) for one in differences_between(judged_by.firmware, other)]
        about = {"stream": stream.name, "firmware": firmware, "firmware_reason": judged_by.reason, "known": known}
        out.print_json(data={**about, **both, "differs": differs})
        return
    out.print(f"before: firmware {names[0]}; after: firmware {names[1]}")
    out.print(str(judged_by))
    for part in (*firmware_tables(comparison), *replay_tables(comparison, with_filter=before.aiding is not None)):
        out.print(part)
    for line in release_lines(judged_by.firmware, other):
        out.print(line)
