# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Two GPS, and which of them the vehicle uses: the primary one (AP_GPS/AP_GPS.cpp, update_primary)."""

from collections.abc import Callable
from typing import Final

from ap_core.clock import Clock
from ap_core.param import ParamTable
from ekf_stub.inputs.measurements import FIX_3D, AllGps, GpsSample
from mav_handlers.wire.messages import GPS_INPUT
from viso.vehicle.gps import GPS_TYPE_NONE, Gps

ALWAYS_PRIMARY: Final = 0
"""Of GPS_AUTO_SWITCH."""
PRIMARY_WITH_FIX: Final = 4

MORE_SATELLITES_MS: Final = 20_000
"""So long after the last change another GPS takes over that has a satellite more."""
MANY_MORE_SATELLITES_MS: Final = 5000
"""The same for two satellites."""


class GpsReceivers:
    """The GPS of a vehicle.

    FIRMWARE PARITY: solutions are not blended: GPS_AUTO_SWITCH 2 is as 1, as in the firmware without accuracies.

    Args:
        clock: time since boot.
        params: GPS_AUTO_SWITCH, GPS_PRIMARY and GPSn_TYPE count.
        all_gps: the first and the second one.
        on_change: called when another one has become primary.

    Attributes:
        all: the first and the second one.
        primary: the number of the one that is used, from 0.
    """

    def __init__(
        self, clock: Clock, params: ParamTable, all_gps: tuple[Gps, Gps], on_change: Callable[[], None]
    ) -> None:
        self._clock = clock
        self._params = params
        self.all = all_gps
        self._on_change = on_change
        self.primary = 0
        self._changed_ms = 0

    def update(self) -> None:
        """Update both, and choose the primary one, 50 times per second (AP_GPS::update)."""
        for gps in self.all:
            gps.update()
        chosen = self._choose()
        if chosen != self.primary:
            self.primary = chosen
            for number, gps in enumerate(self.all):
                gps.is_used = number == chosen
            self._on_change()

    def _choose(self) -> int:
        switch, preferred = self._params.get_int("GPS_AUTO_SWITCH"), self._preferred()
        if switch == ALWAYS_PRIMARY:
            return preferred
        before = self.primary
        if switch == PRIMARY_WITH_FIX and self.all[preferred].status >= FIX_3D:
            chosen = preferred
        else:
            chosen = 1 - before if self._is_better(self.all[1 - before], self.all[before]) else before
        if chosen != before:
            self._changed_ms = self._clock.millis()
        return chosen

    def _preferred(self) -> int:
        preferred = self._params.get_int("GPS_PRIMARY")
        is_one = 0 <= preferred < len(self.all)
        return preferred if is_one and self._params.get_int(f"GPS{preferred + 1}_TYPE") != GPS_TYPE_NONE else 0

    def _is_better(self, other: Gps, used: Gps) -> bool:
        if other.status != used.status:
            return other.status > used.status
        more, since_ms = other.num_sats - used.num_sats, self._clock.millis() - self._changed_ms
        return (more >= 1 and since_ms >= MORE_SATELLITES_MS) or (more > 1 and since_ms >= MANY_MORE_SATELLITES_MS)

    def idle_until_us(self) -> int:
        """Return until when ``update`` has nothing to do, us since boot; 0 if it may have at once."""
        return min(gps.idle_until_us() for gps in self.all)

    def take(self, packet: GPS_INPUT) -> bool:
        """Give a message to the GPS of its number; return whether that takes messages (AP_GPS::handle_msg)."""
        return packet.gps_id < len(self.all) and self.all[packet.gps_id].take(packet)

    def sample(self) -> GpsSample | None:
        """Return the newest solution of the primary one, or None without a driver."""
        return self.all[self.primary].sample()

    def samples(self) -> AllGps:
        """Return the newest solution of each, up to the last one with a driver."""
        first, second = (gps.sample() for gps in self.all)
        return AllGps((first,) if second is None else (first, second), self.primary)

    def lag_s(self) -> float:
        """Return how late solutions of the primary one are taken to be."""
        return self.all[self.primary].lag_s()
