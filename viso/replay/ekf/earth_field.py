# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The earth's magnetic field at a place, as the firmware's table of the world has it (AP_Declination.cpp).

The table holds what the International Geomagnetic Reference Field, 13th generation, says of the beginning of 2023, each
10 degrees; between them it is interpolated. From 4.6 on it is the same in all releases. Here it is computed from the
field's coefficients, and agrees with the firmware's to 0.04 mGauss.
"""

import math
from functools import cache
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

_Array = npt.NDArray[np.float64]

_STEP_DEG: Final = 10
_DEGREES: Final = 13  # of the harmonics
_GAUSS: Final = 1e-5  # in nT
_EARTH_KM: Final = 6371.2  # of the coefficients
_EQUATOR_KM: Final = 6378.137
_POLE_KM: Final = 6356.752314245
_LEAST_SINE: Final = 1e-10

# Of the cosines and the sines, nT: a line for each degree from 1 on, with the orders from 0 on.
_G: Final = (
    (-29387.64, -1428.64),
    (-2532.54, 2961.12, 1670.52),
    (1369.8, -2398.84, 1245.38, 489.58),
    (899.4, 804.88, 68.48, -293.8, 32.7),
    (-235.14, 364.7, 186.0, -140.1, -147.36, 16.08),
    (64.38, 64.48, 74.1, -117.6, -40.4, 13.44, -62.0),
    (80.18, -77.12, -8.32, 58.54, 16.04, 4.78, -9.48, 12.08),
    (23.64, 10.12, -17.72, 0.82, -21.28, 16.56, 14.6, -16.74, 0.84),
    (5.0, 8.4, 2.9, -1.5, -1.1, -13.2, 1.1, 8.8, -9.3, -11.9),
    (-1.9, -6.2, -0.1, 1.7, -0.9, 0.7, -0.9, 1.9, 1.4, -2.4, -3.8),
    (3.0, -1.4, -2.5, 2.3, -0.9, 0.3, -0.7, -0.1, 1.4, -0.6, 0.2, 3.1),
    (-2.0, -0.1, 0.5, 1.3, -1.1, 0.7, 0.3, 0.5, -0.3, -0.5, 0.1, -1.1, -0.3),
    (0.1, -0.9, 0.5, 0.7, -0.3, 0.8, 0.0, 0.8, 0.0, 0.4, 0.1, 0.5, -0.5, -0.4),
)
_H: Final = (
    (0.0, 4574.8),
    (0.0, -3082.14, -801.8),
    (0.0, -64.04, 238.56, -542.02),
    (0.0, 281.54, -138.96, 210.32, -364.58),
    (0.0, 47.64, 215.68, -122.88, 41.24, 99.64),
    (0.0, -18.98, 20.24, 48.78, -62.04, 8.96, 70.98),
    (0.0, -49.64, -15.16, -0.02, 22.78, -5.5, -26.78, -0.9),
    (0.0, 7.68, -13.5, 12.32, -10.14, 14.06, 2.28, -5.4, 2.92),
    (0.0, -23.4, 11.0, 9.8, -5.1, -6.3, 7.8, 0.4, -1.4, 9.6),
    (0.0, 3.4, -0.2, 3.5, 4.8, -8.6, -0.1, -4.3, -3.4, -0.1, -8.8),
    (0.0, 0.0, 2.5, -0.6, -0.4, 0.6, -0.2, -1.7, -1.6, -3.0, -2.0, -2.5),
    (0.0, -1.2, 0.5, 1.4, -1.8, 0.1, 0.8, -0.1, 0.6, 0.2, -0.9, 0.0, 0.5),
    (0.0, -0.9, 0.6, 1.4, -0.4, -1.3, -0.1, 0.3, -0.1, 0.5, 0.5, -0.4, -0.3, -0.6),
)


class EarthField(NamedTuple):
    """The field at a place: declination, rad, and vector, Gauss, NED."""

    declination: float
    vector: tuple[float, float, float]


def earth_field(lat_deg: float, lng_deg: float) -> EarthField:
    """Return the field at a place, by bilinear interpolation (get_mag_field_ef, get_earth_field_ga)."""
    table = _table()
    row = min(max(math.floor(lat_deg / _STEP_DEG), -90 // _STEP_DEG), 90 // _STEP_DEG - 1)
    column = min(max(math.floor(lng_deg / _STEP_DEG), -180 // _STEP_DEG), 180 // _STEP_DEG - 1)
    up, along = lat_deg / _STEP_DEG - row, lng_deg / _STEP_DEG - column
    i, j = row + 90 // _STEP_DEG, column + 180 // _STEP_DEG
    south = table[:, i, j] + along * (table[:, i, j + 1] - table[:, i, j])
    north = table[:, i + 1, j] + along * (table[:, i + 1, j + 1] - table[:, i + 1, j])
    declination_deg, inclination_deg, size = (south + up * (north - south)).tolist()
    declination, inclination = math.radians(declination_deg), math.radians(inclination_deg)
    level = size * math.cos(inclination)
    vector = level * math.cos(declination), level * math.sin(declination), size * math.sin(inclination)
    return EarthField(declination, vector)


@cache
def _table() -> _Array:
    """Return declination and inclination, degrees, and intensity, Gauss, by latitude and longitude."""
    lat, lng = np.meshgrid(np.arange(-90, 91, _STEP_DEG), np.arange(-180, 181, _STEP_DEG), indexing="ij")
    north, east, down = _at_sea_level(np.radians(lat), np.radians(lng))
    level = np.hypot(north, east)
    return np.array(
        [
            np.degrees(np.arctan2(east, north)),
            np.degrees(np.arctan2(down, level)),
            _GAUSS * np.hypot(level, down),
        ]
    )


def _at_sea_level(lat: _Array, lng: _Array) -> tuple[_Array, _Array, _Array]:
    """Return the field, nT, NED, at geodetic places, rad, by Schmidt's quasi-normal functions."""
    a2, b2 = _EQUATOR_KM**2, _POLE_KM**2
    s, c = np.sin(lat), np.cos(lat)
    rho = np.sqrt(a2 * c**2 + b2 * s**2)
    radius = np.sqrt(a2**2 * c**2 + b2**2 * s**2) / rho
    # From the vertical of the ellipsoid to that of the sphere:
    cos_turn, sin_turn = rho / radius, (a2 - b2) / rho * s * c / radius
    cosine = s * cos_turn - c * sin_turn
    sine = np.maximum(c * cos_turn + s * sin_turn, _LEAST_SINE)  # of the angle from the pole
    size = _DEGREES + 1
    value, slope = np.zeros((size, size, *lat.shape)), np.zeros((size, size, *lat.shape))
    value[0, 0] = 1.0
    north, east, down = np.zeros(lat.shape), np.zeros(lat.shape), np.zeros(lat.shape)
    for n in range(1, size):
        far = (_EARTH_KM / radius) ** (n + 2)
        for m in range(n + 1):
            if m == n:
                k = math.sqrt(1.0 - 0.5 / n) if n > 1 else 1.0
                value[n, n] = k * sine * value[n - 1, n - 1]
                slope[n, n] = k * (sine * slope[n - 1, n - 1] + cosine * value[n - 1, n - 1])
            else:
                k, before = math.sqrt(n * n - m * m), math.sqrt(max((n - 1) ** 2 - m * m, 0))
                turned = cosine * slope[n - 1, m] - sine * value[n - 1, m]
                value[n, m] = ((2 * n - 1) * cosine * value[n - 1, m] - before * value[n - 2, m]) / k
                slope[n, m] = ((2 * n - 1) * turned - before * slope[n - 2, m]) / k
            g, h = _G[n - 1][m], _H[n - 1][m]
            along = g * np.cos(m * lng) + h * np.sin(m * lng)
            across = g * np.sin(m * lng) - h * np.cos(m * lng)
            north += far * along * slope[n, m]
            east += far * m * across * value[n, m] / sine
            down -= far * (n + 1) * along * value[n, m]
    return north * cos_turn + down * sin_turn, east, down * cos_turn - north * sin_turn
