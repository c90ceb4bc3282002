# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""When a vehicle counts as standing still on the ground."""

import math
from collections.abc import Sequence

import numpy as np
import pytest

from ekf_stub.filter.inertial import GRAVITY_MSS, InertialDelta
from ekf_stub.filter.stillness import Filtered, Stillness

LOOP_DT = 0.0025
STEP_DT = 0.0125
NO_BIAS = (0.0, 0.0, 0.0)
DIFFS_TAKE = 36  # passes from 1 to below 0.7, by a hundredth of the rest each


def sense(
    stillness: Stillness, *, gyro_deg_s: Sequence[float] = NO_BIAS, accel: Sequence[float] = (0, 0, -GRAVITY_MSS)
) -> None:
    """Let the filters settle at rates and an acceleration."""
    turn, velocity = np.radians(gyro_deg_s) * LOOP_DT, np.array(accel) * LOOP_DT
    for _ in range(200):
        stillness.sense(InertialDelta(velocity, turn, LOOP_DT, LOOP_DT))


def run(stillness: Stillness, passes: int, *, scale: float = 1.0) -> None:
    for _ in range(passes):
        stillness.test(NO_BIAS, NO_BIAS, STEP_DT, scale)


def resting(**sensed: Sequence[float]) -> Stillness:
    stillness = Stillness()
    stillness.skip()
    sense(stillness, **sensed)
    return stillness


def still() -> Stillness:
    stillness = resting()
    run(stillness, 400)
    assert stillness.is_still
    return stillness


def test_vehicle_at_rest_is_still_once_its_jerks_have_been_small_for_long_enough() -> None:
    stillness = resting()
    run(stillness, DIFFS_TAKE)
    assert not stillness.is_still
    run(stillness, 1)
    assert stillness.is_still


def test_first_pass_of_all_is_a_jerk_from_weightlessness() -> None:
    stillness = Stillness()
    sense(stillness)
    run(stillness, 1)
    assert stillness.report is not None
    assert stillness.report.accel_diff_ratio == pytest.approx(0.01 * GRAVITY_MSS / STEP_DT / 5.0)


def test_nothing_is_said_in_the_first_pass_after_a_rest() -> None:
    stillness = resting()
    run(stillness, 1)
    assert (stillness.is_still, stillness.report) == (False, None)


@pytest.mark.parametrize(("sensed", "is_still"), [
    ({"gyro_deg_s": (0, 2.0, 0)}, True),
    ({"gyro_deg_s": (0, 2.2, 0)}, False),
    ({"gyro_deg_s": (1.6, 0, 1.6)}, False),
    ({"accel": (0, 0, -GRAVITY_MSS - 0.65)}, True),
    ({"accel": (0, 0, -GRAVITY_MSS - 0.75)}, False),
    ({"accel": (0, 0, -GRAVITY_MSS + 0.75)}, False),
    ({"accel": (GRAVITY_MSS, 0, 0)}, True),
])  # fmt: skip
def test_seven_tenths_of_every_limit_must_hold_to_become_still(
    sensed: dict[str, Sequence[float]], is_still: bool
) -> None:
    stillness = resting(**sensed)
    run(stillness, 400)
    assert stillness.is_still is is_still


@pytest.mark.parametrize(("rate_deg_s", "is_still"), [(2.9, True), (3.1, False)])
def test_limits_themselves_must_hold_to_stay_still(rate_deg_s: float, is_still: bool) -> None:
    stillness = still()
    sense(stillness, gyro_deg_s=(rate_deg_s, 0, 0))
    run(stillness, 400)
    assert stillness.is_still is is_still


def test_change_of_rate_ends_stillness_for_a_while() -> None:
    stillness = still()
    sense(stillness, gyro_deg_s=(0, 0, 2))
    before = stillness.report
    run(stillness, 1)
    assert before is not None
    assert stillness.report is not None
    jump = 0.01 * math.radians(2) / STEP_DT / 0.2
    assert stillness.report.gyro_diff_ratio - 0.99 * before.gyro_diff_ratio == pytest.approx(jump, rel=1e-3)


def test_change_of_acceleration_counts_over_5_m_s3() -> None:
    stillness = still()
    sense(stillness, accel=(0, 0, -GRAVITY_MSS - 0.5))
    before = stillness.report
    run(stillness, 1)
    assert before is not None
    assert stillness.report is not None
    jump = 0.01 * 0.5 / STEP_DT / 5
    assert stillness.report.accel_diff_ratio - 0.99 * before.accel_diff_ratio == pytest.approx(jump, rel=1e-3)


@pytest.mark.parametrize(("scale", "is_still"), [(1.0, False), (2.0, True)])
def test_limits_grow_with_the_parameter(scale: float, is_still: bool) -> None:
    stillness = resting(gyro_deg_s=(4, 0, 0))
    run(stillness, 400, scale=scale)
    assert stillness.is_still is is_still


def test_biases_do_not_count() -> None:
    stillness = resting(gyro_deg_s=(4, -3, 2), accel=(1, -2, -GRAVITY_MSS - 2))
    gyro_x, gyro_y, gyro_z = np.radians((4.0, -3.0, 2.0)).tolist()
    for _ in range(400):
        stillness.test((gyro_x, gyro_y, gyro_z), (1, -2, -2), STEP_DT, 1.0)
    assert stillness.is_still
    assert stillness.report is not None
    assert stillness.report.gyro_length_ratio == pytest.approx(0, abs=1e-6)
    assert stillness.report.accel_length_ratio == pytest.approx(0, abs=1e-6)


def test_test_that_rests_begins_anew() -> None:
    stillness = still()
    stillness.skip()
    assert (stillness.is_still, stillness.report) == (False, None)
    run(stillness, DIFFS_TAKE)
    assert not stillness.is_still


def test_filters_go_on_as_the_test_begins_anew() -> None:
    stillness = still()
    stillness.reset()
    assert stillness.accel.value[2] == pytest.approx(-GRAVITY_MSS)


def test_filter_cuts_off_at_10_hz() -> None:
    filtered = Filtered()
    filtered.add((1.0, 0.0, 0.0), LOOP_DT)
    assert filtered.value[0] == pytest.approx(LOOP_DT / (LOOP_DT + 1 / (20 * math.pi)))


def test_filter_ignores_an_increment_of_no_time() -> None:
    filtered = Filtered()
    filtered.add(None, LOOP_DT)
    assert filtered.value == (0, 0, 0)
