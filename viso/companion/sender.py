# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The companion computer as a MAVLink component: its messages and their times, by its own clock."""

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final

from mav_handlers.links.base import Link
from mav_handlers.wire.codec import BadData, Codec, Received
from mav_handlers.wire.messages import COMMAND_LONG, HEARTBEAT, Message

MAV_COMP_ID_VISUAL_INERTIAL_ODOMETRY: Final = 197
HEARTBEAT_PERIOD_US: Final = 1_000_000
COMPANION_HEARTBEAT: Final = HEARTBEAT(18, 8, 0, 0, 4, 3)
"""Of an onboard controller (MAV_TYPE 18), no autopilot (MAV_AUTOPILOT 8), active (MAV_STATE 4), protocol version 3."""


@dataclass(frozen=True, slots=True)
class OffsetClock:
    """A clock with its own epoch and its own rate.

    Attributes:
        offset_us: its time when the autopilot boots.
        drift_ppm: how much faster it runs, in parts per million.
    """

    offset_us: int = 0
    drift_ppm: float = 0.0

    def time_us(self, true_us: int) -> int:
        """Return its time ``true_us`` after the autopilot's boot."""
        return self.offset_us + true_us + int(true_us * self.drift_ppm * 1e-6)


def command_long(command: int, *params: float) -> COMMAND_LONG:
    """Return a command for the autopilot; missing parameters are 0."""
    seven = (*params, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)[:7]
    return COMMAND_LONG(1, 1, command, 0, *seven)


def next_due_us(due_us: int, period_us: int, now_us: int) -> int:
    """Return the first instant of a schedule after now."""
    return due_us + ((now_us - due_us) // period_us + 1) * period_us


class MavlinkSender(Codec):
    """The companion's end of MAVLink without a link: a codec that counts messages, and has a heartbeat each second.

    Messages missed by a late call are skipped.

    Args:
        system_id, component_id: of outgoing frames.
        start_us: when the first heartbeat is due.

    Attributes:
        sent: number of encoded messages by kind.
        heartbeat_us: when the next heartbeat is due.
    """

    def __init__(
        self,
        system_id: int = 1,
        component_id: int = MAV_COMP_ID_VISUAL_INERTIAL_ODOMETRY,
        *,
        start_us: int = 0,
    ) -> None:
        super().__init__(system_id, component_id)
        self.sent: Counter[str] = Counter()
        self.heartbeat_us = start_us

    def encode(self, message: Message) -> bytes:
        """Return the frame of a message."""
        self.sent[type(message).__name__] += 1
        return super().encode(message)

    def heartbeats(self, now_us: int) -> tuple[HEARTBEAT, ...]:
        """Return the heartbeat, if it is due by now."""
        if now_us < self.heartbeat_us:
            return ()
        self.heartbeat_us = next_due_us(self.heartbeat_us, HEARTBEAT_PERIOD_US, now_us)
        return (COMPANION_HEARTBEAT,)

    def skip_heartbeats(self, until_us: int) -> None:
        """Leave out the heartbeats that are due before a time."""
        self.heartbeats(until_us - 1)

    def received(self, data: bytes) -> Iterator[Received | BadData]:
        """Add received bytes; yield the whole messages."""
        self.feed(data)
        while (received := self.next_received()) is not None:
            yield received


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
        self._mavlink = MavlinkSender(system_id, start_us=start_us)
        self._next_frame_us = start_us
        self.received: list[Message] = []

    def next_due_us(self) -> int:
        """Return when ``run`` has something to do next."""
        return min(self._next_frame_us + self._latency_us, self._mavlink.heartbeat_us)

    def run(self, now_us: int) -> None:
        """Send messages due by ``now_us`` and handle arrivals."""
        for heartbeat in self._mavlink.heartbeats(now_us):
            self.send(heartbeat)
        while self._next_frame_us + self._latency_us <= now_us:
            message = self._estimate(self._next_frame_us)
            self._next_frame_us += self._period_us
            if message is not None:
                self.send(message)
        self._receive()

    def send(self, message: Message) -> None:
        """Send a message now."""
        self._link.send(self._mavlink.encode(message))

    def command(self, command: int, *params: float) -> None:
        """Send a COMMAND_LONG to the autopilot; missing parameters are 0."""
        self.send(command_long(command, *params))

    def _receive(self) -> None:
        while data := self._link.receive():
            for received in self._mavlink.received(data):
                if isinstance(received, Received) and received.message is not None:
                    self.received.append(received.message)
