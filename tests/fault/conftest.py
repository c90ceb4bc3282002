# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A vehicle in virtual time with real files behind it, and what must be true of it whatever was done to it."""

import gc
import tracemalloc
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pymavlink.DFReader import DFReader_binary

from ap_core.param_info import ParamType
from mav_handlers.channel import OUTPUT_LIMIT_BYTES, Channel
from mav_handlers.endpoint import MessageEvent
from mav_handlers.wire.codec import BadData, Codec, Received
from mav_handlers.wire.messages import HEARTBEAT, ODOMETRY, PARAM_REQUEST_READ, PARAM_VALUE, Message
from viso.logs.files import LogStore
from viso.parameters.store import ParamStore
from viso.running.virtual_time import Scheduler
from viso.vehicle.vehicle import LOOP_PERIOD_US, Vehicle, VehicleConfig

BOOTED_US = 5_000_000
BOOTING_PERIOD_US = 10_000
"""Of the main loop until then: as seldom as the sensors allow."""
LONGEST_FRAME_BYTES = 280
LONGEST_REPLY_BYTES = 8 * LONGEST_FRAME_BYTES
KNOWN_REASONS = {"bad_prefix", "bad_crc", "bad_frame"}
RANGES = {
    ParamType.INT8: (-(1 << 7), (1 << 7) - 1),
    ParamType.INT16: (-(1 << 15), (1 << 15) - 1),
    ParamType.INT32: (-(1 << 31), (1 << 31) - 1),
}


def odometry(time_us: int) -> ODOMETRY:
    """Return a sample that the autopilot accepts: level, at rest, near the origin."""
    at_rest, variances = (0.0,) * 6, (0.01,) * 21
    attitude = (1.0, 0.0, 0.0, 0.0)
    return ODOMETRY(time_us, 20, 12, 0.1, 0.2, 0.3, attitude, *at_rest, variances, variances, 0, 3, 90)


def read_log(path: Path) -> tuple[Counter[str], int]:
    """Read a log with pymavlink to its end; return how many records of each type it has, and their bytes."""
    counts: Counter[str] = Counter()
    size = 0
    with DFReader_binary(str(path)) as reader:
        while (record := reader.recv_msg()) is not None:
            counts[record.get_type()] += 1
            size += record.fmt.len
    return counts, size


class Bench:
    """A vehicle whose log and parameters are files, with clients; it keeps account of every byte and verdict.

    Args:
        folder: for ``logs`` and ``storage.parm``.
        links: how many links.
        params: values that count as defaults.
    """

    def __init__(self, folder: Path, links: int, params: dict[str, float]) -> None:
        self.folder = folder
        self.store = LogStore(folder / "logs")
        self.param_store = ParamStore(folder / "storage.parm")
        config = VehicleConfig(
            links=links, defaults={"VISO_TYPE": 1, **params}, log_store=self.store, param_store=self.param_store
        )
        self.vehicle = Vehicle(config)
        self.endpoint = self.vehicle.endpoint
        self.scheduler = Scheduler(self.vehicle)
        self.channels = [self.endpoint.open_channel(f"link{number}") for number in range(links)]
        self.codecs = [Codec(255, 190 + number) for number in range(links)]
        self._decoders = [Codec(255, 190) for _ in range(links)]
        self._frame_bytes = [0] * links
        self._heard: list[Counter[tuple[str, str]]] = [Counter() for _ in range(links)]
        self._delivered = [0] * links
        self.on_event: Callable[[MessageEvent], None] = lambda _event: None
        self.endpoint.on_event = self._take_event
        self.scheduler.period_us = BOOTING_PERIOD_US
        self.scheduler.run_until(BOOTED_US)
        self.scheduler.period_us = LOOP_PERIOD_US
        self.read_all()

    def _take_event(self, event: MessageEvent) -> None:
        if event.header is not None:
            self._frame_bytes[event.channel] += len(event.header.frame)
            self._heard[event.channel][event.name, event.verdict.rule.code] += 1
        self.on_event(event)

    @property
    def now_us(self) -> int:
        """Time since boot."""
        return self.scheduler.now_us

    def run_ms(self, duration_ms: float) -> None:
        """Let the vehicle run."""
        self.scheduler.run_until(self.now_us + round(duration_ms * 1000))

    def deliver(self, link: int, data: bytes) -> None:
        """Hand bytes to the vehicle now."""
        self._delivered[link] += len(data)
        self.scheduler.deliver(self.channels[link], data)

    def send(self, link: int, *messages: Message) -> None:
        """Send messages of a link's client now."""
        self.deliver(link, b"".join(self.codecs[link].encode(message) for message in messages))

    def send_sample(self, link: int) -> None:
        """Send an ODOMETRY that the autopilot accepts."""
        self.send(link, odometry(self.now_us))

    def read(self, link: int) -> list[Message]:
        """Return what has come on a link since the last call; bytes that are no frame fail the test."""
        data = self.channels[link].take_output()
        assert len(data) < OUTPUT_LIMIT_BYTES + LONGEST_REPLY_BYTES
        decoder = self._decoders[link]
        decoder.feed(data)
        found = []
        while (received := decoder.next_received()) is not None:
            assert not isinstance(received, BadData), received
            found.append(received)
        assert decoder.unread_bytes == 0
        return [one.message for one in found if isinstance(one, Received) and one.message is not None]

    def read_all(self) -> None:
        """Read what has come on every link, take the events, and forget both."""
        for link in range(len(self.channels)):
            self.read(link)
        self.drop_events()

    def drop_events(self) -> None:
        """Take the endpoint's events, as somebody who shows them does."""
        while self.endpoint.next_event() is not None:
            pass

    def accepted(self, link: int = 0) -> int:
        """Return how many messages of a link were handed to the EKF."""
        return self._count(self.channels[link], "accepted")

    @staticmethod
    def _count(channel: Channel, outcome: str) -> int:
        return sum(amount for key, amount in channel.counters.items() if key[1] == outcome)

    # What must hold

    def check_account(self) -> None:
        """Every byte is in a frame with one verdict, or counted as no frame with a reason, or still waits."""
        for number, channel in enumerate(self.channels):
            bad = {key[2]: amount for key, amount in channel.counters.items() if key[0] == "BAD_DATA"}
            assert set(bad) <= KNOWN_REASONS
            waiting = channel.codec.unread_bytes
            assert channel.bytes_received == self._delivered[number]
            assert self._delivered[number] == self._frame_bytes[number] + sum(bad.values()) + waiting
            assert waiting <= LONGEST_FRAME_BYTES
            frames = Counter({(key[0], key[2]): n for key, n in channel.counters.items() if key[0] != "BAD_DATA"})
            assert frames == self._heard[number]
            assert frames.total() == channel.frames_received

    def check_alive(self, link: int) -> None:
        """The vehicle answers on a link, and its heart beats there.

        A parser that waits for the rest of a frame takes the first bytes for it, so a client asks again.
        """
        self.read(link)
        found: list[Message] = []
        for _ in range(LONGEST_FRAME_BYTES // 20):
            self.send(link, PARAM_REQUEST_READ(0, 0, "VISO_TYPE", -1))
            self.run_ms(150)
            found += self.read(link)
        values = [message for message in found if isinstance(message, PARAM_VALUE)]
        assert values
        assert {value.param_id for value in values} == {"VISO_TYPE"}
        assert any(isinstance(message, HEARTBEAT) for message in found)

    def check_params(self) -> None:
        """Every parameter has a value that its type can hold."""
        for param in self.vehicle.params:
            assert np.isfinite(param.value), param
            if param.type in RANGES:
                low, high = RANGES[param.type]
                assert low <= self.vehicle.params.get_int(param.name) <= high

    def check_files(self) -> Counter[str]:
        """Close the vehicle; every log is whole to pymavlink, and the parameters come back. Return the records."""
        self.vehicle.close()
        records: Counter[str] = Counter()
        for number in self.store.log_numbers():
            counts, size = read_log(self.store.path_of(number))
            assert size == self.store.path_of(number).stat().st_size
            records += counts
        assert self.vehicle.logger.dropped == 0
        assert ParamStore(self.folder / "storage.parm").load() == self.vehicle.params.stored_values()
        return records

    def check_everything(self) -> Counter[str]:
        """Check all of the above; return the records of the logs."""
        for link in range(len(self.channels)):
            self.check_alive(link)
        self.check_account()
        self.check_params()
        return self.check_files()


MakeBench = Callable[..., Bench]


@pytest.fixture
def make_bench(tmp_path: Path) -> Iterator[MakeBench]:
    """Return a function that makes a vehicle from parameters given by keyword; it has booted."""
    made: list[Bench] = []

    def make(*, links: int = 2, **params: float) -> Bench:
        made.append(Bench(tmp_path, links, params))
        return made[-1]

    yield make
    for bench in made:
        bench.vehicle.close()


class Memory:
    """Measures how much memory Python's objects take more than before; tracing is slow, and ends with the answer.

    What waits for the collector of cycles doesn't count: how long it waits depends on what other tests left alive.
    """

    def __init__(self) -> None:
        self._before = 0

    def begin(self) -> None:
        """Take what is in use now as the measure."""
        self._before = self._in_use_bytes()

    def growth(self) -> int:
        """Return by how many bytes it has grown since."""
        growth = self._in_use_bytes() - self._before
        tracemalloc.stop()
        return growth

    @staticmethod
    def _in_use_bytes() -> int:
        gc.collect()
        return tracemalloc.get_traced_memory()[0]


@pytest.fixture
def memory() -> Iterator[Memory]:
    """Trace memory while a test runs."""
    tracemalloc.start()
    try:
        yield Memory()
    finally:
        tracemalloc.stop()


def pytest_make_parametrize_id(val: Any) -> str | None:
    """Show a path's name alone."""
    return val.name.removesuffix(".jsonl.gz") if isinstance(val, Path) else None
