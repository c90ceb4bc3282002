# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Points that are held while a body hardly moves."""

import copy
import functools

import numpy as np
import pytest

from tests.flights import hover
from tests.unit.viso.companion.msckf.point_world import B_T_C, SIGMA, PointWorld, filter_at
from viso.companion.msckf.estimator import WindowEstimator
from viso.companion.msckf.held_points import FEWEST_HELD, MOST_HELD
from viso.companion.msckf.window_filter import POS, HeldPoint, sigma_of

FRAMES = 25


@functools.cache
def hovering(depth_m: float) -> tuple[WindowEstimator, list[float]]:
    """Return an estimator that has hovered at 40 m for 2.5 s, and how far off it was."""
    world = PointWorld(0, hover(40.0, seed=0))
    estimator = WindowEstimator(filter_at(*world.start()), B_T_C, SIGMA, 11, 3)
    off_m = []
    for moment in world.moments(FRAMES):
        if moment.number > 1:
            estimator.propagate(moment.window)
        estimator.compare(moment.sighting)
        estimator.add_frame(moment.number, moment.sighting, None, 1, depth_m)
        off_m.append(float(np.linalg.norm(estimator.state.p - moment.pose.t)))
    return estimator, off_m


@pytest.mark.parametrize("depth_m", [20.0, 40.0])
def test_body_that_hovers_stays_where_it_is(depth_m: float) -> None:
    estimator, off_m = hovering(depth_m)
    assert FEWEST_HELD <= len(estimator.state.points) <= MOST_HELD
    assert max(off_m) < 0.4
    assert off_m[-1] < 4 * sigma_of(estimator.state.cov[POS, POS])


def test_depth_of_points_held_is_never_learnt() -> None:
    estimator, _ = hovering(20.0)
    assert {point.at[2] for point in estimator.state.points} == {1 / 20.0}


def test_points_out_of_sight_are_held_no_more_and_leave_the_rest_alone() -> None:
    estimator, _ = hovering(20.0)
    state = copy.deepcopy(estimator.state)
    before = state.cov[: state.clones_end, : state.clones_end].copy()
    state.release({point.number for point in state.points})
    assert not state.points
    np.testing.assert_array_equal(state.cov, before)


def test_point_goes_with_the_pose_that_it_is_told_from() -> None:
    world = PointWorld(0)
    state = filter_at(*world.start())
    for number in (1, 2):
        state.clone(number)
        state.hold(HeldPoint(10 + number, number, np.array([0.1, 0.2, 0.025])), SIGMA, 0.01, None)
    state.drop(1)
    assert [point.number for point in state.points] == [12]
    assert len(state.cov) == state.clones_end + 3
    assert state.cov[-1, -1] == pytest.approx(0.01**2)
