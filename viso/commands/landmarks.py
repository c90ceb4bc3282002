# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""``viso landmarks``: where landmarks and aircraft should be in the picture, and where they are."""

import json
import math
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, closing, contextmanager
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Final

import typer
from rich.console import Console

from mav_handlers.links import open_link
from viso.errors import InputError, within
from viso.extras import pip_install
from viso.files.outputs import output_file
from viso.files.text_files import write_text
from viso.landmarks.camera import KEYS, camera_of
from viso.landmarks.inputs.files import InputOptions
from viso.landmarks.live import AircraftSender, Live, standard_lines
from viso.landmarks.local_frame import FrameMode
from viso.landmarks.palette import Palette
from viso.landmarks.recordings import STANDARD_INPUT, Merged, is_live
from viso.landmarks.report import drops, fit_lines, oddities, refusals, summary_table
from viso.landmarks.run import Draw, Frames, Run, Sink, csv_sink, json_sink, line_sink
from viso.landmarks.scene import ESTIMATED_LABEL, ODOMETRY_LABEL
from viso.landmarks.session import ReceiverWatch, Session, Settings
from viso.landmarks.synthetic import Planted, SyntheticFlight
from viso.landmarks.types import CameraInfo, Event, GeodeticPoint, LandmarkMap
from viso.terminal.console import drawing, err, out
from viso.terminal.outputs import Output
from viso.terminal.process import stop_on_signal

LONGEST_S: Final = 4e9
_PLOT_HINT: Final = f"no pictures: matplotlib is missing; install it with: {pip_install('plot')}"
_NEVER_FLY: Final = (
    "note: --estimate takes the middle of the aircraft for the receiver: it is kilometres off, and must never reach "
    "the autopilot"
)


class PredictFrom(StrEnum):
    """The predicting pose."""

    ODOM = ODOMETRY_LABEL
    ESTIMATED = ESTIMATED_LABEL


def _reference(text: str | None) -> GeodeticPoint | None:
    if text is None:
        return None
    try:
        latitude_deg, longitude_deg, alt_m = map(float, text.split(","))
        return GeodeticPoint(latitude_deg, longitude_deg, alt_m)
    except ValueError:
        raise InputError(f"--reference {text}: not LATITUDE,LONGITUDE,ALTITUDE in degrees and metres") from None


def _draw(palette: Palette, extent_m: float, *, with_sky: bool) -> Draw | None:
    """Return a function that makes a PNG of a scene; None, and a hint, without matplotlib."""
    with drawing(_PLOT_HINT):
        from viso.landmarks import picture

        return lambda scene: picture.png_of(picture.draw(scene, palette, extent_m=extent_m, with_sky=with_sky))
    return None


@contextmanager
def _one_line_extras() -> Iterator[None]:
    try:
        yield
    except ModuleNotFoundError as error:
        if error.name not in ("pymap3d", "filterpy"):
            raise
        hint = "; --frame spherical works without" if error.name == "pymap3d" else ""
        raise InputError(f"{error.msg}{hint}") from error


def landmarks(
    inputs: Annotated[
        list[str] | None,
        typer.Argument(
            help="Files: JSON lines, aircraft.json, BaseStation or Mode-S lines, .BIN, .tlog, bags; - for standard "
            "input; a link to an autopilot as of viso serve; sbs:HOST:PORT.",
            metavar="[INPUT]...",
            show_default=False,
        ),
    ] = None,
    demo: Annotated[bool, typer.Option("--demo", help="A made-up flight, in place of inputs.")] = False,
    demo_noise_px: Annotated[float, typer.Option(help="Sigma of what the demo's camera sees.")] = 0.0,
    demo_wrong: Annotated[float, typer.Option(help="Share of it that is taken for another, 0 to 1.")] = 0.0,
    demo_yaw_deg: Annotated[float, typer.Option(help="What the demo's heading lacks, counter-clockwise.")] = 0.0,
    demo_pitch_deg: Annotated[float, typer.Option(help="What its camera's pitch trim lacks, nose up.")] = 0.0,
    demo_delay_ms: Annotated[float, typer.Option(help="By how much its pictures are stamped late.")] = 0.0,
    seed: Annotated[int, typer.Option(help="Of the demo's noise.")] = 0,
    camera_file: Annotated[
        Path | None,
        typer.Option("--camera", help="TOML with the names of --set, or JSON with K, width, height.", metavar="FILE"),
    ] = None,
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", help=f"Of the camera: {', '.join(KEYS)}.", metavar="NAME=VALUE", show_default=False),
    ] = None,
    full_attitude: Annotated[
        bool, typer.Option("--full-attitude", help="Predict with roll and pitch of the vehicle, not its yaw alone.")
    ] = False,
    frame: Annotated[FrameMode, typer.Option(help="How degrees become metres.")] = FrameMode.WGS84,
    qnh_offset: Annotated[
        float | None, typer.Option(help="What to add to pressure altitudes, in m.", metavar="M")
    ] = None,
    reference: Annotated[
        str | None, typer.Option(help="Of the local origin; default the first fix.", metavar="LAT,LON,ALT")
    ] = None,
    estimate: Annotated[
        bool, typer.Option("--estimate", help="Estimate where the receiver is from the aircraft it hears.")
    ] = False,
    predict_from: Annotated[
        PredictFrom, typer.Option(help="Whose east and north predict; the heading is the odometry's.")
    ] = PredictFrom.ODOM,
    follow: Annotated[
        bool, typer.Option("--follow", help="Read on as lines arrive, until Ctrl-C; always so with a link.")
    ] = False,
    until: Annotated[float | None, typer.Option(help="End after this many seconds.", metavar="S")] = None,
    plot: Annotated[Path | None, typer.Option(help="Draw the last picture.", metavar="OUT.png"), Output.FILE] = None,
    frames: Annotated[
        Path | None, typer.Option(help="Draw all, five per second, for a video.", metavar="DIR"), Output.PLACE
    ] = None,
    palette: Annotated[Palette, typer.Option(help="Colours of pictures; safe for all eyes.")] = Palette.SAFE,
    extent: Annotated[float, typer.Option(help="Of the world in pictures, from side to side, in m.")] = 20_000.0,
    all_sky: Annotated[bool, typer.Option("--all-sky", help="Draw the disc of the sky as well.")] = False,
    csv_file: Annotated[
        Path | None, typer.Option("--csv", help="Write the innovations, a row each.", metavar="OUT.csv"), Output.FILE
    ] = None,
    records: Annotated[
        Path | None,
        typer.Option(help="Write state vectors and estimates, which this reads again.", metavar="OUT.jsonl"),
        Output.FILE,
    ] = None,
    send_aircraft: Annotated[
        str | None,
        typer.Option(help="Pass reports of aircraft on to an autopilot, as ADSB_VEHICLE.", metavar="LINK"),
    ] = None,
    ned: Annotated[bool, typer.Option("--ned", help="A bag's odometry is in NED, not ENU.")] = False,
    utc_offset_h: Annotated[float, typer.Option(help="How far BaseStation times are ahead of UTC.")] = 0.0,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the innovations as lines of JSON, the figures last.")
    ] = False,
) -> None:
    """Compare landmarks and aircraft in pictures with their predicted places; report errors of heading and time.

    Nothing of this goes to the autopilot, but aircraft with --send-aircraft. Inputs are merged by time.

    Example: viso landmarks --demo --frame spherical --demo-noise-px 1 --demo-yaw-deg 3.1
    """
    for option, value, low, high in (
        ("--demo-noise-px", demo_noise_px, 0, 1e4),
        ("--demo-wrong", demo_wrong, 0, 1),
        ("--demo-yaw-deg", demo_yaw_deg, -180, 180),
        ("--demo-pitch-deg", demo_pitch_deg, -45, 45),
        ("--demo-delay-ms", demo_delay_ms, -1000, 1000),
        ("--seed", seed, 0, 2**31 - 1),
        ("--qnh-offset", qnh_offset, -1e4, 1e4),
        ("--until", until, 0, LONGEST_S),
        ("--extent", extent, 1, 1e6),
        ("--utc-offset-h", utc_offset_h, -14, 14),
    ):
        within(option, value, low, high)
    names = inputs or []
    if demo == bool(names):
        raise InputError("nothing to read: name inputs, or --demo" if not demo else "--demo takes no inputs")
    if names.count(STANDARD_INPUT) > 1:
        raise InputError("-: standard input can be read only once")
    camera, keeps_intrinsics = camera_of(camera_file, settings or [])
    session = Session(
        Settings(
            camera=camera,
            keeps_intrinsics=keeps_intrinsics,
            mode=frame,
            qnh_offset_m=qnh_offset,
            reference=_reference(reference),
            from_estimate=predict_from is PredictFrom.ESTIMATED,
            full_attitude=full_attitude,
        )
    )
    if estimate:
        err.print(_NEVER_FLY)
    draw = None if plot is None and frames is None else _draw(palette, extent, with_sky=all_sky)
    console = err if as_json else out
    follow = follow or any(map(is_live, names))
    options = InputOptions(odometry_is_ned=ned, utc_offset_s=3600 * utc_offset_h)
    with ExitStack() as stack:
        stack.enter_context(_one_line_extras())
        signals = stack.enter_context(stop_on_signal())
        is_over = partial(bool, signals)
        sinks: list[Sink] = []
        if as_json:
            sinks.append(json_sink(_write_line))
        elif follow:
            sinks.append(line_sink(out.print))
        if csv_file is not None:
            sinks.append(csv_sink(stack.enter_context(write_text(csv_file, growing=follow))))
        if frames is not None and draw is not None:
            sinks.append(Frames(frames, draw))
        record_file = None if records is None else stack.enter_context(write_text(records, growing=follow))
        run = Run(session, ReceiverWatch(frame) if estimate else None, tuple(sinks), record_file)
        if demo:
            planted = Planted(math.radians(demo_yaw_deg), math.radians(demo_pitch_deg), 1e-3 * demo_delay_ms)
            noise = (demo_noise_px, demo_wrong, seed)
            flight = SyntheticFlight(camera, planted, *noise, mode=frame, qnh_offset_m=qnh_offset)
            events, refused = _enough(flight.events(), is_over, until), _nothing_refused
        elif follow:
            live = stack.enter_context(Live(names, options, sys.stdin.fileno))
            events, refused = live.events(is_over, until), live.refused
        else:
            lines = standard_lines(sys.stdin.fileno(), is_over) if STANDARD_INPUT in names else ()
            merged = Merged(names, options, lines)
            events, refused = _enough(merged.events(), is_over, until), merged.refused
        sender = None
        if send_aircraft is not None:
            sender = AircraftSender(stack.enter_context(closing(open_link(send_aircraft))))
        for event in events:
            run.take(event)
            if sender is not None:
                sender.take(event)
        run.finish()
        for line in (*refusals(refused()), *drops(session.dropped)):
            err.print(line)
        if sender is not None:
            err.print(f"note: {sender.sent} reports of aircraft sent to {send_aircraft}")
        _tell(console, run, as_json=as_json)
        if plot is not None and draw is not None:
            _save(run, draw, plot, console)


def _nothing_refused() -> Mapping[str, Mapping[str, int]]:
    return {}


def _enough(events: Iterator[Event], stop: Callable[[], bool], until_s: float | None) -> Iterator[Event]:
    """Yield events until stopped or a time limit is reached."""
    start_s: float | None = None
    for event in events:
        # Constant data may have no time of their own.
        if start_s is None and not isinstance(event, LandmarkMap | CameraInfo):
            start_s = event.t_s
        if stop() or (until_s is not None and start_s is not None and event.t_s - start_s > until_s):
            return
        yield event


def _write_line(text: str) -> None:
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


def _save(run: Run, draw: Draw, path: Path, console: Console) -> None:
    if run.last is None:
        err.print(f"note: {path} is not written: there is no picture, for want of poses")
        return
    with output_file(path) as file:
        file.write(draw(run.last))
    console.print(f"plot: {path}")


def _tell(console: Console, run: Run, *, as_json: bool) -> None:
    if as_json:
        _write_line(json.dumps({"summary": run.row()}))
        return
    summaries = run.summaries()
    for kind, summary in summaries.items():
        if summary.overall.count:
            console.print(summary_table(kind, summary))
        for line in oddities(summary):
            console.print(f"{kind}: {line}")
    for line in fit_lines(run.fit()):
        console.print(line)
    if run.estimate is not None:
        _tell_estimate(console, run.estimate)


def _tell_estimate(console: Console, estimate: Mapping[str, Any]) -> None:
    place = f"{estimate['kf_lat']:.3f} {estimate['kf_lon']:.3f}"
    count, radius = estimate["aircraft_used"], estimate["kf_radius_km"]
    console.print(f"receiver, by {count} aircraft: {place}, within {radius:.1f} km at the very best")
