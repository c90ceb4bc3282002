# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Barometer, compass and heading of any log, as each pass of the main loop had them."""

import math
from typing import Final, NamedTuple

import numpy as np

from ap_core.dataflash_columns import LogColumns
from ekf_stub.inputs.measurements import Array
from viso.vehicle.sensors.flight import Ints, Readings, chosen, first_instance, has, parameters, readings

_CORE: Final = 0
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
    declination, since_us = declination_of(log, parameters(log).get("COMPASS_DEC", 0.0))
    return SlowSensors(
        readings([(int(row[1]), row[2]) for row in baro.tolist()], baro[:, 0], pass_us),
        readings([(int(row[1]), row[2:]) for row in mag], mag[:, 0], pass_us),
        readings(declination, since_us, pass_us),
        readings(yaw, attitude[:, 0], pass_us),
    )


def declination_of(log: LogColumns, default: float) -> tuple[list[float], list[float]]:
    """Return the magnetic declination in rad that a log's filter used, and from when on in us since boot.

    No ordinary record tells it. The filter has it from a table as soon as it has an origin, and turns its earth field
    (XKF2) by it; the compass has it once there is a place (POS). Before that it is the default.
    """
    origins, _ = chosen(log, "ORGN", ["TimeUS", "Type"])
    origins = origins[origins[:, 1] == _EKF_ORIGIN, 0]
    places, _ = chosen(log, "POS", ["TimeUS"])
    since_us = min([*origins[:1].tolist(), *places[:1, 0].tolist()], default=0.0)
    field, _ = chosen(log, "XKF2", ["TimeUS", "MN", "ME"], _CORE)
    field = field[field[:, 1:].any(axis=1)]
    if not len(field):
        return [default], [-1.0]
    first = np.searchsorted(field[:-1, 0], origins[0] if len(origins) else math.inf)
    return [default, math.atan2(field[first, 2], field[first, 1])], [-1.0, since_us]


def _timed(log: LogColumns, kind: str, stamp: str, per_us: float, labels: list[str]) -> Array:
    """Return rows of a time of logging in us, the time of the reading, and fields, of the first sensor of a kind."""
    first = first_instance(log, kind)
    if has(log, kind, stamp):
        table, _ = chosen(log, kind, ["TimeUS", stamp, *labels], first)
        return table
    table, _ = chosen(log, kind, ["TimeUS", "TimeUS", *labels], first)
    table[:, 1] = np.floor(table[:, 1] * per_us)
    return table
