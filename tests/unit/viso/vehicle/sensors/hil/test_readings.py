# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Times of a simulator's messages, and heights."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from viso.vehicle.sensors.hil import LATE_US, MessageTime, RelativeHeight, isa_height_m


@pytest.mark.parametrize(
    ("pressure_hpa", "height_m"), [(1013.25, 0.0), (954.608, 500.0), (898.746, 1000.0), (701.085, 3000.0)]
)
def test_height_of_the_standard_atmosphere(pressure_hpa: float, height_m: float) -> None:
    # The pairs are those of the published tables.
    assert isa_height_m(pressure_hpa) == pytest.approx(height_m, abs=0.1)


def test_times_that_repeat_or_come_late_are_refused() -> None:
    time = MessageTime()
    assert time.refusal(5) is None
    assert time.interval_us(5_000_000) is None
    assert time.refusal(5_000_000) == "repeated"
    assert time.refusal(5_000_001 - LATE_US) == "late"
    assert time.refusal(5_000_000 - LATE_US) is None
    assert time.interval_us(5_002_500) == 2500


def test_time_begins_anew_when_it_goes_back_far() -> None:
    time = MessageTime()
    time.interval_us(5_000_000)
    assert time.interval_us(1000) is None
    assert time.interval_us(3500) == 2500


@given(st.lists(st.integers(1, 10_000_000), min_size=1, max_size=200))
def test_interval_is_never_absurd(intervals_us: list[int]) -> None:
    time = MessageTime()
    for interval_us in intervals_us:
        assert 0.0 < time.limited_s(interval_us) <= 0.4


def test_usual_interval_follows_the_simulator() -> None:
    time = MessageTime()
    for _ in range(200):
        time.limited_s(2500)
    for _ in range(400):
        time.limited_s(10_000)
    assert time.limited_s(10_000) == pytest.approx(0.01)
    assert 0.04 <= time.limited_s(100_000) < 0.041


def test_height_counts_from_the_average_of_the_first_second() -> None:
    height = RelativeHeight()
    assert [height.take(time_us, metres) for time_us, metres in ((0, 99.0), (999_999, 101.0))] == [None, None]
    assert height.take(1_000_000, 103.0) == 3.0


def test_height_stays_known_when_time_begins_anew() -> None:
    height = RelativeHeight()
    height.take(5_000_000, 100.0)
    assert height.take(0, 101.0) == 1.0
