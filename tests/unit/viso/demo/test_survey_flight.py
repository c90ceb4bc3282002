# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A whole flight: it begins and ends at rest, and is smooth in between."""

import math

import numpy as np
import pytest

from viso.companion.world.ground import generate_texture
from viso.demo.survey_flight import COMPANION_CLOCK_NS, STAND_M, SurveyPlan, survey_flight

PLAN = SurveyPlan(climb_s=2.0, cruise_s=6.0, descent_s=20.0, landed_s=25.0, ramp_s=3.0, height_m=15.0, speed_m_s=6.0)


def test_vehicle_stands_before_the_climb_and_after_the_landing() -> None:
    motion = PLAN.trajectory().motion(np.array([0.0, 1.9, 25.1, 40.0]))
    assert motion.position_w[:, 2] == pytest.approx(STAND_M, abs=1e-9)
    assert motion.velocity_w == pytest.approx(0.0, abs=1e-6)
    assert motion.rates_b == pytest.approx(0.0, abs=1e-6)


def test_climb_and_descent_are_straight_up_and_down() -> None:
    motion = PLAN.trajectory().motion(np.concatenate([np.linspace(2.0, 6.0, 20), np.linspace(20.0, 25.0, 20)]))
    assert motion.velocity_w[:, :2] == pytest.approx(0.0, abs=1e-6)


def test_survey_has_its_height_and_speed() -> None:
    motion = PLAN.trajectory().motion(np.linspace(9.0, 17.0, 200))
    assert motion.position_w[:, 2] == pytest.approx(15.0, rel=0.04)
    assert np.linalg.norm(motion.velocity_w[:, :2], axis=1).mean() == pytest.approx(6.0, rel=0.25)


@pytest.mark.slow
def test_nothing_jerks() -> None:
    motion = PLAN.trajectory().motion(np.arange(0.0, 27.0, 0.005))
    assert np.abs(np.diff(motion.specific_force_b, axis=0)).max() < 0.15
    assert np.abs(np.diff(motion.rates_b, axis=0)).max() < 0.05


def test_flight_without_landing_goes_on() -> None:
    plan = SurveyPlan(climb_s=2.0, cruise_s=6.0)
    assert math.isinf(plan.landed_s)
    assert plan.trajectory().motion(np.array([100.0])).position_w[0, 2] == pytest.approx(30.0, rel=0.04)


def test_sensors_begin_at_the_companions_time() -> None:
    flight = survey_flight(PLAN, 1.0, seed=4, texture=generate_texture(size_px=64), covered_s=((0.2, 0.5),))
    assert (flight.start_ns, flight.duration_s, flight.seed) == (COMPANION_CLOCK_NS, 1.0, 4)
    assert flight.covered_s == ((0.2, 0.5),)
