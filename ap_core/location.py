# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A place on the globe and short distances from it (AP_Common/Location.cpp), with the simulator's precision."""

import math
from dataclasses import dataclass
from typing import Final

from ap_core.cint import i32, int64_of_float, int_of_float
from ap_core.fmath import M_PI, cosf, f32
from ap_core.vector3 import Vector3f

MAX_LAT: Final = 900_000_000
MAX_LNG: Final = 1_800_000_000
METRES_PER_UNIT: Final = float(f32(0.011131884502145034))
"""Length of 1e-7 degrees of latitude, a float32 constant (Location.h, LOCATION_SCALING_FACTOR)."""

_UNITS_PER_METRE: Final = float(f32(89.83204953368922))
_RADIANS_PER_UNIT: Final = f32(f32(1.0e-7) * f32(M_PI / f32(180)))
_CENTI: Final = f32(0.01)
_MIN_LONGITUDE_SCALE: Final = float(_CENTI)


def longitude_scale(lat: int) -> float:
    """Return the ratio of a degree of longitude to one of latitude, at least 0.01.

    The cosine is a float32 one. Source: Location::longitude_scale.
    """
    return max(float(cosf(f32(f32(lat) * _RADIANS_PER_UNIT))), _MIN_LONGITUDE_SCALE)


def wrap_longitude(lng: int) -> int:
    """Wrap a longitude, at most one turn outside, to -180..180 degrees (Location::wrap_longitude)."""
    if lng > MAX_LNG:
        lng -= 2 * MAX_LNG
    elif lng < -MAX_LNG:
        lng += 2 * MAX_LNG
    return i32(lng)


def diff_longitude(lng: int, other: int) -> int:
    """Return ``lng`` minus ``other`` the shorter way round, in 1e-7 deg (Location::diff_longitude)."""
    difference = lng - other
    return difference if (lng < 0) == (other < 0) else wrap_longitude(difference)


def limit_latitude(lat: int) -> int:
    """Reflect a latitude beyond a pole to the other side of it (Location::limit_lattitude)."""
    if lat > MAX_LAT:
        return i32(2 * MAX_LAT - lat)
    return i32(-2 * MAX_LAT - lat) if lat < -MAX_LAT else lat


def _half(value: int) -> int:
    return math.trunc(value / 2)


@dataclass(frozen=True, slots=True)
class Location:
    """A place: latitude and longitude in 1e-7 deg, altitude in cm above mean sea level."""

    lat: int
    lng: int
    alt_cm: int

    def is_valid(self) -> bool:
        """Return whether latitude and longitude are within +-90 and +-180 degrees (check_latlng)."""
        return abs(self.lat) <= MAX_LAT and abs(self.lng) <= MAX_LNG

    def distance_ned(self, to: "Location") -> Vector3f:
        """Return the distance to another place in metres north, east, down (Location::get_distance_NED)."""
        north = float(f32(i32(to.lat - self.lat))) * METRES_PER_UNIT
        east = f32(float(f32(diff_longitude(to.lng, self.lng))) * METRES_PER_UNIT)
        scale = longitude_scale(_half(i32(self.lat + to.lat)))
        return Vector3f(north, float(east) * scale, f32(i32(self.alt_cm - to.alt_cm)) * _CENTI)

    def distance_ne(self, to: "Location") -> tuple[float, float]:
        """Return the distance to another place in m north and east, in double precision (get_distance_NE_ftype)."""
        scale = longitude_scale(_half(i32(self.lat + to.lat)))
        east = diff_longitude(to.lng, self.lng) * METRES_PER_UNIT * scale
        return i32(to.lat - self.lat) * METRES_PER_UNIT, east

    def offset(self, ned: Vector3f) -> "Location":
        """Return the location at an offset in metres north, east, down.

        Offsets that are not finite, or too large for an integer, give the location that x86-64 computes.

        Source: Location::offset, Location::offset_latlng.
        """
        dlat = int_of_float(float(ned.x) * _UNITS_PER_METRE)
        dlng = int64_of_float(float(ned.y) * _UNITS_PER_METRE / longitude_scale(i32(self.lat + _half(dlat))))
        alt_cm = int_of_float(self.alt_cm - float(ned.z) * 100)
        return Location(limit_latitude(i32(self.lat + dlat)), wrap_longitude(dlng + self.lng), alt_cm)
