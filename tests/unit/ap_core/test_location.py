# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Places and short ways between them, at the edges of the globe and of C++ integers."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ap_core.location import (
    MAX_LAT,
    MAX_LNG,
    Location,
    diff_longitude,
    limit_latitude,
    longitude_scale,
    wrap_longitude,
)
from ap_core.vector3 import Vector3f

DEGREE = 10_000_000
LATITUDE_DEGREE_M = 111_318.845
ZURICH = Location(473977418, 85455938, 48800)

latitudes = st.integers(-80 * DEGREE, 80 * DEGREE)
longitudes = st.integers(-MAX_LNG, MAX_LNG)
altitudes = st.integers(-100_000, 1_000_000)
places = st.builds(Location, latitudes, longitudes, altitudes)
metres = st.floats(-2000, 2000, width=32)
ways = st.builds(Vector3f, metres, metres, metres)


def moved(place: Location, north: float = 0, east: float = 0, down: float = 0) -> Location:
    return place.offset(Vector3f(north, east, down))


def test_degree_of_latitude_has_its_length() -> None:
    way = Location(0, 0, 0).distance_ned(Location(DEGREE, 0, 0))
    assert way.x == pytest.approx(LATITUDE_DEGREE_M, abs=0.01)
    assert [way.y, way.z] == [0, 0]


def test_degree_of_longitude_has_half_that_length_at_60_degrees() -> None:
    way = Location(60 * DEGREE, 0, 0).distance_ned(Location(60 * DEGREE, DEGREE, 0))
    assert way.y == pytest.approx(LATITUDE_DEGREE_M / 2, rel=1e-6)


def test_ways_between_latitudes_are_scaled_at_the_middle() -> None:
    way = Location(0, 0, 0).distance_ned(Location(-60 * DEGREE, DEGREE, 0))
    assert way.y == pytest.approx(LATITUDE_DEGREE_M * math.cos(math.radians(30)), rel=1e-6)


def test_down_is_positive_towards_lower_places() -> None:
    assert Location(0, 0, 250).distance_ned(Location(0, 0, -50)).z == np.float32(3)


@pytest.mark.parametrize(
    ("degrees", "scale"), [(0, 1.0), (60, 0.5), (-60, 0.5), (89, math.cos(math.radians(89))), (90, 0.01), (-90, 0.01)]
)
def test_longitude_scale_is_the_cosine_but_never_less_than_a_hundredth(degrees: int, scale: float) -> None:
    assert longitude_scale(degrees * DEGREE) == pytest.approx(scale, abs=5e-8)


def test_longitude_scale_has_single_precision() -> None:
    scale = longitude_scale(ZURICH.lat)
    assert scale == float(np.float32(scale))


@pytest.mark.parametrize(
    ("lng", "wrapped"),
    [(MAX_LNG, MAX_LNG), (-MAX_LNG, -MAX_LNG), (MAX_LNG + 1, 1 - MAX_LNG), (-MAX_LNG - 1, MAX_LNG - 1), (5, 5)],
)
def test_longitude_wraps_just_beyond_180_degrees(lng: int, wrapped: int) -> None:
    assert wrap_longitude(lng) == wrapped


@pytest.mark.parametrize(
    ("lng", "other", "difference"),
    [(5, 3, 2), (-5, -3, -2), (179 * DEGREE, -179 * DEGREE, -2 * DEGREE), (-179 * DEGREE, 179 * DEGREE, 2 * DEGREE)],
)
def test_difference_of_longitudes_is_the_shorter_way(lng: int, other: int, difference: int) -> None:
    assert diff_longitude(lng, other) == difference


@pytest.mark.parametrize(
    ("lat", "limited"),
    [(MAX_LAT, MAX_LAT), (-MAX_LAT, -MAX_LAT), (MAX_LAT + 7, MAX_LAT - 7), (-MAX_LAT - 7, 7 - MAX_LAT), (-3, -3)],
)
def test_latitude_beyond_a_pole_comes_down_on_the_other_side(lat: int, limited: int) -> None:
    assert limit_latitude(lat) == limited


def test_way_across_180_degrees_is_the_short_one() -> None:
    west, east = Location(0, MAX_LNG - DEGREE // 2, 0), Location(0, -MAX_LNG + DEGREE // 2, 0)
    assert west.distance_ned(east).y == pytest.approx(LATITUDE_DEGREE_M, abs=0.01)
    assert east.distance_ned(west).y == pytest.approx(-LATITUDE_DEGREE_M, abs=0.01)


def test_step_across_180_degrees_arrives_on_the_other_side() -> None:
    assert moved(Location(0, MAX_LNG - 10, 0), east=1).lng == -MAX_LNG + 79
    assert moved(Location(0, -MAX_LNG + 10, 0), east=-1).lng == MAX_LNG - 79


def test_step_across_a_pole_comes_down_again() -> None:
    assert moved(Location(MAX_LAT - 10, 0, 0), north=1).lat == MAX_LAT - 79


@pytest.mark.parametrize(("north", "units"), [(0.999 / 89.83205, 0), (1.001 / 89.83205, 1), (-1.001 / 89.83205, -1)])
def test_units_are_truncated_towards_zero(north: float, units: int) -> None:
    assert moved(Location(10, 20, 0), north=north).lat == 10 + units
    assert moved(Location(0, 20, 0), east=north).lng == 20 + units


@pytest.mark.parametrize(("alt_cm", "down", "result"), [(-10, 0.005, -10), (10, 0.005, 9), (-10, -0.025, -7)])
def test_altitude_is_truncated_as_a_sum(alt_cm: int, down: float, result: int) -> None:
    assert moved(Location(0, 0, alt_cm), down=down).alt_cm == result


@given(place=places)
def test_no_way_leads_nowhere(place: Location) -> None:
    assert place.offset(Vector3f()) == place
    assert place.distance_ned(place) == Vector3f()


@given(place=places, way=ways)
def test_way_to_where_a_way_led_is_that_way(place: Location, way: Vector3f) -> None:
    back = place.distance_ned(place.offset(way))
    # Two truncated units, the altitude's centimetre, and the float32 cosine at slightly different latitudes.
    assert back.x == pytest.approx(way.x, abs=0.013)
    assert back.y == pytest.approx(way.y, abs=0.013 + abs(float(way.y)) * 2e-6)
    assert back.z == pytest.approx(way.z, abs=0.011)


@given(place=places, other=places)
def test_way_back_is_the_way_reversed(place: Location, other: Location) -> None:
    there, back = place.distance_ned(other), other.distance_ned(place)
    reversed_way = Vector3f(-back.x, -back.y, -back.z)
    assert (there.x, there.z) == (reversed_way.x, reversed_way.z)
    assert abs(there.y) == abs(back.y)


@given(place=places, way=st.tuples(*[st.floats(width=32)] * 3))
def test_place_has_32_bits_whatever_the_way(place: Location, way: tuple[float, float, float]) -> None:
    arrived = place.offset(Vector3f(*way))
    assert all(-(1 << 31) <= value < 1 << 31 for value in (arrived.lat, arrived.lng, arrived.alt_cm))


@pytest.mark.parametrize(
    ("place", "valid"),
    [
        (Location(MAX_LAT, MAX_LNG, 0), True),
        (Location(-MAX_LAT, -MAX_LNG, 0), True),
        (Location(MAX_LAT + 1, 0, 0), False),
        (Location(0, -MAX_LNG - 1, 0), False),
    ],
)
def test_place_is_valid_up_to_the_poles_and_180_degrees(place: Location, valid: bool) -> None:
    assert place.is_valid() is valid


def test_distance_in_double_precision_is_that_of_the_recordings_from_the_other_side_of_the_globe() -> None:
    north, east = Location(-353_632_610, 1_491_652_299, 0).distance_ne(Location(0, 0, 0))
    assert (np.float32(north), np.float32(east)) == (np.float32(3936597.5), np.float32(-15820467))
