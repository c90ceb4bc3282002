# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Position, velocity, attitude, rates and forces of a flight agree with each other, as a vehicle's do."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.unit.viso.companion.world.from_ground import from_ground
from viso.companion.vio.frames import GRAVITY_MSS
from viso.companion.world.motion import FlightPath, nadir_survey
from viso.geometry.rotation import so3_exp, so3_log, yaw_of

SURVEY = nadir_survey(seed=1)
FLIGHTS = {
    "survey": SURVEY,
    "fast": nadir_survey(20.0, 150.0, seed=2),
    "from ground": from_ground(SURVEY, still_s=4.0, climb_s=8.0, ramp_s=5.0),
}
UP = np.array([0.0, 0.0, 1.0])
MILLISECONDS = np.linspace(0.0, 0.3, 301)
flights = st.sampled_from(sorted(FLIGHTS))
times = st.floats(0.0, 60.0)


@pytest.mark.slow
@given(flights, times)
def test_velocity_integrates_to_the_position(name: str, start_s: float) -> None:
    motion = FLIGHTS[name].motion(start_s + MILLISECONDS)
    moved = np.trapezoid(motion.velocity_w, motion.t_s, axis=0)
    assert moved == pytest.approx(motion.position_w[-1] - motion.position_w[0], abs=6e-7)


@pytest.mark.slow
@given(flights, times)
def test_specific_force_and_gravity_integrate_to_the_velocity(name: str, start_s: float) -> None:
    motion = FLIGHTS[name].motion(start_s + MILLISECONDS)
    acceleration = np.einsum("nij,nj->ni", motion.rotation_wb, motion.specific_force_b) - GRAVITY_MSS * UP
    gained = np.trapezoid(acceleration, motion.t_s, axis=0)
    assert gained == pytest.approx(motion.velocity_w[-1] - motion.velocity_w[0], abs=6e-7)


@pytest.mark.slow
@given(flights, times)
def test_rates_integrate_to_the_attitude(name: str, start_s: float) -> None:
    motion = FLIGHTS[name].motion(start_s + MILLISECONDS)
    rotation = motion.rotation_wb[0]
    for rates in 0.5 * (motion.rates_b[1:] + motion.rates_b[:-1]):
        rotation = rotation @ so3_exp(1e-3 * rates)
    assert np.linalg.norm(so3_log(motion.rotation_wb[-1].T @ rotation)) < 6e-7


@given(flights, times)
def test_attitude_has_the_yaw(name: str, time_s: float) -> None:
    flight = FLIGHTS[name]
    yaw_rad = float(flight.yaw_rad(np.array([time_s]))[0])
    assert math.remainder(yaw_of(flight.pose(time_s).R) - yaw_rad, 2 * math.pi) == pytest.approx(0, abs=1e-9)


@given(flights, times)
def test_single_pose_and_velocity_are_those_of_the_motion(name: str, time_s: float) -> None:
    flight = FLIGHTS[name]
    motion = flight.motion(np.array([time_s]))
    pose = flight.pose(time_s)
    assert np.abs(pose.R - motion.rotation_wb[0]).max() < 1e-12
    assert pose.t == pytest.approx(motion.position_w[0], abs=1e-12)
    assert flight.velocity_w(time_s) == pytest.approx(motion.velocity_w[0], abs=1e-12)


def lean_deg(flight: FlightPath) -> np.ndarray:
    return np.degrees(np.arccos(flight.motion(np.arange(0, 60, 0.1)).rotation_wb[:, 2, 2]))


@pytest.mark.parametrize("name", sorted(FLIGHTS))
def test_vehicle_leans_as_far_as_a_multicopter_does(name: str) -> None:
    assert 0.5 < lean_deg(FLIGHTS[name]).max() < 32


def test_survey_leans_against_the_drag() -> None:
    motion = SURVEY.motion(np.arange(0, 60, 0.05))
    forward = np.einsum("nij,nj->ni", motion.rotation_wb.transpose(0, 2, 1), motion.velocity_w)[:, 0]
    assert (motion.specific_force_b[:, 0] @ forward) / (forward @ forward) == pytest.approx(-0.12, abs=0.02)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("speed_m_s", [8.0, 15.0])
def test_survey_is_flown_at_its_speed_on_average(seed: int, speed_m_s: float) -> None:
    velocity = nadir_survey(speed_m_s, seed=seed).motion(np.arange(0, 60, 0.1)).velocity_w
    assert np.linalg.norm(velocity, axis=1).mean() == pytest.approx(speed_m_s, rel=0.05)


@pytest.mark.parametrize("seed", range(3))
def test_survey_keeps_about_its_height(seed: int) -> None:
    height = nadir_survey(height_m=100.0, seed=seed).motion(np.arange(0, 60, 0.1)).position_w[:, 2]
    assert height.min() > 96
    assert height.max() < 104
    assert np.ptp(height) > 5


@pytest.mark.parametrize(("extent_m", "expected"), [(80.0, 80.0), (None, 120.0)])
def test_survey_has_its_extent(extent_m: float | None, expected: float) -> None:
    position = nadir_survey(extent_m=extent_m).motion(np.arange(0, 60, 0.1)).position_w
    assert 2 * np.linalg.norm(position[:, :2], axis=1).max() == pytest.approx(expected, rel=0.15)


def test_survey_flies_nose_ahead() -> None:
    motion = SURVEY.motion(np.arange(0, 60, 0.1))
    course = np.arctan2(motion.velocity_w[:, 1], motion.velocity_w[:, 0])
    assert np.abs(np.exp(1j * (course - SURVEY.yaw_rad(motion.t_s))) - 1).max() < 1e-6


def test_survey_turns_to_all_sides_without_a_jump() -> None:
    yaw = SURVEY.yaw_rad(np.arange(0, 60, 0.01))
    assert np.ptp(yaw) == pytest.approx(math.radians(270), abs=0.01)
    assert np.abs(np.diff(yaw)).max() < 0.02


def test_seed_changes_the_survey() -> None:
    assert np.linalg.norm(nadir_survey(seed=1).pose(3.0).t - nadir_survey(seed=2).pose(3.0).t) > 1


def test_vehicle_stands_still_and_level_before_take_off() -> None:
    motion = FLIGHTS["from ground"].motion(np.arange(0, 3.9, 0.1))
    assert np.ptp(motion.position_w, axis=0).max() < 1e-12
    assert motion.position_w[0, 2] == pytest.approx(0.25)
    assert np.abs(motion.rates_b).max() < 1e-9
    assert motion.specific_force_b == pytest.approx(np.tile([0, 0, GRAVITY_MSS], (39, 1)), abs=1e-9)


def test_vehicle_climbs_straight_up() -> None:
    position = FLIGHTS["from ground"].motion(np.arange(4, 12, 0.1)).position_w
    assert np.ptp(position[:, :2], axis=0).max() < 1e-12
    assert (np.diff(position[:, 2]) >= 0).all()


def test_flight_goes_over_into_the_other_one() -> None:
    after, other = FLIGHTS["from ground"].motion(np.array([20.0])), SURVEY.motion(np.array([20.0 - 4 - 8 - 2.5]))
    assert after.position_w == pytest.approx(other.position_w, abs=1e-9)
    assert after.velocity_w == pytest.approx(other.velocity_w, abs=1e-6)
