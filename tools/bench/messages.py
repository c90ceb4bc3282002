# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What ODOMETRY with covariance costs from its bytes to its log records, and pymavlink's parse of the same bytes."""

import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from typing import Final

from pymavlink.dialects.v20 import ardupilotmega as dialect

from ap_core.clock import NEVER
from mav_handlers.wire.codec import Codec
from tools.bench.odometry import PERIOD_US, odometry_at
from viso.running.virtual_time import Scheduler
from viso.vehicle.vehicle import Vehicle, VehicleConfig

BOOTED_US: Final = 5_000_000
_PARAMS: Final = {"VISO_TYPE": 1, "GPS1_TYPE": 0, "LOG_DISARMED": 1}


class CountedLog:
    """A log of which only the size is kept."""

    def __init__(self) -> None:
        self.size = 0
        self.dropped = 0
        self.reason: str | None = None
        self.flush_due_us = NEVER

    def write(self, data: bytes) -> bool:
        """Count whole records."""
        self.size += len(data)
        return True

    def flush_if_due(self, now_us: int) -> bool:
        """Do nothing."""
        return True

    def close(self) -> None:
        """Do nothing."""


class LoggingVehicle:
    """A vehicle that has booted and logs; its main loop stands still from then on.

    Attributes:
        log: where its records go.
        vehicle: it.
    """

    def __init__(self) -> None:
        self.log = CountedLog()
        self.vehicle = Vehicle(VehicleConfig(defaults=_PARAMS, open_log=lambda: self.log))
        self._channel = self.vehicle.endpoint.open_channel("companion")
        Scheduler(self.vehicle).run_until(BOOTED_US)
        self._frames = Frames(BOOTED_US)

    def take(self, count: int) -> float:
        """Take messages in, and what is to be sent out; return the seconds that this took."""
        vehicle, channel, frames = self.vehicle, self._channel, self._frames.next(count)
        begin_s = time.process_time()
        for time_us, frame in frames:
            vehicle.clock.set_us(time_us)
            vehicle.receive_bytes(channel, frame)
            vehicle.endpoint.bytes_to_send(channel)
        return time.process_time() - begin_s


class Frames:
    """ODOMETRY as bytes, one message after the other."""

    def __init__(self, time_us: int) -> None:
        self._codec = Codec(1, 197)
        self._time_us = time_us

    def next(self, count: int) -> list[tuple[int, bytes]]:
        """Return frames with the times of their arrival."""
        times_us = [self._time_us + number * PERIOD_US for number in range(1, count + 1)]
        self._time_us = times_us[-1]
        return [(time_us, self._codec.encode(odometry_at(time_us))) for time_us in times_us]


def parse(frames: Sequence[tuple[int, bytes]]) -> float:
    """Have pymavlink parse frames; return the seconds that this took."""
    parser = dialect.MAVLink(None)
    parser.robust_parsing = True
    begin_s = time.process_time()
    for _, frame in frames:
        parser.parse_char(frame)
    return time.process_time() - begin_s


def prepare(count: int, _stack: ExitStack) -> Callable[[], float]:
    """Start a vehicle; a round is some messages."""
    vehicle = LoggingVehicle()
    return lambda: vehicle.take(count)


def prepare_parse(_stack: ExitStack) -> Callable[[], float]:
    """A round is 100 messages."""
    frames = Frames(BOOTED_US)
    return lambda: parse(frames.next(100))
