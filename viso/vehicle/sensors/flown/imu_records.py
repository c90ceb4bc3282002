# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Passes of a main loop made of the IMU records of an ordinary log.

IMU holds what gyros and accelerometers said at a moment, 25 times per second or faster, after the low-pass filters of
INS_GYRO_FILTER and INS_ACCEL_FILTER. These are filters of second order, so that a record is about a moment before it,
by sqrt(2) over the angular cut-off: 11 ms at 20 Hz. GYR and ACC (raw IMU logging) come unfiltered, with their time.
"""

import math
from collections.abc import Mapping
from typing import Final, NamedTuple

import numpy as np

from ap_core.dataflash_columns import LogColumns
from ekf_stub.inputs.measurements import Array
from viso.logs.recorded import ahrs_start_us, valid_positions
from viso.vehicle.sensors.flight import PASS_US, REST_S, Basis, Flight, Ints, chosen, growing, imu_of, parameters
from viso.vehicle.sensors.flown.events import events_of, gps_of
from viso.vehicle.sensors.flown.slow_sensors import slow_sensors

GAP_S: Final = 0.5
"""A longer gap between records is bridged by a straight line, and reported."""

BRIDGED_S: Final = 10.0
"""For longer than that there is nothing in between."""

MOST_PASSES: Final = 3 * 3600 * 400
"""Of three hours; what comes after that is left out."""

_FEWEST: Final = 50
_S: Final = 1e-6
_FILTERS: Final = ("INS_GYRO_FILTER", "INS_ACCEL_FILTER")


class Rates(NamedTuple):
    """The data of a sensor of three axes: times in s since boot, growing, and values [N, 3]."""

    time_s: Array
    values: Array


def imu_records(log: LogColumns, lane: int) -> Flight | None:
    """Return the flight by the records of a lane's IMU; None for a log without enough of them."""
    params, imu = parameters(log), imu_of(log, lane)
    gyro, accel = _raw(log, "GYR", imu), _raw(log, "ACC", imu)
    kind = "GYR and ACC"
    if min(len(gyro.time_s), len(accel.time_s)) < _FEWEST:
        gyro, accel = _filtered(log, imu, params)
        kind = "IMU"
    if len(gyro.time_s) < _FEWEST:
        return None
    common = (gyro.time_s >= accel.time_s[0]) & (gyro.time_s <= accel.time_s[-1])
    pass_us = passes_of(gyro.time_s[common])
    if not len(pass_us):
        return None
    begin_s, end_s = edges_of(pass_us)
    del_ang, del_vel = (integral_at(rates, end_s) - integral_at(rates, begin_s) for rates in (gyro, accel))
    rate_hz = 1.0 / float(np.median(np.diff(gyro.time_s)))
    return flight_of(
        log,
        lane,
        Basis.IMU,
        pass_us,
        del_vel,
        del_ang,
        (f"{kind} of IMU {imu}, {rate_hz:.0f} Hz", *gaps_in(gyro.time_s)),
    )


def passes_of(time_s: Array) -> Ints:
    """Return the times in us of the passes of a main loop at 400 Hz while there are records.

    Args:
        time_s: of the records, growing. Where they are more than ``BRIDGED_S`` apart there are no passes.
    """
    if not len(time_s):
        return np.zeros(0, np.int64)
    breaks = np.flatnonzero(np.diff(time_s) > BRIDGED_S)
    starts, ends = (np.ceil(time_s[at] / _S / PASS_US) for at in (np.append(0, breaks + 1), np.append(breaks, -1)))
    passes, left = [], MOST_PASSES
    for start, end in zip(starts.astype(np.int64) + 1, ends.astype(np.int64), strict=True):
        passes.append(np.arange(start, min(end, start + left)) * PASS_US)
        left -= len(passes[-1])
    return np.concatenate(passes)


def edges_of(pass_us: Ints) -> tuple[Array, Array]:
    """Return when each pass begins and ends, in s."""
    end_s: Array = pass_us.astype(np.float64) * _S
    return end_s - PASS_US * _S, end_s


def flight_of(
    log: LogColumns, lane: int, basis: Basis, pass_us: Ints, del_vel: Array, del_ang: Array, notes: tuple[str, ...]
) -> Flight:
    """Return a flight of passes 2.5 ms long, with all other data of an ordinary log.

    A log that begins late begins with a vehicle that stands as it stood in the first pass.

    Args:
        log: the log.
        lane: whose estimate the track is.
        basis: what the motion is made of.
        pass_us: of each pass, since boot.
        del_vel: changes of velocity in m/s, body, [passes, 3].
        del_ang: rotations in rad, body, [passes, 3].
        notes: how that was made.
    """
    begun_s = pass_us[0] * _S
    if begun_s > REST_S:
        rest = round(REST_S / _S / PASS_US)
        still = del_vel[: round(1.0 / _S / PASS_US)].mean(axis=0)
        pass_us = np.concatenate([pass_us[0] - np.arange(rest, 0, -1) * PASS_US, pass_us])
        del_vel = np.concatenate([np.tile(still, (rest, 1)), del_vel])
        del_ang = np.concatenate([np.zeros((rest, 3)), del_ang])
        notes = (*notes, f"begins {begun_s:.0f} s after boot; taken to have stood still for {REST_S:.0f} s before")
    intervals = np.full((len(pass_us), 2), PASS_US * _S)
    return Flight(
        basis,
        pass_us,
        np.column_stack([del_vel, del_ang, intervals]).astype(np.float32).astype(np.float64),
        *slow_sensors(log, pass_us),
        gps_of(log, pass_us),
        events_of(log),
        valid_positions(log, lane),
        notes,
        ahrs_start_us(log),
    )


def _raw(log: LogColumns, kind: str, imu: int) -> Rates:
    axes = [f"{kind.capitalize()}{axis}" for axis in "XYZ"]
    return _rates(chosen(log, kind, ["SampleUS", *axes], imu)[0])


def _filtered(log: LogColumns, imu: int, params: Mapping[str, float]) -> tuple[Rates, Rates]:
    # Before 4.1 each IMU had a type of its own.
    kind = "IMU" if imu == 0 or "I" in (log.types["IMU"].labels if "IMU" in log.types else ()) else f"IMU{imu + 1}"
    axes = [f"{sensor}{axis}" for sensor in ("Gyr", "Acc") for axis in "XYZ"]
    table, _ = chosen(log, kind, ["TimeUS", *axes], imu)
    gyro, accel = (
        _rates(np.column_stack([table[:, 0] - lag_s(params.get(name, 0.0)) / _S, table[:, first : first + 3]]))
        for name, first in zip(_FILTERS, (1, 4), strict=True)
    )
    return gyro, accel


def lag_s(cut_off_hz: float) -> float:
    """Return by how much a low-pass filter of second order (Butterworth) delays what changes slowly; 0 for none."""
    return math.sqrt(2.0) / (2.0 * math.pi * cut_off_hz) if cut_off_hz > 0 else 0.0


def _rates(table: Array) -> Rates:
    table = table[growing(table[:, 0])]
    return Rates(table[:, 0] * _S, table[:, 1:])


def gaps_in(time_s: Array) -> tuple[str, ...]:
    """Return a line about the gaps between records, if there are any."""
    steps = np.diff(time_s)
    gaps = steps[steps > GAP_S]
    told = f"no record for {gaps.sum():.1f} s in {len(gaps)} gaps; up to {BRIDGED_S:g} s each are a straight line"
    return (told,) if len(gaps) else ()


def integral_at(rates: Rates, at_s: Array) -> Array:
    """Return the integral of rates from their first time on, at times between the first and the last.

    Between samples rates are a smooth curve through them; in a gap they are a straight line.
    """
    time_s, values = rates
    steps = np.diff(time_s)[:, None]
    slopes = np.gradient(values, time_s, axis=0)
    bends = np.where(steps <= GAP_S, slopes[:-1] - slopes[1:], 0.0) * steps**2 / 12.0
    whole = np.concatenate([np.zeros((1, 3)), np.cumsum(0.5 * (values[1:] + values[:-1]) * steps + bends, axis=0)])
    return hermite(time_s, whole, values, at_s)


def hermite(time_s: Array, values: Array, slopes: Array, at_s: Array) -> Array:
    """Return the smooth curve that goes through values with slopes, at times between the first and the last."""
    before = np.clip(np.searchsorted(time_s, at_s, side="right") - 1, 0, len(time_s) - 2)
    step = (time_s[before + 1] - time_s[before])[:, None]
    share = (at_s - time_s[before])[:, None] / step
    rest = 1.0 - share
    low, high = values[before], values[before + 1]
    bend_low, bend_high = step * slopes[before] - (high - low), (high - low) - step * slopes[before + 1]
    curve: Array = rest * low + share * high + share * rest * (rest * bend_low + share * bend_high)
    return curve
