# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""``viso play``: the trajectory that an odometry recorded, sent as external navigation."""

import math
from collections.abc import Callable, Mapping
from contextlib import ExitStack, closing
from pathlib import Path
from typing import Annotated, Any, Final, NamedTuple, TypeVar

import typer
from rich.console import Console
from rich.live import Live
from rich.table import Column, Table

from mav_handlers.links import Link, open_link
from viso.companion.sender import OffsetClock
from viso.companion.vio.config import CovarianceEncoding
from viso.dds.poses import SCHEME, PoseTopic, live_topic_of
from viso.errors import InputError, within
from viso.geometry.frame_change import PRESETS, FrameChange, parse_rotation
from viso.geometry.trajectory import Trajectory
from viso.running.bridging import Bridge, delay_lines
from viso.running.playing import LinkPlay, write_telemetry_log
from viso.streams.live import RESET_JUMP_M, LiveOptions, LivePoses
from viso.streams.messages import FORMS
from viso.streams.player import Playback, Player, RecordedEngine, Text
from viso.streams.readers import FORMATS, Source
from viso.streams.trajectory import axes_of, form_of, left_out, load
from viso.terminal.console import err, out
from viso.terminal.options import DomainOption
from viso.terminal.outputs import Output
from viso.terminal.process import stop_on_signal

DEFAULT_LINK: Final = "tcp:127.0.0.1:5760"
_FOR_FILES: Final = (
    *("output", "format_name", "topic", "times", "rate", "max_gap"),
    *("speed", "loop", "delay", "latency", "stamp_offset", "speedup"),
)
LONGEST_S: Final = 4e9
LONGEST_DELAY_S: Final = 86_400.0
_Run = TypeVar("_Run", LinkPlay, Bridge)


class _To(NamedTuple):
    """The destination, the duration and the display."""

    name: str
    until_us: int | None
    wait_s: float
    console: Console
    live: bool


def _frame_change(axes: str, mounting: str, yaw_deg: float, from_zero: bool, scale: float) -> FrameChange:
    matrices = axes_of(axes)
    try:
        rotation = parse_rotation(mounting)
    except ValueError as error:
        raise InputError(f"--mounting: {error}") from error
    return FrameChange(*matrices, rotation, math.radians(yaw_deg), from_zero, scale)


def _sigmas(text: str) -> tuple[float, float] | None:
    if text == "none":
        return None
    try:
        position_m, angle_deg = map(float, text.split(","))
    except ValueError:
        raise InputError(f"--sigma {text}: neither METRES,DEGREES nor none") from None
    within("--sigma", position_m, 0, 1e3)
    within("--sigma", angle_deg, 0, 180)
    return position_m, math.radians(angle_deg)


def _table(sent: Mapping[str, int]) -> Table:
    table = Table("message", Column("count", justify="right"), title="What was sent")
    for name, count in sorted(sent.items()):
        table.add_row(name, str(count))
    return table


def play(
    context: typer.Context,
    trajectory_file: Annotated[
        Path | None,
        typer.Argument(
            help=f"A text file, a bag or the folder of one, see --format; or {SCHEME}/TOPIC, see --ros2.",
            metavar="TRAJECTORY",
        ),
    ] = None,
    ros2: Annotated[
        str | None,
        typer.Option(
            help="Send what comes on this live topic of ROS 2, at once: Odometry, a pose with or without covariance, "
            f"or transforms, named /tf:PARENT.CHILD. The same as {SCHEME}/TOPIC for TRAJECTORY.",
            metavar="/TOPIC",
        ),
    ] = None,
    domain: DomainOption = 0,
    master: Annotated[
        str | None,
        typer.Option(help=f"Link to the vehicle, as of viso serve; default {DEFAULT_LINK}.", metavar="STRING"),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="Write a .tlog instead, without waiting.", metavar="OUT.tlog"),
        Output.FILE,
    ] = None,
    form: Annotated[str, typer.Option("--as", help=f"What to send: {', '.join(FORMS)}.")] = "odometry",
    format_name: Annotated[
        str | None, typer.Option("--format", help=f"Of the file, if not to be found out: {', '.join(FORMATS)}.")
    ] = None,
    topic: Annotated[str | None, typer.Option(help="Of a bag; default the only one with poses.")] = None,
    times: Annotated[Path | None, typer.Option(help="File with the times of KITTI's poses.", metavar="FILE")] = None,
    axes: Annotated[
        str, typer.Option(help=f"Of the recording: WORLD/BODY, such as ENU/FLU, or {', '.join(PRESETS)}.")
    ] = "enu_flu",
    mounting: Annotated[
        str,
        typer.Option(
            help="How the recording's body is turned on the vehicle: ROLL,PITCH,YAW in degrees, a quaternion W,X,Y,Z "
            "or a matrix of nine numbers, from its FRD axes to the vehicle's.",
            metavar="ROTATION",
        ),
    ] = "0,0,0",
    yaw: Annotated[float, typer.Option(help="Turn the world, degrees clockwise.")] = 0.0,
    from_zero: Annotated[bool, typer.Option(help="Let the first position be the origin, as UTM's needs.")] = False,
    scale: Annotated[float, typer.Option(help="Multiply positions, as of a monocular odometry.")] = 1.0,
    rate: Annotated[
        float | None, typer.Option(help="Interpolate to this rate in Hz; default the recording's own.")
    ] = None,
    max_gap: Annotated[float, typer.Option(help="Longest time in s to interpolate over.")] = 1.0,
    sigma: Annotated[
        str | None,
        typer.Option(help="Covariance in place of the recording's: METRES,DEGREES or none.", metavar="SIGMAS"),
    ] = None,
    encoding: Annotated[
        CovarianceEncoding,
        typer.Option(
            help="Of covariances: as MAVLink defines them, or so that ArduPilot up to 4.6 gets the standard deviations."
        ),
    ] = CovarianceEncoding.VARIANCE,
    quality: Annotated[int, typer.Option(help="Of every pose, -1 to 100; the confidence of changes.")] = 100,
    differentiate: Annotated[
        bool, typer.Option("--differentiate", help="Take velocities from positions, whatever the recording says.")
    ] = False,
    reset_jump: Annotated[
        float | None,
        typer.Option(help="Count up the reset counter where the position jumps by more, in m; 0.5 of a live topic."),
    ] = None,
    speed: Annotated[float, typer.Option(help="Fly this much faster; velocities follow.")] = 1.0,
    loop: Annotated[bool, typer.Option("--loop", help="Start again at the end, as after a reset.")] = False,
    delay: Annotated[float, typer.Option(help="Seconds before the first pose.")] = 0.0,
    latency: Annotated[float, typer.Option(help="From a pose's time to its sending, in ms.")] = 0.0,
    stamp_offset: Annotated[float, typer.Option(help="What the sender's clock shows at the start, in s.")] = 0.0,
    until: Annotated[float | None, typer.Option(help="End after this many seconds.", metavar="S")] = None,
    speedup: Annotated[float, typer.Option(help="Seconds in one second, as of a viso serve with --speedup.")] = 1.0,
    wait: Annotated[float, typer.Option(help="How long to wait for the vehicle, in s; 0 plays unheard.")] = 5.0,
    live: Annotated[bool, typer.Option(help="Show the counts while they grow, on a terminal.")] = True,
    as_json: Annotated[bool, typer.Option("--json", help="Print the counts as JSON.")] = False,
) -> None:
    """Play the trajectory that an odometry or a motion capture recorded, as a companion computer would send it.

    It goes out in real time, and what the vehicle says is shown; or into a telemetry log that viso replay reads. A live
    topic of ROS 2 is sent as it comes, until Ctrl-C.
    ODOMETRY is in LOCAL_FRD and BODY_FRD, all else in NED.

    Example: seq -f '%g 0 0 -1 0 0 0 1' 0 .05 9 > poses.tum && viso play poses.tum -o flight.tlog
    """
    for option, value, low, high in (
        ("--yaw", yaw, -360, 360),
        ("--scale", scale, 1e-6, 1e6),
        ("--rate", rate, 0.1, 1000),
        ("--max-gap", max_gap, 0, 3600),
        ("--quality", quality, -1, 100),
        ("--reset-jump", reset_jump, 0, 1e6),
        ("--speed", speed, 0.01, 100),
        ("--delay", delay, 0, LONGEST_DELAY_S),
        ("--latency", latency, 0, 1e6),
        ("--stamp-offset", stamp_offset, 0, LONGEST_S),
        ("--until", until, 0, LONGEST_S),
        ("--speedup", speedup, 0.01, 1000),
        ("--wait", wait, 0, LONGEST_S),
    ):
        within(option, value, low, high)
    if master is not None and output is not None:
        raise InputError("--master and --output: use one of the two")
    if loop and output is not None and until is None:
        raise InputError("--loop: a log without an end needs --until")
    live_name = _live_topic(trajectory_file, ros2)
    change = _frame_change(axes, mounting, yaw, from_zero and live_name is None, scale)
    sigmas = None if sigma is None else _sigmas(sigma)
    until_us = None if until is None else int(until * 1e6)
    console = err if as_json else out
    texts: list[Text] = []

    def adapted(recorded: Trajectory) -> Trajectory:
        trajectory = change.apply(recorded.without_velocities() if differentiate else recorded)
        return trajectory if sigma is None else trajectory.with_sigmas(sigmas)

    def take(text: Text) -> None:
        texts.append(text)
        console.print(f"({text.severity}) {text.text}")

    to = _To(master or DEFAULT_LINK, until_us, wait, console, live and not as_json)
    if live_name is not None:
        _refuse_for_files(context)
        jump_m = RESET_JUMP_M if reset_jump is None else reset_jump
        options = LiveOptions(adapted, form_of(form), quality, encoding, jump_m, from_zero)
        with closing(PoseTopic(live_name, domain)) as live_topic:
            poses = LivePoses(options)
            summary = _drive(
                to, lambda link, stop: Bridge(link, live_topic, poses, on_text=take, on_news=err.print, stop=stop)
            ).summary()
        if as_json:
            out.print_json(data={**summary, "texts": [text._asdict() for text in texts]})
        else:
            _print_bridged(summary)
        return
    assert trajectory_file is not None
    start_us, latency_us, clock = int(delay * 1e6), int(latency * 1e3), OffsetClock(int(stamp_offset * 1e6))
    playback = Playback(form_of(form), speed, loop, start_us, latency_us, clock, quality, encoding)
    source = Source(trajectory_file, topic, times)
    recorded = load(source, format_name, from_anywhere=from_zero)
    for line in left_out(source, recorded):
        err.print(f"note: {line}")
    trajectory = adapted(recorded)
    if reset_jump is not None:
        trajectory = trajectory.with_resets_at_jumps(reset_jump)
    if rate is not None:
        trajectory = trajectory.resampled(rate, max_gap)
    player = Player(RecordedEngine(trajectory, playback))
    lengths = f"{len(recorded)} records in {recorded.duration_s:.3f} s, {len(trajectory)} to send"
    console.print(f"{trajectory_file}: {lengths}")
    if output is not None:
        write_telemetry_log(output, player, int(trajectory.times_ns[0]), until_us)
    else:
        _drive(to, lambda link, stop: LinkPlay(link, player, on_text=take, stop=stop, speedup=speedup))
    if as_json:
        rows = [text._asdict() for text in texts]
        counts = {"records": len(recorded), "left_out": dict(recorded.left_out), "sent": dict(player.sent)}
        out.print_json(data={**counts, "texts": rows})
        return
    console.print(_table(player.sent))
    if output is not None:
        console.print(f"log: {output}")


def _live_topic(file: Path | None, ros2: str | None) -> str | None:
    """Return the name of the live topic, None for a file; raises InputError unless it is one of them."""
    if (file is None) == (ros2 is None):
        raise InputError("TRAJECTORY: a file is needed, or a live topic")
    return ros2 if file is None else live_topic_of(str(file))


def _refuse_for_files(context: typer.Context) -> None:
    for option in context.command.params:
        given = option.name in _FOR_FILES and context.get_parameter_source(option.name)
        if given and given.name == "COMMANDLINE":
            raise InputError(f"{option.opts[-1]}: not of a live topic, which is sent as it comes")


def _print_bridged(summary: Mapping[str, Any]) -> None:
    for reason, count in summary["left_out"].items():
        err.print(f"note: {summary['topic']}: {count} with {reason}")
    out.print(_table(summary["sent"]))
    out.print(f"{summary['topic']}: {summary['heard']} poses heard, {summary['resets']} resets")
    for line in delay_lines(summary):
        out.print(line)


def _drive(to: _To, make: Callable[[Link, Callable[[], bool]], _Run]) -> _Run:
    """Run the sender that ``make`` builds from a link and a stop function; return it."""
    with ExitStack() as stack:
        link = stack.enter_context(closing(open_link(to.name)))
        stop = stack.enter_context(stop_on_signal())
        run = make(link, lambda: bool(stop))
        if to.live and to.console.is_terminal:
            # Drawn by a thread, which takes a copy of the counts.
            shown = Live(console=to.console, transient=True, get_renderable=lambda: _table(run.sent()))
            stack.enter_context(shown)
        if to.wait_s and not run.wait_for_vehicle(to.wait_s) and not stop:
            why = link.stats.unreached
            reason = f"no vehicle heard within {to.wait_s:g} s{f': {why}' if why else ''} (--wait 0 plays unheard)"
            raise InputError(f"--master {to.name}: {reason}")
        before = link.stats.bytes_dropped  # a heartbeat may have been ahead of the connection
        run.run(to.until_us)
        stats = link.stats
    if stats.bytes_dropped > before:
        reasons = ", ".join(stats.drop_reasons)
        err.print(f"note: {to.name}: {stats.bytes_dropped - before} bytes did not reach the vehicle: {reasons}")
    return run
