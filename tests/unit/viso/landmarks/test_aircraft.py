# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Aircraft from what they tell: units, attitude, turn rate, and which of them are there."""

import json
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from viso.geometry.rotation import rotation_from_quat_wxyz, so3_exp
from viso.landmarks.aircraft import AircraftTracker, attitude_wxyz, drawn, state_vectors_record, velocity_enu
from viso.landmarks.local_frame import FrameMode, to_geodetic
from viso.landmarks.types import AircraftReport, AircraftState, GeodeticPoint, VehiclePose

ORIGIN = GeodeticPoint(47.0, 8.0, 500.0)
MODES = pytest.mark.parametrize("mode", FrameMode)


def told(t_s: float = 0.0, icao: str = "4B1803", **others: Any) -> AircraftReport:
    return replace(AircraftReport(t_s, icao, 47.02, 8.03, 3000.0), **others)


def states(*reports: AircraftReport, now_s: float = 0.0) -> tuple[AircraftState, ...]:
    tracker = AircraftTracker()
    for report in reports:
        tracker.add(report)
    return tracker.states(now_s, ORIGIN)


def turn_rate_rad_s(*headings: tuple[float, float]) -> float | None:
    (state,) = states(*(told(t_s, heading_deg=deg) for t_s, deg in headings), now_s=headings[-1][0])
    return state.turn_rate_rad_s


@MODES
def test_an_aircraft_is_where_it_says(mode: FrameMode) -> None:
    tracker = AircraftTracker(mode)
    place = to_geodetic(mode, ORIGIN, 3000.0, -2000.0, 1000.0)
    report = AircraftReport(0.0, "4B1803", place.latitude_deg, place.longitude_deg, place.alt_m / 0.3048)
    tracker.add(report)
    (state,) = tracker.states(0.0, ORIGIN)
    assert (state.east_m, state.north_m, state.up_m) == pytest.approx((3000, -2000, 1000), abs=1e-3)
    assert state.report is report
    assert state.range_m == pytest.approx(math.hypot(3000, 2000))


def test_feet_count_from_the_origins_altitude() -> None:
    tracker = AircraftTracker(FrameMode.SPHERICAL)
    tracker.add(told(altitude_ft=3000.0))
    assert tracker.states(0.0, ORIGIN)[0].up_m == pytest.approx(3000 * 0.3048 - 500)


@pytest.mark.parametrize(("is_baro", "offset_m"), [(True, 25.0), (False, 0.0)])
def test_the_pressure_offset_is_added_to_pressure_altitudes_only(is_baro: bool, offset_m: float) -> None:
    corrected, plain = AircraftTracker(qnh_offset_m=25.0), AircraftTracker()
    for tracker in (corrected, plain):
        tracker.add(told(is_baro=is_baro))
    high, low = (tracker.states(0.0, ORIGIN)[0].up_m for tracker in (corrected, plain))
    assert high is not None
    assert low is not None
    assert high - low == pytest.approx(offset_m)


def test_an_aircraft_without_altitude_is_kept_without_up() -> None:
    (state,) = states(told(altitude_ft=None))
    (level,) = states(told(altitude_ft=ORIGIN.alt_m / 0.3048))
    assert state.up_m is None
    assert (state.east_m, state.north_m) == pytest.approx((level.east_m, level.north_m))


def test_knots_and_feet_a_minute_become_metres_a_second() -> None:
    report = told(speed_kt=100.0, heading_deg=30.0, vertical_rate_ft_min=600.0)
    expected = [51.4444 * 0.5, 51.4444 * math.sqrt(0.75), 3.048]
    assert velocity_enu(report) == pytest.approx(expected)


def test_an_aircraft_that_tells_no_motion_stands_level_and_looks_north() -> None:
    (state,) = states(told())
    assert state.vel_enu.tolist() == [0, 0, 0]
    assert rotation_from_quat_wxyz(state.quat_wxyz)[:, 0] == pytest.approx([0, 1, 0])
    assert state.turn_rate_rad_s is None


@given(st.floats(2.5, 500), st.floats(0, 360), st.floats(-6000, 6000))
def test_an_aircraft_flies_along_its_nose_without_bank(speed_kt: float, heading_deg: float, rate: float) -> None:
    report = told(speed_kt=speed_kt, heading_deg=heading_deg, vertical_rate_ft_min=rate)
    attitude, velocity = rotation_from_quat_wxyz(attitude_wxyz(report)), velocity_enu(report)
    assert attitude[:, 0] == pytest.approx(velocity / np.linalg.norm(velocity), abs=1e-9)
    assert attitude[2, 1] == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize(("speed_kt", "climbs"), [(1.9, False), (2.0, True)])
def test_an_aircraft_up_to_a_metre_a_second_has_no_pitch(speed_kt: float, climbs: bool) -> None:
    quat = attitude_wxyz(told(speed_kt=speed_kt, heading_deg=90.0, vertical_rate_ft_min=500.0))
    assert bool(rotation_from_quat_wxyz(quat)[2, 0] > 0.5) is climbs


def test_a_turn_to_the_right_is_negative_also_across_north() -> None:
    assert turn_rate_rad_s((0.0, 350.0), (2.0, 10.0)) == pytest.approx(-math.radians(10))
    assert turn_rate_rad_s((0.0, 10.0), (2.0, 350.0)) == pytest.approx(math.radians(10))


def test_the_turn_rate_is_an_exponential_mean() -> None:
    rate = turn_rate_rad_s((0.0, 0.0), (1.0, 3.0), (2.0, 3.0), (3.0, 13.0))
    assert rate == pytest.approx(-math.radians(0.7 * (0.7 * 3 + 0.3 * 0) + 0.3 * 10))


@pytest.mark.parametrize(("dt_s", "expected"), [(0.0, None), (9.99, -math.radians(20) / 9.99), (10.0, None)])
def test_headings_at_once_or_ten_seconds_apart_tell_no_turn(dt_s: float, expected: float | None) -> None:
    assert turn_rate_rad_s((0.0, 0.0), (dt_s, 20.0)) == (expected and pytest.approx(expected))


def test_a_turn_is_kept_over_a_pause_but_not_over_a_long_silence() -> None:
    assert turn_rate_rad_s((0.0, 0.0), (1.0, 3.0), (12.0, 90.0)) == pytest.approx(-math.radians(3))
    assert turn_rate_rad_s((0.0, 0.0), (1.0, 3.0), (17.0, 90.0)) is None


def test_turns_of_several_aircraft_are_apart() -> None:
    first, second = states(
        told(0.0, "000001", heading_deg=0.0),
        told(0.5, "000002", heading_deg=180.0),
        told(1.0, "000001", heading_deg=5.0),
        now_s=1.0,
    )
    assert first.turn_rate_rad_s == pytest.approx(-math.radians(5))
    assert second.turn_rate_rad_s is None


def test_an_aircraft_that_is_told_twice_is_there_once_and_as_it_was_told_last() -> None:
    (state,) = states(told(1.0, speed_kt=10.0), told(1.0, speed_kt=20.0), told(0.5, speed_kt=30.0), now_s=1.0)
    assert state.report.speed_kt == 20.0


@pytest.mark.parametrize(("age_s", "count"), [(15.0, 1), (15.001, 0), (-15.0, 1), (-15.001, 0)])
def test_an_aircraft_that_was_silent_for_too_long_is_not_there(age_s: float, count: int) -> None:
    assert len(states(told(), now_s=age_s)) == count


def test_a_clock_that_was_set_back_starts_anew() -> None:
    (state,) = states(told(1000.0, heading_deg=0.0), told(1001.0, heading_deg=5.0), told(3.0, speed_kt=9.0), now_s=3.0)
    assert state.report.t_s == 3.0
    assert state.turn_rate_rad_s is None


def test_aircraft_come_in_the_order_of_their_addresses() -> None:
    found = states(told(icao="B00000"), told(icao="A00000"), told(icao="00000F"))
    assert [state.report.icao for state in found] == ["00000F", "A00000", "B00000"]


def test_without_a_fix_there_is_no_aircraft_and_no_record() -> None:
    tracker, nowhere = AircraftTracker(), GeodeticPoint(0.0, 0.0)
    tracker.add(told())
    assert tracker.states(0.0, nowhere) == ()
    assert state_vectors_record(0.0, nowhere, VehiclePose(0.0, 0.0, 0.0, 0.0), ()) is None


@pytest.mark.parametrize("field", ["latitude_deg", "longitude_deg", "altitude_ft", "heading_deg", "speed_kt"])
def test_what_is_not_a_number_is_no_report(field: str) -> None:
    none: dict[str, Any] = {field: math.nan}
    with pytest.raises(ValueError, match=field):
        told(**none)


@pytest.mark.parametrize("icao", ["4b1803", "4B180", "4B18033", "~4B180", "GGGGGG"])
def test_an_address_has_six_hexadecimal_digits_in_upper_case(icao: str) -> None:
    with pytest.raises(ValueError, match="icao"):
        told(icao=icao)


@pytest.mark.parametrize(
    ("range_m", "expected"), [(49.9, False), (50.0, True), (8000.0, True), (8000.1, False), (0.0, False)]
)
def test_aircraft_are_drawn_from_50_m_to_8_km(range_m: float, expected: bool) -> None:
    state = AircraftState(told(), range_m, 0.0, 9000.0, np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))
    assert drawn(state) is expected


def test_the_record_tells_everything() -> None:
    report = told(speed_kt=100.0, heading_deg=90.0, vertical_rate_ft_min=-600.0)
    found = states(report, told(0.0, "FFFFFF", altitude_ft=None))
    record = state_vectors_record(12.25, ORIGIN, VehiclePose(12.25, 1.0, 2.0, math.pi / 2), found)
    assert record is not None
    assert json.loads(json.dumps(record, allow_nan=False)) == record
    assert record["header"] == {
        "frame_id": "local_enu",
        "stamp": {"sec": 12, "nanosec": 250_000_000},
        "origin_lla": {"lat": 47.0, "lon": 8.0, "alt_m": 500.0},
    }
    assert record["vehicle"]["pose"]["position"] == {"x": 1.0, "y": 2.0, "z": 0.0}
    half = math.sqrt(0.5)
    assert record["vehicle"]["pose"]["orientation"] == pytest.approx({"x": 0.0, "y": 0.0, "z": half, "w": half})
    assert record["vehicle"]["twist"]["linear"] == {"x": 0.0, "y": 0.0, "z": 0.0}
    first, second = record["aircraft"]
    assert first["icao"] == "4B1803"
    assert first["pose"]["position"] == {"x": found[0].east_m, "y": found[0].north_m, "z": found[0].up_m}
    assert first["twist"]["linear"] == pytest.approx({"x": 51.4444, "y": 0.0, "z": -3.048})
    assert first["raw"] == {
        "speed_kts": 100.0,
        "heading_deg": 90.0,
        "vertical_rate_ftmin": -600.0,
        "altitude_ft": 3000.0,
        "latitude": 47.02,
        "longitude": 8.03,
    }
    assert second["pose"]["position"]["z"] is None
    assert second["raw"]["altitude_ft"] is None


def test_the_record_has_the_vehicles_full_attitude_and_whole_seconds() -> None:
    attitude = so3_exp(np.array([0.3, 0.0, 0.0]))
    record = state_vectors_record(4.9999999999, ORIGIN, VehiclePose(5.0, 0.0, 0.0, 0.0, 7.0, attitude), ())
    assert record is not None
    assert record["header"]["stamp"] == {"sec": 5, "nanosec": 0}
    assert record["vehicle"]["pose"]["orientation"]["x"] == pytest.approx(math.sin(0.15))
    assert record["vehicle"]["pose"]["position"]["z"] == 7.0
