# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Passes the aircraft that a receiver hears on to an autopilot, as that receiver would (ADSB_VEHICLE)."""

from typing import Final

from mav_handlers.links.base import Link
from mav_handlers.wire.codec import Codec
from viso.companion.landmarks.adsb_vehicle import to_message
from viso.companion.landmarks.types import AircraftReport, Event

MAV_COMP_ID_ADSB: Final = 156


class AircraftSender:
    """Sends each report of an aircraft.

    Args:
        link: to the autopilot.
        system_id: of the vehicle that carries the receiver.

    Attributes:
        sent: how many reports were sent.
    """

    def __init__(self, link: Link, system_id: int = 1) -> None:
        self._link = link
        self._codec = Codec(system_id, MAV_COMP_ID_ADSB)
        self.sent = 0

    def take(self, event: Event) -> None:
        """Take what happened; all but reports of aircraft is passed over, and so is what the autopilot answers."""
        while self._link.receive():
            pass
        if isinstance(event, AircraftReport):
            self._link.send(self._codec.encode(to_message(event, event.t_s)))
            self.sent += 1
