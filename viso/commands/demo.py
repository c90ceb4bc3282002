# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""``viso demo``: everything at once, without hardware."""

import importlib.util
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Final

import typer
from rich.table import Table

from viso.companion.vio.config import VioConfig
from viso.companion.vio.errors import StrategyNotAvailableError
from viso.companion.vio.registry import STRATEGIES
from viso.demo import tracking_camera as simulated
from viso.demo.record import LoopRecord
from viso.errors import InputError, as_input_errors
from viso.extras import pip_install
from viso.firmware.releases import Firmware
from viso.logs.files import LogFile, LogStore
from viso.terminal.console import drawing, err, out, progress, verdict_rows
from viso.terminal.engine import EngineOption, with_engine
from viso.terminal.filter_report import aiding_rows, filter_rows, tables_of
from viso.terminal.options import DEFAULT_FIRMWARE, FirmwareOption, firmware_of
from viso.terminal.outputs import Output
from viso.terminal.process import stop_on_signal
from viso.vehicle.vehicle import Vehicle

_SIMULATED_INSTEAD: Final = f"the camera is simulated: OpenCV is missing; for a real one: {pip_install('vio')}"
_NO_VIO: Final = f"--camera vio: OpenCV is missing; install it with: {pip_install('vio')}; --camera simulated works"

Text = tuple[float, str, int, str]
"""A text: time in s, sender, severity and words."""
Choose = Callable[[VioConfig], VioConfig]


class Camera(StrEnum):
    """The camera of the flight."""

    VIO = "vio"
    SIMULATED = "simulated"


@dataclass(frozen=True)
class _Flown:
    """The result of a flight, which ends at ``end_s`` since boot unless it is stopped.

    ``rows`` are for machines, beside the common rows of every flight, and ``tables`` for people. ``save_plot`` writes
    the
    picture; it raises ModuleNotFoundError without matplotlib.
    """

    end_s: float
    vehicle: Vehicle
    texts: list[Text]
    rows: Mapping[str, object]
    tables: list[Table]
    save_plot: Callable[[Path], None]


@contextmanager
def _flying(end_s: float) -> Iterator[tuple[Callable[[float], None], Callable[[], bool]]]:
    """Yield the progress display of a flight, and a function that returns whether the user wants to stop."""
    with progress("flying", int(end_s)) as show, stop_on_signal() as signals:
        yield show, lambda: bool(signals)


def _texts(record: LoopRecord) -> list[Text]:
    return [(text.time_us * 1e-6, text.who, text.severity, text.text) for text in record.all_texts]


def _fly_simulated(seed: int, log_file: LogFile, firmware: Firmware, _choose: Choose) -> _Flown:
    run = simulated.Demo(seed, lambda: log_file, firmware)
    with _flying(simulated.END_S) as (on_progress, stop):
        result = run.run(on_progress, stop)

    def save_plot(path: Path) -> None:
        from viso.demo.plot import save_plot

        save_plot(result, path)

    counts, filter_counts = run.vehicle.endpoint.verdict_counts(), run.vehicle.ahrs.ext_nav_counts
    rows = {"aiding": aiding_rows(result.aiding)}
    return _Flown(simulated.END_S, run.vehicle, _texts(result), rows, tables_of(counts, filter_counts), save_plot)


def _fly_vio(seed: int, log_file: LogFile, firmware: Firmware, choose: Choose) -> _Flown:
    # These need OpenCV, without which the rest of the command line works.
    from viso.demo import odometry as demo_vio
    from viso.demo.figures import figures_of, figures_table

    with as_input_errors(StrategyNotAvailableError):
        run = demo_vio.VioDemo(seed, lambda: log_file, firmware, choose)
    with _flying(demo_vio.END_S) as (on_progress, stop):
        run.run(on_progress, stop)

    def save_plot(path: Path) -> None:
        from viso.demo.loop_plot import save_plot

        save_plot(run.loop, path)

    figures, vehicle = figures_of(run.loop), run.loop.vehicle
    rows = {"loop": asdict(figures), "aiding": aiding_rows(run.loop.watch.aiding())}
    return _Flown(demo_vio.END_S, vehicle, _texts(run.loop.record), rows, [figures_table(figures)], save_plot)


_FLIGHTS: Final = {Camera.VIO: _fly_vio, Camera.SIMULATED: _fly_simulated}


def _choose(camera: Camera | None) -> Camera:
    has_opencv = importlib.util.find_spec("cv2") is not None
    if camera is Camera.VIO and not has_opencv:
        raise InputError(_NO_VIO)
    if camera is None and not has_opencv:
        err.print(_SIMULATED_INSTEAD)
    return camera or (Camera.VIO if has_opencv else Camera.SIMULATED)


def _fly(camera: Camera, seed: int, log_file: LogFile, firmware: Firmware, choose: Choose) -> _Flown:
    """Fly to the end, or until the user stops it."""
    flown = _FLIGHTS[camera](seed, log_file, firmware, choose)
    stopped_s = flown.vehicle.clock.micros64() * 1e-6
    if stopped_s < flown.end_s - 0.5:
        err.print(f"stopped at {stopped_s:.0f} s")
    return flown


def _save_plot(flown: _Flown, path: Path) -> Path | None:
    with drawing():
        flown.save_plot(path)
        return path
    return None


def demo(
    seed: Annotated[int, typer.Option(help="Seed of all noise; the same seed gives the same log.", min=0)] = 1,
    camera: Annotated[
        Camera | None,
        typer.Option(
            help="What sees the flight: vio, a camera over rendered ground and an odometry (the default if OpenCV is "
            "there), or simulated, a tracking camera with faults."
        ),
    ] = None,
    strategy: Annotated[
        str | None, typer.Option(help=f"With --camera vio: {', '.join(STRATEGIES)}, or a plug-in's.")
    ] = None,
    engine: EngineOption = None,
    log_dir: Annotated[Path, typer.Option(help="Where the log and the plot go."), Output.PLACE] = Path("logs"),
    firmware: FirmwareOption = DEFAULT_FIRMWARE,
    plot: Annotated[bool, typer.Option(help="Draw what happened, if matplotlib is there.")] = True,
    as_json: Annotated[bool, typer.Option("--json", help="Print the outcome as JSON.")] = False,
) -> None:
    """Fly a survey in virtual time, navigating by what a camera sees of the ground.

    A companion computer makes odometry of rendered ground and inertial data, and sends it as ODOMETRY. The autopilot's
    filter, a model of EKF3, fuses it: aiding starts, the vehicle arms and flies. The lens is covered twice: for 2 s,
    which degrades the odometry, and for 6 s, in which it is lost and falls silent. It restarts with another reset
    counter. A table and a picture compare truth, odometry and estimate.

    With --camera simulated a tracking camera sees a figure of eight instead, with low quality, a reset, a dropout and a
    second of wrong places. The DataFlash log holds the filter's inputs and estimates. Ctrl-C ends the flight early.

    Example: viso demo --seed 1
    """
    profile = firmware_of(firmware)
    chosen = _choose(camera)
    if chosen is Camera.SIMULATED and (strategy or engine):
        raise InputError("--strategy, --engine: --camera simulated has no odometry")
    # Opened before the run, so that a file that cannot be written is reported at once.
    log_file = LogStore(log_dir).open_next()
    log_file.is_told_at_end = True
    flown = _fly(chosen, seed, log_file, profile, lambda config: with_engine(config, strategy, engine))
    if log_file.reason:
        raise InputError(log_file.reason)
    picture = _save_plot(flown, log_file.path.with_suffix(".png")) if plot else None
    if as_json:
        _print_json(flown, log_file.path, picture)
        return
    out.print("What was said:")
    for time_s, who, severity, text in flown.texts:
        out.print(f"{time_s:7.2f} s  {who}  ({severity}) {text}")
    out.print(*flown.tables)
    out.print(f"log:  {log_file.path}")
    if picture is not None:
        out.print(f"plot: {picture}")


def _print_json(flown: _Flown, log: Path, picture: Path | None) -> None:
    keys = ("time_s", "who", "severity", "text")
    data = {
        "log": str(log),
        "plot": None if picture is None else str(picture),
        "texts": [dict(zip(keys, text, strict=True)) for text in flown.texts],
        "verdicts": verdict_rows(flown.vehicle.endpoint.verdict_counts()),
        "filter": filter_rows(flown.vehicle.ahrs.ext_nav_counts),
    }
    out.print_json(data={**data, **flown.rows})
