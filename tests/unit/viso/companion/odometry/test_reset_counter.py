# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""When the reset counter counts."""

import numpy as np
import pytest

from viso.companion.odometry.source import ResetCounter

SIGMA_01 = np.eye(3) * 0.01


def moved(*metres: float) -> np.ndarray:
    return np.array(metres)


def test_first_start_does_not_count() -> None:
    counter = ResetCounter()
    counter.start()
    assert counter.value == 0


def test_every_further_start_counts() -> None:
    counter = ResetCounter()
    for _ in range(4):
        counter.start()
    assert counter.value == 3


def test_counter_wraps_at_256() -> None:
    counter = ResetCounter()
    for _ in range(257):
        counter.start()
    assert counter.value == 0


@pytest.mark.parametrize(
    ("distance_m", "sigma_m", "counts"),
    [
        (0.51, 0.1, 1),  # both
        (0.49, 0.1, 0),  # 4.9 sigma, but a small move
        (2.0, 0.7, 0),  # a large move, but within 3 sigma
        (2.2, 0.7, 1),
        (0.51, 0.0, 1),  # nothing was uncertain
    ],
)
def test_correction_counts_above_3_sigma_and_half_a_metre(distance_m: float, sigma_m: float, counts: int) -> None:
    counter = ResetCounter()
    counter.correct(moved(0.0, distance_m, 0.0), np.eye(3) * sigma_m**2)
    assert counter.value == counts


def test_sigma_is_that_of_the_direction_of_the_move() -> None:
    uncertain_ahead = np.diag([1.0, 0.01, 0.01])
    counter = ResetCounter()
    counter.correct(moved(1.0, 0.0, 0.0), uncertain_ahead)
    assert counter.value == 0
    counter.correct(moved(0.0, 1.0, 0.0), uncertain_ahead)
    assert counter.value == 1


def test_no_move_is_no_correction() -> None:
    counter = ResetCounter()
    counter.correct(moved(0.0, 0.0, 0.0), SIGMA_01)
    assert counter.value == 0
