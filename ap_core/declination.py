# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The earth's magnetic field at a place, by a table of the world (AP_Declination/AP_Declination.cpp).

The table is the same in all releases from 4.6 on.
"""

import math
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from ap_core.declination_tables import DECLINATION_DEG, INCLINATION_DEG, INTENSITY_GAUSS
from ap_core.fmath import M_PI, f32
from ap_core.location import Location
from ap_core.matrix3 import Matrix3f
from ap_core.vector3 import Vector3f

_STEP_DEG: Final = 10
_ROWS: Final = 19
_COLUMNS: Final = 37
_DEG_TO_RAD: Final = f32(M_PI / f32(180))
_DEGREES: Final = f32(1.0e-7)  # in a unit of Location


class MagField(NamedTuple):
    """The field at a place: strength in Gauss, and where it points in degrees, east of north and down."""

    intensity_gauss: np.float32
    declination_deg: np.float32
    inclination_deg: np.float32


def _table(text: str) -> npt.NDArray[np.float32]:
    return np.array(text.split(), dtype=np.float32).reshape(_ROWS, _COLUMNS)


_TABLES: Final = tuple(map(_table, (INTENSITY_GAUSS, DECLINATION_DEG, INCLINATION_DEG)))


def _corner_below(degrees: np.float32, limit: int) -> int:
    """Return the ten degrees below a coordinate; below the last ones from the limit on."""
    if degrees <= -limit:
        return -limit
    if degrees >= limit:
        return int(degrees / f32(_STEP_DEG)) * _STEP_DEG - _STEP_DEG
    return math.floor(degrees / f32(_STEP_DEG)) * _STEP_DEG


def get_mag_field_ef(latitude_deg: np.float32, longitude_deg: np.float32) -> MagField:
    """Return the field at sea level, by bilinear interpolation in each of the three tables."""
    south, west = _corner_below(latitude_deg, 90), _corner_below(longitude_deg, 180)
    row = min((90 + south) // _STEP_DEG, _ROWS - 2)
    column = min((180 + west) // _STEP_DEG, _COLUMNS - 2)
    north_part = (latitude_deg - f32(south)) / f32(_STEP_DEG)
    east_part = (longitude_deg - f32(west)) / f32(_STEP_DEG)

    def interpolated(table: npt.NDArray[np.float32]) -> np.float32:
        (sw, se), (nw, ne) = table[row : row + 2, column : column + 2]
        low = east_part * (se - sw) + sw
        high = east_part * (ne - nw) + nw
        return f32(north_part * (high - low) + low)

    return MagField(*map(interpolated, _TABLES))


def get_earth_field_ga(place: Location) -> Vector3f:
    """Return the field at a place, Gauss, NED."""
    field = _field_at(place)
    down, east = field.inclination_deg * _DEG_TO_RAD, field.declination_deg * _DEG_TO_RAD
    return Matrix3f.from_euler(f32(0), -down, east) * Vector3f(field.intensity_gauss, 0, 0)


def get_declination_rad(place: Location) -> np.float32:
    """Return the declination at a place in rad."""
    return _field_at(place).declination_deg * _DEG_TO_RAD


def _field_at(place: Location) -> MagField:
    return get_mag_field_ef(f32(place.lat) * _DEGREES, f32(place.lng) * _DEGREES)
