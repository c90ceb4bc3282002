# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A whole vehicle in virtual time, with a client on a wire of its own."""

import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest
from pymavlink.DFReader import DFReader_binary

from ap_core.clock import VirtualClock
from ap_core.internal_error import InternalErrors
from ap_core.location import Location
from ap_core.log_field import LogValue
from ap_core.param import ParamTable
from ap_core.vector3 import Vector3f
from ekf_stub.ahrs.ahrs_base import AhrsBase
from ekf_stub.ahrs.ahrs_settable import SettableAhrs
from ekf_stub.inputs.measurements import AllGps, GpsSample
from ekf_stub.reports import NO_LIMITS, ControlLimits, FilterFlag, FilterStatus
from mav_handlers.links.pair import make_pair
from mav_handlers.wire.codec import Codec, Received
from mav_handlers.wire.messages import COMMAND_ACK, COMMAND_LONG, ODOMETRY, PARAM_SET, Message
from tests.unit.viso.command_line import Outcome, Viso
from viso import cli
from viso.commands import serve as serve_command
from viso.firmware.releases import DEFAULT, JULY_2025, Firmware
from viso.logs.logger import Logger, LogSink, MemoryLog
from viso.logs.vehicle_log import VehicleLog
from viso.parameters.table import make_groups
from viso.running.virtual_time import Scheduler
from viso.terminal import console
from viso.vehicle.copter.copter import Copter
from viso.vehicle.flow import OpticalFlow
from viso.vehicle.ranges import RangeFinders
from viso.vehicle.sensors.source import ImuOptions, VehicleSource
from viso.vehicle.vehicle import LOOP_PERIOD_US, Vehicle, VehicleConfig, bench

BOOTED_US = 6_000_000
STARTED_US, STARTING_PERIOD_US = 3_400_000, 100_000
"""Before the estimator starts, and the period of the main loop until then."""
BOOTING_PERIOD_US = 10_000
"""Of the main loop from there on: as seldom as the sensors allow."""


MakeAhrs = Callable[[Vehicle], AhrsBase]


class Bench:
    """A vehicle with one link, whose client encodes and decodes; texts, records and logs are remembered.

    ``texts`` holds time in us, severity and text; ``records`` name and values by label, log or no log.
    """

    def __init__(
        self,
        params: Mapping[str, float],
        make_ahrs: MakeAhrs | None = None,
        open_log: Callable[[], LogSink] | None = None,
        firmware: Firmware = DEFAULT,
    ) -> None:
        self.logs: list[MemoryLog] = []
        config = VehicleConfig(
            make_ahrs or bench(), defaults=params, open_log=open_log or self._open_memory, firmware=firmware
        )
        self.vehicle = Vehicle(config)
        self.texts: list[tuple[int, int, str]] = []
        self.records: list[tuple[str, dict[str, Any]]] = []
        self.vehicle.texts.on_text.append(self._take_text)
        self.vehicle.logger.on_write = lambda structure, values: self.records.append(
            (structure.name, dict(zip(structure.fields, values, strict=True)))
        )
        self.scheduler = Scheduler(self.vehicle)
        self.channel = self.vehicle.endpoint.open_channel("client")
        self._client = Codec(255, 190)
        self._vision_us = 0

    def _open_memory(self) -> MemoryLog:
        self.logs.append(MemoryLog())
        return self.logs[-1]

    def _take_text(self, severity: int, text: str) -> None:
        self.texts.append((self.vehicle.clock.micros64(), severity, text))

    def boot(self) -> None:
        """Run the main loop until booting is over, and forget what was said."""
        self.scheduler.period_us = STARTING_PERIOD_US
        self.run_to(STARTED_US * 1e-6)
        self.scheduler.period_us = BOOTING_PERIOD_US
        self.run_to(BOOTED_US * 1e-6)
        self.scheduler.period_us = LOOP_PERIOD_US
        self.texts.clear()

    def run_to(self, time_s: float) -> None:
        """Run the main loop up to a time since boot."""
        self.scheduler.run_until(round(time_s * 1e6))

    def run_for(self, duration_s: float) -> None:
        """Run the main loop for a while."""
        self.scheduler.run_until(self.scheduler.now_us + round(duration_s * 1e6))

    def send(self, *messages: Message) -> None:
        """Hand messages of the client to the vehicle now."""
        self.scheduler.deliver(self.channel, b"".join(self._client.encode(message) for message in messages))

    def set(self, name: str, value: float) -> None:
        """Set a parameter by MAVLink; the echo comes with the next pass."""
        self.send(PARAM_SET(0, 0, name, value, 9))

    def received(self) -> list[Message]:
        """Return what the vehicle has sent since the last call."""
        self._client.feed(self.vehicle.endpoint.bytes_to_send(self.channel))
        found = []
        while (received := self._client.next_received()) is not None:
            if isinstance(received, Received) and received.message is not None:
                found.append(received.message)
        return found

    def command(self, command: int, *params: float) -> int:
        """Send a command, run for a moment and return its result."""
        self.received()
        seven = (*params, *(0.0,) * 7)[:7]
        self.send(COMMAND_LONG(1, 1, command, 0, *seven))
        self.run_for(0.01)
        results = [message.result for message in self.received() if isinstance(message, COMMAND_ACK)]
        assert len(results) == 1
        return int(results[0])

    def see(self, duration_s: float, **fields: Any) -> None:
        """Send ODOMETRY at 20 Hz for a while: level, at rest, heading north, unless told otherwise."""
        for _ in range(round(duration_s * 20)):
            self.send(odometry(self.scheduler.now_us, **fields))
            self.run_for(0.05)

    def log_records(self, tmp_path: Path, number: int = -1) -> list[dict[str, Any]]:
        """Return the records of a log as pymavlink reads them."""
        path = tmp_path / "memory.BIN"
        path.write_bytes(self.logs[number].data)
        return read_log(path)

    def written(self, name: str) -> list[dict[str, Any]]:
        """Return the records of one type, TimeUS left out."""
        return [
            {label: value for label, value in fields.items() if label != "TimeUS"}
            for record, fields in self.records
            if record == name
        ]


def odometry(time_us: int = 1, **fields: Any) -> ODOMETRY:
    """Make an ODOMETRY message that the autopilot accepts: level, at rest, heading north, unless told otherwise."""
    nothing = (0.0,) * 21
    values: dict[str, Any] = {
        "time_usec": time_us,
        "frame_id": 20,
        "child_frame_id": 12,
        **dict.fromkeys(("x", "y", "z", "vx", "vy", "vz", "rollspeed", "pitchspeed", "yawspeed"), 0.0),
        "q": (1.0, 0.0, 0.0, 0.0),
        "pose_covariance": nothing,
        "velocity_covariance": nothing,
        "reset_counter": 0,
        "estimator_type": 3,
        "quality": 90,
    }
    return ODOMETRY(**{**values, **fields})


def read_log(path: Path) -> list[dict[str, Any]]:
    """Return every record of a log but the descriptions, with its type under ``name``."""
    records = []
    with DFReader_binary(str(path)) as log:
        while (record := log.recv_msg()) is not None:
            kind = record.get_type()
            if kind not in ("FMT", "FMTU", "UNIT", "MULT"):
                records.append({"name": kind} | {name: getattr(record, name) for name in record._fieldnames})
    return records


@pytest.fixture
def make_bench() -> Callable[..., Bench]:
    """Return a function that makes a vehicle from parameters, given by keyword, and boots it.

    What was said while booting is forgotten.
    """

    def make(
        *,
        heading_deg: float = 0.0,
        boot: bool = True,
        make_ahrs: MakeAhrs | None = None,
        open_log: Callable[[], LogSink] | None = None,
        firmware: Firmware = DEFAULT,
        **params: float,
    ) -> Bench:
        made = Bench(params, make_ahrs or bench(heading_deg), open_log, firmware)
        if boot:
            made.boot()
        return made

    return make


NAVIGATES = FilterFlag.ATTITUDE | FilterFlag.VERT_VEL | FilterFlag.VERT_POS | FilterFlag.HORIZ_POS_ABS


class FakeAhrs(SettableAhrs):
    """An AHRS whose every answer is an attribute, as far as a copter asks."""

    primary = yaw_reset_ms = 0
    started = True
    is_healthy = True
    failure: str | None = None
    position_required: bool | None = None
    status: FilterStatus | None = FilterStatus(NAVIGATES)
    place: Location | None = None
    ekf_origin: Location | None = None
    height_resets = 0
    terrain_is_stable = True
    velocity: Vector3f | None = None
    has_gps_as_source = True
    limits = NO_LIMITS

    def __init__(self) -> None:
        super().__init__()
        self.asked: list[str] = []

    def request_yaw_reset(self) -> None:
        self.asked.append("yaw reset")

    def check_lane_switch(self) -> None:
        self.asked.append("lane switch")

    def estimator_started(self) -> bool:
        return self.started

    def uses_gps(self) -> bool:
        return self.has_gps_as_source

    def set_terrain_stable(self, *, is_stable: bool) -> None:
        self.terrain_is_stable = is_stable

    def healthy(self) -> bool:
        return self.is_healthy

    def pre_arm_failure(self, requires_position: bool) -> str | None:
        self.position_required = requires_position
        return self.failure

    def get_filter_status(self) -> FilterStatus | None:
        return self.status

    def get_location(self) -> Location | None:
        return self.place

    def origin(self) -> Location | None:
        return self.ekf_origin

    def get_velocity_NED(self) -> Vector3f | None:
        return self.velocity

    def control_limits(self) -> ControlLimits:
        return self.limits

    def reset_height_datum(self) -> bool:
        self.height_resets += 1
        return True

    def navigate(self, *flags: FilterFlag) -> None:
        """Say of itself nothing but these flags."""
        self.status = FilterStatus(FilterFlag(sum(flags)))

    def stand_at(self, place: Location, down_m: float = 0.0) -> None:
        """Be somewhere, by default at the origin's height."""
        self.place = place
        self.pos = Vector3f(0, 0, down_m)


class FakeVisualOdom:
    """Visual odometry, on or off, with the failure that it is given."""

    is_enabled = True
    failure: str | None = None

    def enabled(self) -> bool:
        return self.is_enabled

    def pre_arm_check(self) -> str | None:
        return self.failure


class CopterRig:
    """A copter with everything that it needs faked; texts, records and changes of mode are kept."""

    def __init__(self, open_log: Callable[[], LogSink] | None = MemoryLog, source: VehicleSource | None = None) -> None:
        self.clock = VirtualClock()
        self.clock.set_us(10_000_000)
        self.params = ParamTable(make_groups(0, None, JULY_2025.params))
        self.texts: list[tuple[int, str]] = []
        self.records: list[tuple[str, dict[str, LogValue]]] = []
        self.ahrs = FakeAhrs()
        self.visual_odom = FakeVisualOdom()
        self.errors = InternalErrors()
        self.gps: GpsSample | None = None
        self.second_gps: GpsSample | None = None
        self.is_active = False
        self.logger = Logger(self.clock, open_log)
        self.logger.on_write = lambda structure, values: self.records.append(
            (structure.name, dict(zip(structure.fields, values, strict=True)))
        )
        self.ranges = RangeFinders(self.clock, self.params, self.logger)
        self.vehicle = cast(
            Vehicle,
            SimpleNamespace(
                firmware=JULY_2025,
                release=JULY_2025.endpoint,
                clock=self.clock,
                params=self.params,
                texts=self,
                log=VehicleLog(self.logger, self.clock),
                logger=self.logger,
                ahrs=self.ahrs,
                visual_odom=self.visual_odom,
                internal_errors=self.errors,
                flow=OpticalFlow(self.clock, self.params, cast(AhrsBase, self.ahrs), self.logger),
                ranges=self.ranges,
                gps=self,
                source=source or VehicleSource(ImuOptions()),
                log_transfer=self,
            ),
        )
        self.copter = self.vehicle.copter = Copter(self.vehicle)
        self.copter.has_booted = True
        self.copter.disarm_when_idle()

    def use_firmware(self, firmware: Firmware) -> None:
        """Let the copter be of another release."""
        self.vehicle.firmware = firmware

    def samples(self) -> AllGps:
        """Return the solutions of the GPS, of which the first is used."""
        return AllGps((self.gps,) if self.second_gps is None else (self.gps, self.second_gps))

    def sample(self) -> GpsSample | None:
        """Return the newest solution (Gps)."""
        return self.gps

    def pause(self) -> None:
        """Do nothing: no log is being downloaded (LogTransfer)."""

    def send_text(self, severity: int, text: str) -> None:
        self.texts.append((severity, text))

    def take_texts(self) -> list[str]:
        """Return the texts since the last call."""
        texts = [text for _, text in self.texts]
        self.texts.clear()
        return texts

    def written(self, *names: str) -> list[tuple[str, tuple[LogValue, ...]]]:
        """Return the records of some types since the last call, without their times."""
        found = [(name, tuple(values.values())[1:]) for name, values in self.records if name in names]
        self.records.clear()
        return found

    def run_for(self, duration_s: float) -> None:
        """Run the copter's main loop for a while, ten times per second."""
        for _ in range(round(duration_s * 10)):
            self.clock.set_us(self.clock.micros64() + 100_000)
            self.copter.update()
            self.copter.expect_ground()
            self.copter.disarm_when_idle()


@pytest.fixture
def rig() -> CopterRig:
    """Return a copter that navigates, 10 s after boot, without an origin and with nothing wrong."""
    return CopterRig()


@pytest.fixture
def viso(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], tmp_path: Path) -> Viso:
    """Return a function that runs a command line in a folder of its own."""
    monkeypatch.chdir(tmp_path)
    for terminal in (console.out, console.err):
        monkeypatch.setattr(terminal, "width", 200)  # whatever COLUMNS was when they were made

    def run(*args: object) -> Outcome:
        monkeypatch.setattr(sys, "argv", ["viso", *map(str, args)])
        with pytest.raises(SystemExit) as ended:
            cli.main()
        return Outcome(int(ended.value.code or 0), *capfd.readouterr())

    return run


@pytest.fixture
def serve(viso: Viso, monkeypatch: pytest.MonkeyPatch) -> Viso:
    """Return a function that serves for a moment to a client that has sent some messages."""

    def run(*args: object, sent: tuple[Message, ...] = ()) -> Outcome:
        ours, client = make_pair(("pair", "client"))
        client.send(b"".join(map(Codec(255, 190).encode, sent)))
        monkeypatch.setattr(serve_command, "open_link", lambda _name: ours)
        return viso("serve", "--master", "pair", "--speedup", "1000", "--duration", "0.02", *args)

    return run
