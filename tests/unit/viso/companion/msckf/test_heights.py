# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Heights: which one a frame gets, what is refused, and the outcome of each."""

import math
import threading

import numpy as np
import pytest

from tests.unit.viso.companion.msckf.point_world import filter_at
from viso.companion.msckf.heights import MOST_REFUSED, Heights
from viso.companion.msckf.window_filter import WindowFilter
from viso.geometry.pose import SE3

MS = 1_000_000
GROUND_M = -5.0
STILL = np.zeros(3)


def state(up_m: float = 35.0, climb_m_s: float = 0.0, sigma_m: float = 0.5) -> WindowFilter:
    made = filter_at(SE3(np.eye(3), np.array([0.0, 0.0, up_m])), np.array([0.0, 0.0, climb_m_s]))
    made.cov[5, 5] = sigma_m**2
    return made


def heights(*at_ms: float, height_m: float = 40.0) -> Heights:
    made = Heights(0.3)
    for ms in at_ms:
        assert made.add(round(ms * MS), height_m, 0.1)
    return made


def test_height_is_above_the_ground() -> None:
    taken = heights(100).take(100 * MS, GROUND_M, STILL)
    assert taken is not None
    assert taken[0] == 35.0


@pytest.mark.parametrize(
    ("least_m", "height_m", "sigma_m", "expected_m"),
    [(0.3, 10.0, 0.1, 0.3), (0.3, 100.0, 0.1, 1.0), (0.3, 10.0, 2.0, 2.0), (0.001, 0.0, 0.0, 0.001)],
)
def test_sigma_is_the_largest_of_three(least_m: float, height_m: float, sigma_m: float, expected_m: float) -> None:
    made = Heights(least_m)
    made.add(0, height_m, sigma_m)
    taken = made.take(0, 0.0, STILL)
    assert taken is not None
    assert taken[1] == pytest.approx(expected_m)


@pytest.mark.parametrize(("at_ms", "is_near"), [(-200, True), (-201, False), (200, True), (201, False)])
def test_height_must_be_near(at_ms: float, is_near: bool) -> None:
    assert (heights(1000 + at_ms).take(1000 * MS, 0.0, STILL) is not None) is is_near


def test_nearest_height_is_taken_and_each_once() -> None:
    made = Heights(0.3)
    for ms, height_m in ((0, 1.0), (90, 2.0), (110, 3.0), (160, 4.0)):
        made.add(ms * MS, height_m, 0.1)
    assert made.take(95 * MS, 0.0, STILL) == (2.0, 0.3)
    assert made.take(100 * MS, 0.0, STILL) == (3.0, 0.3)
    assert made.take(100 * MS, 0.0, STILL) == (4.0, 0.3)
    assert made.take(100 * MS, 0.0, STILL) is None


def test_climb_since_then_is_added() -> None:
    taken = heights(0).take(100 * MS, 0.0, np.array([9.0, 9.0, 5.0]))
    assert taken is not None
    assert taken[0] == pytest.approx(40.5)


@pytest.mark.parametrize(
    ("height_m", "sigma_m"),
    [(math.nan, 0.1), (math.inf, 0.1), (-0.1, 0.1), (10.0, math.nan), (10.0, math.inf), (10.0, -1.0)],
)
def test_what_is_no_height_is_left_out(height_m: float, sigma_m: float) -> None:
    made = Heights(0.3)
    assert not made.add(0, height_m, sigma_m)
    assert made.take(0, 0.0, STILL) is None


def test_heights_that_nobody_wants_give_way() -> None:
    made = heights(*range(0, 100_000, 100))
    assert made.take((1000 - 67) * 100 * MS, 0.0, STILL) is None
    assert made.take(99_900 * MS, 0.0, STILL) is not None


def test_filter_takes_the_height() -> None:
    made, filter_ = heights(0), state(34.0)
    made.use(filter_, 0, GROUND_M)
    assert 34.2 < filter_.p[2] < 35.0


def test_filter_without_a_height_is_left_alone() -> None:
    made, filter_ = heights(), state(34.0)
    made.use(filter_, 0, GROUND_M)
    assert filter_.p[2] == 34.0


def test_single_outlier_is_refused() -> None:
    made, filter_ = heights(0, height_m=600.0), state()
    made.use(filter_, 0, GROUND_M)
    assert filter_.p[2] == 35.0


def test_outliers_that_go_on_are_believed() -> None:
    made, filter_ = heights(*range(0, 2000, 100), height_m=60.0), state()
    places = []
    for ms in range(0, 2000, 100):
        made.use(filter_, ms * MS, GROUND_M)
        places.append(filter_.p[2])
    assert places[: MOST_REFUSED - 1] == [35.0] * (MOST_REFUSED - 1)
    assert places[MOST_REFUSED - 1] == 35.0
    assert places[MOST_REFUSED] > 36
    assert places[-1] > 45


def test_good_height_makes_outliers_outliers_again() -> None:
    made, filter_ = Heights(0.3), state()
    for index in range(20):
        made.add(index * 300 * MS, 40.0 if index % MOST_REFUSED == 2 else 90.0, 0.1)
        made.use(filter_, index * 300 * MS, GROUND_M)
    assert filter_.p[2] == pytest.approx(35.0, abs=0.1)


def test_heights_come_from_any_thread() -> None:
    made, filter_ = Heights(0.3), state()
    threads = [
        threading.Thread(target=lambda: [made.add(index * MS, 40.0, 0.1) for index in range(2000)]) for _ in range(2)
    ]
    for thread in threads:
        thread.start()
    for index in range(2000):
        made.use(filter_, index * MS, GROUND_M)
    for thread in threads:
        thread.join(10)
    assert np.isfinite(filter_.p).all()
