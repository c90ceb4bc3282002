# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""IMU records become the passes that the vehicle's gyros and accelerometers felt."""

import math
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from tests.unit.viso.vehicle.sensors.flown.made import log_of
from viso.vehicle.sensors.flight import PASS_US, Basis, Flight, imu_of
from viso.vehicle.sensors.flown.imu_records import Rates, imu_records, integral_at, lag_s

GRAVITY = 9.80665
FILTERS = {"INS_GYRO_FILTER": 20.0, "INS_ACCEL_FILTER": 20.0}


def swaying(time_s: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Return rates and specific forces [N, 6] of a vehicle that sways at 1 Hz about its x axis, and along it."""
    sway = np.sin(math.tau * time_s)
    still = np.zeros_like(sway)
    return np.column_stack([sway, still, still, 2 * sway, still, still - GRAVITY])


def rows(
    start_s: float, end_s: float, imu: int = 0, rate_hz: float = 25.0, lag: float = lag_s(20.0)
) -> list[list[float]]:
    times = np.arange(start_s, end_s, 1 / rate_hz)
    return [[1e6 * time_s, imu, *values] for time_s, values in zip(times, swaying(times - lag).tolist(), strict=True)]


def flown(params: dict[str, float] | None = None, lane: int = 0, **records: list[list[float]]) -> Flight:
    flight = imu_records(log_of(FILTERS | (params or {}), **records), lane)
    assert flight is not None
    return flight


def test_passes_add_up_to_the_motion_that_the_filters_delayed() -> None:
    flight = flown(IMU=rows(1, 4))
    assert flight.basis is Basis.IMU
    end_s = flight.time_us * 1e-6
    expected = swaying(end_s - 0.5e-6 * PASS_US) * (1e-6 * PASS_US)
    found = np.column_stack([flight.deltas[:, 3:6], flight.deltas[:, :3]])
    assert found == pytest.approx(expected, abs=2e-5)  # of 2.5e-3, at 25 samples a period
    assert set(np.diff(flight.time_us).tolist()) == {PASS_US}
    assert flight.deltas[:, 6:] == pytest.approx(1e-6 * PASS_US)


@pytest.mark.parametrize(("cut_off_hz", "lag_ms"), [(20.0, 11.25), (80.0, 2.81), (0.0, 0.0)])
def test_lag_is_that_of_a_low_pass_filter(cut_off_hz: float, lag_ms: float) -> None:
    assert 1e3 * lag_s(cut_off_hz) == pytest.approx(lag_ms, abs=0.01)


@pytest.mark.parametrize("mask", [math.inf, math.nan])
def test_imu_is_the_first_where_the_mask_is_no_number(mask: float) -> None:
    assert imu_of(log_of({"EK3_IMU_MASK": mask}), lane=0) == 0


def test_imu_is_that_of_the_lane() -> None:
    other = [[time_us, 1, *np.zeros(5), -GRAVITY] for time_us, *_ in rows(1, 9)]
    records = [row for pair in zip(rows(1, 9, imu=2), other, strict=True) for row in pair]
    assert flown({"EK3_IMU_MASK": 6}, lane=1, IMU=records).deltas[:, 3].any()
    assert not flown({"EK3_IMU_MASK": 6}, lane=0, IMU=records).deltas[:, 3].any()


def test_raw_samples_come_first_and_have_no_lag() -> None:
    times_us = np.arange(1_000_000, 2_000_000, 1000)
    motion = swaying(1e-6 * times_us)
    raw = [
        [[t + 7000, 0, t, *row[part : part + 3]] for t, row in zip(times_us, motion, strict=True)] for part in (0, 3)
    ]
    flight = flown(IMU=rows(1, 2), GYR=raw[0], ACC=raw[1])
    expected = swaying(1e-6 * flight.time_us - 0.5e-6 * PASS_US) * (1e-6 * PASS_US)
    assert flight.deltas[:, 3:6] == pytest.approx(expected[:, :3], abs=1e-6)
    assert "GYR and ACC of IMU 0, 1000 Hz" in flight.notes


def test_gap_is_a_straight_line_and_told() -> None:
    flight = flown(IMU=rows(1, 4.26) + rows(10.26, 14))
    during = (flight.time_us > 4_300_000) & (flight.time_us < 10_200_000)
    assert np.abs(np.diff(flight.deltas[during, 3], n=2)).max() < 1e-8
    assert flight.notes[1:] == ("no record for 6.0 s in 1 gaps; up to 10 s each are a straight line",)


def test_long_silence_is_passed_over() -> None:
    flight = flown(IMU=rows(1, 3) + rows(40_000, 40_003))
    assert not ((flight.time_us > 3_000_000) & (flight.time_us < 39_980_000_000)).any()
    assert len(flight.time_us) == pytest.approx(400 * 5, abs=40)
    assert np.abs(flight.deltas[:, 3:6]).max() < 0.003


def test_log_that_begins_late_begins_at_rest() -> None:
    flight = flown(IMU=rows(60, 64))
    assert flight.time_us[0] == pytest.approx(50_000_000, abs=20_000)
    before = flight.time_us < 59_980_000
    assert not flight.deltas[before, 3:6].any()
    assert flight.deltas[before, 2] == pytest.approx(-GRAVITY * 0.0025)
    assert any("begins 60 s after boot" in note for note in flight.notes)


def test_too_few_records_are_no_flight() -> None:
    assert imu_records(log_of(IMU=rows(1, 2)), 0) is None
    assert imu_records(log_of(), 0) is None


def test_integral_is_exact_for_rates_that_change_steadily() -> None:
    time_s = np.array([0.0, 0.03, 0.1, 0.14, 0.2])
    at_s = np.linspace(0, 0.2, 17)
    slopes = np.array([1.0, -2.0, 0.5])
    found = integral_at(Rates(time_s, 3.0 + time_s[:, None] * slopes), at_s)
    assert found == pytest.approx(3.0 * at_s[:, None] + 0.5 * at_s[:, None] ** 2 * slopes)
