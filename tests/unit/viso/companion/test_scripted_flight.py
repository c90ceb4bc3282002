# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The scripted flight is one that a vehicle could fly."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from viso.companion.simulated_camera import Flight

FLIGHT = Flight(start_s=10.0)
TIMES = st.floats(0.0, FLIGHT.end_s + 10)


def test_flight_lasts_for_climb_loop_and_landing() -> None:
    assert FLIGHT.end_s == 10 + 4 + 24 + 4


@pytest.mark.parametrize("time_s", [0.0, 10.0, FLIGHT.end_s, FLIGHT.end_s + 60])
def test_vehicle_rests_at_its_place_before_and_after(time_s: float) -> None:
    assert FLIGHT.position_ned(time_s) == pytest.approx([0, 0, 0], abs=1e-9)
    assert FLIGHT.velocity_ned(time_s) == pytest.approx([0, 0, 0], abs=1e-6)


def test_figure_is_flown_at_its_height() -> None:
    assert [FLIGHT.position_ned(t)[2] for t in (14.0, 20.0, 38.0)] == pytest.approx([-3, -3, -3])


def test_climb_and_landing_are_vertical() -> None:
    assert all(np.all(FLIGHT.position_ned(t)[:2] == 0) for t in (11.0, 13.9))
    assert FLIGHT.position_ned(39.0)[:2] == pytest.approx([0, 0], abs=1e-9)


def test_figure_has_its_size() -> None:
    path = np.array([FLIGHT.position_ned(t) for t in np.arange(14, 38, 0.01)])
    assert np.abs(path).max(axis=0) == pytest.approx([4, 2.5, 3], abs=1e-2)


@settings(deadline=None)
@given(TIMES)
def test_position_is_continuous(time_s: float) -> None:
    step = FLIGHT.position_ned(time_s + 1e-4) - FLIGHT.position_ned(time_s)
    assert np.linalg.norm(step) < 1e-3


@settings(deadline=None)
@given(TIMES)
def test_velocity_is_continuous(time_s: float) -> None:
    step = FLIGHT.velocity_ned(time_s + 1e-3) - FLIGHT.velocity_ned(time_s)
    assert np.linalg.norm(step) < 2e-2


@pytest.mark.slow
@settings(deadline=None)
@given(TIMES, st.floats(0.1, 5.0))
def test_velocity_integrates_to_the_change_of_position(time_s: float, duration_s: float) -> None:
    times = np.linspace(time_s, time_s + duration_s, 501)
    moved = np.trapezoid([FLIGHT.velocity_ned(t) for t in times], times, axis=0)
    assert moved == pytest.approx(FLIGHT.position_ned(times[-1]) - FLIGHT.position_ned(time_s), abs=2e-3)


@settings(deadline=None)
@given(TIMES)
def test_velocity_is_that_of_a_multicopter(time_s: float) -> None:
    assert np.linalg.norm(FLIGHT.velocity_ned(time_s)) < 5.0


@settings(deadline=None)
@given(TIMES, st.floats(-math.pi, math.pi))
def test_heading_is_kept(time_s: float, heading_rad: float) -> None:
    assert Flight(10.0, heading_rad=heading_rad).attitude_rpy_rad(time_s)[2] == heading_rad


def test_vehicle_is_level_at_rest() -> None:
    assert FLIGHT.attitude_rpy_rad(0.0)[:2] == pytest.approx([0, 0], abs=1e-6)


@settings(deadline=None)
@given(TIMES, st.floats(-math.pi, math.pi))
def test_thrust_points_along_the_acceleration(time_s: float, heading_rad: float) -> None:
    flight = Flight(10.0, heading_rad=heading_rad)
    ahead, behind = flight.velocity_ned(time_s + 0.01), flight.velocity_ned(time_s - 0.01)
    north, east, _ = (ahead - behind) / 0.02
    roll, pitch, _ = flight.attitude_rpy_rad(time_s)
    forward = north * math.cos(heading_rad) + east * math.sin(heading_rad)
    right = east * math.cos(heading_rad) - north * math.sin(heading_rad)
    assert (-math.tan(pitch), math.tan(roll)) == pytest.approx((forward / 9.80665, right / 9.80665), abs=1e-6)


@settings(deadline=None)
@given(TIMES)
def test_vehicle_leans_as_far_as_a_multicopter_does(time_s: float) -> None:
    assert np.abs(np.degrees(FLIGHT.attitude_rpy_rad(time_s)[:2])).max() < 30
