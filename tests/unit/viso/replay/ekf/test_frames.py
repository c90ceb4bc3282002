# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""When the filter runs by a log, and on which inertial data."""

import math
from collections.abc import Iterator

import pytest

from ap_core.dataflash import DataFlashWriter
from ap_core.dataflash_columns import LogColumns
from ap_core.log_field import LogValue
from ekf_stub.core.imus import IMU_COLUMNS, TIME_COLUMNS
from viso.logs.logger import STRUCTURES
from viso.replay.ekf.frames import EKF3_RUNS, Frames

BY_NAME = {structure.name: structure for structure in STRUCTURES}
ACCEL_AND_GYRO, ACCEL = 15, 13
Record = tuple[str, list[LogValue]]


def begin(time_us: int, flying_ms: int = 0) -> Record:
    return "RFRH", [time_us, flying_ms]


def inertial(imu: int, first: float, flags: int = ACCEL_AND_GYRO) -> Record:
    return "RISI", [first, 2.0, 3.0, 4.0, 5.0, 6.0, 0.5, 0.25, flags, imu]


def runs(late: int = 0) -> Record:
    return "RFRF", [EKF3_RUNS, late << 4]


def estimates() -> Record:
    return "XKF4", [0] * len(BY_NAME["XKF4"].format)


def frames(*records: Record, until_us: float = math.inf) -> Frames:
    writer = DataFlashWriter(STRUCTURES)
    data = b"".join([*writer.start_up([], time_us=0), *(writer.record(BY_NAME[name], row) for name, row in records)])
    return Frames(LogColumns(data), until_us)


def rows(log: Frames, imus: int = 1) -> Iterator[list[float]]:
    table, first, end = log.rows(0, imus)
    width = TIME_COLUMNS + IMU_COLUMNS * imus
    assert (first, end, len(table)) == (0, len(log), width * len(log))
    yield from (table[width * frame : width * (frame + 1)] for frame in range(end))


def test_frame_has_times_and_what_the_imu_says() -> None:
    log = frames(begin(5000, 7), inertial(0, 1.0), runs(late=1))
    assert list(rows(log)) == [[5000, 7, 1, 1, 2, 3, 4, 5, 6, 0.5, 0.25]]


def test_inertial_data_stand_until_they_change() -> None:
    log = frames(begin(1), inertial(0, 1.0), runs(), begin(2), runs(), begin(3), inertial(0, 9.0), runs())
    assert [row[TIME_COLUMNS] for row in rows(log)] == [1, 1, 9]


def test_inertial_data_are_those_of_each_imu() -> None:
    log = frames(begin(1), inertial(0, 1.0), runs(), begin(2), inertial(1, 5.0), runs())
    first_of_each = [(row[TIME_COLUMNS], row[TIME_COLUMNS + IMU_COLUMNS]) for row in rows(log, imus=2)]
    assert first_of_each == [(1, 0), (1, 5)]
    assert (log.imus_with_data(0), log.imus_with_data(1)) == ([0], [0, 1])


def test_frame_in_which_the_filter_does_not_run_is_left_out() -> None:
    log = frames(begin(1), inertial(0, 1.0), begin(2), ("RFRF", [1, 0]), begin(3), runs())
    assert log.time_us.tolist() == [3]
    assert log.begin_times_us.tolist() == [1, 2, 3]


def test_filter_has_run_before_estimates_that_come_before_the_frames_end() -> None:
    log = frames(begin(1), inertial(0, 1.0), estimates(), runs(), begin(2), inertial(0, 2.0), runs(), estimates())
    first, second = log.runs < log.starts
    assert first
    assert not second


def test_sensors_may_be_used_as_their_flags_say() -> None:
    log = frames(begin(1), inertial(0, 1.0), runs(), begin(2), runs(), begin(3), inertial(0, 1.0, ACCEL), runs())
    assert [log.usable(frame, 0) for frame in range(3)] == [(True, True), (True, True), (False, True)]
    assert log.changes_of_use().tolist() == [2]


def test_log_is_read_up_to_a_time() -> None:
    log = frames(begin(1), inertial(0, 1.0), runs(), begin(5), runs(), begin(6), runs(), until_us=5)
    assert log.time_us.tolist() == [1, 5]


def test_time_may_stand_still_and_not_run_backwards() -> None:
    assert frames(begin(5), inertial(0, 1.0), runs(), begin(5), runs()).problem() is None
    problem = frames(begin(5), inertial(0, 1.0), runs(), begin(4), runs()).problem()
    assert problem is not None
    assert str(problem[1]) == "RFRH.TimeUS runs backwards, from 5 to 4"


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_inertial_data_that_are_no_numbers_are_a_problem_from_there_on(value: float) -> None:
    log = frames(begin(1), inertial(0, 1.0), runs(), begin(2), inertial(0, value), runs())
    problem = log.problem()
    assert problem is not None
    assert str(problem[1]) == f"RISI.DVX is {value}"
    assert log.starts[0] < problem[0] < log.starts[1]
