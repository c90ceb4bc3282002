# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Rotations between times come out of attitudes, and nonsense is left out."""

import math

import numpy as np
import pytest

from tests.unit.viso.estimators.motions import integrated, motion
from viso.estimators.turning import attitudes_of, correlation_of, turn_pair, turns, windows
from viso.geometry.rotation import quats_from_euler

IDENTITY = [1.0, 0.0, 0.0, 0.0]


def test_rotation_at_a_steady_rate_is_rate_times_time() -> None:
    times = np.arange(0, 2e6, 1e4)
    track = attitudes_of(times, integrated(times, np.tile([0.1, -0.2, 3.0], (200, 1))))
    turned, known = turns(track, np.array([0.1234]), np.array([0.3234]))
    assert known.all()
    np.testing.assert_allclose(turned, [[0.02, -0.04, 0.6]], atol=1e-12)


def test_scale_and_sign_of_quaternions_do_not_matter() -> None:
    quats = quats_from_euler(np.linspace(0, 1, 60).reshape(-1, 3))
    times = np.arange(20) * 1e5
    scaled = quats * np.resize([3.0, -0.1, -1.0], (20, 1))
    at = np.arange(0.05, 1.7, 0.11)
    expected, _ = turns(attitudes_of(times, quats), at, at + 0.2)
    np.testing.assert_allclose(turns(attitudes_of(times, scaled), at, at + 0.2)[0], expected, atol=1e-12)


def test_what_cannot_be_used_is_left_out() -> None:
    times = [0, 1e6, 1e6, 0.5e6, 2e6, math.nan, 3e6, 4e6]
    quats = [IDENTITY] * 8
    quats[4] = [0.0] * 4
    quats[6] = [1.0, math.inf, 0.0, 0.0]
    assert attitudes_of(times, quats).time_s.tolist() == [0.0, 1.0, 4.0]


def test_nothing_is_known_in_a_gap_or_beyond_the_ends() -> None:
    track = attitudes_of([1e6, 1.1e6, 1.2e6, 2.2e6, 2.3e6], [IDENTITY] * 5)
    _, known = track.at(np.array([0.99, 1.0, 1.15, 1.7, 2.25, 2.31]))
    assert known.tolist() == [False, True, True, False, True, False]


@pytest.mark.parametrize("count", [0, 1])
def test_so_few_samples_tell_nothing(count: int) -> None:
    track = attitudes_of(np.zeros(count), np.ones((count, 4)))
    assert len(track) == count
    assert not track.at(np.array([0.0]))[1].any()


@pytest.mark.parametrize(("times", "motion_shape"), [(3, (3, 3)), (2, (3, 4)), (3, (3,))])
def test_other_shapes_are_refused(times: int, motion_shape: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match="not \\[N\\] and \\[N, 4\\]"):
        attitudes_of(np.arange(times), np.ones(motion_shape))


def test_windows_are_as_long_as_asked_and_none_spans_a_gap() -> None:
    time_s = np.concatenate([np.arange(0, 1, 0.1), np.arange(3, 4, 0.1)])
    start, end = windows(time_s, 0.2)
    np.testing.assert_allclose(time_s[end] - time_s[start], 0.2)
    assert len(start) == 16


VECTORS = np.random.default_rng(50).normal(size=(30, 3))


def test_correlation_is_one_of_equals_and_none_without_motion() -> None:
    assert correlation_of(VECTORS, 3 * VECTORS) == 1.0
    assert correlation_of(VECTORS, -VECTORS) == -1.0
    assert correlation_of(VECTORS, 0 * VECTORS) == 0.0


def test_rotations_of_the_vehicle_are_those_of_the_delayed_stream() -> None:
    rng = np.random.default_rng(51)
    vehicle = motion(rng)
    pair = turn_pair(*vehicle.seen(rng, delay_ms=80, noise_rad=0.0), vehicle.time_us, vehicle.quat_wxyz)
    turned, known = pair.vehicle_rad(0.08)
    assert known.all()
    np.testing.assert_allclose(pair.stream_rad, turned, atol=1e-12)


def test_thinned_rotations_overlap_by_half() -> None:
    rng = np.random.default_rng(52)
    vehicle = motion(rng)
    pair = turn_pair(*vehicle.seen(rng, hz=90), vehicle.time_us, vehicle.quat_wxyz)
    sparse = pair.thinned()
    assert 0.4 < np.median(np.diff(sparse.start_s)) / pair.window_s <= 0.55


def test_rotations_of_a_long_stream_are_thinned_out_evenly() -> None:
    times = np.arange(25_000) * 2e4
    pair = turn_pair(times, [IDENTITY] * len(times), times, [IDENTITY] * len(times))
    spread = pair.spread()
    assert 0.3 * len(pair) < len(spread) <= 10_000
    assert np.unique(np.round(np.diff(spread.start_s), 6)).tolist() == [0.06]
    assert len(spread.spread()) == len(spread)
