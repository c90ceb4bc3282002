# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Degrees to metres and back, against the library and against the definition."""

import math
import sys
from importlib import import_module

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from viso.landmarks.local_frame import EARTH_RADIUS_M, MISSING_EXTRA, FrameMode, to_enu, to_geodetic
from viso.landmarks.types import GeodeticPoint

pymap3d = import_module("pymap3d")

origins = st.builds(GeodeticPoint, st.floats(-85, 85), st.floats(-180, 180), st.floats(-100, 5000))
degrees = st.floats(-0.5, 0.5)
heights = st.floats(-100, 13_000)
metres = st.floats(-50_000, 50_000)


def ecef(latitude_deg: float, longitude_deg: float, alt_m: float) -> list[float]:
    """Return earth-centred coordinates by the definition of WGS 84."""
    a_m, flattening = 6_378_137.0, 1 / 298.257223563
    square = flattening * (2 - flattening)
    latitude, longitude = math.radians(latitude_deg), math.radians(longitude_deg)
    normal_m = a_m / math.sqrt(1 - square * math.sin(latitude) ** 2)
    across_m = (normal_m + alt_m) * math.cos(latitude)
    z_m = (normal_m * (1 - square) + alt_m) * math.sin(latitude)
    return [across_m * math.cos(longitude), across_m * math.sin(longitude), z_m]


def enu_by_ecef(origin: GeodeticPoint, latitude_deg: float, longitude_deg: float, alt_m: float) -> list[float]:
    here = ecef(origin.latitude_deg, origin.longitude_deg, origin.alt_m)
    x, y, z = (there - mine for there, mine in zip(ecef(latitude_deg, longitude_deg, alt_m), here, strict=True))
    latitude, longitude = math.radians(origin.latitude_deg), math.radians(origin.longitude_deg)
    away = math.cos(longitude) * x + math.sin(longitude) * y
    east = -math.sin(longitude) * x + math.cos(longitude) * y
    north = -math.sin(latitude) * away + math.cos(latitude) * z
    return [east, north, math.cos(latitude) * away + math.sin(latitude) * z]


@given(origins, degrees, degrees, heights)
def test_wgs84_is_the_librarys_and_the_definitions(
    origin: GeodeticPoint, dlat: float, dlon: float, alt_m: float
) -> None:
    latitude, longitude = origin.latitude_deg + dlat, origin.longitude_deg + dlon
    enu = to_enu(FrameMode.WGS84, origin, latitude, longitude, alt_m)
    library = pymap3d.geodetic2enu(latitude, longitude, alt_m, origin.latitude_deg, origin.longitude_deg, origin.alt_m)
    assert enu == pytest.approx(np.array(library, dtype=float), abs=1e-3)
    assert enu == pytest.approx(enu_by_ecef(origin, latitude, longitude, alt_m), abs=1e-3)


@given(origins, degrees, degrees, heights)
def test_spherical_is_its_formula(origin: GeodeticPoint, dlat: float, dlon: float, alt_m: float) -> None:
    latitude, longitude = origin.latitude_deg + dlat, origin.longitude_deg + dlon
    east = EARTH_RADIUS_M * math.cos(math.radians(origin.latitude_deg)) * math.radians(longitude - origin.longitude_deg)
    north = EARTH_RADIUS_M * math.radians(latitude - origin.latitude_deg)
    enu = to_enu(FrameMode.SPHERICAL, origin, latitude, longitude, alt_m)
    assert enu == pytest.approx([east, north, alt_m - origin.alt_m], abs=1e-6)


@pytest.mark.parametrize("mode", FrameMode)
@given(origin=origins, east_m=metres, north_m=metres, up_m=heights)
def test_there_and_back(mode: FrameMode, origin: GeodeticPoint, east_m: float, north_m: float, up_m: float) -> None:
    place = to_geodetic(mode, origin, east_m, north_m, up_m)
    enu = to_enu(mode, origin, place.latitude_deg, place.longitude_deg, place.alt_m)
    assert enu == pytest.approx([east_m, north_m, up_m], abs=1e-6 if mode is FrameMode.SPHERICAL else 1e-3)


@pytest.mark.parametrize("mode", FrameMode)
def test_the_shorter_way_is_over_the_date_line(mode: FrameMode) -> None:
    origin = GeodeticPoint(10.0, 179.99, 0.0)
    east_m, north_m, _ = to_enu(mode, origin, 10.0, -179.99, 0.0).tolist()
    assert east_m == pytest.approx(2190, abs=10)
    assert north_m == pytest.approx(0, abs=1)
    assert to_geodetic(mode, origin, east_m, north_m, 0.0).longitude_deg == pytest.approx(-179.99, abs=1e-6)


@pytest.mark.parametrize("mode", FrameMode)
def test_many_places_at_once_have_a_row_each(mode: FrameMode) -> None:
    origin = GeodeticPoint(47.0, 8.0, 500.0)
    latitudes, longitudes = [47.1, 46.9], [8.1, 7.9]
    rows = to_enu(mode, origin, latitudes, longitudes, 1000.0)
    assert rows.shape == (2, 3)
    for row, latitude, longitude in zip(rows, latitudes, longitudes, strict=True):
        assert row == pytest.approx(to_enu(mode, origin, latitude, longitude, 1000.0))


def test_the_sphere_is_some_metres_off_and_does_not_bend() -> None:
    origin = GeodeticPoint(47.0, 8.0, 500.0)
    place = to_geodetic(FrameMode.WGS84, origin, 0.0, 8000.0, 0.0)
    ball = to_enu(FrameMode.SPHERICAL, origin, place.latitude_deg, place.longitude_deg, place.alt_m)
    assert 1 < math.dist(ball[:2].tolist(), (0.0, 8000.0)) < 41
    assert ball[2] == pytest.approx(5.0, abs=0.1)


def test_without_pymap3d_one_line_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pymap3d", None)
    origin = GeodeticPoint(47.0, 8.0)
    with pytest.raises(ModuleNotFoundError) as caught:
        to_enu(FrameMode.WGS84, origin, 47.0, 8.0, 0.0)
    assert str(caught.value) == MISSING_EXTRA
    assert to_enu(FrameMode.SPHERICAL, origin, 47.0, 8.0, 0.0).tolist() == [0, 0, 0]


def test_there_is_no_place_beyond_a_pole() -> None:
    with pytest.raises(ValueError, match="latitude_deg"):
        to_geodetic(FrameMode.SPHERICAL, GeodeticPoint(89.9, 0.0), 0.0, 50_000.0, 0.0)
