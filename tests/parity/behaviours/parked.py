# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A vehicle in virtual time, with its log, and a client that streams external navigation to it."""

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final, TypeVar

from ekf_stub.ahrs.ahrs_base import AhrsBase
from mav_handlers.wire.codec import Codec, Received
from mav_handlers.wire.messages import (
    COMMAND_ACK,
    COMMAND_LONG,
    EKF_STATUS_REPORT,
    PARAM_SET,
    STATUSTEXT,
    VISION_POSITION_DELTA,
    VISION_POSITION_ESTIMATE,
    VISION_SPEED_ESTIMATE,
    Message,
)
from tests.parity.behaviours.logs import Log
from viso.firmware.releases import JULY_2025
from viso.logs.logger import MemoryLog
from viso.running.virtual_time import Scheduler
from viso.vehicle.vehicle import Vehicle, VehicleConfig

M = TypeVar("M", bound=Message)

RATE_HZ: Final = 30
_READ_US: Final = 100_000
_INTERVAL_S: Final = 0.06
_EKF_STATUS_REPORT, _LOCAL_POSITION_NED = 193, 32
_REAL32: Final = 9
SOURCES: Final = ("POSXY", "VELXY", "POSZ", "VELZ", "YAW")


def source_set(number: int, values: str) -> dict[str, float]:
    """Return the parameters of a source set, from its five values in order."""
    return {f"EK3_SRC{number}_{name}": float(value) for name, value in zip(SOURCES, values, strict=True)}


class Parked:
    """A vehicle on the bench, unless ``make_ahrs`` says otherwise; without a GPS, and disarmed.

    Args:
        make_ahrs: makes its AHRS.
        params: values that count as defaults.
        folder: where its log can be put for reading.

    Attributes:
        received: what it has sent, with the time in s.
    """

    def __init__(self, make_ahrs: Callable[[Vehicle], AhrsBase], params: Mapping[str, float], folder: Path) -> None:
        self._folder = folder
        self._file = MemoryLog()
        self._read_log: Log | None = None
        self._logged = 0
        intervals = {0: {_EKF_STATUS_REPORT: 100, _LOCAL_POSITION_NED: 100}}
        defaults = {"VISO_TYPE": 1.0, "LOG_DISARMED": 1.0, "LOG_REPLAY": 1.0, **params}
        config = VehicleConfig(
            make_ahrs, defaults=defaults, firmware=JULY_2025, open_log=lambda: self._file, message_intervals=intervals
        )
        self.vehicle = Vehicle(config)
        self._scheduler = Scheduler(self.vehicle)
        self._channel = self.vehicle.endpoint.open_channel("client")
        self._codec = Codec(255, 190)
        self.received: list[tuple[float, Message]] = []

    @property
    def now_us(self) -> int:
        """Time since boot."""
        return self._scheduler.now_us

    # Time

    def run_to(self, time_s: float) -> None:
        """Let it run up to a time since boot."""
        end_us = round(1e6 * time_s)
        while self.now_us < end_us:
            self._scheduler.run_until(min(self.now_us + _READ_US, end_us))
            self._read()

    def run_for(self, duration_s: float) -> None:
        """Let it run for a while."""
        self.run_to(1e-6 * self.now_us + duration_s)

    def stream(self, until_s: float, *send: Callable[[], None], rate_hz: float = RATE_HZ) -> None:
        """Send all that, at a rate, up to a time since boot."""
        next_us = float(self.now_us)
        while next_us < 1e6 * until_s:
            self.run_to(1e-6 * next_us)
            for one in send:
                one()
            next_us += 1e6 / rate_hz
        self.run_to(until_s)

    def _read(self) -> None:
        self._codec.feed(self.vehicle.endpoint.bytes_to_send(self._channel))
        while (received := self._codec.next_received()) is not None:
            if isinstance(received, Received) and received.message is not None:
                self.received.append((1e-6 * self.now_us, received.message))

    # What the client sends

    def send(self, *messages: Message) -> None:
        """Hand messages to the vehicle now."""
        self._scheduler.deliver(self._channel, b"".join(map(self._codec.encode, messages)))

    def pose(
        self,
        north: float = 0.0,
        east: float = 0.0,
        down: float = 0.0,
        *,
        yaw_deg: float = 0.0,
        counter: int = 0,
        variance: float = math.nan,
    ) -> None:
        """Send a pose, whose variances are not known unless given."""
        yaw, covariance = math.radians(yaw_deg), (variance,) * 21
        self.send(VISION_POSITION_ESTIMATE(self.now_us, north, east, down, 0.0, 0.0, yaw, covariance, counter))

    def velocity(self, north: float = 0.0, east: float = 0.0, down: float = 0.0) -> None:
        """Send a velocity whose variances are not known."""
        self.send(VISION_SPEED_ESTIMATE(self.now_us, north, east, down, (math.nan,) * 9, 0))

    def odometry(self, forward: float = 0.0, right: float = 0.0, down: float = 0.0) -> None:
        """Send how far the vehicle has come in an interval, by its velocity in m/s."""
        moved = (_INTERVAL_S * forward, _INTERVAL_S * right, _INTERVAL_S * down)
        self.send(VISION_POSITION_DELTA(self.now_us, round(1e6 * _INTERVAL_S), (0.0, 0.0, 0.0), moved, 90.0))

    def set(self, name: str, value: float) -> None:
        """Set a parameter."""
        self.send(PARAM_SET(1, 1, name, value, _REAL32))

    def command(self, command: int, *params: float) -> int:
        """Send a command, run for a moment and return its result."""
        since_us = self.now_us
        self.send(COMMAND_LONG(1, 1, command, 0, *(*params, *(0.0,) * 7)[:7]))
        self.run_for(0.01)
        return self.messages(COMMAND_ACK, 1e-6 * since_us)[-1][1].result

    # What comes of it

    def messages(self, kind: type[M], since_s: float = 0.0) -> list[tuple[float, M]]:
        """Return the messages of a kind, with the time in s."""
        return [(t, message) for t, message in self.received if t >= since_s and isinstance(message, kind)]

    def flags(self, start_s: float, end_s: float = math.inf) -> list[int]:
        """Return the flags of EKF_STATUS_REPORT of a time, each as often as it was sent."""
        return [report.flags for t, report in self.messages(EKF_STATUS_REPORT, start_s) if t <= end_s]

    def texts(self, since_s: float = 0.0) -> list[tuple[int, str]]:
        """Return severities and texts of STATUSTEXT, put together from their chunks."""
        texts: list[tuple[int, str]] = []
        for _, chunk in self.messages(STATUSTEXT, since_s):
            if chunk.id and chunk.chunk_seq:
                texts[-1] = chunk.severity, texts[-1][1] + chunk.text
            else:
                texts.append((chunk.severity, chunk.text))
        return texts

    def log(self) -> Log:
        """Return what the log holds so far."""
        data = bytes(self._file.data)
        if self._read_log is None or len(data) != self._logged:
            path = self._folder / "vehicle.BIN"
            path.write_bytes(data)
            self._read_log, self._logged = Log(path, "the vehicle's log"), len(data)
        return self._read_log
