# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes ap_core/declination_tables.py: the earth's magnetic field each ten degrees, as the firmware has it.

The field is that of the International Geomagnetic Reference Field, 13th generation. Its coefficients come from pyIGRF
(`pip install pyigrf==0.3.3`), which nothing else here needs. The firmware's table was made at ``MADE_AT`` by a program
with constants in single precision, which prints eight digits; so does this, and all digits of the table agree.
"""

from __future__ import annotations

import math
from datetime import datetime
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt
from pyIGRF.loadCoeffs import get_coeffs

_Array = npt.NDArray[np.float64]

TARGET: Final = Path(__file__).resolve().parent.parent / "ap_core" / "declination_tables.py"
MADE_AT: Final = datetime(2022, 12, 29, 8, 32, 45)
STEP_DEG: Final = 10
WIDTH: Final = 120
EPOCH: Final = 2020.0  # of the coefficients; their change per year is given with one decimal

HEAD: Final = '''# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The earth's magnetic field each ten degrees: rows of latitude from -90 on, in each the longitudes from -180 to 180.

tools/make_earth_field.py writes this file.
"""

from typing import Final
'''


def _single(value: float) -> float:
    return float(np.float32(value))


RADIANS: Final = _single(0.017453292)
EARTH_KM: Final = _single(6371.2)  # of the coefficients
EQUATOR_KM2: Final = _single(40680631.6)
POLE_KM2: Final = _single(40408296.0)


def coefficients() -> dict[tuple[int, int], tuple[float, float]]:
    """Return the coefficients of cosine and sine in nT when the table was made, by degree and order."""
    begin, end = datetime(MADE_AT.year, 1, 1), datetime(MADE_AT.year + 1, 1, 1)
    years = MADE_AT.year + (MADE_AT - begin) / (end - begin) - EPOCH

    def at_date(now: float | None, in_a_year: float | None) -> float:
        if now is None or in_a_year is None:  # the sine of order 0
            return 0.0
        return _single(now) + years * _single(round(in_a_year - now, 1))

    now, later = get_coeffs(EPOCH), get_coeffs(EPOCH + 1)
    return {
        (n, m): (at_date(now[0][n][m], later[0][n][m]), at_date(now[1][n][m], later[1][n][m]))
        for n in range(1, len(now[0]))
        for m in range(n + 1)
    }


def field_ned(lat_deg: _Array, lng_deg: _Array) -> tuple[_Array, _Array, _Array]:
    """Return the field at sea level, nT, NED, at geodetic places, by Schmidt's quasi-normal functions."""
    gh = coefficients()
    from_pole, lng = (90.0 - lat_deg) * RADIANS, lng_deg * RADIANS
    s, c = np.cos(from_pole), np.sin(from_pole)
    rho = np.sqrt(EQUATOR_KM2 * c**2 + POLE_KM2 * s**2)
    radius = np.sqrt(EQUATOR_KM2**2 * c**2 + POLE_KM2**2 * s**2) / rho
    # From the vertical of the ellipsoid to that of the sphere:
    cos_turn, sin_turn = rho / radius, (EQUATOR_KM2 - POLE_KM2) / rho * s * c / radius
    cosine, sine = s * cos_turn - c * sin_turn, c * cos_turn + s * sin_turn
    value = {(0, 0): np.ones(lat_deg.shape)}
    slope = {(0, 0): np.zeros(lat_deg.shape)}
    nothing = np.zeros(lat_deg.shape)
    north, east, down = np.zeros(lat_deg.shape), np.zeros(lat_deg.shape), np.zeros(lat_deg.shape)
    for (n, m), (g, h) in gh.items():
        if m == n:
            k = math.sqrt(1.0 - 0.5 / n) if n > 1 else 1.0
            value[n, n] = k * sine * value[n - 1, n - 1]
            slope[n, n] = k * (sine * slope[n - 1, n - 1] + cosine * value[n - 1, n - 1])
        else:
            k, before = math.sqrt(n * n - m * m), math.sqrt(max((n - 1) ** 2 - m * m, 0))
            turned = cosine * slope[n - 1, m] - sine * value[n - 1, m]
            value[n, m] = ((2 * n - 1) * cosine * value[n - 1, m] - before * value.get((n - 2, m), nothing)) / k
            slope[n, m] = ((2 * n - 1) * turned - before * slope.get((n - 2, m), nothing)) / k
        far = (EARTH_KM / radius) ** (n + 2)
        along = far * (g * np.cos(m * lng) + h * np.sin(m * lng))
        across = far * (g * np.sin(m * lng) - h * np.cos(m * lng))
        is_pole = sine == 0.0
        north += along * slope[n, m]
        east += across * np.where(is_pole, cosine * slope[n, m], m * value[n, m] / np.where(is_pole, 1.0, sine))
        down -= (n + 1) * along * value[n, m]
    return north * cos_turn + down * sin_turn, east, down * cos_turn - north * sin_turn


def tables() -> tuple[_Array, _Array, _Array]:
    """Return declination and inclination in degrees, and intensity in Gauss, by latitude and longitude."""
    lat, lng = np.meshgrid(np.arange(-90.0, 90.1, STEP_DEG), np.arange(-180.0, 180.1, STEP_DEG), indexing="ij")
    north, east, down = field_ned(lat, lng)
    size = np.sqrt(north**2 + east**2 + down**2)
    north, east, down, size = (
        np.array([float(f"{value:.7e}") for value in part.ravel()]).reshape(part.shape)
        for part in (north, east, down, size)
    )
    return np.degrees(np.arctan2(east, north)), np.degrees(np.arctan2(down, np.hypot(north, east))), size / 1e5


def text_of(table: _Array) -> str:
    """Return the numbers of a table, as many a line as there is room for."""
    lines = [""]
    for number in table.ravel().tolist():
        word = f"{number:.5f}"
        if len(lines[-1]) + 1 + len(word) > WIDTH:
            lines.append("")
        lines[-1] += f" {word}" if lines[-1] else word
    return "\n".join(lines)


def source() -> str:
    """Return the module's source."""
    names = ("DECLINATION_DEG", "INCLINATION_DEG", "INTENSITY_GAUSS")
    parts = (f'{name}: Final = """\n{text_of(table)}\n"""\n' for name, table in zip(names, tables(), strict=True))
    return "\n".join([HEAD, *parts])


if __name__ == "__main__":
    TARGET.write_text(source(), encoding="utf-8")
