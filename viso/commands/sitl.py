# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""``viso sitl``: the autopilot with the command line of the firmware's simulator, to stand in its place."""

import math
import os
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final

import typer
from rich.console import Console

from ekf_stub.ahrs.ahrs_base import AhrsBase
from mav_handlers.links import Link, open_link
from viso.errors import InputError, file_errors
from viso.files.item_store import FileItemStore
from viso.files.key_store import FileKeyStore
from viso.files.outputs import reading, refuse_input
from viso.firmware.releases import Firmware
from viso.logs.files import LogStore
from viso.parameters.releases import MAX_LINKS
from viso.parameters.store import ParamStore
from viso.replay.ahrs import ahrs_maker
from viso.running.lockstep import Lockstep
from viso.running.power import Port, PoweredVehicle
from viso.running.radio import UdpRadio
from viso.terminal.ahrs import AhrsChoice
from viso.terminal.console import err
from viso.terminal.live_report import LiveReport
from viso.terminal.options import DEFAULT_FIRMWARE, FirmwareOption, firmware_of
from viso.terminal.outputs import Output
from viso.terminal.process import stop_on_signal
from viso.terminal.serial_devices import DEFAULT_DEVICES, FORMS, SerialDevice, mavlink_ports, read_device
from viso.terminal.settings import known_parameters, load_message_intervals, load_settings
from viso.terminal.verdict_stream import VerdictStream, open_streams
from viso.vehicle.sensors.inertial_sources import FLIES
from viso.vehicle.vehicle import Vehicle, VehicleConfig

BASE_PORT: Final = 5760
RADIO_PORT: Final = 5501
PORTS_OF_AN_INSTANCE: Final = 10
LOOPBACK: Final = "127.0.0.1"
HOME: Final = "-35.363261,149.165230,584,353"
STORAGE: Final = Path("storage.parm")
MISSIONS: Final = Path("missions.txt")
KEY: Final = Path("signing.key")
LOG_DIR: Final = Path("logs")
MULTICOPTERS: Final = (
    *("+", "quad", "copter", "x", "bfxrev", "bfx", "djix", "cwx", "hexa", "hexax", "hexa-cwx", "hexa-dji"),
    *("octa", "octa-cwx", "octa-dji", "octa-quad-cwx", "dodeca-hexa", "tri", "y6", "deca", "deca-cwx"),
)
"""The simulator's models that fly as the vehicle here does."""
SPEEDUP: Final = "SIM_SPEEDUP"

_SERIAL_OF_UART: Final = {"A": 0, "B": 3, "C": 1, "D": 2, "E": 4, "F": 5}
"""The numbers of SERIALn by the letter of the option of releases up to 4.4."""

_FirstDevice = Annotated[
    str | None, typer.Option(help=f"What this port is connected to: {FORMS}.", metavar="DEVICE", show_default=False)
]
_Device = Annotated[str | None, typer.Option(help="The same.", metavar="DEVICE", show_default=False)]
_Flag = Annotated[bool, typer.Option(hidden=True)]
_Text = Annotated[str | None, typer.Option(hidden=True)]


@dataclass(frozen=True)
class _Setup:
    """What stays over restarts: the release, the AHRS's maker, values of parameters, and devices of serial ports.

    ``devices`` are by number of the serial port; ``boot_utc_us`` is the time of day at a start, 0 for now. ``radio`` is
    the address of the radio's UDP port; ``duration_us`` is how long the vehicle runs after a start.
    """

    firmware: Firmware
    make_ahrs: Callable[[Vehicle], AhrsBase]
    defaults: Mapping[str, float]
    read_only: frozenset[str]
    overrides: Mapping[str, float]
    devices: Sequence[SerialDevice]
    radio: tuple[str, int]
    speedup: float
    boot_utc_us: int
    duration_us: float

    def ports(self, stored: Mapping[str, float]) -> list[int]:
        """Return the serial ports that speak MAVLink after a start with such stored values, in their order."""
        params = known_parameters(MAX_LINKS, self.firmware)
        for name, value in {**self.defaults, **stored, **self.overrides}.items():
            if name.startswith("SERIAL") and params.find(name) is not None:
                params.set(name, value)
        wired = mavlink_ports(params, len(self.devices))
        return [number for number in wired if self.devices[number].link or self.devices[number].is_vicon]


def _print(line: str) -> None:
    """Print a line that scripts may wait for."""
    print(line, flush=True)


def sitl(
    model: Annotated[str, typer.Option("--model", "-M", help=f"Frame: {', '.join(MULTICOPTERS)}.")] = "+",
    home: Annotated[
        str,
        typer.Option(
            "--home", "-O", help="Where it starts: degrees, m above sea level, degrees.", metavar="LAT,LON,ALT,HEADING"
        ),
    ] = HOME,
    defaults: Annotated[str, typer.Option(help="Parameter files, with commas between them.", metavar="FILE,...")] = "",
    param: Annotated[
        list[str] | None, typer.Option("--param", "-P", help="NAME=VALUE; repeatable, wins over files.")
    ] = None,
    wipe: Annotated[bool, typer.Option("--wipe", "-w", help="Forget stored parameters and missions first.")] = False,
    speedup: Annotated[
        float | None, typer.Option("--speedup", "-s", help=f"Vehicle seconds in one second: default of {SPEEDUP}.")
    ] = None,
    instance: Annotated[int, typer.Option("--instance", "-I", help="Add 10 times this to all ports.", min=0)] = 0,
    firmware: FirmwareOption = DEFAULT_FIRMWARE,
    sysid: Annotated[int | None, typer.Option(help="Default system id.", min=1, max=255)] = None,
    base_port: Annotated[int, typer.Option(help="TCP port of SERIAL0.")] = BASE_PORT,
    rc_in_port: Annotated[
        int, typer.Option(help="UDP port of the radio: 8 or 16 pulse lengths, uint16 in us, in a datagram.")
    ] = RADIO_PORT,
    bind: Annotated[str, typer.Option(help="Address that servers bind to; 0.0.0.0 for all.")] = LOOPBACK,
    start_time: Annotated[int, typer.Option(help="Time of day at boot, s since 1970; 0 for now.", min=0)] = 0,
    duration: Annotated[
        float | None, typer.Option(help="Stop so many vehicle seconds after the last start.", min=0)
    ] = None,
    verdicts_file: Annotated[
        Path | None,
        typer.Option(help="Write a line a message, and a line a sample in the filter, as JSON.", metavar="FILE"),
        Output.FILE,
    ] = None,
    serial0: _FirstDevice = None,
    serial1: _Device = None,
    serial2: _Device = None,
    serial3: _Device = None,
    serial4: _Device = None,
    serial5: _Device = None,
    serial6: _Device = None,
    serial7: _Device = None,
    serial8: _Device = None,
    serial9: _Device = None,
    uart_a: Annotated[str | None, typer.Option("--uartA", hidden=True)] = None,
    uart_b: Annotated[str | None, typer.Option("--uartB", hidden=True)] = None,
    uart_c: Annotated[str | None, typer.Option("--uartC", hidden=True)] = None,
    uart_d: Annotated[str | None, typer.Option("--uartD", hidden=True)] = None,
    uart_e: Annotated[str | None, typer.Option("--uartE", hidden=True)] = None,
    uart_f: Annotated[str | None, typer.Option("--uartF", hidden=True)] = None,
    synthetic_clock: Annotated[bool, typer.Option("--synthetic-clock", "-S", hidden=True)] = False,
    rate: Annotated[float | None, typer.Option("--rate", "-r", hidden=True)] = None,
    vehicle: Annotated[str, typer.Option("--vehicle", "-v", hidden=True)] = "ArduCopter",
    unhide_groups: Annotated[bool, typer.Option("--unhide-groups", "-u", hidden=True)] = False,
    config: Annotated[str, typer.Option("--config", "-c", hidden=True)] = "",
    flight_gear: Annotated[str, typer.Option("--fg", "-F", hidden=True)] = "",
    enable_fgview: _Flag = False,
    autotest_dir: _Text = None,
    rtscts: _Flag = False,
    sim_address: _Text = None,
    sim_port_in: _Text = None,
    sim_port_out: _Text = None,
    irlock_port: _Text = None,
    slave: _Text = None,
) -> None:
    """Stand in for the firmware's simulator of ArduCopter: the same command line, ports, lines and parameters.

    It flies the same model of a multicopter as viso serve --imu fly, with the simulator's GPS. Its clock waits for the
    computer: a speed that cannot be reached is not reached, and no pass is lost. It waits for a client on
    SERIAL0, keeps parameters in storage.parm, missions in missions.txt and logs in logs/ of the present folder, and
    starts again when a client asks for it. It ends by Ctrl-C, or with the program that started it.

    Options of the simulator that have no effect here are taken in silence: -S, --rate, --unhide-groups, --config, --fg,
    --enable-fgview, --autotest-dir, --rtscts, --sim-address, --sim-port-in, --sim-port-out, --irlock-port,
    --slave.

    Example: viso sitl --serial0 udpclient:127.0.0.1:14550 --serial1 none --serial2 none --speedup 10 --duration 1
    """
    _check_model(model, vehicle)
    profile = firmware_of(firmware)
    uarts = (uart_a, uart_b, uart_c, uart_d, uart_e, uart_f)
    serials = [serial0, serial1, serial2, serial3, serial4, serial5, serial6, serial7, serial8, serial9]
    port = base_port if base_port != BASE_PORT else base_port + PORTS_OF_AN_INSTANCE * instance
    radio_port = rc_in_port if rc_in_port != RADIO_PORT else rc_in_port + PORTS_OF_AN_INSTANCE * instance
    read_only: set[str] = set()
    files = [Path(name) for name in defaults.split(",") if name]
    settings = dict(load_settings(files, [], links=MAX_LINKS, firmware=profile, read_only=read_only))
    if speedup is not None:
        if not 0 < speedup <= 1000:
            raise InputError(f"--speedup {speedup}: not between 0 and 1000")
        settings[SPEEDUP] = speedup
    if sysid is not None:
        settings[profile.endpoint.params.system_id] = sysid
    setup = _Setup(
        profile,
        ahrs_maker(AhrsChoice(imu=FLIES, home=home, with_each_imu=True)),
        settings,
        frozenset(read_only),
        load_settings([], param or [], links=MAX_LINKS, firmware=profile),
        _devices(serials, uarts, port, bind),
        (bind, radio_port),
        speedup or 1.0,
        start_time * 1_000_000,
        math.inf if duration is None else 1e6 * duration,
    )
    with file_errors(f"{LOG_DIR}"):
        LOG_DIR.mkdir(exist_ok=True)
    parent = os.getppid()
    with ExitStack() as stack:
        stack.enter_context(reading(("--defaults", path) for path in files))
        for kept in (STORAGE, MISSIONS, KEY):
            refuse_input(kept)
        if wipe:
            for kept in (STORAGE, MISSIONS):
                kept.unlink(missing_ok=True)
        for path in files:
            _print(f"Loaded defaults from {path}")
        streams = open_streams(None, verdicts_file, stack)
        received = stack.enter_context(stop_on_signal())

        def stop() -> bool:
            return bool(received) or os.getppid() != parent

        _print(f"Starting sketch '{vehicle}'")
        _print("Starting SITL input")
        losses: list[str] = []
        while _boot(setup, streams, losses, stop):
            pass
    losses += filter(None, (stream.failure() for stream in streams))
    for loss in losses:
        err.print(loss)
    if losses:
        raise typer.Exit(1)


def _check_model(model: str, vehicle: str) -> None:
    if model.partition(":")[0].lower() not in MULTICOPTERS:
        raise InputError(f"--model {model}: not a multicopter that flies here; there are {', '.join(MULTICOPTERS)}")
    if vehicle != "ArduCopter":
        raise InputError(f"--vehicle {vehicle}: there is ArduCopter alone")


def _devices(
    serials: Sequence[str | None], uarts: Sequence[str | None], base_port: int, host: str
) -> list[SerialDevice]:
    """Return what each serial port is connected to."""
    given = [*DEFAULT_DEVICES, "none"]
    options = [f"--serial{number}" for number in range(len(given))]
    for (letter, number), text in zip(_SERIAL_OF_UART.items(), uarts, strict=True):
        if text is not None:
            given[number], options[number] = text, f"--uart{letter}"
    for number, text in enumerate(serials):
        if text is not None:
            given[number], options[number] = text, f"--serial{number}"
    return [read_device(option, text, base_port, host) for option, text in zip(options, given, strict=True)]


def _boot(setup: _Setup, streams: Sequence[VerdictStream], losses: list[str], stop: Callable[[], bool]) -> bool:
    """Run the vehicle from a start to the next one, or to the end; return whether there is to be a next one.

    What could not be kept goes to ``losses``, a line each.
    """
    store, items = ParamStore(STORAGE), FileItemStore(MISSIONS)
    numbers = setup.ports(store.load())
    links_by_number = {number: setup.devices[number] for number in numbers if setup.devices[number].link}
    is_seen = any(setup.devices[number].is_vicon for number in numbers)
    config = VehicleConfig(
        setup.make_ahrs,
        links=len(links_by_number),
        vicon=is_seen,
        defaults=setup.defaults,
        read_only=setup.read_only,
        overrides=setup.overrides,
        log_store=LogStore(LOG_DIR),
        param_store=store,
        signing_store=FileKeyStore(KEY),
        item_store=items,
        firmware=setup.firmware,
        boot_utc_us=setup.boot_utc_us or time.time_ns() // 1000,
        message_intervals=load_message_intervals(Path(), len(links_by_number)),
    )
    with ExitStack() as stack:
        links = [stack.enter_context(closing(_open(number, device))) for number, device in links_by_number.items()]
        radio = stack.enter_context(closing(UdpRadio(*setup.radio)))
        report = LiveReport(
            Console(quiet=True), [stream.take for stream in streams], [stream.take_outcome for stream in streams]
        )
        powered = PoweredVehicle(config, [Port(link.name) for link in links], on_boot=report.watch)
        stack.callback(powered.close)
        lockstep = Lockstep(powered, links, radio, lambda: _speed(powered, setup.speedup))
        for link, device in zip(links, links_by_number.values(), strict=True):
            if device.waits:
                _print("Waiting for connection ....")
                lockstep.wait_for_client(link, stop)
                _print(f"Connection on serial port {link.name.rpartition(':')[2]}")
        is_to_restart = lockstep.run(lambda: stop() or powered.vehicle.clock.micros64() >= setup.duration_us)
    losses += [f"log: {count} records lost: {reason}" for reason, count in powered.log_losses().items()]
    losses += filter(None, (store.failure, items.failure))
    if radio.malformed:
        err.print(f"radio: {radio.malformed} datagrams dropped, of another length than 16 or 32 bytes")
    return is_to_restart


def _open(number: int, device: SerialDevice) -> Link:
    kind, _, place = device.link.partition(":")
    if kind == "tcpin":
        _print(f"bind port {place.rpartition(':')[2]} for SERIAL{number}")
    link = open_link(device.link)
    if kind == "tcpin":
        _print(f"SERIAL{number} on TCP port {place.rpartition(':')[2]}")
    return link


def _speed(powered: PoweredVehicle, otherwise: float) -> float:
    """Return how fast time passes: SIM_SPEEDUP, if it is positive."""
    asked = float(powered.vehicle.params.get_float(SPEEDUP))
    return asked if asked > 0 else otherwise
