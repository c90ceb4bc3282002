# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Gaps in inertial data: what is one depends on how the data usually come."""

from collections.abc import Sequence

import numpy as np
import pytest

from viso.companion.msckf.imu_period import ImuPeriod
from viso.companion.vio.imu_window import IMU_EMPTY, IMU_GAP
from viso.companion.vio.types import ImuSample, ImuWindow

MS = 1_000_000


class Stream:
    """Inertial data at given times, in windows of 100 ms."""

    def __init__(self, times_ms: Sequence[float]) -> None:
        self._times = [round(ms * MS) for ms in times_ms]
        self.period = ImuPeriod()

    def faults(self, from_ms: int, to_ms: int) -> list[str | None]:
        return [self.period.fault(self.window(ms - 100, ms)) for ms in range(from_ms + 100, to_ms + 1, 100)]

    def window(self, from_ms: int, to_ms: int) -> ImuWindow:
        times = np.array(self._times)
        first = max(int(np.searchsorted(times, from_ms * MS, "right")) - 1, 0)
        last = int(np.searchsorted(times, to_ms * MS, "left")) + 1
        samples = tuple(ImuSample(t_ns, np.zeros(3), np.zeros(3)) for t_ns in times[first:last].tolist())
        return ImuWindow(from_ms * MS, to_ms * MS, samples)


@pytest.mark.parametrize("period_ms", [2, 5, 10, 20])
def test_steady_stream_has_no_faults(period_ms: int) -> None:
    assert set(Stream(range(0, 2001, period_ms)).faults(0, 2000)) == {None}


def test_gap_is_one() -> None:
    times = [ms for ms in range(0, 2001, 5) if not 1030 < ms < 1050]
    assert [index for index, fault in enumerate(Stream(times).faults(0, 2000)) if fault == IMU_GAP] == [10]


def test_three_periods_are_no_gap() -> None:
    times = [ms for ms in range(0, 2001, 5) if not 1030 < ms < 1045]
    assert set(Stream(times).faults(0, 2000)) == {None}


def test_jitter_is_no_gap() -> None:
    rng = np.random.default_rng(0)
    times = np.arange(0, 10_001, 5) + rng.uniform(-2, 2, 2001)
    assert set(Stream(times.tolist()).faults(100, 9_900)) == {None}


def test_bunched_stamps_make_no_gaps_later() -> None:
    """Stamps of samples that waited on the link and came all at once."""
    times = [*range(0, 1000, 5), *(1000 + 0.1 * index for index in range(40)), *range(1205, 4001, 5)]
    assert set(Stream(times).faults(1300, 4000)) == {None}


def test_slower_stream_is_one_with_gaps_until_it_is_the_usual_one() -> None:
    stream = Stream([*range(0, 2000, 5), *range(2000, 8001, 20)])
    assert set(stream.faults(0, 2000)) == {None}
    assert set(stream.faults(2000, 3900)) == {IMU_GAP}
    assert set(stream.faults(4200, 8000)) == {None}


def test_faster_stream_is_no_fault() -> None:
    stream = Stream([*range(0, 2000, 20), *range(2000, 4001, 5)])
    assert set(stream.faults(0, 4000)) == {None}


def test_nothing_is_empty() -> None:
    assert ImuPeriod().fault(ImuWindow(0, 100 * MS, ())) == IMU_EMPTY
    stream = Stream(range(0, 1001, 5))
    assert set(stream.faults(0, 1000)) == {None}
    assert stream.faults(1100, 1200) == [IMU_EMPTY]


def test_data_that_end_too_early_are_a_gap() -> None:
    stream = Stream(range(0, 951, 5))
    assert stream.faults(0, 1000) == [None] * 9 + [IMU_GAP]


def test_window_without_duration_has_no_fault() -> None:
    assert ImuPeriod().fault(ImuWindow(0, 0, ())) is None
    assert ImuPeriod().fault(Stream(range(0, 11, 5)).window(5, 5)) is None


def test_single_sample_tells_nothing() -> None:
    window = ImuWindow(0, 100 * MS, (ImuSample(50 * MS, np.zeros(3), np.zeros(3)),))
    assert ImuPeriod().fault(window) == IMU_EMPTY
