# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Real time: paces a vehicle by the wall clock and moves bytes between its endpoint and links."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Final

from mav_handlers.links import wait_readable
from mav_handlers.links.base import Link, Readable
from viso.running.exchange import NOW_S, Exchange
from viso.running.power import PoweredVehicle
from viso.vehicle.vehicle import LOOP_PERIOD_US

if TYPE_CHECKING:
    from viso.dds.autopilot import DdsAutopilot  # needs the extra ros2

MOST_SLEPT_OVER: Final = 20
"""So many passes may be run at once: what comes of them, such as a text, is sent no later than after 50 ms."""


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
        self._exchange = Exchange(powered, links, now_s=now_s)
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
            others = (reader for other in self._beside for reader in other.readers)
            readers: list[Readable] = [*self._exchange.links, *others]
            wait_readable(readers, wait_us / 1e6 / self._speedup)
        self._make_up(min(self._now_us(), due_us - 1))
        self._exchange.admit()
        self._exchange.read(self._now_us)
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
            self._exchange.write()
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
            self._exchange.write()

    def _restart_if_asked(self) -> None:
        ran_us = self._ran_us()
        if self._powered.restart_if_asked():
            self._before_restart_us = ran_us
            self._power_up()
