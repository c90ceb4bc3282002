# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""``viso serve``: the autopilot on links, in real time."""

from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import ExitStack, closing
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mav_handlers.channel import CountKey
from mav_handlers.links import Link, is_open_to_network, open_link
from viso.dds.graph import check_domain, require_cyclonedds
from viso.errors import InputError, file_errors
from viso.files.item_store import FileItemStore
from viso.files.key_store import FileKeyStore
from viso.files.outputs import refuse_input
from viso.firmware.releases import PROFILES, Firmware
from viso.logs.files import LogStore
from viso.parameters.releases import MAX_LINKS
from viso.parameters.store import ParamStore
from viso.replay.ahrs import ahrs_maker
from viso.running.power import Port, PoweredVehicle
from viso.running.real_time import Pacer
from viso.terminal.ahrs import (
    AhrsChoice,
    AhrsOption,
    HeadingOption,
    HomeOption,
    ImuErrorOption,
    ImuOption,
    ImuSeedOption,
)
from viso.terminal.console import err, out, verdict_rows
from viso.terminal.filter_report import filter_rows, tables_of
from viso.terminal.live_report import REFRESH_US, LiveCounts, LiveReport
from viso.terminal.options import DEFAULT_FIRMWARE, FirmwareOption, firmware_of
from viso.terminal.outputs import Output
from viso.terminal.process import stop_on_signal
from viso.terminal.settings import PRESET_HELP, STRICT_HELP, load_message_intervals, load_settings, preset_files
from viso.terminal.verdict_stream import VerdictFormat, open_streams
from viso.vehicle.sensors.inertial_sources import wants_vicon
from viso.vehicle.vehicle import Vehicle, VehicleConfig

if TYPE_CHECKING:
    from viso.dds.autopilot import DdsAutopilot
    from viso.web.live_view import LiveView

MAX_DURATION_S = 4e9
STORAGE_NAME = "storage.parm"
KEY_NAME = "signing.key"
MISSIONS_NAME = "missions.txt"
DEFAULT_LINKS = ("tcpin:127.0.0.1:5760", "udpout:127.0.0.1:14550")


def _tell_of_links(links: Sequence[Link], takers: Sequence[Callable[[str, str], None]]) -> None:
    """Report present peers, and from now on those that come and go, with the name of the link."""

    def report_news(link: str, news: str) -> None:
        for take in takers:
            take(link, news)

    for link in links:
        link.news.tell(partial(report_news, link.name))
        for peer in link.peer_names:
            report_news(link.name, f"{peer} connected")


def _profile_text(firmware: Firmware) -> str:
    *others, last = (name for name in PROFILES if name != firmware.name)
    return f"firmware {firmware.name}, --firmware {', '.join(others)} or {last} for another"


def _open_view(address: str, links: Sequence[Link], title: str, speedup: float, stack: ExitStack) -> "LiveView":
    # Imported only when needed: with its faults it takes as long to import as the autopilot itself.
    from viso.web.live_view import LiveView

    view = LiveView(address, links, title, speedup=speedup)
    stack.callback(view.close)
    return view


def _enter_domain(domain: int, stack: ExitStack) -> "DdsAutopilot":
    from viso.dds.autopilot import DdsAutopilot  # imported only when needed: it needs an extra

    return stack.enter_context(closing(DdsAutopilot(domain)))


def serve(
    master: Annotated[
        list[str] | None,
        typer.Option(
            help="Link: udpin:, udpout:, tcp:, tcpin: HOST:PORT, mcast: or DEVICE,BAUD; repeatable. "
            f"Default {' and '.join(DEFAULT_LINKS)}.",
            metavar="STRING",
        ),
    ] = None,
    preset: Annotated[str | None, typer.Option(help=PRESET_HELP, metavar="NAME")] = None,
    defaults: Annotated[list[Path] | None, typer.Option(help="Parameter file; repeatable.", metavar="FILE")] = None,
    param: Annotated[list[str] | None, typer.Option(help="NAME=VALUE; repeatable, wins over files.")] = None,
    strict: Annotated[bool, typer.Option("--strict", help=STRICT_HELP)] = False,
    firmware: FirmwareOption = DEFAULT_FIRMWARE,
    log_dir: Annotated[
        Path,
        typer.Option(help="Where logs 00000001.BIN and so on go, and message-intervals-chan0.txt is."),
        Output.PLACE,
    ] = Path("logs"),
    storage: Annotated[
        Path | None,
        typer.Option(
            help=f"Where parameters are kept over a restart, {KEY_NAME} and {MISSIONS_NAME} beside; "
            f"default {STORAGE_NAME} beside the logs."
        ),
        Output.PLACE,
    ] = None,
    speedup: Annotated[float, typer.Option(help="Vehicle seconds in one second.")] = 1.0,
    imu: ImuOption = None,
    imu_error: ImuErrorOption = None,
    imu_seed: ImuSeedOption = 0,
    vision: Annotated[
        str | None,
        typer.Option(
            help="vicon: the simulator's own camera, which SIM_VICON_ parameters spoil, on a link of its own; "
            "takes --imu fly.",
            metavar="CAMERA",
        ),
    ] = None,
    heading: HeadingOption = 0.0,
    home: HomeOption = None,
    ahrs: AhrsOption = None,
    baud: Annotated[
        int | None,
        typer.Option(help="Model the transport time of a UART of this rate on network links, as the simulator does."),
    ] = None,
    duration: Annotated[float | None, typer.Option(help="Stop after this many vehicle seconds.")] = None,
    verdicts: Annotated[
        VerdictFormat | None,
        typer.Option(
            help="Print a line a message, and a line a sample in the filter: its outcome and why; all else goes "
            "to standard error."
        ),
    ] = None,
    verdicts_file: Annotated[
        Path | None, typer.Option(help="Write these lines to a file, as JSON.", metavar="FILE"), Output.FILE
    ] = None,
    web: Annotated[
        str | None,
        typer.Option(
            help="Show all this on a page in the browser, which can change parameters and switch faults on.",
            metavar="[HOST:]PORT",
        ),
    ] = None,
    dds: Annotated[
        int | None,
        typer.Option(
            help="Be on this DDS domain, the ROS_DOMAIN_ID of ROS 2, as AP_DDS is: transforms come in on /ap/tf.",
            metavar="DOMAIN",
        ),
    ] = None,
    live: Annotated[bool, typer.Option(help="Show the counts while they grow, on a terminal.")] = True,
    as_json: Annotated[bool, typer.Option("--json", help="Print the closing counts as JSON.")] = False,
) -> None:
    """Run the autopilot: a vehicle that takes external navigation, estimates its state and answers as ArduCopter.

    It stands still unless --imu moves it; with --imu fly it obeys a companion in GUIDED, and a pilot's sticks.
    External navigation is off until VISO_TYPE is set. Ctrl-C closes the log and ends with tables of the outcome of
    each message, and of each sample in the filter; the filter is a model of EKF3, and what it decides is marked as a
    model's. The exit code is 1 if anything that was to be kept is lost.

    Example: viso serve --param VISO_TYPE=1 --duration 1
    """
    names = list(master or DEFAULT_LINKS)
    if not 0 < speedup <= 1000:
        raise InputError(f"--speedup {speedup}: not between 0 and 1000")
    if baud is not None and baud <= 0:
        raise InputError(f"--baud {baud}: not a rate")
    if duration is not None and not 0 <= duration <= MAX_DURATION_S:
        raise InputError(f"--duration {duration}: not a time in seconds")
    if len(names) > MAX_LINKS:
        raise InputError(f"--master: the autopilot has parameters for {MAX_LINKS} links, not {len(names)}")
    if as_json and verdicts is not None:
        raise InputError("--json and --verdicts both take standard output: use --verdicts-file")
    if dds is not None:
        check_domain(dds, "--dds")
        require_cyclonedds("--dds")
    profile = firmware_of(firmware)
    files = [*preset_files(preset), *(defaults or [])]
    vicon = wants_vicon(vision, imu, "--vision")
    read_only: set[str] = set()
    settings = load_settings(files, [], links=len(names) + vicon, strict=strict, firmware=profile, read_only=read_only)
    overrides = load_settings([], param or [], links=len(names) + vicon, firmware=profile)
    with file_errors(f"--log-dir {log_dir}"):
        log_dir.mkdir(parents=True, exist_ok=True)
    store = LogStore(log_dir)
    storage_path = storage or log_dir / STORAGE_NAME
    key_path, missions_path = storage_path.with_name(KEY_NAME), storage_path.with_name(MISSIONS_NAME)
    for path in (storage_path, key_path, missions_path):
        refuse_input(path)
    param_store, key_store, item_store = ParamStore(storage_path), FileKeyStore(key_path), FileItemStore(missions_path)
    config = VehicleConfig(
        ahrs_maker(AhrsChoice(ahrs, imu, imu_error, imu_seed, heading, home)),
        links=len(names),
        vicon=vicon,
        defaults=settings,
        read_only=read_only,
        overrides=overrides,
        log_store=store,
        param_store=param_store,
        item_store=item_store,
        signing_store=key_store,
        firmware=profile,
        message_intervals=load_message_intervals(log_dir, len(names)),
    )
    # Standard output for a machine has one format only.
    console = out if verdicts is None and not as_json else err
    with ExitStack() as stack:
        links = [stack.enter_context(closing(open_link(name))) for name in names]
        streams = open_streams(verdicts, verdicts_file, stack)
        graphs = [] if dds is None else [_enter_domain(dds, stack)]
        title = f"{config.firmware.banner} on {', '.join([*names, *(graph.name for graph in graphs)])}"
        view = None if web is None else _open_view(web, links, title, speedup, stack)
        feeds = [] if view is None else [view.feed]
        takers = [*(stream.take for stream in streams), *(feed.take for feed in feeds)]
        filter_takers = [*(stream.take_outcome for stream in streams), *(feed.take_outcome for feed in feeds)]
        report = LiveReport(console, takers, filter_takers)
        for graph in graphs:
            graph.listeners = [report.take]

        def watch(vehicle: Vehicle) -> None:
            report.watch(vehicle)
            for feed in feeds:
                feed.watch(vehicle)

        ports = [Port(link.name, link.baud or baud) for link in links]
        powered = PoweredVehicle(config, ports, on_boot=watch)
        stack.callback(powered.close)
        stop = stack.enter_context(stop_on_signal())
        console.print(f"{title}; {_profile_text(profile)}; logs in {log_dir}; Ctrl-C ends")
        for note in powered.vehicle.ahrs.notes:
            console.print(f"note: {note}")
        for link in filter(is_open_to_network, links):
            console.print(f"{link.name} is open to the network; whoever reaches it can command the vehicle")
        for graph in graphs:
            console.print(f"{graph.name} is open to all who are on this domain; they can command the vehicle")
        if view is not None:
            console.print(view.introduction)

        def message_counts() -> Counter[CountKey]:
            return sum((graph.counts for graph in graphs), Counter(powered.verdict_counts()))

        counted = message_counts, powered.filter_counts
        period_us = int(REFRESH_US * speedup)
        shown = stack.enter_context(LiveCounts(console, *counted, period_us=period_us, wanted=live and console is out))
        _tell_of_links(links, [report.print_link_news, *(feed.take_news for feed in feeds)])

        def is_over() -> bool:
            shown.update(powered.vehicle.clock.micros64())
            for feed in feeds:
                feed.update()
            return bool(stop) or any(stream.reader_left for stream in streams)

        until_us = None if duration is None else int(duration * 1e6)
        pacer = Pacer(powered, links if view is None else view.links, speedup=speedup, beside=graphs)
        pacer.run(is_over, until_us=until_us)
    losses = [f"log: {count} records lost: {reason}" for reason, count in powered.log_losses().items()]
    if param_store.failure:
        losses.append(f"parameters: {param_store.failure}")
    losses += filter(None, (item_store.failure, key_store.failure, *(stream.failure() for stream in streams)))
    for loss in losses:
        err.print(loss)
    counts, filter_counts = message_counts(), powered.filter_counts()
    if as_json:
        out.print_json(data={"verdicts": verdict_rows(counts), "filter": filter_rows(filter_counts)})
    else:
        console.print(*tables_of(counts, filter_counts))
    if losses:
        raise typer.Exit(1)
