# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The flight of a log, ready to be flown again: each pass of the main loop, and what happened between them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Final, Generic, NamedTuple, TypeVar

import numpy as np
import numpy.typing as npt

from ap_core.dataflash_columns import LogColumns
from ap_core.location import Location
from ekf_stub.ahrs.ahrs_base import AHRS_START_US
from ekf_stub.inputs.measurements import Array, GpsSample
from viso.estimators.series import IMPOSSIBLE_S
from viso.logs.filter_records import parameters_in

T = TypeVar("T")
Ints = npt.NDArray[np.int64]

TIME: Final = "TimeUS"
PASS_US: Final = 2500
REST_S: Final = 10.0
"""A log that begins later after boot is assumed to begin with a vehicle that stood still for so long."""


class Basis(Enum):
    """What the motion of a flight is made of."""

    REPLAY = "the log's replay records"
    IMU = "the log's IMU records"
    ESTIMATE = "a motion reconstructed from what the filter believed in flight, smoothed"


@dataclass(frozen=True, slots=True)
class Readings(Generic[T]):
    """The readings of a slow sensor, and which was the newest in each pass; -1 for none yet."""

    values: Sequence[T]
    newest: Ints

    def at(self, index: int) -> T | None:
        """Return what was newest in a pass."""
        number = int(self.newest[index])
        return None if number < 0 else self.values[number]


def readings(values: Sequence[T], keys: npt.ArrayLike, of_passes: npt.ArrayLike) -> Readings[T]:
    """Return values as readings: each is there from the first pass on that comes after it.

    Args:
        values: one after the other.
        keys: of each value, in order: its time, or its place in the log.
        of_passes: the same of each pass.
    """
    growing_keys = np.maximum.accumulate(np.asarray(keys)) if len(values) else np.zeros(0)
    return Readings(values, np.searchsorted(growing_keys, np.asarray(of_passes)) - 1)


class FlownImu(NamedTuple):
    """Data of one of several IMUs: see ``Flight.deltas``; and whether gyro and accelerometer were used, [passes]."""

    deltas: Array
    has_gyro: npt.NDArray[np.bool_]
    has_accel: npt.NDArray[np.bool_]


class Happening(Enum):
    """An event of a vehicle that its sensors do not show."""

    ARMED = "armed"
    DISARMED = "disarmed"
    LIFTED_OFF = "lifted off"
    LANDED = "landed"
    SOURCE_SET = "source set"
    ORIGIN = "origin"


@dataclass(frozen=True, slots=True)
class Event:
    """Something that happened, in us since boot; ``value`` is a source set, 0..2, or the place of the origin."""

    time_us: int
    what: Happening
    value: int | Location | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Flight:
    """A flight.

    Attributes:
        basis: what the motion is made of.
        time_us: of each pass, since boot, growing.
        deltas: change of velocity (m/s) and rotation (rad) by axis, body, and the seconds of each, [passes, 8].
        baro: time in ms and height in m.
        mag: time in us and field in mGauss, body.
        declination: of the magnetic field, rad.
        yaw_rad: of the log's own estimate.
        gps: solutions of the primary receiver.
        events: what happened, in order.
        track: where the log's own filter says it was, while it knew: time in us and NED in m, [N, 4].
        notes: how it was made, a line each.
        ahrs_start_us: when the AHRS started, since boot.
        imus: what all IMUs said, of a log that tells of several.
        expected: whether a take-off was expected, and whether a touchdown was, of a log that tells it.
    """

    basis: Basis
    time_us: Ints
    deltas: Array
    baro: Readings[tuple[int, float]]
    mag: Readings[tuple[int, Array]]
    declination: Readings[float]
    yaw_rad: Readings[float]
    gps: Readings[GpsSample]
    events: Sequence[Event]
    track: Array
    notes: tuple[str, ...] = ()
    ahrs_start_us: int = AHRS_START_US
    imus: tuple[FlownImu, ...] = ()
    expected: Readings[tuple[bool, bool]] | None = None

    @property
    def tells_flying(self) -> bool:
        """Whether the log has the times of lift-off and landing."""
        return any(event.what in (Happening.LIFTED_OFF, Happening.LANDED) for event in self.events)

    def told(self) -> tuple[str, ...]:
        """Return what the vehicle moves by, and how that was made, a line each."""
        return (f"the vehicle moves by {self.basis.value}", *self.notes)


# Columns of a log


def has(log: LogColumns, kind: str, *labels: str) -> bool:
    """Return whether a log has records of a type with such fields."""
    return kind in log.counts and set(labels) <= set(log.types[kind].labels)


def first_instance(log: LogColumns, kind: str) -> int | None:
    """Return the least number among the instances of a type; None where records have none."""
    return int(log.columns(kind, ["I"])["I"].min()) if has(log, kind, "I") else None


def chosen(log: LogColumns, kind: str, labels: Sequence[str], instance: int | None = None) -> tuple[Array, Ints]:
    """Return fields of the records of a type, a row each, and where these begin in the log.

    Rows with a number that is not finite are left out, and such with a TimeUS that damage made up; with an instance
    those of others as well. There are none without the type, or where a field is no number.
    """
    columns = list(log.columns(kind, labels).values()) if has(log, kind, *labels) else []
    if not columns or any(column.ndim != 1 or column.dtype.kind not in "iuf" for column in columns):
        return np.zeros((0, len(labels))), np.zeros(0, np.int64)
    table = np.column_stack([column.astype(np.float64) for column in columns])
    kept = np.isfinite(table).all(axis=1)
    label = next((name for name in ("I", "C") if name in log.types[kind].labels), None)
    if instance is not None and label is not None:
        kept &= log.columns(kind, [label])[label] == instance
    if TIME in labels and kept.any():
        times = table[:, list(labels).index(TIME)]
        kept &= np.abs(times - np.median(times[kept])) < IMPOSSIBLE_S * 1e6
    return table[kept], log.offsets(kind)[kept]


def parameters(log: LogColumns) -> dict[str, float]:
    """Return the parameters with which a log began."""
    return dict(reversed([(name, value) for _, name, value in parameters_in(log)]))


def growing(time_us: Array) -> npt.NDArray[np.bool_]:
    """Return which times come after all before them."""
    newest = np.maximum.accumulate(time_us) if len(time_us) else time_us
    return np.concatenate([np.ones(min(len(time_us), 1), bool), time_us[1:] > newest[:-1]])


def imu_of(log: LogColumns, lane: int) -> int:
    """Return the IMU of a lane, by EK3_IMU_MASK, 1 where the log has no number for it."""
    logged = parameters(log).get("EK3_IMU_MASK", 1.0)
    mask = int(logged) if math.isfinite(logged) else 1
    imus = [number for number in range(8) if mask >> number & 1] or [0]
    return imus[min(lane, len(imus) - 1)]
