# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""``viso vio``: visual-inertial odometry on recorded or live data."""

import dataclasses
import logging
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated, Any, Final

import typer
from rich.console import Console
from rich.live import Live

from viso.companion.run.log import VioLog, tum_lines
from viso.companion.run.session import VioSession, event_logger
from viso.companion.run.tables import live_table, summary_table
from viso.companion.sources.base import Recording, SourceError, SourceOptions
from viso.companion.sources.camera import LiveCamera
from viso.companion.sources.kinds import SOURCES, open_source
from viso.companion.vio.config import ConfigError, VioConfig, load_config
from viso.companion.vio.errors import StrategyNotAvailableError
from viso.companion.vio.registry import STRATEGIES, build_vio_strategy
from viso.companion.vio.types import VioState
from viso.errors import InputError, as_input_errors, within
from viso.files.text_files import write_text
from viso.geometry.frame_change import parse_rotation
from viso.geometry.rotation import Array
from viso.geometry.trajectory import Trajectory
from viso.geometry.trajectory_files import TrajectoryError
from viso.streams.readers import Source, load_trajectory
from viso.terminal.console import drawing, err, out
from viso.terminal.engine import EngineOption, with_engine
from viso.terminal.outputs import Output
from viso.terminal.process import stop_on_signal

LONGEST_S: Final = 4e9
_LOST: Final = 1


def rotation_of(text: str) -> Array:
    """Return the rotation matrix that ``--mounting`` gives."""
    try:
        return parse_rotation(text)
    except ValueError as error:
        raise InputError(f"--mounting: {error}") from error


def opened(options: SourceOptions, kind: str | None) -> Recording | LiveCamera:
    """Open a source."""
    with as_input_errors(SourceError):
        return open_source(options, kind)


def configured(
    source: Recording | LiveCamera, file: Path | None, strategy: str | None, engine: str | None = None
) -> VioConfig:
    """Return the configuration of the file, or else of the source, with the given overrides.

    Args:
        strategy: replaces the configuration's.
        engine: command that starts the engine's program.

    Raises InputError if the file is invalid, or the strategy is not available.
    """
    with as_input_errors(ConfigError):
        config = source.config if file is None else load_config(file)
    config = with_engine(config, strategy, engine)
    # Built once in advance, so that missing parts are reported before anything is opened.
    silent = logging.Logger("viso.trying", logging.CRITICAL + 1)
    with as_input_errors(ValueError, StrategyNotAvailableError):
        build_vio_strategy(config, source.calibration, lambda: 0, silent).close()
    return config


def known_truth(source: Recording | LiveCamera, file: Path | None) -> Trajectory | None:
    """Return the trajectory in a file, or the source's own."""
    if file is None:
        return source.poses if isinstance(source, Recording) else None
    with as_input_errors(TrajectoryError):
        return load_trajectory(Source(file))


def _is_paced(source: Recording | LiveCamera, master: str | None, realtime: bool | None) -> bool:
    if isinstance(source, LiveCamera) and master is None:
        raise InputError("--master STRING is missing: the IMU that goes with a camera is the autopilot's")
    must = isinstance(source, LiveCamera) or master is not None
    if must and realtime is False:
        raise InputError("--no-realtime: neither a camera nor a vehicle can be hurried")
    return must or bool(realtime)


def vio(
    source_name: Annotated[
        str, typer.Argument(help="A folder, a video, a camera's number or URL, or synthetic.", metavar="SOURCE")
    ],
    kind: Annotated[
        str | None, typer.Option("--source", help=f"Kind of source, if not to be found out: {', '.join(SOURCES)}.")
    ] = None,
    config_file: Annotated[
        Path | None, typer.Option("--config", help="Configuration (TOML, section vio).", metavar="FILE")
    ] = None,
    calibration: Annotated[
        Path | None, typer.Option(help="Of the camera (.toml, or .yaml as EuRoC's).", metavar="FILE")
    ] = None,
    strategy: Annotated[
        str | None, typer.Option(help=f"In place of the configuration's: {', '.join(STRATEGIES)}, or a plug-in's.")
    ] = None,
    engine: EngineOption = None,
    imu: Annotated[
        Path | None, typer.Option(help="Inertial data of a video: t_ns or t_s, gx, gy, gz, ax, ay, az.", metavar="CSV")
    ] = None,
    imu_start: Annotated[float, typer.Option(help="Time in that file, in s, at which the video begins.")] = 0.0,
    imu_axes: Annotated[
        str | None, typer.Option(help="Where x, y and z of the IMU point: three of F, B, L, R, U, D, such as FLU.")
    ] = None,
    mounting: Annotated[
        str,
        typer.Option(help="How the IMU is turned on the vehicle beyond that, as of viso play.", metavar="ROTATION"),
    ] = "0,0,0",
    fps: Annotated[float | None, typer.Option(help="Take no more frames per second than this.")] = None,
    warm_start: Annotated[
        bool, typer.Option(help="Begin with the state that the source knows, or else wait for stillness.")
    ] = True,
    truth_file: Annotated[
        Path | None, typer.Option("--truth", help="Trajectory to compare with, as of viso play.", metavar="FILE")
    ] = None,
    save_trajectory: Annotated[
        Path | None, typer.Option(help="Write the poses (t x y z qx qy qz qw).", metavar="OUT.tum"), Output.FILE
    ] = None,
    plot: Annotated[Path | None, typer.Option(help="Draw what happened.", metavar="OUT.png"), Output.FILE] = None,
    events: Annotated[
        Path | None, typer.Option(help="Write the events, each as JSON.", metavar="OUT.jsonl"), Output.FILE
    ] = None,
    master: Annotated[
        str | None, typer.Option(help="Send ODOMETRY on this link, as of viso serve.", metavar="STRING")
    ] = None,
    wait: Annotated[float, typer.Option(help="How long to wait for the vehicle, in s; 0 sends unheard.")] = 5.0,
    delay: Annotated[float, typer.Option(help="Seconds before the first frame, once the vehicle is heard.")] = 0.0,
    until: Annotated[float | None, typer.Option(help="End after this many seconds.", metavar="S")] = None,
    realtime: Annotated[
        bool | None,
        typer.Option(
            "--realtime/--no-realtime",
            help="In step with the clock, as always with a vehicle, or as fast as can be, as else.",
        ),
    ] = None,
    live: Annotated[bool, typer.Option(help="Show each frame's figures, on a terminal.")] = True,
    as_json: Annotated[bool, typer.Option("--json", help="Print the closing figures as JSON.")] = False,
) -> None:
    """Estimate a vehicle's position from pictures and inertial data, and send it to the autopilot if there is one.

    Exit code 1 if it had lost its way at the end. Ctrl-C ends it; what was done until then is written all the same.

    Example: viso vio synthetic --until 5
    """
    within("--fps", fps, 0.1, 1000)
    within("--imu-start", imu_start, -LONGEST_S, LONGEST_S)
    within("--wait", wait, 0, LONGEST_S)
    within("--delay", delay, 0, 86_400)
    within("--until", until, 0, LONGEST_S)
    options = SourceOptions(source_name, calibration, imu, imu_start, fps, imu_axes, rotation_of(mounting))
    source = opened(options, kind)
    is_paced = _is_paced(source, master, realtime)
    config = configured(source, config_file, strategy, engine)
    truth = known_truth(source, truth_file)
    has_own_world = truth_file is not None or not warm_start
    if isinstance(source, Recording) and not warm_start:
        source = dataclasses.replace(source, start=None, world_is_north=False)
    console = err if as_json else out
    begins = "as the source says" if isinstance(source, Recording) and source.start else "once it stands still"
    console.print(f"{source_name}: {config.strategy}, camera {source.calibration.camera_id}; begins {begins}")
    log, sent = VioLog(config), dict[str, Any]()
    with ExitStack() as stack:
        logger = stack.enter_context(event_logger(events))
        stop = stack.enter_context(stop_on_signal())
        session = VioSession(
            source=source, config=config, log=log, logger=logger, stop=lambda: bool(stop), until_s=until
        )
        if live and not as_json and console.is_terminal:
            # Drawn by a thread of its own.
            shown = Live(console=console, transient=True, get_renderable=lambda: live_table(log.last))
            stack.enter_context(shown)
        if is_paced:
            alignment = None if config_file is None else config.odometry.local_alignment
            sent = session.run_live(master, wait_s=wait, delay_s=delay, alignment=alignment, show=console.print)
        else:
            session.run_through()
    summary = {"source": source_name, "strategy": config.strategy, **log.summary(truth), **sent}
    if save_trajectory is not None:
        with write_text(save_trajectory) as file:
            file.writelines(f"{line}\n" for line in tum_lines(log.trajectory()))
    picture = None if plot is None else _save_plot(log, truth, _title(summary), plot, aligned=has_own_world)
    _print(console, summary, save_trajectory, picture, as_json=as_json)
    if summary["ended"] == VioState.LOST.value:
        raise typer.Exit(_LOST)


def _title(summary: Mapping[str, Any]) -> str:
    error = "" if summary["ate_m"] is None else f", {summary['ate_m']:.2f} m off in the mean (ATE)"
    name = Path(summary["source"]).name or summary["source"]
    return f"viso vio {name}, {summary['strategy']}: {summary['path_m']:.1f} m{error}"


def _save_plot(log: VioLog, truth: Trajectory | None, title: str, path: Path, *, aligned: bool) -> Path | None:
    with drawing():
        from viso.companion.run.plot import save_plot

        save_plot(log, truth, title, path, aligned=aligned)
        return path
    return None


def _print(
    console: Console, summary: dict[str, Any], trajectory: Path | None, picture: Path | None, *, as_json: bool
) -> None:
    if as_json:
        files = {"trajectory": trajectory and str(trajectory), "plot": picture and str(picture)}
        out.print_json(data={**summary, **files})
        return
    console.print(summary_table(summary["source"], summary))
    for what, path in (("trajectory", trajectory), ("plot", picture)):
        if path is not None:
            console.print(f"{what}: {path}")
