# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The door to gtsam: what each kind of measurement does, what is forgotten, and what cannot be solved."""

import importlib
import sys
from typing import Any

import numpy as np
import pytest

pytest.importorskip("cv2")
pytest.importorskip("gtsam")

from tests.unit.viso.companion.smoother.scene import B_T_C, NOISE, PERIOD_NS, SIGMA, WALL, pose_at, velocity_at, window
from viso.companion.smoother.lag_smoother import (
    LAG_S,
    LagSmoother,
    LandmarkSighting,
    Motion,
    SmootherError,
    preintegrated,
)
from viso.companion.vio.types import ImuBias
from viso.geometry.pose import SE3

COV = np.diag(np.repeat([0.01, 1e-3, 0.3, 0.1, 0.01], 3) ** 2)


def motion_at(number: int) -> Motion:
    """Return the true motion at a node; its number is its time in periods."""
    return Motion(pose_at(number * PERIOD_NS), velocity_at(number * PERIOD_NS), ImuBias.zero())


def inertial(number: int) -> Any:
    """Return the motion in the period before a node, by inertial data."""
    return preintegrated(window((number - 1) * PERIOD_NS, number * PERIOD_NS).samples, NOISE, ImuBias.zero())


def begin() -> LagSmoother:
    smoother = LagSmoother(B_T_C, 0, 0.0, motion_at(0), COV)
    smoother.solve()
    return smoother


def go_on(smoother: LagSmoother, number: int, expected: Motion | None = None) -> None:
    smoother.add_node(number, number * PERIOD_NS * 1e-9, expected or motion_at(number), inertial(number))


def pixel(number: int, landmark: int) -> LandmarkSighting:
    local = (pose_at(number * PERIOD_NS) @ B_T_C).inverse().map(WALL[landmark])
    return LandmarkSighting(number, landmark, local[:2] / local[2])


def test_first_node_is_where_it_was_put() -> None:
    smoother, expected = begin(), motion_at(0)
    assert np.allclose(smoother.pose(0).matrix(), expected.pose.matrix())
    assert np.allclose(smoother.motion().velocity_w, expected.velocity_w)


def test_inertial_data_alone_carry_the_motion_on() -> None:
    smoother, nowhere = begin(), Motion(SE3.identity(), np.zeros(3), ImuBias.zero())
    for number in range(1, 6):
        go_on(smoother, number, nowhere)
        smoother.solve(passes=3)
    assert np.allclose(smoother.motion().pose.t, pose_at(5 * PERIOD_NS).t, atol=2e-3)
    assert np.allclose(smoother.motion().velocity_w, velocity_at(5 * PERIOD_NS), atol=2e-3)


def test_landmarks_correct_a_wrong_start() -> None:
    truth = motion_at(0)
    smoother = LagSmoother(B_T_C, 0, 0.0, Motion(truth.pose, truth.velocity_w + 0.2, ImuBias.zero()), COV)
    for landmark in range(30):
        smoother.add_landmark(landmark, WALL[landmark] + 0.1)
    smoother.add_sightings([pixel(0, landmark) for landmark in range(30)], SIGMA)
    smoother.solve()
    for number in range(1, 6):
        go_on(smoother, number)
        smoother.add_sightings([pixel(number, landmark) for landmark in range(30)], SIGMA)
        smoother.solve(passes=3)
    assert np.allclose(smoother.motion().velocity_w, velocity_at(5 * PERIOD_NS), atol=0.02)
    assert np.linalg.norm(smoother.points(range(30)) / WALL[:30] - 1, axis=1).max() < 0.1


def test_stillness_stops_the_body() -> None:
    smoother = begin()
    go_on(smoother, 1)
    smoother.add_stillness()
    smoother.solve(passes=2)
    assert np.linalg.norm(smoother.motion().velocity_w) < 0.02


def test_height_moves_the_body_up_and_nowhere_else() -> None:
    cov = COV.copy()
    cov[5, 5] = 100.0
    smoother = LagSmoother(B_T_C, 0, 0.0, motion_at(0), cov)
    smoother.solve()
    go_on(smoother, 1)
    smoother.add_height(30.0, 0.1)
    smoother.solve(passes=5)
    place = smoother.motion().pose.t
    assert place[2] == pytest.approx(30.0, abs=0.1)
    assert np.allclose(place[:2], pose_at(PERIOD_NS).t[:2], atol=0.02)


def test_wild_height_counts_for_little() -> None:
    smoother = begin()
    go_on(smoother, 1)
    smoother.add_height(300.0, 0.1)
    smoother.solve(passes=3)
    assert smoother.motion().pose.t[2] == pytest.approx(pose_at(PERIOD_NS).t[2], abs=0.2)


def test_nodes_older_than_the_lag_are_forgotten_but_for_those_to_keep() -> None:
    smoother = begin()
    last = round(LAG_S * 1e9 / PERIOD_NS) + 3
    for number in range(1, last + 1):
        go_on(smoother, number)
        smoother.solve(keep=[1])
    assert np.allclose(smoother.pose(1).t, pose_at(PERIOD_NS).t, atol=0.05)
    assert np.allclose(smoother.pose(last - 1).t, pose_at((last - 1) * PERIOD_NS).t, atol=0.2)
    with pytest.raises(SmootherError):
        smoother.pose(2)


def test_sighting_of_an_unknown_landmark_cannot_be_solved() -> None:
    smoother = begin()
    go_on(smoother, 1)
    smoother.add_sightings([pixel(1, 5)], SIGMA)
    with pytest.raises(SmootherError, match=r"^[^\n]+$"):
        smoother.solve()


def test_unknown_node_is_a_smoother_error() -> None:
    with pytest.raises(SmootherError):
        begin().joint_cov(7)


def test_missing_gtsam_tells_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "gtsam", None)
    monkeypatch.delitem(sys.modules, "viso.companion.smoother.lag_smoother")
    with pytest.raises(ImportError, match=r"pip install 'ardupilot-viso\[gtsam\]'$"):
        importlib.import_module("viso.companion.smoother.lag_smoother")
