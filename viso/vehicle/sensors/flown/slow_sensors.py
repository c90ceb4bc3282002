# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Barometer, compass and heading of any log, as each pass of the main loop had them."""

import math
from typing import Final, NamedTuple

import numpy as np

from ap_core.dataflash_columns import LogColumns
from ap_core.declination import get_declination_rad
from ap_core.location import Location
from ekf_stub.inputs.measurements import Array
from viso.vehicle.sensors.flight import Ints, Readings, chosen, first_instance, has, parameters, readings

_EKF_ORIGIN: Final = 0  # of ORGN.Type


class SlowSensors(NamedTuple):
    """The readings; see ``Flight``."""

    baro: Readings[tuple[int, float]]
    mag: Readings[tuple[int, Array]]
    declination: Readings[float]
    yaw_rad: Readings[float]


def slow_sensors(log: LogColumns, pass_us: Ints) -> SlowSensors:
    """Return the data of a log's BARO, MAG and ATT in each pass (us since boot), and its declination."""
    baro = _timed(log, "BARO", "SMS", 1e-3, ["Alt"])
    mag = _timed(log, "MAG", "S", 1.0, ["MagX", "MagY", "MagZ"])
    attitude, _ = chosen(log, "ATT", ["TimeUS", "Yaw"])
    yaw = [math.remainder(one, math.tau) for one in np.radians(attitude[:, 1])]
    declination, since_us = declination_of(log)
    return SlowSensors(
        readings([(int(row[1]), row[2]) for row in baro.tolist()], baro[:, 0], pass_us),
        readings([(int(row[1]), row[2:]) for row in mag], mag[:, 0], pass_us),
        readings(declination, since_us, pass_us),
        readings(yaw, attitude[:, 0], pass_us),
    )


def declination_of(log: LogColumns) -> tuple[list[float], list[float]]:
    """Return the magnetic declination in rad that a log's compass had, and from when on in us since boot.

    It is COMPASS_DEC until the vehicle knows where it is, by an origin or a position, and that of the place then
    (Compass::try_set_initial_location), unless COMPASS_AUTODEC is 0.
    """
    params = parameters(log)
    default = params.get("COMPASS_DEC", 0.0)
    origins, _ = chosen(log, "ORGN", ["TimeUS", "Lat", "Lng", "Type"])
    positions, _ = chosen(log, "POS", ["TimeUS", "Lat", "Lng"])
    places = [*origins[origins[:, 3] == _EKF_ORIGIN, :3][:1].tolist(), *positions[:1].tolist()]
    if not places or not params.get("COMPASS_AUTODEC", 1.0):
        return [default], [-1.0]
    since_us, lat_deg, lng_deg = min(places)
    place = Location(round(1e7 * lat_deg), round(1e7 * lng_deg), 0)
    return [default, float(get_declination_rad(place))], [-1.0, since_us]


def _timed(log: LogColumns, kind: str, stamp: str, per_us: float, labels: list[str]) -> Array:
    """Return rows of a time of logging in us, the time of the reading, and fields, of the first sensor of a kind."""
    first = first_instance(log, kind)
    if has(log, kind, stamp):
        table, _ = chosen(log, kind, ["TimeUS", stamp, *labels], first)
        return table
    table, _ = chosen(log, kind, ["TimeUS", "TimeUS", *labels], first)
    table[:, 1] = np.floor(table[:, 1] * per_us)
    return table
