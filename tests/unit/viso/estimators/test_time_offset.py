# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The line below stamps and arrivals is the best one, and what it says of the clocks is so."""

import math
from itertools import combinations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from tests.unit.viso.estimators.conftest import Flight
from viso.estimators.time_offset import estimate_time_offset
from viso.estimators.turning import Array


def messages(
    rng: np.random.Generator, *, offset_us: float, drift_ppm: float, span_s: float = 30.0, lag_us: float = 5000.0
) -> tuple[Array, Array]:
    """Return stamps and arrivals: the clocks differ by the offset at stamp 0, and each message is late by chance."""
    stamps = np.arange(0, span_s * 1e6, 4e4)
    return stamps, stamps * (1 + drift_ppm * 1e-6) + offset_us + rng.exponential(lag_us, len(stamps))


@settings(max_examples=40)
@given(offset_us=st.floats(-1e12, 1e12), drift_ppm=st.floats(-300, 300), seed=st.integers(0, 2**32 - 1))
def test_offset_and_drift_are_found_within_their_uncertainty(offset_us: float, drift_ppm: float, seed: int) -> None:
    stamps, arrivals = messages(np.random.default_rng(seed), offset_us=offset_us, drift_ppm=drift_ppm)
    found = estimate_time_offset(stamps, arrivals)
    assert found.sufficient
    there = offset_us + drift_ppm * 1e-6 * found.reference_us
    assert abs(found.offset_us - there) < 5 * found.offset_sigma_us
    assert abs(found.drift_ppm - drift_ppm) < 5 * found.drift_sigma_ppm
    assert found.drift_sigma_ppm < 30
    assert found.median_lag_us == pytest.approx(5000 * math.log(2), rel=0.35)


@settings(max_examples=15)
@given(points=st.lists(st.tuples(st.integers(0, 5_000_000), st.integers(0, 400_000)), min_size=40, max_size=50))
def test_no_line_below_all_messages_is_nearer_to_them(points: list[tuple[int, int]]) -> None:
    stamps, lags = np.array(points, np.float64).T
    arrivals = stamps + lags
    assume(np.ptp(arrivals) >= 2e6)
    found = estimate_time_offset(stamps, arrivals)
    above = found.lags_us(stamps, arrivals)
    assert above.min() > -1e-3
    best = math.inf
    for i, j in combinations(range(len(stamps)), 2):
        if stamps[i] != stamps[j]:
            slope = (lags[j] - lags[i]) / (stamps[j] - stamps[i])
            left = lags - lags[i] - slope * (stamps - stamps[i])
            if left.min() > -1e-6:
                best = min(best, float(left.sum()))
    assert above.sum() == pytest.approx(best, rel=1e-6, abs=1.0)


def test_lags_are_those_of_the_transport() -> None:
    stamps = np.arange(0, 20e6, 4e4)
    late = np.where(np.arange(len(stamps)) % 10, 7000.0, 0.0)
    found = estimate_time_offset(stamps, stamps + 1e6 + late)
    np.testing.assert_allclose(found.lags_us(stamps, stamps + 1e6 + late), late, atol=1e-3)
    assert found.offset_us == pytest.approx(1e6)
    assert found.median_lag_us == pytest.approx(7000)


def test_order_of_messages_does_not_matter() -> None:
    rng = np.random.default_rng(40)
    stamps, arrivals = messages(rng, offset_us=1e6, drift_ppm=50)
    mixed = rng.permutation(len(stamps))
    assert estimate_time_offset(stamps[mixed], arrivals[mixed]) == estimate_time_offset(stamps, arrivals)


@pytest.mark.parametrize(("unit_us", "drift_ppm"), [(1e-3, 1e9), (1e3, -1e6)])
def test_stamps_of_another_unit_show_as_an_absurd_drift(unit_us: float, drift_ppm: float) -> None:
    stamps, arrivals = messages(np.random.default_rng(41), offset_us=0, drift_ppm=0)
    assert estimate_time_offset(stamps * unit_us, arrivals).drift_ppm == pytest.approx(drift_ppm, rel=2e-3)


@pytest.mark.parametrize("span_s", [30.0, 600.0])
def test_step_of_a_clock_is_uneven(span_s: float) -> None:
    stamps, arrivals = messages(np.random.default_rng(42), offset_us=0, drift_ppm=0, span_s=span_s)
    arrivals[len(arrivals) // 2 :] += 100_000
    found = estimate_time_offset(stamps, arrivals)
    assert not found.sufficient
    assert found.uneven_us > 20_000


def test_drift_of_the_recorded_flight_is_that_of_a_clock(flight: Flight) -> None:
    found = estimate_time_offset(flight.remote_us, flight.arrival_us)
    assert found.sufficient
    assert abs(found.drift_ppm) < 200
    assert found.median_lag_us < 20_000


def test_planted_drift_of_the_recorded_flight_is_found(flight: Flight) -> None:
    before = estimate_time_offset(flight.remote_us, flight.arrival_us)
    slower = flight.remote_us[0] + (flight.remote_us - flight.remote_us[0]) / (1 + 500e-6)
    after = estimate_time_offset(slower, flight.arrival_us)
    assert after.drift_ppm - before.drift_ppm == pytest.approx(500, abs=1)


@pytest.mark.parametrize(("stamps", "arrivals"), [
    (np.zeros(0), np.zeros(0)),
    (np.arange(39) * 1e5, np.arange(39) * 1e5),
    (np.arange(100) * 1e3, np.arange(100) * 1e3),
    (np.full(100, 7.0), np.arange(100) * 1e5),
    (np.full(100, math.nan), np.arange(100) * 1e5),
])  # fmt: skip
def test_too_little_tells_nothing(stamps: Array, arrivals: Array) -> None:
    found = estimate_time_offset(stamps, arrivals)
    assert (found.sufficient, math.isnan(found.drift_ppm), found.drift_sigma_ppm) == (False, True, math.inf)


def test_messages_of_two_instants_alone_do_not_settle_a_drift() -> None:
    stamps = np.repeat([0.0, 10e6], 50)
    assert not estimate_time_offset(stamps, stamps + np.tile(np.arange(50) * 100.0, 2)).sufficient


def test_other_shapes_of_stamps_are_refused() -> None:
    with pytest.raises(ValueError, match="not \\[N\\] and \\[N\\]"):
        estimate_time_offset([1, 2], [1])
