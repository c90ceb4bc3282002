# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A path is told from one of something else, whatever its axes, its scale, its delay and its jumps."""

import math

import numpy as np
import pytest

from tests.unit.viso.estimators.test_positions import seen, walk
from viso.estimators.axis_rotations import AxisMap
from viso.estimators.likeness import departure, estimate_likeness, rests
from viso.geometry.rotation import Array

GPS_M = 1.5


def turned(path: Array, heading_deg: float) -> Array:
    cos, sin = math.cos(math.radians(heading_deg)), math.sin(math.radians(heading_deg))
    return np.asarray(path @ np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]]).T)


@pytest.mark.parametrize(
    ("axes", "scale", "delay_s"), [((1, 2, 3), 1.0, 0.0), ((2, 1, -3), 1.0, 0.4), ((3, -1, -2), 2.5, 0.1)]
)
def test_path_of_the_vehicle_is_like_it_in_any_axes(axes: tuple[int, int, int], scale: float, delay_s: float) -> None:
    rng = np.random.default_rng(1)
    time_us, path = walk(rng)
    sent = turned(seen(rng, path, scale=scale) @ AxisMap(axes).matrix, 70.0)
    found = estimate_likeness(time_us + 1e6 * delay_s, sent, time_us, path, noise_m=0.05)
    assert found.sufficient
    assert found.correlation > 0.95
    assert found.unlike < 0.05


def test_path_of_something_else_is_not() -> None:
    rng = np.random.default_rng(2)
    time_us, path = walk(rng)
    found = estimate_likeness(time_us, walk(rng)[1], time_us, path, noise_m=0.05)
    assert found.correlation < 0.7
    assert found.unlike > 0.5


def test_stream_that_stands_is_told_with_what_was_flown() -> None:
    rng = np.random.default_rng(3)
    time_us, path = walk(rng)
    found = estimate_likeness(time_us, rng.normal(0, 0.01, path.shape), time_us, path, noise_m=0.05)
    flown_m = float(np.sum(np.linalg.norm(np.diff(path[::40, :2], axis=0), axis=1)))
    assert found.flown_m == pytest.approx(flown_m, rel=0.25)
    assert found.ratio < 0.05
    assert found.worst_m == pytest.approx(
        np.linalg.norm(path[:, :2] - np.median(path[:, :2], axis=0), axis=1).max(), rel=0.2
    )


def test_what_sinks_is_not_taken_for_what_flies() -> None:
    time_us, path = walk(np.random.default_rng(4))
    path = path * (1, 1, 0) + np.outer(1e-6 * time_us, (0.5, 0, 0))
    sinking = np.column_stack([np.zeros((len(path), 2)), 2e-6 * time_us])
    assert estimate_likeness(time_us, sinking, time_us, path, noise_m=0.05).ratio < 0.01


def test_horizontal_reference_is_enough() -> None:
    rng = np.random.default_rng(5)
    time_us, path = walk(rng)
    assert estimate_likeness(time_us, seen(rng, path), time_us[::4], path[::4, :2], noise_m=0.05).correlation > 0.95


@pytest.mark.parametrize("noise_m", [0.05, GPS_M])
def test_jump_alone_is_no_other_motion(noise_m: float) -> None:
    time_us, path = walk(np.random.default_rng(6), speed_mps=2.0)
    jumped = path + np.outer(time_us > 3e7, (30.0, 0, 0))
    assert estimate_likeness(time_us, jumped, time_us, path, noise_m=noise_m).correlation > 0.9


def test_axes_may_turn_where_the_stream_began_anew() -> None:
    time_us, path = walk(np.random.default_rng(7))
    again = np.where((time_us > 3e7)[:, None], turned(path, 120.0), path)
    assert estimate_likeness(time_us, again, time_us, path, noise_m=0.05).correlation < 0.9
    assert estimate_likeness(time_us, again, time_us, path, noise_m=0.05, breaks_us=[3e7]).correlation > 0.99


def test_vehicle_that_hardly_moves_tells_nothing() -> None:
    rng = np.random.default_rng(8)
    time_us, path = walk(rng, speed_mps=0.1)
    assert not estimate_likeness(time_us, walk(rng)[1], time_us, path, noise_m=GPS_M).sufficient
    assert not estimate_likeness(time_us[:5], path[:5], time_us, path, noise_m=0.05).sufficient


def test_rest_is_told_with_how_far_the_stream_went_in_it() -> None:
    time_us, path = walk(np.random.default_rng(9))
    stands = np.where((time_us < 2e7)[:, None], path * 0.0, path + 5.0)
    found = rests(time_us, path, time_us, stands, noise_m=0.05)
    assert found
    assert all(one.end_us <= 21e6 and one.reference_m < 0.1 for one in found)
    assert max(one.stream_m for one in found) > 1.0


@pytest.mark.parametrize("factor", [1.0, -1.0, 0.7])
def test_height_departs_by_what_no_scale_explains(factor: float) -> None:
    height = 3 * np.sin(np.linspace(0, 9, 300))
    assert np.abs(departure(factor * height + 4, height, least_m=1.0)).max() < 1e-9
    sinking = factor * height + np.linspace(0, 20, 300)
    assert np.ptp(departure(sinking, height, least_m=1.0)) > 15
    assert np.ptp(departure(0.02 * height, 0.02 * height, least_m=1.0)) < 1e-9
