# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The earth's magnetic field by the table, at places where the firmware's is known."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ap_core.declination import get_declination_rad, get_earth_field_ga, get_mag_field_ef
from ap_core.fmath import f32
from ap_core.location import Location


@pytest.mark.parametrize(("lat_deg", "lng_deg", "declination_deg", "inclination_deg", "intensity_gauss"), [
    (-90, -180, 148.83402, -72.0207, 0.54507),
    (90, 180, -169.79948, 88.2142, 0.5683),
    (-40, 140, 10.15622, -71.21594, 0.61626),
    (-30, 150, 10.92679, -60.76846, 0.55095),
    (-40, 150, 15.07307, -69.8898, 0.60311),
    (-30, 140, 7.49078, -61.94296, 0.56426),
    (40, 0, 1.14514, 54.89128, 0.45083),
    (50, 0, 0.78143, 65.21557, 0.48569),
    (50, 10, 3.701, 65.80372, 0.49085),
    (40, 10, 3.24292, 55.8278, 0.45875),
    (30, -120, 11.14011, 54.75852, 0.43724),
    (40, -120, 13.1877, 63.50628, 0.49435),
    (-90, 0, -31.16598, -72.0207, 0.54507),
    (70, -10, -7.06335, 78.37555, 0.53271),
    (0, 0, -4.15177, -30.24089, 0.31935),
    (80, -170, 1.12345, 85.99807, 0.57728),
    (-30, -20, -24.6759, -61.22645, 0.24558),
    (30, -170, 8.41617, 45.45851, 0.37289),
    (-30, -40, -22.41588, -49.7857, 0.23198),
    (30, 180, 6.31041, 43.33608, 0.37236),
    (-90, -20, -11.16598, -72.0207, 0.54507),
    (20, -70, -11.85029, 45.46014, 0.38157),
    (-70, 50, -60.71951, -65.50302, 0.46271),
    (-90, -120, 88.83402, -72.0207, 0.54507),
])  # fmt: skip
def test_table_has_all_digits_of_the_firmwares(
    lat_deg: int, lng_deg: int, declination_deg: float, inclination_deg: float, intensity_gauss: float
) -> None:
    found = get_mag_field_ef(f32(lat_deg), f32(lng_deg))
    assert found == (f32(intensity_gauss), f32(declination_deg), f32(inclination_deg))


@pytest.mark.parametrize(("lat", "lng", "declination"), [
    (-353632610, 1491652300, 0.22335722),
    (-353632610, 1491652299, 0.22335722),
])  # fmt: skip
def test_declination_is_the_one_that_the_firmware_logs(lat: int, lng: int, declination: float) -> None:
    assert get_declination_rad(Location(lat, lng, 0)) == f32(declination)


def test_field_is_where_the_filters_estimate_was_recorded_to_begin() -> None:
    north, east, down = (1000 * part for part in get_earth_field_ga(Location(-353632610, 1491652300, 0)).to_tuple())
    assert (int(north), int(east), int(down)) == (232, 52, -528)


@given(lat=st.integers(-(1 << 31), (1 << 31) - 1), lng=st.integers(-(1 << 31), (1 << 31) - 1))
def test_any_place_has_a_field(lat: int, lng: int) -> None:
    assert all(map(math.isfinite, get_earth_field_ga(Location(lat, lng, 0)).to_tuple()))


@pytest.mark.parametrize("lat_deg", [-89.0, -47.0, 0.0, 33.3, 89.0])
def test_field_goes_on_over_the_date_line(lat_deg: float) -> None:
    west, east = (get_earth_field_ga(Location(round(1e7 * lat_deg), lng, 0)) for lng in (-1800000000, 1800000000))
    assert np.array(west.to_tuple()) == pytest.approx(np.array(east.to_tuple()), abs=1e-6)


def test_field_is_interpolated_between_tens_of_degrees() -> None:
    south, middle, north = (get_mag_field_ef(f32(lat), f32(10)).declination_deg for lat in (30, 35, 40))
    assert middle == pytest.approx((south + north) / 2, rel=1e-6)
