# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The passes of a main loop that a log with replay records (LOG_REPLAY 1) holds whole.

It has each pass (RFRH to RFRF), and inertial data (RISI), height (RBRI), magnetic field (RMGI) and declination (RMGH)
where they differ from the pass before.
"""

from typing import Final

import numpy as np

from ap_core.dataflash_columns import LogColumns
from viso.logs.recorded import valid_positions
from viso.sensors.flown.events import ahrs_start_us, events_of, gps_of
from viso.sensors.flown.flight import Basis, Flight, Ints, Readings, chosen, growing, imu_of, readings
from viso.sensors.flown.slow_sensors import slow_sensors

_DELTA: Final = ("DVX", "DVY", "DVZ", "DAX", "DAY", "DAZ", "DVDT", "DADT")


def replay_records(log: LogColumns, lane: int) -> Flight | None:
    """Return the flight of a log with replay records of a lane's IMU; None for one without."""
    times, begins = chosen(log, "RFRH", ["TimeUS"])
    deltas, of_deltas = chosen(log, "RISI", _DELTA, imu_of(log, lane))
    if not len(deltas):
        deltas, of_deltas = chosen(log, "RISI", _DELTA, 0)
    ends = log.offsets("RFRF")
    of_time, of_delta = (np.searchsorted(places, ends) - 1 for places in (begins, of_deltas))
    known = (of_time >= 0) & (of_delta >= 0)
    time_us = times[of_time[known], 0].astype(np.int64)
    if not len(time_us):
        return None
    kept = growing(time_us)
    ends, time_us = ends[known][kept], time_us[kept]
    baro, of_baro = chosen(log, "RBRI", ["LastUpdate", "Alt"], 0)
    mag, of_mag = chosen(log, "RMGI", ["LU", "FX", "FY", "FZ"], 0)
    slow = slow_sensors(log, time_us)
    return Flight(
        Basis.REPLAY,
        time_us,
        deltas[of_delta[known][kept]],
        readings([(int(time_ms), height) for time_ms, height in baro.tolist()], of_baro, ends),
        readings([(int(row[0]), row[1:]) for row in mag], of_mag, ends),
        _declination(log, ends) or slow.declination,
        slow.yaw_rad,
        gps_of(log, time_us),
        events_of(log),
        valid_positions(log, lane),
        ahrs_start_us=ahrs_start_us(log),
    )


def _declination(log: LogColumns, ends: Ints) -> Readings[float] | None:
    """Return what RMGH says; the last of it from the origin on, when the filter has a table for its place."""
    values, begins = chosen(log, "RMGH", ["Dec"])
    if not len(values):
        return None
    origin = log.offsets("ORGN")[:1]
    before = begins < origin.min(initial=begins[-1])
    numbers, places = values[before, 0].tolist(), begins[before].tolist()
    return readings([*numbers, float(values[-1, 0])], [*places, origin.min(initial=begins[-1])], ends)
