# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The companion as a MAVLink odometry component: its messages and their times."""

from collections import Counter, deque
from collections.abc import Callable, Sequence
from typing import Final

from mav_handlers.links.base import Link
from mav_handlers.wire.codec import BadData, Received
from mav_handlers.wire.messages import ODOMETRY, STATUSTEXT, TIMESYNC, Message
from viso.companion.odometry.clock_sync import REQUEST_PERIOD_NS, ClockSync
from viso.companion.odometry.inbound import FcInbound
from viso.companion.sender import MavlinkSender, next_due_us
from viso.companion.vio.config import OdometryConfig

MAV_COMP_ID_AUTOPILOT1: Final = 1
LOST_PERIOD_US: Final = 250_000
TEXTS: Final = 100
REQUEST_PERIOD_US: Final = REQUEST_PERIOD_NS // 1000


class OdometrySender:
    """Sends odometry at its rate, a heartbeat once a second and clock requests, and receives messages of the autopilot.

    Args:
        link: the wire to the autopilot.
        odometry: returns the message to send at a time in us, or None.
        clock: gets the TIMESYNC messages.
        inbound: gets all others of the autopilot.
        config: the rate, and the ids of the sender; the autopilot has the same system id.
        stream_requests: sent with each heartbeat for as long as no inertial data come.
        start_us: when the companion is up.

    Attributes:
        counters: messages sent by kind, and unusable ones received.
        texts: the last ones of the autopilot.
    """

    def __init__(
        self,
        link: Link,
        odometry: Callable[[int], ODOMETRY | None],
        clock: ClockSync,
        inbound: FcInbound,
        config: OdometryConfig,
        *,
        stream_requests: Sequence[Message] = (),
        start_us: int = 0,
    ) -> None:
        self._link = link
        self._odometry = odometry
        self._clock = clock
        self._inbound = inbound
        self._stream_requests = tuple(stream_requests)
        self._period_us = round(1e6 / config.rate_hz)
        self._mavlink = MavlinkSender(config.system_id, config.component_id, start_us=start_us)
        self._next_request_us = self._next_odometry_us = start_us
        self.counters: Counter[str] = self._mavlink.sent
        self.texts: deque[STATUSTEXT] = deque(maxlen=TEXTS)

    def next_due_us(self) -> int:
        """Return the time at which ``run`` has something to send next; earlier arrivals are handled then."""
        return min(self._mavlink.heartbeat_us, self._next_request_us, self._next_odometry_us)

    def run(self, now_us: int) -> None:
        """Handle arrivals and send due messages; messages missed by a late call are skipped."""
        self._receive(now_us)
        for heartbeat in self._mavlink.heartbeats(now_us):
            self.send(heartbeat)
            if self._inbound.imu_silent(now_us * 1000):
                for request in self._stream_requests:
                    self.send(request)
        if self._next_request_us <= now_us:
            self._next_request_us = next_due_us(self._next_request_us, REQUEST_PERIOD_US, now_us)
            self.send(self._clock.request(now_us * 1000))
        if self._next_odometry_us <= now_us:
            self._send_odometry(now_us)

    def send(self, message: Message) -> None:
        """Send a message now."""
        self._link.send(self._mavlink.encode(message))

    def _send_odometry(self, now_us: int) -> None:
        message = self._odometry(now_us)
        period_us = self._period_us
        if message is not None:
            self.send(message)
            if message.quality < 0:
                period_us = LOST_PERIOD_US
        self._next_odometry_us = next_due_us(self._next_odometry_us, period_us, now_us)

    def _receive(self, now_us: int) -> None:
        while data := self._link.receive():
            for received in self._mavlink.received(data):
                self._take(received, now_us * 1000)

    def _take(self, received: Received | BadData, arrival_ns: int) -> None:
        if isinstance(received, BadData):
            self.counters["received_bad_data"] += 1
            return
        header, message = received.header, received.message
        if (header.system_id, header.component_id) != (self._mavlink.system_id, MAV_COMP_ID_AUTOPILOT1):
            self.counters["received_from_others"] += 1
        elif isinstance(message, TIMESYNC):
            answer = self._clock.take(message, arrival_ns)
            if answer is not None:
                self.send(answer)
        elif isinstance(message, STATUSTEXT):
            self.texts.append(message)
        elif message is not None:
            self._inbound.take(message, arrival_ns)
