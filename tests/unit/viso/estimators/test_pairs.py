# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Vectors are compared with those of the same time."""

import numpy as np

from tests.unit.viso.estimators.motions import motion
from viso.estimators.pairs import correlation_of, turn_pair

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
