# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The frames of a log with replay records: times and inertial data, read by columns (AP_DAL/LogStructure.h).

A frame begins with RFRH. It holds the changed inputs, RFRF, and records that were logged or passed in from outside.
RISI is written when it differs from the previous frame, and holds until the next one.
"""

from typing import Final

import numpy as np
import numpy.typing as npt

from ap_core.dataflash_columns import LogColumns
from ekf_stub.core.imus import IMU_COLUMNS, MAX_IMUS, TIME_COLUMNS
from ekf_stub.inputs.measurements import Array
from ekf_stub.log.replay_log import INERTIAL, USE_ACCEL, USE_GYRO
from viso.logs.recorded import RecordError, table_of

Ints = npt.NDArray[np.int64]

AFTER_THE_FILTER: Final = ("XKF4", "ROFH", "REPH", "REVH", "RBOH", "RSO3", "RSLL", "REV3")
"""Records that follow the filter's run in a frame; RFRF, which confirms the run, may come before or after them."""

EKF3_RUNS: Final = 4 | 8  # of RFRF.FTypes: starts, runs
_SLOW_EKF3: Final = 4  # first bit of RFRF.Slow that is about EKF3
_NEVER: Final = np.iinfo(np.int64).max
_CHUNK: Final = 4096


def _numbers(log: LogColumns, kind: str, *labels: str) -> Array:
    """Return fields of all records of a kind, a row for each record."""
    if not log.counts.get(kind):
        return np.zeros((0, len(labels)))
    try:
        return table_of(log, kind, labels)
    except (KeyError, ValueError) as error:
        raise RecordError(f"{kind} lacks a number in {' or '.join(labels)}") from error


class Frames:
    """All frames up to a time in which EKF3 runs.

    Attributes:
        time_us: of each, since boot.
        is_confirmed: whether RFRF confirms it. The filter starts in no other frame.
        starts: offset of that place in the log, in bytes.
        runs: latest offset at which EKF3 has run: the same, or before the records that follow it in the frame.
        begins, begin_times_us: offset and time of the start of all frames, whether or not EKF3 runs in them.
        end: offset up to which the log is read.
    """

    def __init__(self, log: LogColumns, until_us: float) -> None:
        times = _numbers(log, "RFRH", "TimeUS", "TF")
        begins = log.offsets("RFRH")
        beyond = np.flatnonzero(times[:, 0] > until_us)
        count = int(beyond[0]) if len(beyond) else len(times)
        self.end: int = int(begins[count]) if count < len(begins) else _NEVER
        self.begins: Ints = begins[:count]
        self.begin_times_us: Ints = times[:count, 0].astype(np.int64)
        ends = np.append(self.begins[1:], self.end)
        done = _numbers(log, "RFRF", "FTypes", "Slow")
        done_at = log.offsets("RFRF")
        runs = done[:, 0].astype(np.int64) & EKF3_RUNS != 0
        starts = _first_within(done_at[runs], self.begins, ends)
        others = np.sort(np.concatenate([np.zeros(0, np.int64), *map(log.offsets, AFTER_THE_FILTER)]))
        latest = np.minimum(starts, _first_within(others, self.begins, ends) - 1)
        late = _value_within(done_at, done[:, 1], self.begins, ends).astype(np.int64) >> _SLOW_EKF3
        kept = latest < _NEVER - 1
        self.runs: Ints = latest[kept]
        self.is_confirmed = (starts < _NEVER)[kept]
        self.starts: Ints = np.where(starts < _NEVER, starts, latest)[kept]
        self.time_us: Ints = self.begin_times_us[kept]
        self._flying_ms, self._late = times[:count, 1][kept], late[kept]
        readings, places = _numbers(log, "RISI", *INERTIAL, "Flags", "I"), log.offsets("RISI")
        imu_of = readings[:, -1]
        self._imus = [_Imu(readings[imu_of == imu, :-1], places[imu_of == imu], self.runs) for imu in range(MAX_IMUS)]
        self._chunk_of = -1
        self._chunk: list[float] = []

    def __len__(self) -> int:
        return len(self.time_us)

    def problem(self) -> tuple[int, RecordError] | None:
        """Return the offset from which on the log cannot be used, and why; None if all of it can."""
        found = [imu.bad for imu in self._imus if imu.bad is not None]
        backwards = np.flatnonzero(np.diff(self.begin_times_us) < 0)
        if len(backwards):
            before, after = self.begin_times_us[backwards[0] : backwards[0] + 2]
            place = int(self.begins[backwards[0] + 1])
            found.append((place, f"RFRH.TimeUS runs backwards, from {before} to {after}"))
        if not found:
            return None
        place, text = min(found)
        return place, RecordError(text)

    def imus_with_data(self, frame: int) -> list[int]:
        """Return the numbers of the IMUs that have data up to a frame."""
        return [number for number, imu in enumerate(self._imus) if imu.row[frame] >= 0]

    def usable(self, frame: int, imu: int) -> tuple[bool, bool]:
        """Return whether gyro and accelerometer of an IMU may be used in a frame."""
        flags = self._imus[imu].flags[self._imus[imu].row[frame]]
        return bool(flags & USE_GYRO), bool(flags & USE_ACCEL)

    def changes_of_use(self) -> Ints:
        """Return the frames at which the IMUs that have data, or that may be used, change."""
        changed = [np.flatnonzero(np.diff(imu.use_of_frames())) + 1 for imu in self._imus]
        return np.unique(np.concatenate(changed))

    def rows(self, frame: int, imus: int) -> tuple[list[float], int, int]:
        """Return rows for the filter with the data of the first ``imus`` IMUs, among them that of a frame.

        Returns:
            The rows of several frames, one after the other; the number of the first frame, and that after the last.
        """
        chunk = frame // _CHUNK
        first, end = chunk * _CHUNK, min((chunk + 1) * _CHUNK, len(self))
        if chunk != self._chunk_of:
            self._chunk_of = chunk
            table = np.zeros((end - first, TIME_COLUMNS + IMU_COLUMNS * imus))
            table[:, 0] = self.time_us[first:end]
            table[:, 1] = self._flying_ms[first:end]
            table[:, 2] = self._late[first:end]
            for number, imu in enumerate(self._imus[:imus]):
                at = TIME_COLUMNS + IMU_COLUMNS * number
                rows = imu.row[first:end]
                table[rows >= 0, at : at + IMU_COLUMNS] = imu.deltas[rows[rows >= 0]]
            self._chunk = table.reshape(-1).tolist()
        return self._chunk, first, end


class _Imu:
    """The data of an IMU.

    Attributes:
        deltas, flags: of each of its records.
        row: the number of the valid record in each frame, -1 before the first.
        bad: the offset of the first record that cannot be used, and why; None if all can.
    """

    def __init__(self, readings: Array, places: Ints, until: Ints) -> None:
        self.deltas, self.flags = readings[:, :-1], readings[:, -1].astype(np.int64)
        self.row: Ints = np.searchsorted(places, until) - 1
        self.bad: tuple[int, str] | None = None
        bad = np.argwhere(~np.isfinite(self.deltas))
        if len(bad):
            record, column = bad[0].tolist()
            self.bad = int(places[record]), f"RISI.{INERTIAL[column]} is {self.deltas[record, column]}"

    def use_of_frames(self) -> Ints:
        """Return for each frame the flags of the sensors that may be used; -1 without data."""
        if not len(self.flags):
            return self.row
        use: Ints = np.where(self.row >= 0, self.flags[np.maximum(self.row, 0)] & (USE_ACCEL | USE_GYRO), -1)
        return use


def _first_within(places: Ints, begins: Ints, ends: Ints) -> Ints:
    """Return the first place in each stretch from begin to end; _NEVER where there is none. Places are sorted."""
    found = np.append(places, _NEVER)[np.searchsorted(places, begins)]
    inside: Ints = np.where(found < ends, found, _NEVER)
    return inside


def _value_within(places: Ints, values: Array, begins: Ints, ends: Ints) -> Array:
    """Return the value at the first place in each stretch; 0 where there is none. Places are sorted."""
    at = np.searchsorted(places, begins)
    is_inside = np.append(places, _NEVER)[at] < ends
    found: Array = np.where(is_inside, np.append(values, 0.0)[at], 0.0)
    return found
