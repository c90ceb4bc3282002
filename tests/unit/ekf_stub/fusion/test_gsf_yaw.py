# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Yaw by the velocity of GPS: what the five models find out, and when."""

import math

import numpy as np
import pytest

from ekf_stub.filter.inertial import GRAVITY_MSS, InertialStep
from ekf_stub.filter.release import FEBRUARY_2026, REFERENCE, FilterRelease
from ekf_stub.fusion.gsf_yaw import MAX_BIAS, GsfYaw

DT = 0.01
STEPS_PER_FIX = 20
AT_REST = InertialStep(0, np.array([0.0, 0.0, -GRAVITY_MSS * DT]), np.zeros(3), DT, DT)


class Flight:
    """A level vehicle that is shaken in circles under the GSF, too fast for its tilt to follow; m/s north and east."""

    def __init__(self, heading: float, *, tilt_bias: float = 0.0) -> None:
        self.gsf = GsfYaw()
        self._heading = heading
        self._rate = np.array([tilt_bias, 0.0, 0.0])
        self.vel = np.zeros(2)
        self._steps = 0
        self.gsf.predict(AT_REST, may_run=False)

    def go(self, duration_s: float, *, may_run: bool = True, accel_mss: float = 6.0) -> None:
        for _ in range(round(duration_s / DT)):
            self._steps += 1
            angle = 4 * self._steps * DT
            accel = accel_mss * np.array([math.cos(angle), math.sin(angle)])
            self.vel += DT * accel
            cos, sin = math.cos(self._heading), math.sin(self._heading)
            felt = np.array([cos * accel[0] + sin * accel[1], cos * accel[1] - sin * accel[0], -GRAVITY_MSS])
            step = InertialStep(10 * self._steps, felt * DT, self._rate * DT, DT, DT)
            self.gsf.predict(step, may_run=may_run)
            if self._steps % STEPS_PER_FIX == 0:
                north, east = self.vel.tolist()
                self.gsf.fuse(north, east, 0.3)

    def yaw_error_deg(self) -> float:
        yaw, _ = self.gsf.estimate()
        return math.degrees(math.remainder(yaw - self._heading, 2 * math.pi))


@pytest.mark.parametrize("heading", [0.3, -2.9])
def test_models_find_the_yaw_by_which_velocity_follows_acceleration(heading: float) -> None:
    flight = Flight(heading)
    flight.go(5.0)
    _, variance = flight.gsf.estimate()
    assert abs(flight.yaw_error_deg()) < 3
    assert math.degrees(math.sqrt(variance)) < 5
    assert flight.gsf.innovation_length() < 0.5


def test_nothing_is_known_while_there_is_no_acceleration() -> None:
    flight = Flight(0.3)
    flight.go(3.0, accel_mss=0.0)
    _, variance = flight.gsf.estimate()
    assert math.degrees(math.sqrt(variance)) > 30


@pytest.mark.parametrize(("may_run", "is_running"), [(True, True), (False, False)])
def test_velocity_is_fused_only_while_it_may_be(may_run: bool, is_running: bool) -> None:
    flight = Flight(0.3)
    flight.go(0.5, may_run=may_run)
    assert flight.gsf.is_running is is_running
    assert (flight.gsf.report() is not None) is is_running


def test_models_begin_anew_after_a_pause() -> None:
    flight = Flight(0.3)
    flight.go(5.0)
    flight.go(DT, may_run=False)
    assert not flight.gsf.is_running
    flight.go(0.2)
    report = flight.gsf.report()
    assert report is not None
    assert report.weights == (0.2,) * 5


def test_models_begin_anew_once_none_explains_the_velocity() -> None:
    flight = Flight(0.3)
    flight.go(5.0)
    flight.vel += 100
    flight.go(0.2)
    assert not flight.gsf.is_running


def test_tilt_is_taken_only_near_1_g() -> None:
    gsf = GsfYaw()
    falls = InertialStep(10, np.array([0.0, 0.0, -0.5 * GRAVITY_MSS * DT]), np.zeros(3), DT, DT)
    for _ in range(50):
        gsf.predict(falls, may_run=True)
        gsf.fuse(0.0, 0.0, 0.3)
    assert not gsf.is_running


@pytest.mark.parametrize(("release", "follows"), [(REFERENCE, False), (FEBRUARY_2026, True)])
def test_load_below_1_g_counts_since_february(release: FilterRelease, follows: bool) -> None:
    gsf, tilt = GsfYaw(release), 0.1
    accel = 0.9 * GRAVITY_MSS * np.array([math.sin(tilt), 0.0, -math.cos(tilt)])
    gsf.predict(AT_REST, may_run=True)
    for _ in range(100):
        gsf.predict(InertialStep(10, accel * DT, np.zeros(3), DT, DT), may_run=True)
    assert (gsf.gyro_bias[1] != 0) == follows


def test_gyro_bias_is_learned_slowly_and_within_limits() -> None:
    flight = Flight(0.0, tilt_bias=0.1)
    flight.go(2.0)
    bias = flight.gsf.gyro_bias[0]
    assert 0 < bias < MAX_BIAS
