# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A place on the globe and short ways from it (AP_Common/Location.cpp)."""

import math
from dataclasses import dataclass
from typing import Final

from ap_core.vector3 import Vector3f

MAX_LAT: Final = 900_000_000
MAX_LNG: Final = 1_800_000_000
METRES_PER_UNIT: Final = 0.011131884502145034
"""Length of 1e-7 degrees of latitude (AP_Math/definitions.h, LATLON_TO_M)."""

_FULL_TURN: Final = 3_600_000_000
_MIN_LONGITUDE_SCALE: Final = 0.01


def longitude_scale(lat: int) -> float:
    """Return how much shorter a degree of longitude is than one of latitude, never less than 0.01."""
    return max(math.cos(math.radians(lat * 1e-7)), _MIN_LONGITUDE_SCALE)


def _wrap_longitude(lng: int) -> int:
    return (lng + MAX_LNG) % _FULL_TURN - MAX_LNG


@dataclass(frozen=True, slots=True)
class Location:
    """A place: latitude and longitude in 1e-7 deg, altitude in cm above mean sea level."""

    lat: int
    lng: int
    alt_cm: int

    def is_valid(self) -> bool:
        """Tell whether latitude and longitude are within +-90 and +-180 degrees (check_latlng)."""
        return abs(self.lat) <= MAX_LAT and abs(self.lng) <= MAX_LNG

    def distance_ned(self, to: "Location") -> Vector3f:
        """Return the way to another place in metres north, east, down (Location::get_distance_NED)."""
        north = (to.lat - self.lat) * METRES_PER_UNIT
        east = _wrap_longitude(to.lng - self.lng) * METRES_PER_UNIT * longitude_scale((self.lat + to.lat) // 2)
        return Vector3f(north, east, (self.alt_cm - to.alt_cm) * 0.01)

    def offset(self, ned: Vector3f) -> "Location":
        """Return the place that lies some metres north, east and down of this one (Location::offset)."""
        lat = self.lat + math.trunc(float(ned.x) / METRES_PER_UNIT)
        east = float(ned.y) / METRES_PER_UNIT / longitude_scale(self.lat + (lat - self.lat) // 2)
        alt_cm = math.trunc(self.alt_cm - float(ned.z) * 100)
        return Location(max(-MAX_LAT, min(lat, MAX_LAT)), _wrap_longitude(self.lng + math.trunc(east)), alt_cm)
