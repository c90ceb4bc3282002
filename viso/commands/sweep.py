# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""``viso sweep``: many replays with changed parameters, faults and seeds, and what came of each."""

from collections.abc import Generator
from contextlib import ExitStack, closing
from pathlib import Path
from typing import Annotated, Any, Final

import typer

from ekf_stub.core.buffers import MAX_DELAY_MS
from viso.errors import InputError
from viso.firmware.releases import PROFILES
from viso.geometry.frame_change import PRESETS as AXES
from viso.replay.figures import BY_TIME, OBJECTIVES
from viso.replay.observability import doubts
from viso.streams.messages import FORMS
from viso.streams.readers import FORMATS
from viso.sweep.cluster import run_on_cluster
from viso.sweep.job import Result, run_point
from viso.sweep.plan import FOLLOW, SAMPLINGS, Point, SweepPlan
from viso.sweep.planning import make_plan
from viso.sweep.processes import default_jobs, run_in_processes
from viso.sweep.request import NO_FAULTS, SweepRequest, read_request
from viso.sweep.result_tables import best_as_dict, best_lines, found, result_table, swept_axis
from viso.sweep.store import PLOT, SweepFolder, check_tables, table_rows
from viso.terminal.ahrs import HeadingOption, ImuErrorOption
from viso.terminal.console import PLOT_HINT, drawing, err, out, progress
from viso.terminal.outputs import Output
from viso.terminal.settings import PRESET_HELP, STRICT_HELP
from viso.vehicle.sensors.inertial_sources import IMU_HELP

_FINDINGS: Final = 1
_NAMED: Final = 5


def sweep(
    streams: Annotated[
        list[Path],
        typer.Argument(help="What viso replay reads, any number; or one TOML file that says it all.", metavar="STREAM"),
    ],
    changed: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            help="START:STOP:STEP or A,B,C; LOW:HIGH to sample from; NAME is a parameter, or faults.N.FIELD of the "
            "timelines; repeatable.",
            metavar="NAME=VALUES",
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o", "--output", help="Keep results here; the same command goes on from there.", metavar="FOLDER"
        ),
        Output.PLACE,
    ] = None,
    objective: Annotated[str, typer.Option(help=f"What is best: {', '.join(OBJECTIVES)}.", metavar="COLUMN")] = "nis",
    sample: Annotated[
        str | None, typer.Option(help=f"Draw points in place of a grid: {', '.join(SAMPLINGS)}.", metavar="METHOD")
    ] = None,
    points: Annotated[int | None, typer.Option(help="How many points to draw.")] = None,
    sample_seed: Annotated[int | None, typer.Option(help="Seed of the draw; default 0.")] = None,
    faults: Annotated[
        list[str] | None,
        typer.Option(help=f"Timeline of faults (YAML) as of viso faults, or {NO_FAULTS}; repeatable.", metavar="FILE"),
    ] = None,
    seeds: Annotated[
        str | None, typer.Option(help="Of faults and sensor noise: FIRST:LAST, or A,B,C.", metavar="SEEDS")
    ] = None,
    firmware: Annotated[
        list[str] | None,
        typer.Option(help=f"The firmware to be, several by commas: {', '.join(PROFILES)}.", metavar="PROFILES"),
    ] = None,
    imu: Annotated[
        str | None,
        typer.Option(
            help=f"The filter's sensors: {IMU_HELP}; {{name}} is that of the stream. Default: log, or a capture's log "
            f"of the same name, beside it or in ../logs; else {FOLLOW}.",
            metavar="SOURCE",
        ),
    ] = None,
    imu_error: ImuErrorOption = None,
    ahrs: Annotated[
        str | None,
        typer.Option(
            help="Follow this log: the filter over its replay records, else its attitude and position.", metavar="LOG"
        ),
    ] = None,
    reference: Annotated[
        str | None,
        typer.Option(help="Where the vehicle was, for ate_m: a log or a trajectory; {name} as above.", metavar="FILE"),
    ] = None,
    preset: Annotated[str | None, typer.Option(help=PRESET_HELP, metavar="NAME")] = None,
    defaults: Annotated[list[Path] | None, typer.Option(help="Parameter file; repeatable.", metavar="FILE")] = None,
    param: Annotated[list[str] | None, typer.Option(help="NAME=VALUE; repeatable, wins over files.")] = None,
    strict: Annotated[bool, typer.Option("--strict", help=STRICT_HELP)] = False,
    baud: Annotated[
        int | None, typer.Option(help="Rate of the UART whose transport time is modelled, 0 for none; as viso replay.")
    ] = None,
    heading: HeadingOption = 0.0,
    lead: Annotated[
        float | None, typer.Option(help="Seconds from boot to the first message, if the file does not have it.")
    ] = None,
    until: Annotated[float | None, typer.Option(help="Seconds since boot at which to end.", metavar="S")] = None,
    message: Annotated[
        str | None, typer.Option("--as", "--message", help=f"What a trajectory is sent as: {', '.join(FORMS)}.")
    ] = None,
    format_name: Annotated[
        str | None, typer.Option("--format", help=f"Of trajectories, if not to be found out: {', '.join(FORMATS)}.")
    ] = None,
    topic: Annotated[str | None, typer.Option(help="Of a bag; default the only one with poses.")] = None,
    times: Annotated[Path | None, typer.Option(help="File with the times of KITTI's poses.", metavar="FILE")] = None,
    axes: Annotated[
        str | None, typer.Option(help=f"Of trajectories: WORLD/BODY, such as ENU/FLU, or {', '.join(AXES)}.")
    ] = None,
    rate: Annotated[float | None, typer.Option(help="Interpolate trajectories to this rate in Hz.")] = None,
    jobs: Annotated[
        int | None, typer.Option("-j", "--jobs", help="How many processes; default one a core.", min=1)
    ] = None,
    scheduler: Annotated[
        str | None, typer.Option(help="Run on this Dask cluster, such as tcp://host:8786.", metavar="ADDRESS")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print all results as JSON.")] = False,
) -> None:
    """Replay recorded streams many times with other parameters, faults, seeds or firmware, and report the best.

    Each point is a replay as of viso replay --ekf. With -o, FOLDER gets results.parquet, results.csv and plot.png; what
    is done is kept, whatever ends the command. Exit code 1 if a point could not be worked out.

    Example: seq -f '%g 0 0 -1 0 0 0 1' 0 .05 9 > poses.tum && viso sweep poses.tum --set VISO_SCALE=0.9,1.1 --until 8
    """
    if objective not in OBJECTIVES:
        raise InputError(f"--objective {objective}: there are {', '.join(OBJECTIVES)}")
    given: dict[str, Any] = {
        "set": changed or [],
        "sample": sample,
        "points": points,
        "sample_seed": sample_seed,
        "faults": faults,
        "seeds": seeds,
        "firmware": firmware,
        "imu": imu,
        "imu_error": imu_error,
        "ahrs": ahrs,
        "reference": reference,
        "preset": preset,
        "defaults": defaults,
        "param": param,
        "strict": strict or None,
        "baud": baud,
        "heading": heading or None,
        "lead": lead,
        "until": until,
        "message": message,
        "format": format_name,
        "topic": topic,
        "times": times,
        "axes": axes,
        "rate": rate,
    }
    if output is not None:
        check_tables()
    plan = make_plan(_request_of(streams, given))
    _note(plan)
    rows, failures = _worked_out(plan, output, jobs or default_jobs(), scheduler)
    if failures and not rows:
        raise InputError(failures[0].error)
    if output is not None:
        _draw(plan, rows, objective, output)
    for failure in failures[:_NAMED]:
        err.print(f"note: point {failure.number}: {failure.error}")
    if len(failures) > _NAMED:
        err.print(f"note: {len(failures) - _NAMED} more points could not be worked out")
    _tell(plan, rows, objective, failures, as_json=as_json)
    if failures:
        raise typer.Exit(_FINDINGS)


def _request_of(streams: list[Path], given: dict[str, Any]) -> SweepRequest:
    if any(path.suffix.lower() == ".toml" for path in streams):
        if len(streams) > 1:
            raise InputError(f"{len(streams)} files: a TOML file says it all, the streams as well")
        return SweepRequest(**given).over(read_request(streams[0]))
    return SweepRequest(streams=streams, **given)


def _note(plan: SweepPlan) -> None:
    for recorded in plan.recordings:
        if recorded.basis is not None:
            err.print(f"note: {recorded.name}: the vehicle moves by {recorded.basis.value}")
        for line in () if recorded.ahrs else doubts((axis.name for axis in plan.axes), recorded.imu, recorded.basis):
            err.print(f"note: {recorded.name}: {line}")
    if plan.buffer_ms:
        err.print(f"note: at each point the filter's buffers reach back {min(plan.buffer_ms, MAX_DELAY_MS):g} ms")


def _worked_out(
    plan: SweepPlan, output: Path | None, jobs: int, scheduler: str | None
) -> tuple[list[dict[str, Any]], list[Result]]:
    """Return all rows at the end, and the points without one."""
    done: dict[int, Any] = {}
    failures: list[Result] = []
    with ExitStack() as stack:
        folder = None if output is None else stack.enter_context(SweepFolder(output, plan))
        if folder is not None:
            done = folder.done
            if done:
                err.print(f"note: {output}: {len(done)} of {plan.size} points are done already")
        left = [point for point in plan.points() if point.number not in done]
        try:
            show = stack.enter_context(progress("sweeping", plan.size))
            show(len(done))
            with closing(_results(plan, left, jobs, scheduler)) as results:
                for result in results:
                    if result.row is None:
                        failures.append(result)
                    elif folder is not None:
                        folder.add(result)
                    else:
                        done[result.number] = result.row
                    show(len(done) + len(failures))
        except KeyboardInterrupt:
            if folder is not None:
                err.print(
                    f"note: interrupted; {output} has {len(done)} of {plan.size} points; the same command goes on"
                )
            raise
        finally:
            if folder is not None:
                folder.write_tables()
    return table_rows(plan, done), sorted(failures, key=lambda failure: failure.number)


def _results(plan: SweepPlan, points: list[Point], jobs: int, scheduler: str | None) -> Generator[Result]:
    if not points:
        return
    if scheduler is not None:
        yield from run_on_cluster(plan, points, scheduler)
    elif min(jobs, len(points)) == 1:
        yield from (run_point(plan, point) for point in points)
    else:
        yield from run_in_processes(plan, points, min(jobs, len(points)))


def _draw(plan: SweepPlan, rows: list[dict[str, Any]], objective: str, output: Path) -> None:
    with drawing(f"note: {PLOT_HINT}"):
        from viso.sweep.plot import save_plot

        save_plot(plan, rows, objective, output / PLOT)


def _tell(
    plan: SweepPlan, rows: list[dict[str, Any]], objective: str, failures: list[Result], *, as_json: bool
) -> None:
    bests = found(plan, rows, objective)
    if not as_json:
        out.print(result_table(plan, rows, objective))
        for line in best_lines(plan, bests, objective):
            out.print(line)
        return
    failed = [{"point": failure.number, "error": failure.error} for failure in failures]
    best = [best_as_dict(plan, best_point, objective) for best_point in bests]
    rows = [{name: value for name, value in row.items() if name != BY_TIME} for row in rows]
    result = {"points": plan.size, "objective": objective, "axis": swept_axis(plan), "best": best}
    out.print_json(data={**result, "failed": failed, "rows": rows})
