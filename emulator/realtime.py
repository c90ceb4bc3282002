# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Real time: paces a vehicle by the wall clock and moves bytes between its endpoint and links."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

from emulator.vehicle import LOOP_PERIOD_US, Vehicle
from mav_handlers.channel import Channel
from mav_handlers.links import wait_readable
from mav_handlers.links.base import Link

MAX_READ_BYTES: Final = 65536
MAX_READS: Final = 64


@dataclass(frozen=True, slots=True)
class AttachedLink:
    """A link and the endpoint's channel that it feeds."""

    link: Link
    channel: Channel


class Pacer:
    """Runs a vehicle in step with the wall clock.

    Args:
        vehicle: fresh.
        links: open links, one for each of the vehicle's channels.
        speedup: seconds of the vehicle for one of the wall clock.
        now_s: a monotonic clock in seconds.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        links: Sequence[AttachedLink],
        *,
        speedup: float = 1.0,
        now_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self._vehicle = vehicle
        self._links = tuple(links)
        self._speedup = speedup
        self._now_s = now_s
        self._start_s = now_s()
        self._next_loop_us = 0

    def _now_us(self) -> int:
        return int((self._now_s() - self._start_s) * 1e6 * self._speedup)

    def run(self, stop: Callable[[], bool], *, until_us: int | None = None) -> None:
        """Run until ``stop`` says so, or until the vehicle's time ``until_us``."""
        while not stop() and (until_us is None or self._vehicle.clock.micros64() < until_us):
            self.step()

    def step(self) -> None:
        """Wait for bytes or for the next pass of the main loop, then deal with them."""
        wait_us = self._next_loop_us - self._now_us()
        if wait_us > 0:
            wait_readable([attached.link for attached in self._links], wait_us / 1e6 / self._speedup)
        self._read()
        now_us = self._now_us()
        if now_us >= self._next_loop_us:
            self._vehicle.loop(now_us)
            # A pass that comes late is not made up for, as on the real vehicle.
            self._next_loop_us = max(self._next_loop_us + LOOP_PERIOD_US, now_us)
            self._write()

    def _read(self) -> None:
        for attached in self._links:
            # A peer that never stops must not keep the main loop from its turn.
            for _ in range(MAX_READS):
                data = attached.link.receive(MAX_READ_BYTES)
                if not data:
                    break
                self._vehicle.receive_bytes(attached.channel, data, self._now_us())

    def _write(self) -> None:
        for attached in self._links:
            data = self._vehicle.endpoint.bytes_to_send(attached.channel)
            if data:
                attached.link.send(data)
