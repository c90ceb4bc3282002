# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""``viso serve``: the autopilot on links, in real time."""

import signal
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from ap_core.verdict import Outcome
from emulator.console import err, out, verdict_rows, verdict_table
from emulator.errors import InputError
from emulator.log_files import LogStore
from emulator.param_store import ParamStore
from emulator.parameters import MAX_LINKS
from emulator.realtime import AttachedLink, Pacer
from emulator.settings import load_settings
from emulator.vehicle import Vehicle, VehicleConfig, bench
from mav_handlers.endpoint import MessageEvent
from mav_handlers.links import Link, open_link

MAX_DURATION_S = 4e9
STORAGE_NAME = "storage.parm"
DEFAULT_LINKS = ("tcpin:127.0.0.1:5760", "udpout:127.0.0.1:14550")


class _Reporter:
    """Prints texts as they come, and the first time that a message type meets a verdict other than acceptance."""

    def __init__(self, vehicle: Vehicle, console: Console) -> None:
        self._vehicle = vehicle
        self._console = console
        self._seen: set[tuple[str, str]] = set()
        vehicle.texts.on_text.append(self.text)
        vehicle.endpoint.on_event = self.event

    def _print(self, line: str) -> None:
        self._console.print(f"{self._vehicle.clock.micros64() / 1e6:9.3f} s  {line}")

    def text(self, severity: int, text: str) -> None:
        self._print(f"({severity}) {text}")

    def event(self, event: MessageEvent) -> None:
        verdict = event.verdict
        key = (event.name, verdict.rule.code)
        if verdict.outcome in (Outcome.ACCEPTED, Outcome.HANDLED) or key in self._seen:
            return
        self._seen.add(key)
        self._print(f"first {event.name} {verdict.outcome}: {verdict.rule.text}")


@contextmanager
def _stop_on_signal() -> Iterator[list[int]]:
    """Yield a list to which SIGINT and SIGTERM append instead of killing the process."""
    received: list[int] = []
    before = {
        number: signal.signal(number, lambda caught, _frame: received.append(caught))
        for number in (signal.SIGINT, signal.SIGTERM)
    }
    try:
        yield received
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _open_links(names: Sequence[str], stack: ExitStack) -> list[Link]:
    links = []
    for name in names:
        link = open_link(name)
        stack.callback(link.close)
        links.append(link)
    return links


def serve(
    master: Annotated[
        list[str] | None,
        typer.Option(
            help="Link: udpin:, udpout:, tcp:, tcpin: HOST:PORT, mcast: or DEVICE,BAUD; repeatable. "
            f"Default {' and '.join(DEFAULT_LINKS)}.",
            metavar="STRING",
        ),
    ] = None,
    defaults: Annotated[list[Path] | None, typer.Option(help="Parameter file; repeatable.", metavar="FILE")] = None,
    param: Annotated[list[str] | None, typer.Option(help="NAME=VALUE; repeatable, wins over files.")] = None,
    allow_unknown: Annotated[bool, typer.Option(help="Pass over unknown names in parameter files.")] = False,
    log_dir: Annotated[Path, typer.Option(help="Where logs 00000001.BIN and so on go.")] = Path("logs"),
    storage: Annotated[
        Path | None,
        typer.Option(help=f"Where parameters are kept over a restart; default {STORAGE_NAME} beside the logs."),
    ] = None,
    speedup: Annotated[float, typer.Option(help="Vehicle seconds in one second.")] = 1.0,
    heading: Annotated[float, typer.Option(help="The vehicle's heading in degrees.")] = 0.0,
    baud: Annotated[
        int | None,
        typer.Option(help="Model the transport time of a UART of this rate on network links, as the simulator does."),
    ] = None,
    duration: Annotated[float | None, typer.Option(help="Stop after this many vehicle seconds.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the closing counts as JSON.")] = False,
) -> None:
    """Be the autopilot: a stationary vehicle that takes external navigation and answers as ArduCopter does.

    External navigation is off until VISO_TYPE is set. Ctrl-C closes the log and ends with a table of what became of
    each message.

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
    settings = load_settings(defaults or [], [], links=len(names), allow_unknown=allow_unknown)
    overrides = load_settings([], param or [], links=len(names))
    try:
        log_dir.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"--log-dir {log_dir}: {error.strerror or error}") from error
    store = LogStore(log_dir)
    config = VehicleConfig(
        bench(heading),
        links=len(names),
        defaults=settings,
        overrides=overrides,
        log_store=store,
        param_store=ParamStore(storage or log_dir / STORAGE_NAME),
    )
    with ExitStack() as stack:
        links = _open_links(names, stack)
        vehicle = Vehicle(config)
        stack.callback(vehicle.close)
        # Standard output is for the closing counts alone when a machine reads them.
        live = err if as_json else out
        _Reporter(vehicle, live)
        attached = [
            AttachedLink(link, vehicle.endpoint.open_channel(link.name, baud=link.baud or baud)) for link in links
        ]
        stop = stack.enter_context(_stop_on_signal())
        live.print(f"{config.firmware.banner} on {', '.join(names)}; logs in {log_dir}; Ctrl-C ends")
        until_us = None if duration is None else int(duration * 1e6)
        Pacer(vehicle, attached, speedup=speedup).run(lambda: bool(stop), until_us=until_us)
    if vehicle.logger.failure:
        err.print(f"log: {vehicle.logger.failure}")
    if store_failure := config.param_store and config.param_store.failure:
        err.print(f"parameters: {store_failure}")
    counts = vehicle.endpoint.verdict_counts()
    if as_json:
        out.print_json(data={"verdicts": verdict_rows(counts)})
    else:
        out.print(verdict_table(counts))
