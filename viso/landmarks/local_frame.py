# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""East, north and up of a place on the globe: on a sphere, as in older programs, or on the WGS 84 ellipsoid.

The sphere is off by 0.03 to 0.5 % of the range, and ignores curvature: 5 m of height at 8 km, 71 m at 30 km.
The ellipsoid needs pymap3d, from the extra ``landmarks``.
"""

import math
from enum import StrEnum
from importlib import import_module
from types import ModuleType
from typing import Final

import numpy as np
import numpy.typing as npt

from viso.extras import pip_install
from viso.geometry.rotation import Array
from viso.landmarks.types import GeodeticPoint

EARTH_RADIUS_M: Final = 6_371_000.0
MISSING_EXTRA: Final = f"the frame wgs84 needs pymap3d: {pip_install('landmarks')}"


class FrameMode(StrEnum):
    """The conversion of degrees to metres."""

    SPHERICAL = "spherical"
    WGS84 = "wgs84"


def to_enu(
    mode: FrameMode,
    origin: GeodeticPoint,
    latitude_deg: npt.ArrayLike,
    longitude_deg: npt.ArrayLike,
    alt_m: npt.ArrayLike,
) -> Array:
    """Return places, whose shapes broadcast together and whose heights count as the origin's, as seen from an origin.

    Returns:
        East, north, up [..., 3] in m; up from the plane that touches the ellipsoid at the origin, or from the sphere.

    Raises:
        ModuleNotFoundError: without pymap3d where it is needed; one line that says what to install.
        ValueError: for a latitude that is not on the globe, in mode ``wgs84``.
    """
    latitude, longitude, alt = np.broadcast_arrays(
        *(np.asarray(value, dtype=np.float64) for value in (latitude_deg, longitude_deg, alt_m))
    )
    if mode is FrameMode.WGS84:
        east, north, up = _pymap3d().geodetic2enu(latitude, longitude, alt, *_degrees(origin))
    else:
        latitude_0 = math.radians(origin.latitude_deg)
        # The shorter way round: an origin and a place may be on both sides of the date line.
        turn = np.remainder(longitude - origin.longitude_deg + 180, 360) - 180
        east = EARTH_RADIUS_M * math.cos(latitude_0) * np.radians(turn)
        north = EARTH_RADIUS_M * (np.radians(latitude) - latitude_0)
        up = alt - origin.alt_m
    return np.stack([east, north, up], axis=-1)


def to_geodetic(mode: FrameMode, origin: GeodeticPoint, east_m: float, north_m: float, up_m: float) -> GeodeticPoint:
    """Return the place at a distance from an origin: the inverse of :func:`to_enu`.

    Raises:
        ModuleNotFoundError: without pymap3d where it is needed; one line that says what to install.
        ValueError: if there is no such place, as beyond a pole in mode ``spherical``.
    """
    if mode is FrameMode.WGS84:
        place = _pymap3d().enu2geodetic(east_m, north_m, up_m, *_degrees(origin))
        latitude_deg, longitude_deg, alt_m = map(float, place)
    else:
        latitude_0 = math.radians(origin.latitude_deg)
        latitude_deg = math.degrees(latitude_0 + north_m / EARTH_RADIUS_M)
        turn_deg = math.degrees(east_m / (EARTH_RADIUS_M * math.cos(latitude_0)))
        longitude_deg, alt_m = origin.longitude_deg + turn_deg, origin.alt_m + up_m
    return GeodeticPoint(latitude_deg, math.remainder(longitude_deg, 360), alt_m)


def _degrees(origin: GeodeticPoint) -> tuple[float, float, float]:
    return origin.latitude_deg, origin.longitude_deg, origin.alt_m


def _pymap3d() -> ModuleType:
    try:
        return import_module("pymap3d")
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(MISSING_EXTRA, name="pymap3d") from error
