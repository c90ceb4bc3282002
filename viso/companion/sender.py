# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The companion computer as a MAVLink component: what it sends and when, by its own clock."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from mav_handlers.links.base import Link
from mav_handlers.wire.codec import Codec, Received
from mav_handlers.wire.messages import COMMAND_LONG, HEARTBEAT, Message

MAV_COMP_ID_VISUAL_INERTIAL_ODOMETRY: Final = 197
HEARTBEAT_PERIOD_US: Final = 1_000_000
COMPANION_HEARTBEAT: Final = HEARTBEAT(18, 8, 0, 0, 4, 3)
"""Of an onboard controller (MAV_TYPE 18), no autopilot (MAV_AUTOPILOT 8), active (MAV_STATE 4), protocol version 3."""


@dataclass(frozen=True, slots=True)
class OffsetClock:
    """A clock with its own epoch and its own rate.

    Attributes:
        offset_us: what it shows when the autopilot boots.
        drift_ppm: how much faster it runs, in parts per million.
    """

    offset_us: int = 0
    drift_ppm: float = 0.0

    def time_us(self, true_us: int) -> int:
        """Return what it shows ``true_us`` after the autopilot's boot."""
        return self.offset_us + true_us + int(true_us * self.drift_ppm * 1e-6)


def command_long(command: int, *params: float) -> COMMAND_LONG:
    """Return a command for the autopilot; missing parameters are 0."""
    seven = (*params, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)[:7]
    return COMMAND_LONG(1, 1, command, 0, *seven)


class Companion:
    """Sends a heartbeat once a second and an estimate at its own rate, and listens.

    Args:
        estimate: returns the estimate of a frame taken at a time in us, or None when there is none.
        latency_us: from taking a frame to sending its estimate.
        start_us: when the companion is up.
    """

    def __init__(
        self,
        link: Link,
        estimate: Callable[[int], Message | None],
        *,
        rate_hz: float = 30.0,
        latency_us: int = 0,
        start_us: int = 0,
        system_id: int = 1,
    ) -> None:
        self._link = link
        self._estimate = estimate
        self._period_us = round(1e6 / rate_hz)
        self._latency_us = latency_us
        self._codec = Codec(system_id, MAV_COMP_ID_VISUAL_INERTIAL_ODOMETRY)
        self._next_frame_us = start_us
        self._next_heartbeat_us = start_us
        self.received: list[Message] = []

    def next_due_us(self) -> int:
        """Return when ``run`` has something to do next."""
        return min(self._next_frame_us + self._latency_us, self._next_heartbeat_us)

    def run(self, now_us: int) -> None:
        """Send what is due by ``now_us`` and take in what has arrived."""
        while self._next_heartbeat_us <= now_us:
            self._next_heartbeat_us += HEARTBEAT_PERIOD_US
            self.send(COMPANION_HEARTBEAT)
        while self._next_frame_us + self._latency_us <= now_us:
            message = self._estimate(self._next_frame_us)
            self._next_frame_us += self._period_us
            if message is not None:
                self.send(message)
        self._receive()

    def send(self, message: Message) -> None:
        """Send a message now."""
        self._link.send(self._codec.encode(message))

    def command(self, command: int, *params: float) -> None:
        """Send a COMMAND_LONG to the autopilot; missing parameters are 0."""
        self.send(command_long(command, *params))

    def _receive(self) -> None:
        while data := self._link.receive():
            self._codec.feed(data)
            while (received := self._codec.next_received()) is not None:
                if isinstance(received, Received) and received.message is not None:
                    self.received.append(received.message)
