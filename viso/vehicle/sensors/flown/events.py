# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The events of a flight in a log besides its motion: arming, lift-off, source sets, the origin, and the GPS."""

import math
from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from ap_core.dataflash_columns import LogColumns
from ap_core.location import Location
from ap_core.vector3 import Vector3f
from ekf_stub.inputs.measurements import FIX_3D, USUAL_LAG_S, Array, GpsSample
from viso.logs.filter_records import logs_while_armed_alone, rows_of
from viso.vehicle.sensors.flight import (
    Event,
    Happening,
    Ints,
    Readings,
    chosen,
    first_instance,
    has,
    parameters,
    readings,
)

_ARMED, _DISARMED = 10, 11  # of EV
_SWITCHES: Final = {
    28: (Happening.LIFTED_OFF, None),
    18: (Happening.LANDED, None),
    **{85 + number: (Happening.SOURCE_SET, number) for number in range(3)},
}
_EKF_ORIGIN: Final = 0  # of ORGN.Type
_HIGHEST_M: Final = 1e6
_NOT_KNOWN: Final = 655.35  # of GPA's accuracies
_UBLOX_LAG_S: Final = 0.12  # from series 7 on


def events_of(log: LogColumns) -> tuple[Event, ...]:
    """Return what happened in a log, in the order of time; one that begins armed, or in flight, begins with that."""
    begun_us = int(chosen(log, "ATT", ["TimeUS"])[0][:1].sum())
    found = [*_arming(log, begun_us), *_switches(log, begun_us), *_origins(log)]
    return tuple(sorted(found, key=lambda event: event.time_us))


def _arming(log: LogColumns, begun_us: int) -> Iterator[Event]:
    table, _ = chosen(log, "ARM", ["TimeUS", "ArmState"])
    if not len(table):
        table, _ = chosen(log, "EV", ["TimeUS", "Id"])
        table = table[np.isin(table[:, 1], (_ARMED, _DISARMED))]
        table[:, 1] = table[:, 1] == _ARMED
    if not len(table) and logs_while_armed_alone(log):
        yield Event(begun_us, Happening.ARMED)
    for number, (time_us, armed) in enumerate(table.tolist()):
        if number == 0 and not armed:
            yield Event(begun_us, Happening.ARMED)
        yield Event(int(time_us), Happening.ARMED if armed else Happening.DISARMED)


def _switches(log: LogColumns, begun_us: int) -> Iterator[Event]:
    table, _ = chosen(log, "EV", ["TimeUS", "Id"])
    known = [(int(time_us), *_SWITCHES[int(what)]) for time_us, what in table.tolist() if what in _SWITCHES]
    landings = [what for _, what, _ in known if what in (Happening.LIFTED_OFF, Happening.LANDED)]
    if landings[:1] == [Happening.LANDED]:
        yield Event(begun_us, Happening.LIFTED_OFF)
    yield from (Event(*one) for one in known)


def _origins(log: LogColumns) -> Iterator[Event]:
    if has(log, "RFRH", "TimeUS") and not log.counts.get("RSO3"):
        return  # nobody set it: the filter did, by GPS
    for row in chosen(log, "ORGN", ["Type", "TimeUS", "Lat", "Lng", "Alt"])[0].tolist():
        place = _place(row[2:])
        if row[0] == _EKF_ORIGIN and place.is_valid():
            yield Event(int(row[1]), Happening.ORIGIN, place)


def _place(degrees_and_m: Sequence[float]) -> Location:
    lat, lng, alt_m = degrees_and_m
    return Location(round(lat * 1e7), round(lng * 1e7), round(min(max(alt_m, -_HIGHEST_M), _HIGHEST_M) * 100))


def gps_of(log: LogColumns, pass_us: npt.ArrayLike) -> Readings[GpsSample]:
    """Return the solutions of the first receiver (GPS, with GPA), as each pass had them."""
    labels = ["TimeUS", "Status", "NSats", "HDop", "Lat", "Lng", "Alt", "Spd", "GCrs", "VZ"]
    table, begins = chosen(log, "GPS", labels, first_instance(log, "GPS"))
    quality = _quality(log, table[:, 0])
    lags_s = _lags_s(log, begins)
    samples, last_fix_ms = [], 0
    for row, (time_ms, vdop, *accuracies, has_vertical), lag_s in zip(
        table.tolist(), quality.tolist(), lags_s.tolist(), strict=True
    ):
        _, fix_type, satellites, hdop, lat, lng, alt_m, speed, course_deg, down = row
        last_fix_ms = int(time_ms) if fix_type >= FIX_3D else last_fix_ms
        course = math.radians(course_deg)
        horizontal, vertical, of_speed = (value if value < _NOT_KNOWN else None for value in accuracies)
        samples.append(
            GpsSample(
                int(time_ms),
                int(fix_type),
                _place((lat, lng, alt_m)),
                Vector3f(speed * math.cos(course), speed * math.sin(course), down),
                int(satellites),
                round(hdop * 100),
                round(vdop * 100),
                has_vertical_velocity=bool(has_vertical),
                speed_accuracy=of_speed,
                horizontal_accuracy=horizontal,
                vertical_accuracy=vertical,
                last_fix_ms=last_fix_ms,
                lag_s=lag_s,
            )
        )
    return readings(samples, table[:, 0], pass_us)


def _lags_s(log: LogColumns, begins: Ints) -> Array:
    """Return how late each solution of a GPS was taken to be: by replay records, a parameter, or the kind of receiver.

    Source: AP_GPS::get_lag, AP_GPS_UBLOX::get_lag.
    """
    told, of_told = chosen(log, "RGPI", ["Lg"], 0)
    if len(told):
        lags_s: Array = told[np.maximum(np.searchsorted(of_told, begins) - 1, 0), 0]
        return lags_s
    params = parameters(log)
    delay_ms = params.get("GPS1_DELAY_MS", params.get("GPS_DELAY_MS", 0.0))
    is_ublox = any("u-blox" in str(text) for _, text in rows_of(log, "MSG", "Message"))
    by_kind_s = _UBLOX_LAG_S if is_ublox else USUAL_LAG_S
    return np.full(len(begins), 1e-3 * delay_ms if delay_ms > 0 else by_kind_s)


def _quality(log: LogColumns, time_us: Array) -> Array:
    """Return GPA of solutions: ms since boot, VDOP, accuracies of place, height, speed, vertical velocity."""
    quality, _ = chosen(log, "GPA", ["TimeUS", "SMS", "VDop", "HAcc", "VAcc", "SAcc", "VV"], first_instance(log, "GPA"))
    unknown = np.tile([np.nan, _NOT_KNOWN, _NOT_KNOWN, _NOT_KNOWN, _NOT_KNOWN, 1.0], (len(time_us), 1))
    unknown[:, 0] = time_us // 1000
    if not len(quality):
        return unknown
    nearest = np.clip(np.searchsorted(quality[:, 0], time_us), 0, len(quality) - 1)
    same: Array = np.where((quality[nearest, 0] == time_us)[:, None], quality[nearest, 1:], unknown)
    return same
