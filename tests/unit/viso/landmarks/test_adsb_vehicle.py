# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Reports of aircraft as ADSB_VEHICLE, there and back, over the wire."""

import math
import struct
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mav_handlers.wire.codec import Codec, Received
from mav_handlers.wire.messages import ADSB_VEHICLE, Message
from viso.landmarks.adsb_vehicle import AdsbFlags, AltitudeType, from_message, to_message
from viso.landmarks.types import AircraftReport

REPORT = AircraftReport(100.0, "3C6DD1", 47.464127, 8.549031, 5000.0, 251.5, 87.31, -640.0)
ALL = int(AdsbFlags.COORDS | AdsbFlags.ALTITUDE | AdsbFlags.HEADING | AdsbFlags.VELOCITY)


def over_the_wire(message: Message) -> ADSB_VEHICLE:
    codec = Codec(1, 156)
    codec.feed(codec.encode(message))
    received = codec.next_received()
    assert isinstance(received, Received)
    assert isinstance(received.message, ADSB_VEHICLE)
    return received.message


def told(**fields: Any) -> ADSB_VEHICLE:
    return replace(to_message(REPORT, 100.0), **fields)


def test_message_has_the_units_of_its_definition() -> None:
    message = over_the_wire(to_message(REPORT, 103.4))
    assert message == ADSB_VEHICLE(
        ICAO_address=0x3C6DD1,
        lat=474641270,
        lon=85490310,
        altitude_type=AltitudeType.PRESSURE_QNH,
        altitude=1_524_000,
        heading=8731,
        hor_velocity=12938,
        ver_velocity=-325,
        callsign="",
        emitter_type=0,
        tslc=3,
        flags=1 | 2 | 4 | 8 | 128 | 256,
        squawk=0,
    )


@given(
    t_s=st.integers(0, 2_000_000_000),
    age_s=st.integers(0, 255),
    address=st.integers(1, 0xFFFFFF),
    latitude_deg=st.floats(-90, 90),
    longitude_deg=st.floats(-180, 180),
    altitude_ft=st.none() | st.floats(-1200, 126_000),
    speed_kt=st.floats(0, 1270),
    heading_deg=st.floats(0, 360),
    rate_ft_min=st.floats(-32_000, 32_000),
    is_baro=st.booleans(),
)
def test_report_comes_back_within_the_steps_of_the_message(
    t_s: int,
    age_s: int,
    address: int,
    latitude_deg: float,
    longitude_deg: float,
    altitude_ft: float | None,
    speed_kt: float,
    heading_deg: float,
    rate_ft_min: float,
    is_baro: bool,
) -> None:
    sent = AircraftReport(
        float(t_s),
        f"{address:06X}",
        latitude_deg,
        longitude_deg,
        altitude_ft,
        speed_kt,
        heading_deg,
        rate_ft_min,
        is_baro,
    )
    message = over_the_wire(to_message(sent, t_s + float(age_s)))
    if message.lat == 0 and message.lon == 0:
        with pytest.raises(ValueError, match="lat"):
            from_message(message, 0.0)
        return
    found = from_message(message, t_s + float(age_s))
    assert (found.t_s, found.icao, found.is_baro) == (sent.t_s, sent.icao, is_baro)
    assert abs(found.latitude_deg - latitude_deg) <= 0.5e-7 + 1e-12
    assert abs(found.longitude_deg - longitude_deg) <= 0.5e-7 + 1e-12
    assert (found.altitude_ft is None) == (altitude_ft is None)
    if found.altitude_ft is not None and altitude_ft is not None:
        assert abs(found.altitude_ft - altitude_ft) * 0.3048 <= 0.5e-3 + 1e-9
    assert abs(found.speed_kt - speed_kt) * 0.514444 <= 0.5e-2 + 1e-9
    assert abs(math.remainder(found.heading_deg - heading_deg, 360)) <= 0.5e-2 + 1e-9
    assert abs(found.vertical_rate_ft_min - rate_ft_min) * 0.3048 / 60 <= 0.5e-2 + 1e-9


def test_missing_altitude_is_not_marked_as_valid() -> None:
    message = to_message(replace(REPORT, altitude_ft=None), 100.0)
    assert not message.flags & (AdsbFlags.ALTITUDE | AdsbFlags.BARO)
    assert from_message(message, 100.0).altitude_ft is None


def test_zeros_that_may_not_have_been_told_are_not_marked_as_valid() -> None:
    message = to_message(AircraftReport(100.0, "3C6DD1", 47.0, 8.0), 100.0)
    assert message.flags == AdsbFlags.COORDS


def test_geometric_altitude_is_told_from_pressure_altitude() -> None:
    message = to_message(replace(REPORT, is_baro=False), 100.0)
    assert message.altitude_type == AltitudeType.GEOMETRIC
    assert not message.flags & AdsbFlags.BARO
    assert not from_message(message, 100.0).is_baro


@pytest.mark.parametrize("heading_deg", [359.999, 360.0, -0.001, 719.996])
def test_heading_stays_below_a_full_turn(heading_deg: float) -> None:
    assert over_the_wire(to_message(replace(REPORT, heading_deg=heading_deg), 100.0)).heading == 0


@pytest.mark.parametrize(
    "fields",
    [
        {"speed_kt": 1e6},
        {"speed_kt": -5.0},
        {"vertical_rate_ft_min": 1e9},
        {"vertical_rate_ft_min": -1e9},
        {"altitude_ft": 1e12},
        {"altitude_ft": -1e12},
        {"t_s": -1e6},
        {"t_s": 1e6},
    ],
)
def test_numbers_beyond_the_message_become_the_largest_that_it_holds(fields: dict[str, Any]) -> None:
    try:
        message = over_the_wire(to_message(replace(REPORT, **fields), 100.0))
    except struct.error as error:
        pytest.fail(str(error))
    assert (message.hor_velocity, message.ver_velocity, abs(message.altitude), message.tslc) in {
        (65535, -325, 1_524_000, 0),
        (0, -325, 1_524_000, 0),
        (12938, 32767, 1_524_000, 0),
        (12938, -32767, 1_524_000, 0),
        (12938, -325, 0x7FFFFFFF, 0),
        (12938, -325, 1_524_000, 255),
        (12938, -325, 1_524_000, 0),
    }


@pytest.mark.parametrize(
    ("fields", "field"),
    [
        ({"ICAO_address": 0}, "ICAO_address"),
        ({"ICAO_address": 0x1000000}, "ICAO_address"),
        ({"flags": ALL & ~1}, "lat"),
        ({"lat": 0, "lon": 0}, "lat"),
        ({"lat": 910_000_000}, "latitude_deg"),
        ({"lon": -1_810_000_000}, "longitude_deg"),
    ],
)
def test_message_that_is_no_report_names_the_field(fields: dict[str, int], field: str) -> None:
    with pytest.raises(ValueError, match=f"^{field}: "):
        from_message(told(**fields), 100.0)


def test_what_flags_do_not_vouch_for_is_not_told() -> None:
    found = from_message(told(flags=1), 100.0)
    assert (found.altitude_ft, found.speed_kt, found.heading_deg, found.vertical_rate_ft_min) == (None, 0, 0, 0)


def test_heading_beyond_a_full_turn_is_none() -> None:
    assert from_message(told(heading=65535), 100.0).heading_deg == 0


def test_older_senders_have_one_flag_for_both_velocities() -> None:
    assert from_message(told(flags=ALL), 100.0).vertical_rate_ft_min == pytest.approx(-640, abs=1)
