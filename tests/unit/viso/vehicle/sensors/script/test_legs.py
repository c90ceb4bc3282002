# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Legs go where they say, from rest to rest, and what they say of velocity and acceleration is true of their way."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ekf_stub.inputs.measurements import Array
from viso.vehicle.sensors.script.legs import (
    CurveAt,
    CurveLeg,
    Leg,
    Motion,
    PointLeg,
    SquareLeg,
    circle,
    figure_eight,
    line,
    min_jerk,
)
from viso.vehicle.sensors.vectors import Three

ORIGIN = (0.0, 0.0, 0.0)
STEP_S = 1e-4

LENGTHS = st.floats(0.5, 10.0)
PLACES = st.tuples(*[st.floats(-10.0, 10.0)] * 3)
ANGLES = st.tuples(*[st.floats(-1.0, 1.0)] * 3)
BEARINGS = st.floats(-math.pi, math.pi)
PERIODS = st.floats(4.0, 20.0)
LAPS = st.sampled_from([1, 2, 5, math.inf])
CURVES: st.SearchStrategy[CurveAt] = st.one_of(
    st.builds(line, LENGTHS), st.builds(circle, LENGTHS), st.builds(figure_eight, LENGTHS, LENGTHS)
)


@st.composite
def curve_legs(draw: st.DrawFn) -> CurveLeg:
    period_s = draw(PERIODS)
    begin = draw(PLACES), draw(ANGLES), draw(BEARINGS)
    return CurveLeg(
        draw(CURVES), *begin, period_s, draw(st.floats(0.05, 1.0)) * period_s, draw(LAPS), draw(st.booleans())
    )


CURVE_LEGS = curve_legs()
POINT_LEGS = st.builds(PointLeg, PLACES, PLACES, ANGLES, ANGLES, PERIODS)
SQUARE_LEGS = st.builds(SquareLeg, PLACES, ANGLES, BEARINGS, LENGTHS, PERIODS, LAPS)
LEGS: st.SearchStrategy[Leg] = st.one_of(POINT_LEGS, CURVE_LEGS, SQUARE_LEGS)


def end_of(leg: Leg) -> Motion:
    return leg.at(leg.duration_s)


def slope(value_at: Callable[[float], Three], t: float) -> Array:
    change = np.subtract(value_at(t + STEP_S), value_at(t - STEP_S))
    return change / (2 * STEP_S)


def test_least_jerk_way_is_smooth_at_its_ends() -> None:
    assert min_jerk(0.0) == (0, 0, 0)
    assert min_jerk(1.0) == (1, 0, 0)
    assert min_jerk(0.5) == (0.5, 1.875, 0)


@given(LEGS)
def test_leg_begins_and_ends_at_rest(leg: Leg) -> None:
    ends = [leg.at(0.0)] + ([end_of(leg)] if math.isfinite(leg.duration_s) else [])
    for motion in ends:
        assert motion.vel == pytest.approx(ORIGIN, abs=1e-9)
        assert motion.acc == pytest.approx(ORIGIN, abs=1e-9)


@given(st.one_of(CURVE_LEGS, SQUARE_LEGS))
def test_laps_end_where_they_begin(leg: CurveLeg | SquareLeg) -> None:
    assert leg.at(0.0).pos == pytest.approx(leg.start, abs=1e-9)
    if math.isfinite(leg.duration_s):
        assert end_of(leg).pos == pytest.approx(leg.start, abs=1e-9)


@given(POINT_LEGS)
def test_point_and_attitude_are_reached(leg: PointLeg) -> None:
    assert (leg.at(0.0).pos, leg.at(0.0).rpy) == (leg.start, leg.start_rpy)
    assert end_of(leg).pos == pytest.approx(leg.end, abs=1e-12)
    assert end_of(leg).rpy == pytest.approx(leg.end_rpy, abs=1e-12)


@given(LEGS, st.floats(0.001, 0.999))
def test_velocity_and_acceleration_are_those_of_the_way(leg: Leg, part: float) -> None:
    t = part * min(leg.duration_s, 60.0)
    motion = leg.at(t)
    assert motion.vel == pytest.approx(slope(lambda time_s: leg.at(time_s).pos, t), abs=1e-5)
    # Where a side of a square meets the next, acceleration is continuous but has a kink.
    assert motion.acc == pytest.approx(slope(lambda time_s: leg.at(time_s).vel, t), abs=2e-2)


@given(CURVE_LEGS, st.floats(0.0, 1.0))
def test_full_speed_takes_a_period_a_lap(leg: CurveLeg, part: float) -> None:
    t = leg.ramp_s + part * (leg.period_s - leg.ramp_s)
    if t + leg.period_s <= leg.duration_s - leg.ramp_s:
        assert leg.at(t + leg.period_s).pos == pytest.approx(leg.at(t).pos, abs=1e-8)


@given(st.builds(circle, LENGTHS) | st.builds(figure_eight, LENGTHS, LENGTHS), BEARINGS, st.floats(0.1, 30.0))
def test_nose_keeps_its_angle_to_the_path(curve: CurveAt, bearing: float, t: float) -> None:
    leg = CurveLeg(curve, ORIGIN, (0.0, 0.0, bearing), bearing, 5.0, 1.0, turns=True)
    start, motion = leg.at(1e-3), leg.at(t)
    travel = [math.atan2(one.vel[1], one.vel[0]) for one in (start, motion)]
    turned = motion.rpy[2] - start.rpy[2]
    assert math.remainder(travel[1] - travel[0] - turned, 2 * math.pi) == pytest.approx(0.0, abs=1e-6)


@given(st.builds(circle, LENGTHS) | st.builds(figure_eight, LENGTHS, LENGTHS), st.floats(0.1, 30.0))
def test_yaw_turns_without_jumps(curve: CurveAt, t: float) -> None:
    leg = CurveLeg(curve, ORIGIN, ORIGIN, 0.0, 5.0, 1.0, turns=True)
    assert abs(leg.at(t + STEP_S).rpy[2] - leg.at(t).rpy[2]) < 0.1


@pytest.mark.parametrize(("curve", "place"), [
    (circle(2.0), (-3.0, 2.0, -3.0)),
    (line(5.0), (1.0, 7.0, -3.0)),
    (figure_eight(5.0, 2.0), (1.0, 2.0, -3.0)),
])  # fmt: skip
def test_half_a_lap_leads_to_the_other_side(curve: CurveAt, place: tuple[float, ...]) -> None:
    leg = CurveLeg(curve, (1.0, 2.0, -3.0), ORIGIN, math.pi / 2, 8.0, 2.0, laps=1)
    assert leg.at(0.5 * leg.duration_s).pos == pytest.approx(place)


def test_eight_begins_ahead_and_to_the_right_and_lies_as_it_is_told() -> None:
    leg = CurveLeg(figure_eight(6.0, 2.0), ORIGIN, ORIGIN, math.pi / 2, 8.0, 4.0, laps=1)
    way = np.array([leg.at(t).pos for t in np.linspace(0.0, leg.duration_s, 2001)])
    assert way.max(axis=0) == pytest.approx([1.0, 3.0, 0.0], abs=1e-4)
    assert way.min(axis=0) == pytest.approx([-1.0, -3.0, 0.0], abs=1e-4)
    north, east, _ = leg.at(1.0).vel
    assert (north, east) == pytest.approx((-east * 2.0 / 3.0, east), rel=0.01)
    assert east > 0


def test_square_turns_right_in_its_corners() -> None:
    square = SquareLeg((1.0, 2.0, -3.0), ORIGIN, math.pi / 2, 3.0, 8.0, laps=1)
    corners = [square.at(2.0 * number).pos for number in range(4)]
    assert corners == [pytest.approx(place) for place in ((1, 2, -3), (1, 5, -3), (-2, 5, -3), (-2, 2, -3))]
