# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Aircraft that were heard go on to the autopilot, and nothing else does."""

from mav_handlers.links.pair import make_pair
from mav_handlers.wire.codec import Codec, Received
from mav_handlers.wire.messages import ADSB_VEHICLE
from viso.landmarks.adsb_vehicle import from_message
from viso.landmarks.live import MAV_COMP_ID_ADSB, AircraftSender
from viso.landmarks.synthetic import SyntheticFlight
from viso.landmarks.types import AircraftReport, Camera


def test_reports_of_aircraft_are_sent_and_nothing_else() -> None:
    ours, autopilots = make_pair()
    sender = AircraftSender(ours)
    events = list(SyntheticFlight(Camera(), duration_s=3.0).events())
    for event in events:
        sender.take(event)
    reports = [event for event in events if isinstance(event, AircraftReport)]
    codec, received = Codec(1, 1), []
    while data := autopilots.receive():
        codec.feed(data)
        while (frame := codec.next_received()) is not None:
            assert isinstance(frame, Received)
            assert (frame.header.system_id, frame.header.component_id) == (1, MAV_COMP_ID_ADSB)
            assert isinstance(frame.message, ADSB_VEHICLE)
            received.append(from_message(frame.message, 0.0))
    assert len(received) == len(reports) == sender.sent > 0
    assert [report.icao for report in received if report is not None] == [report.icao for report in reports]
