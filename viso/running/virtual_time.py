# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Virtual time: the one place that advances a vehicle's clock."""

from collections.abc import Callable

from mav_handlers.channel import Channel
from viso.vehicle.vehicle import LOOP_PERIOD_US, Vehicle


class Scheduler:
    """Runs a vehicle's main loop at its rate, and hands it bytes at exact times in between.

    Attributes:
        period_us: from one pass to the next; longer where nobody looks at more than messages.
        on_pass: called after each pass at which more was done than to run the filter, and after some others.
    """

    def __init__(self, vehicle: Vehicle) -> None:
        self._vehicle = vehicle
        self.period_us = LOOP_PERIOD_US
        self.on_pass: Callable[[], None] | None = None
        self._next_loop_us = 0

    @property
    def now_us(self) -> int:
        """The vehicle's time in us since boot."""
        return self._vehicle.clock.micros64()

    def run_until(self, time_us: int) -> None:
        """Run every pass of the main loop up to and including ``time_us``, then stand there.

        Raises ValueError if that time has passed.
        """
        self._check_ahead(time_us)
        while self._next_loop_us <= time_us:
            ahead_us = range(self._next_loop_us, time_us + 1, self.period_us)
            self._next_loop_us += self.period_us * self._vehicle.advance(ahead_us)
            if self.on_pass is not None:
                self.on_pass()
        self._vehicle.clock.set_us(time_us)

    def pass_over(self, time_us: int) -> None:
        """Leave out every pass of the main loop up to and including ``time_us``, and stand there.

        Raises ValueError if that time has passed.
        """
        self._check_ahead(time_us)
        self._next_loop_us = max(self._next_loop_us, (time_us // LOOP_PERIOD_US + 1) * LOOP_PERIOD_US)
        self._vehicle.clock.set_us(time_us)

    def _check_ahead(self, time_us: int) -> None:
        if time_us < self.now_us:
            raise ValueError(f"time {time_us} us has passed, it is {self.now_us} us")

    def deliver(self, channel: Channel, data: bytes, *, read_us: int | None = None) -> None:
        """Hand bytes to the vehicle now; ``read_us`` is when the link was read, if earlier."""
        self._vehicle.receive_bytes(channel, data, read_us)
