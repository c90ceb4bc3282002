# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A whole vehicle in virtual time, with a client on a wire of its own."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest
from pymavlink.DFReader import DFReader_binary

from emulator.log_sink import LogSink, MemoryLog
from emulator.scheduler import Scheduler
from emulator.vehicle import AhrsParts, Vehicle, VehicleAhrs, VehicleConfig, bench
from mav_handlers.wire.codec import Codec, Received
from mav_handlers.wire.messages import COMMAND_ACK, COMMAND_LONG, ODOMETRY, PARAM_SET, Message

BOOTED_US = 4_000_000

MakeAhrs = Callable[[AhrsParts], VehicleAhrs]


class Bench:
    """A vehicle with one link, whose client encodes and decodes; texts, records and logs are remembered.

    ``texts`` holds time in us, severity and text; ``records`` name and values by label, log or no log.
    """

    def __init__(
        self, params: Mapping[str, float], make_ahrs: MakeAhrs, open_log: Callable[[], LogSink] | None
    ) -> None:
        self.logs: list[MemoryLog] = []
        config = VehicleConfig(make_ahrs, defaults=params, open_log=open_log or self._open_memory)
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


def odometry(time_us: int, **fields: Any) -> ODOMETRY:
    """Make an ODOMETRY message that the autopilot accepts."""
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
    """Return a function that makes a vehicle from parameters, given by keyword, and boots it."""

    def make(
        *,
        heading_deg: float = 0.0,
        boot: bool = True,
        make_ahrs: MakeAhrs | None = None,
        open_log: Callable[[], LogSink] | None = None,
        **params: float,
    ) -> Bench:
        made = Bench(params, make_ahrs or bench(heading_deg), open_log)
        if boot:
            made.run_to(BOOTED_US * 1e-6)
        return made

    return make
