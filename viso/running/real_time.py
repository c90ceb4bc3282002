# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Real time: paces a vehicle by the wall clock and moves bytes between its endpoint and links."""

import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Final

from mav_handlers.channel import Channel
from mav_handlers.links import wait_readable
from mav_handlers.links.base import Link, Readable
from viso.running.power import PoweredVehicle
from viso.vehicle.vehicle import LOOP_PERIOD_US

if TYPE_CHECKING:
    from viso.dds.autopilot import DdsAutopilot  # needs the extra ros2

NOW_S: Final = time.monotonic
"""The wall clock, in seconds."""
MAX_ROUNDS: Final = 64
READ_BYTES: Final = 1024
"""How much is read from a link before the next one: some 30 messages at most, which take a few milliseconds."""
MOST_SLEPT_OVER: Final = 20
"""So many passes may be run at once: what comes of them, such as a text, is sent no later than after 50 ms."""
READ_BUDGET_S: Final = 0.01
"""How long the links may be read by turns before the next pass of the main loop."""


class Pacer:
    """Runs a fresh vehicle in step with the wall clock, over restarts; each of its ports has an open link.

    ``speedup`` is how many seconds of the vehicle pass in one of ``now_s``, a monotonic clock; ``beside`` exchange
    with the vehicle over DDS.
    """

    def __init__(
        self,
        powered: PoweredVehicle,
        links: Sequence[Link],
        *,
        speedup: float = 1.0,
        beside: Sequence["DdsAutopilot"] = (),
        now_s: Callable[[], float] = NOW_S,
    ) -> None:
        self._powered = powered
        self._links = list(links)  # those of further clients come and go at the end
        self._servers = len(self._links)
        self._speedup = speedup
        self._beside = tuple(beside)
        self._now_s = now_s
        self._before_restart_us = 0
        self._power_up()

    def _power_up(self) -> None:
        self._boot_s = self._now_s()
        self._next_loop_us = 0

    def _now_us(self) -> int:
        return int((self._now_s() - self._boot_s) * 1e6 * self._speedup)

    def _ran_us(self) -> int:
        return self._before_restart_us + self._powered.vehicle.clock.micros64()

    def run(self, stop: Callable[[], bool], *, until_us: int | None = None) -> None:
        """Run until ``stop`` says so, or until the vehicle has run for ``until_us``, restarts included."""
        while not stop() and (until_us is None or self._ran_us() < until_us):
            self.step(until_us)

    def step(self, until_us: int | None = None) -> None:
        """Wait for bytes, or for a pass at which a task is due, then handle them."""
        due_us = self._due_us()
        if until_us is not None:
            due_us = max(self._next_loop_us, min(due_us, until_us - self._before_restart_us))
        wait_us = min([due_us, *(other.due_us() for other in self._beside)]) - self._now_us()
        if wait_us > 0:
            readers: list[Readable] = [*self._links, *(reader for other in self._beside for reader in other.readers)]
            wait_readable(readers, wait_us / 1e6 / self._speedup)
        self._make_up(min(self._now_us(), due_us - 1))
        self._admit()
        self._read()
        for other in self._beside:
            self._powered.vehicle.clock.set_us(self._now_us())
            other.exchange(self._powered.vehicle)
        now_us = self._now_us()
        if now_us >= self._next_loop_us:
            vehicle, is_late = self._powered.vehicle, now_us - self._next_loop_us >= LOOP_PERIOD_US
            pass_us = now_us if is_late else max(self._next_loop_us, vehicle.clock.micros64())
            vehicle.advance(range(pass_us, pass_us + 1, LOOP_PERIOD_US))
            # A pass that comes late is not made up for, as on the real vehicle.
            self._next_loop_us = max(self._next_loop_us + LOOP_PERIOD_US, now_us)
            self._powered.vehicle.keep_set_parameters()
            self._write()
            self._restart_if_asked()

    def _due_us(self) -> int:
        """Return the time of the next pass at which something is to be done; until then nobody has to get up."""
        passes = -((self._next_loop_us - self._powered.vehicle.next_due_us()) // LOOP_PERIOD_US)
        return self._next_loop_us + max(0, min(passes, MOST_SLEPT_OVER)) * LOOP_PERIOD_US

    def _make_up(self, until_us: int) -> None:
        """Run the passes that were slept over, each for its own time."""
        vehicle = self._powered.vehicle
        while self._next_loop_us <= until_us:
            count = vehicle.advance(range(self._next_loop_us, until_us + 1, LOOP_PERIOD_US))
            self._next_loop_us += LOOP_PERIOD_US * count
            self._write()

    def _restart_if_asked(self) -> None:
        ran_us = self._ran_us()
        if self._powered.restart_if_asked():
            self._before_restart_us = ran_us
            self._power_up()

    def _admit(self) -> None:
        """Give further clients of a server channels of their own, and take them from those that have gone."""
        for place in range(len(self._links) - 1, self._servers - 1, -1):
            if not self._links[place].peer_names:
                del self._links[place]
                self._powered.remove_client(place)
        for place, server in enumerate(self._links[: self._servers]):
            while (link := server.admit()) is not None:
                self._links.append(link)
                self._powered.add_client(link.name, place)

    def _read(self) -> None:
        # A peer that never stops must not keep other links, or the main loop, from their turn: what is over the budget
        # waits in the system, which slows a TCP peer down.
        end_s = self._now_s() + READ_BUDGET_S
        waiting = list(zip(self._links, self._powered.channels, strict=True))
        for _ in range(MAX_ROUNDS):
            waiting = [(link, channel) for link, channel in waiting if self._take(channel, link.receive(READ_BYTES))]
            if not waiting or self._now_s() > end_s:
                break

    def _take(self, channel: Channel, data: bytes) -> bool:
        if data:
            self._powered.vehicle.clock.set_us(self._now_us())
            self._powered.vehicle.receive_bytes(channel, data)
        return bool(data)

    def _write(self) -> None:
        for link, channel in zip(self._links, self._powered.channels, strict=True):
            data = self._powered.vehicle.endpoint.bytes_to_send(channel)
            if data:
                link.send(data)
