# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Scale and axes of positions are found whatever the drift, the origin and the heading."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.unit.viso.estimators.conftest import Flight
from tests.unit.viso.estimators.motions import smooth
from viso.estimators.axis_rotations import AxisMap
from viso.estimators.positions import estimate_position_axes, estimate_scale
from viso.geometry.rotation import Array

STEP_US = 5e4


def walk(rng: np.random.Generator, span_s: float = 60.0, speed_mps: float = 0.7) -> tuple[Array, Array]:
    """Return times in us and a random path, NED."""
    velocity = smooth(rng, int(span_s * 1e6 / STEP_US), STEP_US * 1e-6, 0.2)
    velocity *= speed_mps / velocity.std()
    time_us = np.arange(len(velocity), dtype=np.float64) * STEP_US
    steps_s = np.diff(time_us)[:, None] * 1e-6
    path: Array = np.vstack([np.zeros((1, 3)), np.cumsum(0.5 * (velocity[1:] + velocity[:-1]) * steps_s, axis=0)])
    return time_us, path


def seen(rng: np.random.Generator, path: Array, *, scale: float = 1.0, noise_m: float = 0.02) -> Array:
    """Return the path as a stream has it: smaller by its scale, from elsewhere, drifting, noisy."""
    drift = np.cumsum(rng.normal(0, 0.002, path.shape), axis=0)
    return (path + drift) / scale + [3.0, -7.0, 20.0] + rng.normal(0, noise_m, path.shape)


@settings(max_examples=15)
@given(scale=st.floats(0.2, 5.0), seed=st.integers(0, 2**32 - 1))
def test_any_scale_is_found_within_its_uncertainty(scale: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    time_us, path = walk(rng)
    found = estimate_scale(time_us[::2], seen(rng, path, scale=scale)[::2], time_us, path)
    assert found.sufficient
    # Noise of the stream alone makes total least squares too large by its share of the displacement, here 1 in 1000.
    assert abs(found.scale - scale) < 5 * found.sigma + 0.003 * scale
    assert found.sigma < 0.02 * scale


def test_uncertainty_of_the_scale_is_that_of_repeated_trials() -> None:
    rng = np.random.default_rng(30)
    time_us, path = walk(rng)
    trials = [estimate_scale(time_us, seen(rng, path, scale=1.2), time_us, path) for _ in range(30)]
    spread = float(np.std([trial.scale for trial in trials]))
    assert 0.5 < spread / np.mean([trial.sigma for trial in trials]) < 1.7


@pytest.mark.parametrize("axes", [(2, 1, -3), (-2, 1, 3), (1, 2, -3)])
def test_axes_do_not_matter_for_the_scale(axes: tuple[int, int, int]) -> None:
    rng = np.random.default_rng(31)
    time_us, path = walk(rng)
    stream = seen(rng, path, scale=1.5) @ AxisMap(axes).matrix
    assert estimate_scale(time_us, stream, time_us, path).scale == pytest.approx(1.5, rel=0.02)


def test_delay_is_allowed_for_and_jumps_do_little() -> None:
    rng = np.random.default_rng(32)
    time_us, path = walk(rng)
    stream = seen(rng, path, scale=0.8)
    stream[600:] += [5.0, -4.0, 1.0]
    late = estimate_scale(time_us + 2e5, stream, time_us, path, delay_ms=200)
    assert late.scale == pytest.approx(0.8, rel=0.02)
    assert late.correlation > 0.99


@pytest.mark.slow
def test_scale_of_the_recorded_flight_is_one_and_a_planted_one_is_found(flight: Flight) -> None:
    reference = flight.ekf_us, flight.ekf_ned_m
    own = estimate_scale(flight.stamp_us, flight.pos_m, *reference)
    assert own.scale == pytest.approx(1.0, abs=0.02)
    halved = estimate_scale(flight.stamp_us, flight.pos_m / 2, *reference)
    assert halved.scale == pytest.approx(2 * own.scale, rel=0.005)


@pytest.mark.parametrize(("speed_mps", "noise_m"), [(1e-9, 0.02), (0.01, 0.02), (0.03, 1e-4)])
def test_vehicle_at_rest_has_no_scale(speed_mps: float, noise_m: float) -> None:
    rng = np.random.default_rng(33)
    time_us, path = walk(rng, speed_mps=speed_mps)
    stream = path + rng.normal(0, noise_m, path.shape)
    found = estimate_scale(time_us, stream, time_us, path)
    assert (found.sufficient, math.isnan(found.scale), found.sigma) == (False, True, math.inf)


def test_positions_that_never_change_have_no_scale() -> None:
    time_us, path = walk(np.random.default_rng(38))
    assert not estimate_scale(time_us, np.zeros_like(path), time_us, path).sufficient
    assert not estimate_scale(time_us, path, time_us, np.zeros_like(path)).sufficient


def test_path_of_another_vehicle_has_no_scale() -> None:
    rng = np.random.default_rng(34)
    (time_us, path), (_, other) = walk(rng), walk(rng)
    assert not estimate_scale(time_us, seen(rng, other), time_us, path).sufficient


@pytest.mark.parametrize(("signed_axes", "name"), [
    ((1, 2, 3), "NED"),
    ((2, 1, -3), "ENU"),
    ((1, -2, -3), "NWU"),
    ((1, 2, -3), "NEU"),
    ((2, 1, 3), "END"),
])  # fmt: skip
def test_axes_of_positions_are_found_mirrored_or_not(signed_axes: tuple[int, int, int], name: str) -> None:
    rng = np.random.default_rng(35)
    time_us, path = walk(rng)
    stream = seen(rng, path, scale=1.3) @ AxisMap(signed_axes).matrix
    found = estimate_position_axes(time_us, stream, time_us, path)
    assert found.sufficient
    assert found.name == name
    assert (found.axes.rotation is None) == (name in ("NEU", "END"))
    assert found.text.startswith("position x is earth ")


def test_positions_by_an_arbitrary_heading_are_upright() -> None:
    rng = np.random.default_rng(36)
    time_us, path = walk(rng)
    cos, sin = math.cos(math.radians(37)), math.sin(math.radians(37))
    stream = path @ np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]])  # x points to 37 deg, y to the right of it
    found = estimate_position_axes(time_us, seen(rng, stream), time_us, path, heading_deg=37)
    assert found.axes.is_identity
    assert found.choice.correlation > 0.98


def test_axis_without_motion_is_not_settled() -> None:
    rng = np.random.default_rng(37)
    time_us, path = walk(rng)
    flat = path * [1.0, 1.0, 0.0] + rng.normal(0, 0.01, path.shape)
    assert not estimate_position_axes(time_us, seen(rng, path * [1.0, 1.0, 0.0]), time_us, flat).sufficient


def test_too_few_positions_tell_nothing() -> None:
    for count in (0, 1, 20):
        times, places = np.arange(count) * 1e5, np.ones((count, 3))
        assert not estimate_scale(times, places, times, places).sufficient
        assert not estimate_position_axes(times, places, times, places).sufficient


def test_other_shapes_of_positions_are_refused() -> None:
    with pytest.raises(ValueError, match="not \\[N\\] and \\[N, 3\\]"):
        estimate_scale([1, 2], np.ones((3, 3)), [1, 2], np.ones((2, 3)))
