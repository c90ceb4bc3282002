# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The magnetic field at a place, and the place of the origin in a log."""

import math
from types import SimpleNamespace
from typing import Any

import pytest

from viso.replay.ekf.earth_field import earth_field
from viso.replay.ekf.inputs import origin_of

CANBERRA = -35.363261, 149.16523


def test_declination_is_what_the_firmware_was_recorded_with() -> None:
    assert earth_field(*CANBERRA).declination == pytest.approx(0.22335722, abs=1e-5)


def test_field_is_where_the_filters_estimate_was_recorded_to_begin() -> None:
    north, east, down = (1e3 * component for component in earth_field(*CANBERRA).vector)
    assert (int(north), int(east), int(down)) == (232, 52, -528)


def test_vector_points_where_the_declination_says() -> None:
    declination, (north, east, _) = earth_field(60.2, 24.9)
    assert math.atan2(east, north) == pytest.approx(declination)


def test_field_is_interpolated_between_tens_of_degrees() -> None:
    middle = earth_field(0.0, 15.0).declination
    assert middle == pytest.approx((earth_field(0.0, 10.0).declination + earth_field(0.0, 20.0).declination) / 2)


@pytest.mark.parametrize("lat_deg", [-90.0, -47.0, 0.0, 33.3, 90.0])
def test_field_goes_on_over_the_date_line(lat_deg: float) -> None:
    west, east = earth_field(lat_deg, -180.0), earth_field(lat_deg, 180.0)
    assert math.dist(west.vector, east.vector) < (1e-6 if abs(lat_deg) < 90 else 0.7)
    assert 0.2 < math.hypot(*west.vector) < 0.7


def log(*records: tuple[int, float, float]) -> list[Any]:
    return [SimpleNamespace(Type=kind, Lat=lat, Lng=lng) for kind, lat, lng in records]


def test_origin_is_that_of_the_filter() -> None:
    home, origin = (1, 10.0, 20.0), (0, -35.3632611, 149.1652299)
    place = origin_of(log(home, origin, (0, 1.0, 2.0)))
    assert place is not None
    assert (place.lat, place.lng) == (-353632611, 1491652299)
    assert origin_of(log(home)) is None
