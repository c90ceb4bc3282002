# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A whole vehicle on the bench in virtual time, and clients that talk to it in frames."""

from collections.abc import Callable, Sequence
from typing import Any, TypeVar, cast

import pytest

from ap_core.clock import VirtualClock
from ap_core.log_field import LogValue
from ap_core.log_structure import LogStructure
from ap_core.verdict import Verdict
from ekf_stub.ahrs.ahrs_base import AhrsBase
from ekf_stub.ahrs.ahrs_ekf3 import passes_through
from ekf_stub.ahrs.ahrs_settable import ExtNav, ExtNavVel, RememberedCalls
from mav_handlers.channel import Channel
from mav_handlers.endpoint import MessageEvent
from mav_handlers.wire.codec import BadData, Codec, Received
from mav_handlers.wire.messages import COMMAND_ACK, COMMAND_INT, COMMAND_LONG, STATUSTEXT, Message
from tests.uncovered import uncovered
from viso.firmware.releases import JULY_2025, Firmware
from viso.logs.logger import MemoryLog
from viso.running.virtual_time import Scheduler
from viso.vehicle.config import bench, by_ekf3
from viso.vehicle.sensors.moving import FlyingSource
from viso.vehicle.sensors.source import ImuOptions
from viso.vehicle.vehicle import LOOP_PERIOD_US, Vehicle, VehicleConfig

M = TypeVar("M", bound=Message)

SETTLED_MS = 5000
"""When the estimator runs, and heartbeats have just been sent; the estimator has texts to tell until 6 s."""

BOOTING_MS, BOOTING_PERIOD_US = 3400, 100_000
"""Before the estimator starts, and the period of the main loop until then."""

SETTLING_PERIOD_US = 12_500
"""Of the main loop from there on: as seldom as the sensors allow."""


class SpyAhrs(RememberedCalls):
    """The AHRS of the bench, with a note of what it is given.

    Attributes:
        runs: whether the filter does; else it goes on saying what it said last, as it would of a vehicle at rest.
    """

    def __init__(self, ahrs: AhrsBase, clock: VirtualClock) -> None:
        super().__init__()
        self._ahrs = ahrs
        self._clock = clock
        self.runs = True

    @property
    def runs_ahead(self) -> bool:
        return not self.runs

    def advance(self, times_us: range, due_us: Callable[[], int]) -> int:
        if self.runs:
            self._ahrs.update()
            return 1
        left = passes_through(times_us, due_us())
        self._clock.set_us(left[-1])
        return len(left)

    def __getattr__(self, name: str) -> Any:
        if name == "_ahrs":  # a copy in the making
            raise AttributeError(name)
        return getattr(self._ahrs, name)

    def writeExtNavData(self, *args: Any) -> None:
        super().writeExtNavData(*args)
        self._ahrs.writeExtNavData(*args)

    def writeExtNavVelData(self, *args: Any) -> None:
        super().writeExtNavVelData(*args)
        self._ahrs.writeExtNavVelData(*args)

    def writeBodyFrameOdom(self, *args: Any) -> None:
        super().writeBodyFrameOdom(*args)
        self._ahrs.writeBodyFrameOdom(*args)


class Client:
    """A ground station or companion on one link: MAVLink 2, system 255, component 190 unless told otherwise."""

    def __init__(self, bench: "Bench", channel: Channel) -> None:
        self._bench = bench
        self.channel = channel
        self.codec = Codec(255, 190)
        self._decoder = Codec(255, 190)

    def send_bytes(self, data: bytes, *, read_us: int | None = None) -> list[MessageEvent]:
        """Hand bytes to the vehicle now and return their outcomes."""
        self._bench.drop_events()
        self._bench.scheduler.deliver(self.channel, data, read_us=read_us)
        return self._bench.drop_events()

    def tell(self, *messages: Message, read_us: int | None = None) -> Verdict:
        """Send messages, each in a delivery of its own, and return the verdict on the last."""
        events = [event for one in messages for event in self.send_bytes(self.codec.encode(one), read_us=read_us)]
        return events[-1].verdict

    def read_received(self) -> list[Received]:
        """Return the frames that have come since the last call; bytes that are none fail the test."""
        self._decoder.feed(self.channel.take_output())
        frames = []
        while (received := self._decoder.next_received()) is not None:
            assert not isinstance(received, BadData), received
            frames.append(received)
        return frames

    def read(self) -> list[Message]:
        """Return the messages that have come since the last call."""
        return [frame.message for frame in self.read_received() if frame.message is not None]

    def read_of(self, kind: type[M]) -> list[M]:
        """Return the messages of one kind that have come since the last call, and forget the others."""
        return [message for message in self.read() if isinstance(message, kind)]

    def read_texts(self) -> list[str]:
        """Return the texts that have come since the last call, chunk by chunk, and forget everything else."""
        return [message.text for message in self.read_of(STATUSTEXT)]

    def command(self, number: int, *params: float, target: tuple[int, int] = (1, 1)) -> int:
        """Send a COMMAND_LONG with the first of its parameters, read everything, and return the result."""
        filled = (*params, *(0.0,) * (7 - len(params)))
        self.tell(COMMAND_LONG(*target, number, 0, *filled))
        return self.acknowledged()

    def command_int(self, number: int, x: int = 0, y: int = 0, z: float = 0.0, *, frame: int = 0) -> int:
        """Send a COMMAND_INT with a place, read everything, and return the result."""
        self.tell(COMMAND_INT(1, 1, frame, number, 0, 0, 0.0, 0.0, 0.0, 0.0, x, y, z))
        return self.acknowledged()

    def acknowledged(self) -> int:
        """Read everything and return the result in the only COMMAND_ACK."""
        [ack] = self.read_of(COMMAND_ACK)
        return ack.result


class Bench:
    """A vehicle in virtual time with its links and clients.

    Args:
        params: values that count as defaults.
        bauds: one for each link.
        version: of MAVLink on all links.
        firmware: which release the vehicle is.
        until_ms: for how long it has run, 0 for not at all.
        filter_runs: whether the filter goes on from there; it is most of the work, and little of it is ever told.
        filter_starts: whether it has run until then.
        flies: whether it can fly.
        has_log: whether its records go to a log; to start one takes as long as to run the filter.
    """

    def __init__(
        self,
        params: dict[str, float],
        bauds: Sequence[int | None] = (None,),
        *,
        version: int = 2,
        until_ms: int,
        firmware: Firmware = JULY_2025,
        filter_runs: bool = True,
        filter_starts: bool = True,
        flies: bool = False,
        has_log: bool = False,
    ) -> None:
        self.log = MemoryLog()
        spies: list[SpyAhrs] = []

        def make_ahrs(vehicle: Vehicle) -> AhrsBase:
            make = by_ekf3(FlyingSource, ImuOptions()) if flies else bench()
            spies.append(SpyAhrs(make(vehicle), vehicle.clock))
            return cast("AhrsBase", spies[-1])

        config = VehicleConfig(
            make_ahrs,
            links=len(bauds),
            defaults=params,
            open_log=(lambda: self.log) if has_log else None,
            firmware=firmware,
        )
        self.vehicle = Vehicle(config)
        self.ahrs = spies[0]
        self.endpoint = self.vehicle.endpoint
        self.scheduler = Scheduler(self.vehicle)
        self.records: list[tuple[str, dict[str, LogValue]]] = []
        channels = [
            self.endpoint.open_channel(f"link{index}", baud=baud, version=version) for index, baud in enumerate(bauds)
        ]
        self.clients = [Client(self, channel) for channel in channels]
        self.client = self.clients[0]
        self.ahrs.runs = filter_starts
        if until_ms:
            self._settle(until_ms)
        self.ahrs.runs = filter_runs
        for client in self.clients:
            client.read()
        self.vehicle.logger.on_write = self._remember

    def _settle(self, until_ms: int) -> None:
        with uncovered():
            self.scheduler.period_us = BOOTING_PERIOD_US
            self.run_ms(booting_ms := min(BOOTING_MS, until_ms // 2))
            self.scheduler.period_us = SETTLING_PERIOD_US
            self.run_ms(until_ms - booting_ms - SETTLING_PERIOD_US / 1000)
            self.scheduler.period_us = LOOP_PERIOD_US
            self.run_ms(SETTLING_PERIOD_US / 1000)

    def _remember(self, structure: LogStructure, values: Sequence[LogValue]) -> None:
        self.records.append((structure.name, dict(zip(structure.fields, values, strict=True))))

    def drop_events(self) -> list[MessageEvent]:
        """Return the endpoint's waiting events."""
        events = []
        while (event := self.endpoint.next_event()) is not None:
            events.append(event)
        return events

    @property
    def now_us(self) -> int:
        """Time since boot."""
        return self.scheduler.now_us

    def run_ms(self, duration_ms: float) -> None:
        """Let the vehicle run."""
        self.scheduler.run_until(self.now_us + round(duration_ms * 1000))

    def logged(self, name: str) -> list[dict[str, LogValue]]:
        """Return the records of one type, by their labels, since the vehicle has settled."""
        return [fields for record, fields in self.records if record == name]

    @property
    def poses(self) -> list[ExtNav]:
        """What writeExtNavData was given."""
        return [call for call in self.ahrs.calls if isinstance(call, ExtNav)]

    @property
    def velocities(self) -> list[ExtNavVel]:
        """What writeExtNavVelData was given."""
        return [call for call in self.ahrs.calls if isinstance(call, ExtNavVel)]


MakeBench = Callable[..., Bench]


@pytest.fixture
def filter_starts() -> bool:
    """Return whether the filter runs before a test begins; where it has no say, it is half of the work."""
    return True


@pytest.fixture
def make_bench(filter_starts: bool) -> MakeBench:
    """Return a function that makes a vehicle from parameters given by keyword.

    By default it has run for 5 s, and its filter does not go on.
    """

    def make(
        *,
        bauds: Sequence[int | None] = (None,),
        version: int = 2,
        until_ms: int = SETTLED_MS,
        firmware: Firmware = JULY_2025,
        filter_runs: bool | None = None,
        filter_starts: bool = filter_starts,
        flies: bool = False,
        has_log: bool = False,
        **params: float,
    ) -> Bench:
        filter_runs = until_ms == 0 if filter_runs is None else filter_runs
        return Bench(
            {"VISO_TYPE": 1, **params},
            bauds,
            version=version,
            until_ms=until_ms,
            firmware=firmware,
            filter_runs=filter_runs,
            filter_starts=filter_starts,
            flies=flies,
            has_log=has_log,
        )

    return make


@pytest.fixture(name="bench")
def settled_bench(make_bench: MakeBench) -> Bench:
    """Return a settled vehicle with VISO_TYPE 1 and one network link."""
    return make_bench()


@pytest.fixture
def quiet_bench(make_bench: MakeBench) -> Bench:
    """Return a vehicle that has sent the texts of its start."""
    return make_bench(until_ms=7000)


@pytest.fixture
def client(bench: Bench) -> Client:
    """Return the client on the bench's only link."""
    return bench.client
