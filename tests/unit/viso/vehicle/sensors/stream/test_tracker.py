# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Velocity, acceleration and rates as a stream of poses tells them."""

import math

import numpy as np
import pytest

from ekf_stub.core.vectors import ONE, quat_of_euler
from viso.vehicle.sensors.stream.follower import MAX_RATE, MAX_SPEED, StreamTracker
from viso.vehicle.sensors.stream.imagined_vehicle import MAX_ACCEL, Movement
from viso.vehicle.sensors.vectors import ZERO, rotation_between

REST = Movement(ZERO, ZERO, ZERO, ONE, ZERO)


@pytest.mark.parametrize("interval_s", [0.01, 0.033, 0.1, 0.25])
def test_constant_acceleration_and_rate_are_found(interval_s: float) -> None:
    tracker = StreamTracker(0.0, REST)
    for number in range(1, round(8.0 / interval_s)):
        t = number * interval_s
        tracker.take(t, (0.5 * t * t, -2.0 * t, 3.0), quat_of_euler(0.0, 0.0, 1.5 * t))
    ahead_s = tracker.time_s + 0.05
    movement = tracker.at(ahead_s)
    assert movement.pos == pytest.approx((0.5 * ahead_s**2, -2.0 * ahead_s, 3.0), abs=0.01)
    assert movement.vel == pytest.approx((ahead_s, -2.0, 0.0), abs=0.01)
    assert movement.acc == pytest.approx((1.0, 0.0, 0.0), abs=0.01)
    assert movement.rate == pytest.approx((0.0, 0.0, 1.5), abs=0.001)
    assert math.hypot(*rotation_between(movement.quat, quat_of_euler(0.0, 0.0, 1.5 * ahead_s))) < 0.001


def test_noise_is_smoothed() -> None:
    rng = np.random.default_rng(6)
    tracker = StreamTracker(0.0, REST)
    shown = []
    for number in range(1, 3000):
        x, y, z = 0.01 * rng.standard_normal(3)
        tracker.take(number / 30.0, (x, y, z), quat_of_euler(0.0, 0.0, math.radians(0.2) * rng.standard_normal()))
        shown.append((*tracker.at(tracker.time_s).pos, *tracker.at(tracker.time_s).vel))
    pos_and_vel = np.std(shown, axis=0)
    assert pos_and_vel[:3].max() < 0.008
    assert pos_and_vel[3:].max() < 0.1


def test_what_it_believes_is_limited() -> None:
    rng = np.random.default_rng(7)
    tracker = StreamTracker(0.0, REST)
    for number in range(1, 1000):
        x, y, z = 1e6 * rng.standard_normal(3)
        tracker.take(0.001 * number, (x, y, z), quat_of_euler(*rng.uniform(-3.0, 3.0, 3)))
        movement = tracker.at(tracker.time_s)
        assert math.hypot(*movement.vel) <= MAX_SPEED + 1e-9
        assert math.hypot(*movement.acc) <= MAX_ACCEL + 1e-9
        assert math.hypot(*movement.rate) <= MAX_RATE + 1e-9
