# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Windows of inertial data: their faults, their ends, and their steps."""

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from viso.companion.vio.imu import (
    IMU_EMPTY,
    IMU_GAP,
    ImuPeriod,
    bracketed,
    median_period_ns,
    steps_between,
    steps_of,
    window_fault,
)
from viso.companion.vio.types import ImuSample, ImuWindow

PERIOD_NS = 5_000_000


def sample(t_ns: int) -> ImuSample:
    """Return a sample whose measurements are straight lines in time."""
    return ImuSample(t_ns, np.array([1.0, 2.0, 3.0]) * t_ns, np.array([-1.0, 0.5, 0.0]) * t_ns)


def window(start: int, end: int, *times: int) -> ImuWindow:
    return ImuWindow(start, end, tuple(sample(t_ns) for t_ns in times))


def fault(start: int, end: int, *times: int) -> str | None:
    return window_fault(window(start, end, *times), 10)


def test_window_that_brackets_its_stamps_is_fine() -> None:
    assert fault(15, 42, 10, 20, 30, 40, 50) is None


@pytest.mark.parametrize(
    "times",
    [(), (5, 15), (42,), (43, 50), (15,)],
    ids=["no sample", "before", "at the end", "after", "at the start"],
)
def test_window_with_nothing_between_its_stamps_is_empty(times: tuple[int, ...]) -> None:
    assert fault(15, 42, *times) == "imu_empty"


def test_three_periods_between_samples_are_no_gap() -> None:
    assert fault(15, 42, 10, 40, 50) is None


def test_more_than_three_periods_between_samples_are_a_gap() -> None:
    assert fault(15, 42, 10, 41, 50) == "imu_gap"


def test_samples_may_stop_a_period_short_of_the_stamps() -> None:
    assert fault(15, 45, 25, 35) is None


@pytest.mark.parametrize("times", [(26, 35, 45), (15, 25, 34)], ids=["at the start", "at the end"])
def test_samples_that_stop_further_from_a_stamp_are_a_gap(times: tuple[int, ...]) -> None:
    assert fault(15, 45, *times) == "imu_gap"


def test_single_sample_between_near_stamps_is_fine() -> None:
    assert fault(15, 25, 20) is None


def test_median_period_does_not_mind_a_gap() -> None:
    assert median_period_ns(window(0, 100, 0, 10, 20, 70, 80, 90)) == 10


@pytest.mark.parametrize("times", [(), (5,)])
def test_fewer_than_two_samples_have_no_period(times: tuple[int, ...]) -> None:
    assert median_period_ns(window(0, 10, *times)) is None


def test_ends_are_interpolated_on_a_straight_line() -> None:
    samples = bracketed(window(15, 42, 10, 20, 30, 40, 50))
    assert [one.t_ns for one in samples] == [15, 20, 30, 40, 42]
    for one in samples:
        assert np.allclose(one.accel, sample(one.t_ns).accel)
        assert np.allclose(one.gyro, sample(one.t_ns).gyro)


def test_samples_on_the_stamps_are_the_ends() -> None:
    samples = bracketed(window(10, 30, 10, 20, 30))
    assert [one.t_ns for one in samples] == [10, 20, 30]
    assert [one.accel[0] for one in samples] == [10, 20, 30]


def test_stamps_between_the_same_two_samples_are_both_interpolated() -> None:
    samples = bracketed(window(12, 18, 10, 20))
    assert [one.t_ns for one in samples] == [12, 18]
    assert np.allclose([one.accel[0] for one in samples], [12, 18])


def test_nearest_sample_is_held_where_samples_do_not_reach() -> None:
    samples = bracketed(window(15, 42, 20, 30, 40))
    assert [one.t_ns for one in samples] == [15, 20, 30, 40, 42]
    assert [one.accel[0] for one in samples] == [20, 20, 30, 40, 40]


@pytest.mark.parametrize("times", [(), (5, 10), (50, 60)])
def test_empty_window_has_no_samples_and_no_steps(times: tuple[int, ...]) -> None:
    assert bracketed(window(15, 42, *times)) == ()
    steps = steps_of(window(15, 42, *times))
    assert (steps.dt_s.shape, steps.gyro.shape, steps.accel.shape) == ((0,), (0, 3), (0, 3))


def test_steps_hold_the_mean_of_both_ends() -> None:
    steps = steps_of(window(15, 42, 10, 20, 30, 40, 50))
    middles = np.array([17.5, 25, 35, 41])
    assert np.allclose(steps.dt_s, [5e-9, 1e-8, 1e-8, 2e-9])
    assert np.allclose(steps.gyro, np.outer(middles, [-1, 0.5, 0]))
    assert np.allclose(steps.accel, np.outer(middles, [1, 2, 3]))


@given(st.integers(0, PERIOD_NS), st.integers(0, 40 * PERIOD_NS))
def test_steps_fill_the_window_and_integrate_a_straight_line_exactly(start: int, length: int) -> None:
    end = start + 1 + length
    steps = steps_of(window(start, end, *range(0, 43 * PERIOD_NS, PERIOD_NS)))
    assert (steps.dt_s > 0).all()
    assert steps.dt_s.sum() == pytest.approx((end - start) * 1e-9)
    assert steps.dt_s @ steps.accel[:, 0] == pytest.approx((end - start) * 1e-9 * (start + end) / 2)


def test_one_sample_makes_no_step() -> None:
    assert steps_between([sample(1)]).dt_s.shape == (0,)


def test_stamps_far_from_zero_keep_their_nanoseconds() -> None:
    epoch = 1_700_000_000_000_000_000
    assert steps_between([sample(epoch), sample(epoch + 1)]).dt_s.tolist() == [1e-9]


# Gaps: what is one depends on how the data usually come

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
