# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The passes of a main loop that a log with replay records (LOG_REPLAY 1) holds whole.

It has each pass (RFRH to RFRF), and inertial data (RISI), height (RBRI), magnetic field (RMGI) and declination (RMGH)
where they differ from the pass before; RFRN tells when take-off and touchdown were expected.
"""

from collections.abc import Sequence

import numpy as np

from ap_core.dataflash_columns import LogColumns
from ekf_stub.core.imus import MAX_IMUS
from ekf_stub.inputs.measurements import Array
from ekf_stub.log.replay_log import INERTIAL, TAKEOFF_EXPECTED, TOUCHDOWN_EXPECTED, USE_ACCEL, USE_GYRO
from viso.logs.recorded import ahrs_start_us, valid_positions
from viso.vehicle.sensors.flight import Basis, Flight, FlownImu, Ints, Readings, chosen, growing, imu_of, readings
from viso.vehicle.sensors.flown.events import events_of, gps_of
from viso.vehicle.sensors.flown.slow_sensors import slow_sensors


def replay_records(log: LogColumns, lane: int) -> Flight | None:
    """Return the flight of a log with replay records; None for one without.

    Of a log with the records of all IMUs it has them all; of one with those of the lane's IMU alone it has these.
    """
    times, begins = chosen(log, "RFRH", ["TimeUS"])
    imus = [chosen(log, "RISI", (*INERTIAL, "Flags"), imu) for imu in _imus_in(log)]
    lane_imu = imu_of(log, lane)
    deltas, of_deltas = imus[0] if len(imus) > 1 else chosen(log, "RISI", (*INERTIAL, "Flags"), lane_imu)
    if not len(deltas):
        deltas, of_deltas = chosen(log, "RISI", (*INERTIAL, "Flags"), 0)
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
        deltas[of_delta[known][kept], :-1],
        readings([(int(time_ms), height) for time_ms, height in baro.tolist()], of_baro, ends),
        readings([(int(row[0]), row[1:]) for row in mag], of_mag, ends),
        _declination(log, ends) or slow.declination,
        slow.yaw_rad,
        gps_of(log, time_us),
        events_of(log),
        valid_positions(log, lane),
        imus=_flown(imus, ends),
        ahrs_start_us=ahrs_start_us(log),
        expected=_expected(log, ends),
    )


def _imus_in(log: LogColumns) -> list[int]:
    """Return the IMUs of which a log has data, as far as it has those of all before them."""
    has_data = [bool(chosen(log, "RISI", ["DVDT"], imu)[0].any()) for imu in range(MAX_IMUS)]
    return [imu for imu in range(MAX_IMUS) if all(has_data[: imu + 1])]


def _flown(imus: Sequence[tuple[Array, Ints]], ends: Ints) -> tuple[FlownImu, ...]:
    """Return the data of each IMU in each pass; nothing where all IMUs have the same data."""
    newest = [table[np.maximum(np.searchsorted(begins, ends) - 1, 0)] for table, begins in imus]
    if all(np.array_equal(newest[0], table) for table in newest[1:]):
        return ()
    flags = [table[:, -1].astype(int) for table in newest]
    return tuple(
        FlownImu(table[:, :-1], uses & USE_GYRO > 0, uses & USE_ACCEL > 0)
        for table, uses in zip(newest, flags, strict=True)
    )


def _expected(log: LogColumns, ends: Ints) -> Readings[tuple[bool, bool]] | None:
    """Return the flags of take-off and touchdown in RFRN; None without it."""
    flags, begins = chosen(log, "RFRN", ["Flags"])
    if not len(flags):
        return None
    values = flags[:, 0].astype(int).tolist()
    expected = [(value & TAKEOFF_EXPECTED > 0, value & TOUCHDOWN_EXPECTED > 0) for value in values]
    return readings(expected, begins, ends)


def _declination(log: LogColumns, ends: Ints) -> Readings[float] | None:
    """Return the declination of RMGH; None without it."""
    values, begins = chosen(log, "RMGH", ["Dec"])
    if not len(values):
        return None
    return readings(values[:, 0].tolist(), begins, ends)
