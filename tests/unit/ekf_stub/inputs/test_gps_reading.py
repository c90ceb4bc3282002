# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the estimator takes from a GPS, when it comes due, and how far it is believed."""

import math
from typing import Any

import numpy as np
import pytest

from ap_core.location import Location
from ap_core.vector3 import Vector3f
from ekf_stub.filter.inertial import InertialStep
from ekf_stub.inputs.gps_reading import GpsReading
from ekf_stub.inputs.gps_sample import GpsSample

ORIGIN = Location(-353632610, 1491652300, 58400)
NOISES = {"VELNE_M_NSE": 0.3, "POSNE_M_NSE": 0.5, "GPS_CHECK": 31, "CHECK_SCALE": 100}
GOOD_INNOVATIONS = (0.1, 0.1)
STEP_MS = 200


def reading() -> GpsReading:
    return GpsReading(NOISES.__getitem__, 3)


def sample(time_ms: int, **fields: Any) -> GpsSample:
    values: dict[str, Any] = {"fix_type": 3, "location": ORIGIN, "vel_ned": Vector3f(), "num_sats": 10, "hdop": 100}
    return GpsSample(time_ms=time_ms, **{**values, **fields})


def read(
    gps: GpsReading,
    time_ms: int,
    *,
    absolute: bool = True,
    ratios: tuple[float, float] = GOOD_INNOVATIONS,
    **fields: Any,
) -> GpsSample | None:
    return gps.read(sample(time_ms, **fields), time_ms, absolute=absolute, worst_ratios=ratios)


def run(gps: GpsReading, from_ms: int, to_ms: int, **fields: Any) -> None:
    for time_ms in range(from_ms, to_ms + 1, STEP_MS):
        read(gps, time_ms, **fields)


# What is taken


@pytest.mark.parametrize(("fix_type", "taken"), [(1, False), (2, False), (3, True), (6, True)])
def test_solution_with_a_3d_fix_is_taken(fix_type: int, taken: bool) -> None:
    gps = reading()
    assert (read(gps, 1000, fix_type=fix_type) is not None) is taken
    assert gps.received_ms == (1000 if taken else 0)


def test_same_solution_is_taken_once() -> None:
    gps = reading()
    assert read(gps, 1000) is not None
    assert read(gps, 1000) is None


# What waits


def test_solution_counts_from_the_origin_and_is_of_200_ms_ago() -> None:
    gps = reading()
    place = ORIGIN.offset(Vector3f(30, -40, -5))
    gps.push(sample(5000, location=place, vel_ned=Vector3f(1, 2, 3), yaw_deg=90.0), ORIGIN, 584.0, 4700, 5000)
    assert gps.newest is not None
    assert gps.newest.time_ms == 5000 - 200 - 6
    assert gps.newest.pos == pytest.approx([30, -40, -5], abs=0.02)
    assert gps.newest.vel == pytest.approx([1, 2, 3])
    assert gps.newest.yaw == pytest.approx(math.pi / 2)


@pytest.mark.parametrize(("lag_s", "lag_ms"), [(0.0, 0), (0.1, 100), (0.12, 120), (0.22, 220)])
def test_solution_is_as_old_as_its_receiver_is_late(lag_s: float, lag_ms: int) -> None:
    gps = reading()
    gps.push(sample(5000, lag_s=float(np.float32(lag_s))), ORIGIN, 584.0, 4700, 5000)
    assert gps.newest is not None
    assert gps.newest.time_ms == 5000 - lag_ms - 6


def test_solution_is_moved_from_the_antenna_to_the_imu_as_it_comes_due() -> None:
    gps = reading()
    gps.push(sample(5000, vel_ned=Vector3f(1, 2, 3), antenna=(0.5, 0.0, -0.4)), ORIGIN, 584.0, 4700, 5000)
    east = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # the nose points there
    gps.note_motion(east, InertialStep(4800, np.zeros(3), np.array([0.0, 0.0, 0.02]), 0.01, 0.01))
    gps.recall(4800)
    for fix in (gps.delayed, gps.newest_at_imu()):
        assert fix is not None
        assert fix.pos == pytest.approx([0.0, -0.5, 0.4], abs=0.012)  # a place is told to 11 mm
        assert fix.vel == pytest.approx([1 + 2 * 0.5, 2, 3])
    assert gps.newest is not None
    assert gps.newest.pos == pytest.approx([0, 0, 0], abs=1e-3)


def test_height_counts_from_a_height_of_its_own() -> None:
    gps = reading()
    gps.push(sample(5000), ORIGIN, 580.0, 4700, 5000)
    assert gps.newest is not None
    assert gps.newest.pos == pytest.approx([0, 0, -4], abs=1e-4)


@pytest.mark.parametrize(("horizon_ms", "time_ms"), [(4700, 4794), (4900, 4900)])
def test_solution_is_never_older_than_the_horizon(horizon_ms: int, time_ms: int) -> None:
    gps = reading()
    gps.push(sample(5000), ORIGIN, 584.0, horizon_ms, 5000)
    assert gps.newest is not None
    assert gps.newest.time_ms == time_ms


def test_solution_from_the_future_is_of_now() -> None:
    gps = reading()
    gps.push(sample(9000), ORIGIN, 584.0, 4700, 5000)
    assert gps.newest is not None
    assert gps.newest.time_ms == 5000


def test_solution_comes_due_as_the_horizon_reaches_it_and_stays_known() -> None:
    gps = reading()
    gps.push(sample(5000), ORIGIN, 584.0, 4700, 5000)
    gps.recall(4793)
    assert (gps.is_due, gps.delayed) == (False, None)
    gps.recall(4794)
    assert gps.is_due
    gps.recall(4806)
    assert not gps.is_due
    assert gps.delayed is gps.newest


def test_solution_without_a_yaw_has_none() -> None:
    gps = reading()
    gps.push(sample(5000), ORIGIN, 584.0, 4700, 5000)
    assert gps.newest is not None
    assert gps.newest.yaw is None


# How far it is believed


@pytest.mark.parametrize(("absolute", "satellites", "scaler"), [
    (True, 6, 1.0),
    (True, 20, 1.0),
    (True, 5, 1.4),
    (True, 4, 2.0),
    (False, 20, 2.0),
])  # fmt: skip
def test_noise_is_scaled_by_how_many_satellites_are_seen(absolute: bool, satellites: int, scaler: float) -> None:
    gps = reading()
    read(gps, 1000, absolute=absolute, num_sats=satellites)
    assert gps.noise_scaler == scaler


def test_accuracies_are_not_below_the_noise_that_is_assumed() -> None:
    gps = reading()
    read(gps, 1000, speed_accuracy=0.1, horizontal_accuracy=0.1, vertical_accuracy=0.1)
    assert (gps.speed_accuracy, gps.pos_accuracy, gps.height_accuracy) == (0.3, 0.5, 0.75)


def test_accuracies_have_an_upper_limit() -> None:
    gps = reading()
    read(gps, 1000, speed_accuracy=1e3, horizontal_accuracy=1e3, vertical_accuracy=1e3)
    assert (gps.speed_accuracy, gps.pos_accuracy, gps.height_accuracy) == (50, 100, 100)


def test_accuracies_that_are_not_given_are_0() -> None:
    gps = reading()
    read(gps, 1000, speed_accuracy=2.0, horizontal_accuracy=2.0, vertical_accuracy=2.0)
    read(gps, 1200)
    assert (gps.speed_accuracy, gps.pos_accuracy, gps.height_accuracy) == (0, 0, 0)


@pytest.mark.parametrize(("after_ms", "held"), [(500, 9.0), (1000, 8.0), (5000, 1.0), (9000, 1.0)])
def test_worst_accuracy_decays_within_5_s(after_ms: int, held: float) -> None:
    gps = reading()
    read(gps, 1000, horizontal_accuracy=10.0)
    read(gps, 1000 + after_ms, horizontal_accuracy=1.0)
    assert gps.pos_accuracy == pytest.approx(held)


# Whether it is good enough for flight


@pytest.mark.parametrize(("end_ms", "good"), [(11_000, False), (11_200, True)])
def test_accuracy_is_good_once_innovations_have_passed_for_more_than_10_s(end_ms: int, good: bool) -> None:
    gps = reading()
    run(gps, 1000, end_ms)
    assert gps.accuracy_good is good


@pytest.mark.parametrize("ratios", [(1.2, 0.1), (0.1, 1.2)])
@pytest.mark.parametrize(("for_ms", "good"), [(1000, True), (1200, False)])
def test_accuracy_is_bad_once_innovations_have_failed_for_more_than_a_second(
    ratios: tuple[float, float], for_ms: int, good: bool
) -> None:
    gps = reading()
    run(gps, 1000, 12_000)
    run(gps, 12_200, 12_000 + for_ms, ratios=ratios)
    assert gps.accuracy_good is good


def test_accuracy_is_bad_beyond_a_speed_accuracy_of_1_5_until_it_is_below_1() -> None:
    gps = reading()
    run(gps, 1000, 12_000, speed_accuracy=0.5)
    assert gps.accuracy_good
    run(gps, 12_200, 16_000, speed_accuracy=2.0)
    assert not gps.accuracy_good
    run(gps, 16_200, 30_000, speed_accuracy=1.2)
    assert not gps.accuracy_good
    run(gps, 30_200, 60_000, speed_accuracy=0.5)
    assert gps.accuracy_good


@pytest.mark.parametrize(("speed_accuracy", "good"), [(5.4, True), (5.6, False)])
def test_single_speed_accuracy_counts_a_fifth(speed_accuracy: float, good: bool) -> None:
    gps = reading()
    run(gps, 1000, 12_000, speed_accuracy=0.5)
    read(gps, 12_200, speed_accuracy=speed_accuracy)
    assert gps.accuracy_good is good


def test_reset_forgets_all_but_the_judgement_of_the_receiver() -> None:
    gps = reading()
    run(gps, 1000, 12_000, horizontal_accuracy=2.0)
    gps.push(sample(12_000), ORIGIN, 584.0, 11_000, 12_000)
    gps.recall(11_990)
    gps.push(sample(12_200), ORIGIN, 584.0, 11_000, 12_200)
    gps.reset()
    assert (gps.newest, gps.delayed, gps.is_due, gps.received_ms, gps.pos_accuracy) == (None, None, False, 0, 0)
    assert not gps.accuracy_good
    assert gps.checks.good
    gps.recall(12_000)
    assert not gps.is_due
