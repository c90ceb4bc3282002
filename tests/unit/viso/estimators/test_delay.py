# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The delay of a stream is found, to within its stated uncertainty, and not where the motion does not show it."""

import math

import numpy as np
import pytest
import quaternion
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.unit.viso.estimators.conftest import Flight, read_gyro
from tests.unit.viso.estimators.motions import integrated, motion
from viso.estimators.delay import estimate_delay
from viso.geometry.rotation import quats_from_euler

RECORDED_TOLERANCE_MS = 5.0
SET_MS = 30  # VISO_DELAY_MS of the recorded flight


@pytest.mark.slow
def test_delay_of_the_recorded_flight_since_arrival_is_what_was_set(flight: Flight) -> None:
    found = estimate_delay(flight.arrival_us, flight.quat_wxyz, flight.att_us, flight.att_wxyz)
    assert found.enough_motion
    assert found.delay_ms == pytest.approx(SET_MS, abs=RECORDED_TOLERANCE_MS)
    assert found.sigma_ms < 1.0


@pytest.mark.slow
def test_corrected_stamps_of_the_recorded_flight_leave_no_delay(flight: Flight) -> None:
    # The simulated link carries bytes at once, and yet the firmware subtracts what they take at the port's baud rate.
    found = estimate_delay(flight.stamp_us, flight.quat_wxyz, flight.att_us, flight.att_wxyz)
    transport_ms = float(np.median(flight.arrival_us - flight.stamp_us)) * 1e-3
    assert found.delay_ms == pytest.approx(SET_MS - transport_ms, abs=RECORDED_TOLERANCE_MS)


@pytest.mark.slow
@pytest.mark.parametrize("delay_ms", [10, 20, 50, 80, 120, 160, 200])
def test_delays_made_of_the_recorded_flight_are_found(flight: Flight, delay_ms: int) -> None:
    later_us = flight.stamp_us + delay_ms * 1e3
    found = estimate_delay(later_us, flight.quat_wxyz, flight.att_us, flight.att_wxyz)
    assert found.viso_delay_ms == pytest.approx(delay_ms, abs=RECORDED_TOLERANCE_MS)


@pytest.mark.slow
def test_fast_gyro_of_the_recorded_flight_says_what_slow_attitudes_say(flight: Flight) -> None:
    by_attitude = estimate_delay(flight.arrival_us, flight.quat_wxyz, flight.att_us, flight.att_wxyz)
    by_gyro = estimate_delay(flight.arrival_us, flight.quat_wxyz, *read_gyro())
    assert by_gyro.delay_ms == pytest.approx(by_attitude.delay_ms, abs=2.0)
    assert by_gyro.delay_ms == pytest.approx(SET_MS, abs=RECORDED_TOLERANCE_MS)


@pytest.mark.slow
@settings(max_examples=15)
@given(delay_ms=st.floats(-60, 260), seed=st.integers(0, 2**32 - 1), hz=st.sampled_from([10, 30, 90]))
def test_any_delay_is_found_within_its_uncertainty(delay_ms: float, seed: int, hz: int) -> None:
    rng = np.random.default_rng(seed)
    vehicle = motion(rng)
    found = estimate_delay(*vehicle.seen(rng, delay_ms=delay_ms, hz=hz), vehicle.time_us, vehicle.quat_wxyz)
    assert found.enough_motion
    assert abs(found.delay_ms - delay_ms) < 5 * found.sigma_ms + 0.2
    assert found.sigma_ms < 3.0


@pytest.mark.slow
def test_uncertainty_is_that_of_repeated_trials() -> None:
    rng = np.random.default_rng(7)
    vehicle = motion(rng)
    trials = [
        estimate_delay(*vehicle.seen(rng, delay_ms=40, noise_rad=0.01), vehicle.time_us, vehicle.quat_wxyz)
        for _ in range(20)
    ]
    spread_ms = float(np.std([trial.delay_ms for trial in trials]))
    assert 0.6 < spread_ms / np.mean([trial.sigma_ms for trial in trials]) < 1.6


def test_mounting_heading_and_gyro_bias_do_not_matter() -> None:
    rng = np.random.default_rng(8)
    vehicle = motion(rng)
    body, world = quaternion.from_rotation_vector([[1.0, -2.0, 0.5], [0.0, 0.0, 2.0]])
    seen = vehicle.seen(rng, delay_ms=70, body=body, world=world)
    biased = integrated(vehicle.time_us, vehicle.rates_rad + np.array([0.5, -0.5, 0.5]))
    found = estimate_delay(*seen, vehicle.time_us, biased)
    assert found.delay_ms == pytest.approx(70, abs=4 * found.sigma_ms)
    assert found.correlation > 0.95


def test_turning_about_one_axis_is_enough() -> None:
    rng = np.random.default_rng(9)
    vehicle = motion(rng, axes=(0, 0, 1))
    found = estimate_delay(*vehicle.seen(rng, delay_ms=70), vehicle.time_us, vehicle.quat_wxyz)
    assert found.enough_motion
    assert found.delay_ms == pytest.approx(70, abs=4 * found.sigma_ms)


def test_jumps_of_the_heading_and_gaps_do_little() -> None:
    rng = np.random.default_rng(10)
    vehicle = motion(rng)
    stamps, quats = vehicle.seen(rng, delay_ms=70)
    jump = quaternion.from_rotation_vector([0.0, 0.0, 1.0])
    turned = quaternion.as_float_array(jump * quaternion.as_quat_array(quats[300:]))
    kept = np.r_[0:100, 150:400, 420 : len(stamps)]
    quats = np.vstack([quats[:300], turned])
    found = estimate_delay(stamps[kept], quats[kept], vehicle.time_us, vehicle.quat_wxyz)
    assert found.delay_ms == pytest.approx(70, abs=4 * found.sigma_ms)
    assert found.sigma_ms < 2.0


@pytest.mark.parametrize("rate_rad", [0.0, 0.003])
def test_vehicle_at_rest_is_no_motion(rate_rad: float) -> None:
    rng = np.random.default_rng(11)
    vehicle = motion(rng, rate_rad=rate_rad)
    noisy = vehicle.rates_rad + rng.normal(0, 0.002, vehicle.rates_rad.shape)
    found = estimate_delay(*vehicle.seen(rng), vehicle.time_us, integrated(vehicle.time_us, noisy))
    assert not found.enough_motion
    assert math.isnan(found.delay_ms)
    assert found.sigma_ms == math.inf
    assert found.viso_delay_ms is None


def test_estimate_at_rest_that_follows_the_camera_is_no_motion() -> None:
    rng = np.random.default_rng(16)
    vehicle = motion(rng, rate_rad=0.003)
    found = estimate_delay(*vehicle.seen(rng, noise_rad=1e-5, delay_ms=40), vehicle.time_us, vehicle.quat_wxyz)
    assert found.correlation > 0.95
    assert not found.enough_motion


def test_stream_that_is_mostly_noise_is_not_enough() -> None:
    rng = np.random.default_rng(17)
    vehicle = motion(rng, span_s=120.0)
    found = estimate_delay(*vehicle.seen(rng, noise_rad=0.07), vehicle.time_us, vehicle.quat_wxyz)
    assert not found.enough_motion
    assert 0.3 < found.correlation < 0.6


def test_steady_turning_is_no_motion() -> None:
    rng = np.random.default_rng(12)
    vehicle = motion(rng, rate_rad=1e-9)
    spinning = vehicle.rates_rad + np.array([0.0, 0.0, 0.5])
    stamps = vehicle.time_us[::3]
    yaw = stamps * 0.5e-6 + rng.normal(0, 0.003, len(stamps))
    quats = quats_from_euler(np.column_stack([0 * yaw, 0 * yaw, yaw]))
    attitudes = integrated(vehicle.time_us, spinning)
    assert not estimate_delay(stamps, quats, vehicle.time_us, attitudes).enough_motion


def test_motion_that_repeats_itself_within_the_search_is_not_enough() -> None:
    time_us = np.arange(0, 20e6, 1e4)
    rates = np.column_stack([0 * time_us, 0 * time_us, np.sin(2 * np.pi * 5e-6 * time_us)])  # every 200 ms
    quats = quaternion.as_float_array(quaternion.from_rotation_vector(np.cumsum(rates * 0.01, axis=0)))
    stamps, quats = time_us[100:-100:3], quats[100:-100:3]
    noise = np.random.default_rng(13).normal(0, 1e-3, quats.shape)
    assert not estimate_delay(stamps + 50e3, quats + noise, time_us, integrated(time_us, rates)).enough_motion


@pytest.mark.parametrize("seed", range(6))
def test_stream_of_another_vehicle_is_not_taken(seed: int) -> None:
    rng = np.random.default_rng(seed)
    vehicle, other = motion(rng), motion(rng)
    assert not estimate_delay(*other.seen(rng), vehicle.time_us, vehicle.quat_wxyz).enough_motion


def test_delay_beyond_the_search_is_not_taken() -> None:
    rng = np.random.default_rng(14)
    vehicle = motion(rng)
    seen = vehicle.seen(rng, delay_ms=420)
    assert not estimate_delay(*seen, vehicle.time_us, vehicle.quat_wxyz).enough_motion


def test_value_for_the_parameter_stays_within_its_range() -> None:
    rng = np.random.default_rng(15)
    vehicle = motion(rng)
    found = estimate_delay(*vehicle.seen(rng, delay_ms=-50), vehicle.time_us, vehicle.quat_wxyz)
    assert found.delay_ms == pytest.approx(-50, abs=4)
    assert found.viso_delay_ms == 0


@pytest.mark.parametrize("count", [0, 1, 20])
def test_too_few_samples_are_not_enough(count: int) -> None:
    times = np.arange(count) * 3e4
    found = estimate_delay(times, np.tile([1.0, 0, 0, 0], (count, 1)), times, np.ones((count, 4)))
    assert (found.enough_motion, found.sigma_ms) == (False, math.inf)
