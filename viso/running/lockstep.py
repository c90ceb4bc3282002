# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Simulated time: a vehicle whose clock waits for the computer, as the simulator's does.

Each pass of the main loop follows the one before it by its period, however late it is. So a flight is the same at any
speed, and a speed that the computer cannot reach is not reached (SITL/SIM_Aircraft.cpp, Aircraft::sync_frame_time).
"""

import math
from collections.abc import Callable, Sequence
from typing import Final

from mav_handlers.links import wait_readable
from mav_handlers.links.base import Link, Readable
from viso.running.exchange import NOW_S, Exchange
from viso.running.power import PoweredVehicle
from viso.running.radio import UdpRadio
from viso.vehicle.vehicle import LOOP_PERIOD_US

MOST_AT_ONCE: Final = 20
"""So many passes are run between two readings of the links at most."""
WAIT_S: Final = 0.2
"""So often it is looked whether to stop, at least."""
MOST_BEHIND_S: Final = 0.1
"""So much of the wall clock is caught up with; what is over that is lost."""


class Lockstep:
    """Runs a vehicle until it is to restart; each of its ports has an open link.

    Args:
        powered: the vehicle, fresh.
        links: one for each of its ports.
        radio: moves its sticks and switches.
        speedup: returns how many seconds of the vehicle are to pass in one of ``now_s``, above 0.
        now_s: a monotonic clock.
    """

    def __init__(
        self,
        powered: PoweredVehicle,
        links: Sequence[Link],
        radio: UdpRadio | None,
        speedup: Callable[[], float],
        *,
        now_s: Callable[[], float] = NOW_S,
    ) -> None:
        self._powered = powered
        self._exchange = Exchange(powered, links, now_s=now_s)
        self._radio = radio
        self._speedup = speedup
        self._now_s = now_s
        self._next_us = 0
        self._speed = speedup()
        self._start_s = now_s()  # when the vehicle's clock would have been 0 at its present speed

    def wait_for_client(self, link: Link, stop: Callable[[], bool]) -> None:
        """Wait until a server has a client; the vehicle's time stands still."""
        while not link.peer_names and not stop():
            wait_readable([link], WAIT_S)
            self._exchange.admit()

    def run(self, stop: Callable[[], bool]) -> bool:
        """Run until ``stop`` says so or a client has asked for a restart; return whether it is to be restarted."""
        self._begin_at(self._speedup())
        while not stop():
            self.step()
            if self._powered.vehicle.reboot_requested:
                return True
        return False

    def step(self) -> None:
        """Wait for the time of the next passes or for bytes, then take these and run those."""
        self._follow_speed()
        vehicle = self._powered.vehicle
        due_us = max(self._next_us, min(vehicle.next_due_us(), self._next_us + MOST_AT_ONCE * LOOP_PERIOD_US))
        ahead_s = (due_us - self._clock_us()) / 1e6 / self._speed
        if ahead_s > 0:
            readers: list[Readable] = [*self._exchange.links, *([] if self._radio is None else [self._radio])]
            wait_readable(readers, ahead_s)
        self._exchange.admit()
        if self._next_us > 0:  # no autopilot has read anything at its time 0
            self._exchange.read(self._read_us)
        if self._radio is not None:
            vehicle.copter.receiver.radio_us = self._radio.channels_us()
        end_us = min(self._clock_us(), self._next_us + MOST_AT_ONCE * LOOP_PERIOD_US)
        while self._next_us <= end_us and not vehicle.reboot_requested:
            count = vehicle.advance(range(self._next_us, end_us + 1, LOOP_PERIOD_US))
            self._next_us += count * LOOP_PERIOD_US
            vehicle.keep_set_parameters()
            self._exchange.write()

    def _read_us(self) -> int:
        """Return the time of what is read now: between the last pass and the next one."""
        return max(self._powered.vehicle.clock.micros64(), min(self._clock_us(), self._next_us - 1), 1)

    def _clock_us(self) -> int:
        """Return the time that the vehicle's clock is to have; what it is behind by too much is forgotten."""
        now_s = self._now_s()
        least_start_s = now_s - self._next_us / 1e6 / self._speed - MOST_BEHIND_S
        self._start_s = max(self._start_s, least_start_s)
        return math.floor((now_s - self._start_s) * 1e6 * self._speed)

    def _follow_speed(self) -> None:
        speed = self._speedup()
        if speed != self._speed:
            self._begin_at(speed)

    def _begin_at(self, speed: float) -> None:
        self._speed = speed
        self._start_s = self._now_s() - self._next_us / 1e6 / speed
