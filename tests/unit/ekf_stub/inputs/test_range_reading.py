# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Ranges as they are read: medians, substitutes on the ground, and where they are measured."""

import numpy as np
import pytest

from ekf_stub.filter.attitude import matrix_of_quat, quat_of_euler
from ekf_stub.inputs.range_reading import RangeReading
from ekf_stub.inputs.range_state import DOWNWARD, FinderState, RangeState, RangeStatus

LEVEL = np.eye(3)


def read(reading: RangeReading, *distances: float, start_ms: int = 1000, on_ground: bool = False) -> None:
    for index, distance in enumerate(distances):
        finders = RangeState((FinderState((0.0, 0.0, 0.0), distance, DOWNWARD, RangeStatus.GOOD),), 0.1, 40.0)
        reading.read(finders, start_ms + 60 * index, on_ground=on_ground)


@pytest.mark.parametrize(("distances", "median", "time_ms"), [
    ((3.0, 9.0, 4.0), 4.0, 1095),
    ((3.0, 5.0, 9.0), 5.0, 1035),
    ((5.0, 5.0, 5.0), 5.0, 1035),
    ((9.0, 3.0, 5.0), 5.0, 1095),
    ((0.01, 0.02, 0.03), 0.1, 1035),
])  # fmt: skip
def test_median_of_three_is_dated_by_its_sample(distances: tuple[float, ...], median: float, time_ms: int) -> None:
    reading = RangeReading(4)
    read(reading, *distances)
    assert reading.newest == median
    reading.recall(time_ms - 1, LEVEL)
    assert not reading.is_due
    reading.recall(time_ms, LEVEL)
    assert reading.is_due
    assert reading.distance == median


def test_two_samples_are_too_few_and_old_ones_do_not_count() -> None:
    reading = RangeReading(4)
    read(reading, 3.0, 3.0)
    read(reading, 3.0, start_ms=1600)
    assert reading.newest == 0.0
    assert not reading.is_fresh(1600)


def test_no_more_than_twenty_a_second_are_read() -> None:
    reading = RangeReading(4)
    for now_ms in (1000, 1020, 1040, 1050):
        read(reading, 3.0, start_ms=now_ms)
    assert reading.newest == 0.0
    read(reading, 3.0, start_ms=1051)
    read(reading, 3.0, start_ms=1102)
    assert reading.newest == 3.0


def test_on_the_ground_the_height_of_the_sensor_stands_in_for_what_is_missing() -> None:
    reading = RangeReading(4)
    read(reading, 3.0, on_ground=True)
    assert reading.newest == reading.on_ground == 0.1
    assert reading.is_fresh(1499)
    assert not reading.is_fresh(1500)


def test_sensor_that_sees_nothing_is_not_read_even_on_the_ground() -> None:
    reading = RangeReading(4)
    finder = FinderState((0.0, 0.0, 0.0), 3.0, DOWNWARD, RangeStatus.TOO_FAR)
    reading.read(RangeState((finder,), 0.02), 1000, on_ground=True)
    assert reading.newest == 0.0
    assert reading.on_ground == 0.05


def test_range_is_moved_to_the_imu() -> None:
    reading = RangeReading(4)
    finders = RangeState((FinderState((0.5, 0.0, 0.2), 3.0, DOWNWARD, RangeStatus.GOOD),))
    for now_ms in (1000, 1060, 1120):
        reading.read(finders, now_ms, on_ground=False)
    rotation = matrix_of_quat(quat_of_euler(0.0, 0.1, 0.0))
    reading.recall(1100, rotation)
    assert reading.distance == pytest.approx(3.0 + 0.2 - 0.5 * np.tan(0.1))


def test_it_begins_anew_without_what_it_had() -> None:
    reading = RangeReading(4)
    read(reading, 3.0, 3.0, 3.0)
    reading.reset(5000)
    reading.recall(1100, LEVEL)
    assert not reading.is_due
    assert reading.newest == 0.0
    assert reading.is_fresh(5499)
