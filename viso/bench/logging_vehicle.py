# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A vehicle that takes messages and logs what it makes of them, for benches of a message's way through it."""

from collections.abc import Callable, Sequence
from typing import Final

from mav_handlers.wire.codec import Codec
from mav_handlers.wire.messages import Message
from viso.bench.measure import NowS
from viso.bench.odometry import PERIOD_US
from viso.running.virtual_time import Scheduler
from viso.vehicle.vehicle import Vehicle, VehicleConfig

BOOTED_US: Final = 5_000_000
_PARAMS: Final = {"VISO_TYPE": 1, "GPS1_TYPE": 0, "LOG_DISARMED": 1}


class CountedLog:
    """A log of which only the size is kept."""

    def __init__(self) -> None:
        self.size = 0
        self.dropped = 0

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
        self._codec = Codec(1, 197)
        self._time_us = BOOTED_US

    def frames(self, make: Callable[[int], Message], count: int) -> list[tuple[int, bytes]]:
        """Return frames with the times of their arrival, of messages that are made for these times."""
        times_us = [self._time_us + number * PERIOD_US for number in range(1, count + 1)]
        self._time_us = times_us[-1]
        return [(time_us, self._codec.encode(make(time_us))) for time_us in times_us]

    def take(self, frames: Sequence[tuple[int, bytes]], now_s: NowS) -> float:
        """Take frames in, and what is to be sent out; return how long that took."""
        vehicle, channel = self.vehicle, self._channel
        begin_s = now_s()
        for time_us, frame in frames:
            vehicle.receive_bytes(channel, frame, time_us)
            vehicle.endpoint.bytes_to_send(channel)
        return now_s() - begin_s
