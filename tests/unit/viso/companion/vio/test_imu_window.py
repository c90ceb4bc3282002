# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Windows of inertial data: their faults, their ends, and their steps."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from viso.companion.vio.imu_window import bracketed, median_period_ns, steps_between, steps_of, window_fault
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
