# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Moves bytes between a vehicle's endpoint and its links, and lets further clients of servers come and go."""

import time
from collections.abc import Callable, Sequence
from typing import Final

from mav_handlers.channel import Channel
from mav_handlers.links.base import Link
from viso.running.power import PoweredVehicle

NOW_S: Final = time.monotonic
"""The wall clock, in seconds."""
MAX_ROUNDS: Final = 64
READ_BYTES: Final = 1024
"""How much is read from a link before the next one: some 30 messages at most, which take a few milliseconds."""
READ_BUDGET_S: Final = 0.01
"""How long the links may be read by turns before the next pass of the main loop."""


class Exchange:
    """The links of a vehicle, over restarts: one for each of its ports, and further clients of servers behind them.

    Args:
        powered: the vehicle.
        links: one for each of its ports, open.
        now_s: a monotonic clock.

    Attributes:
        links: all that are open now.
    """

    def __init__(self, powered: PoweredVehicle, links: Sequence[Link], *, now_s: Callable[[], float] = NOW_S) -> None:
        self.links = list(links)
        self._powered = powered
        self._servers = len(self.links)
        self._now_s = now_s

    def admit(self) -> None:
        """Give further clients of a server channels of their own, and take them from those that have gone."""
        for place in range(len(self.links) - 1, self._servers - 1, -1):
            if not self.links[place].peer_names:
                del self.links[place]
                self._powered.remove_client(place)
        for place, server in enumerate(self.links[: self._servers]):
            while (link := server.admit()) is not None:
                self.links.append(link)
                self._powered.add_client(link.name, place)

    def read(self, vehicle_us: Callable[[], int]) -> None:
        """Hand over what has arrived, each part at the time of the vehicle that it arrives at."""
        # A peer that never stops must not keep other links, or the main loop, from their turn: what is over the budget
        # waits in the system, which slows a TCP peer down.
        end_s = self._now_s() + READ_BUDGET_S
        waiting = list(zip(self.links, self._powered.channels, strict=True))
        for _ in range(MAX_ROUNDS):
            waiting = [
                (link, channel)
                for link, channel in waiting
                if self._take(channel, link.receive(READ_BYTES), vehicle_us)
            ]
            if not waiting or self._now_s() > end_s:
                break

    def _take(self, channel: Channel, data: bytes, vehicle_us: Callable[[], int]) -> bool:
        if data:
            self._powered.vehicle.clock.set_us(vehicle_us())
            self._powered.vehicle.receive_bytes(channel, data)
        return bool(data)

    def write(self) -> None:
        """Send what waits at the endpoint."""
        for link, channel in zip(self.links, self._powered.channels, strict=True):
            data = self._powered.vehicle.endpoint.bytes_to_send(channel)
            if data:
                link.send(data)
