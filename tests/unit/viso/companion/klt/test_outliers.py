# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The geometric check: planes, other scenes, turns without parallax; with outliers that were planted."""

import numpy as np
import pytest

from viso.companion.klt.outliers import Model, check, rotated
from viso.geometry.pose import SE3
from viso.geometry.rotation import Array, so3_exp

FOCAL = 500.0
THRESHOLD_PX = 1.0
POINTS, OUTLIERS = 150, 40
TURN = so3_exp(np.array([0.02, -0.03, 0.05]))
SHIFT = np.array([0.6, 0.2, 0.1])
PIXEL_NOISE = 0.3 / FOCAL


class Scene:
    """Two views of points, some of which are elsewhere in the second one.

    Attributes:
        before, after: normalised coordinates.
        bad: which were moved away by 8 to 40 px.
    """

    def __init__(self, *, plane: bool, rotation: Array = TURN, shift: Array = SHIFT, bad: int = OUTLIERS) -> None:
        rng = np.random.default_rng(5)
        self.before = rng.uniform((-0.5, -0.4), (0.5, 0.4), (POINTS, 2))
        depth = np.full(POINTS, 8.0) if plane else rng.uniform(3.0, 20.0, POINTS)
        points = np.column_stack([self.before, np.ones(POINTS)]) * depth[:, None]
        seen = SE3(rotation, shift).map(points)
        self.after = seen[:, :2] / seen[:, 2:] + rng.normal(0, PIXEL_NOISE, (POINTS, 2))
        self.bad = np.zeros(POINTS, np.bool_)
        self.bad[rng.choice(POINTS, bad, replace=False)] = True
        angle = rng.uniform(0, 2 * np.pi, POINTS)
        away = rng.uniform(8, 40, POINTS) / FOCAL * np.stack([np.cos(angle), np.sin(angle)])
        self.after[self.bad] += away.T[self.bad]


def test_plane_is_found_and_its_outliers() -> None:
    scene = Scene(plane=True)
    result = check(scene.before, scene.after, TURN, FOCAL, THRESHOLD_PX, planar=False)
    assert result.model is Model.HOMOGRAPHY
    assert not result.inliers[scene.bad].any()
    assert result.inliers[~scene.bad].mean() > 0.9


def test_general_scene_is_found_and_most_of_its_outliers() -> None:
    scene = Scene(plane=False)
    result = check(scene.before, scene.after, TURN, FOCAL, THRESHOLD_PX, planar=False)
    assert result.model is Model.ESSENTIAL
    assert result.inliers[scene.bad].mean() < 0.3  # those that went along their epipolar lines cannot be told
    assert result.inliers[~scene.bad].mean() > 0.8


def test_scene_known_to_be_a_plane_is_one() -> None:
    scene = Scene(plane=False, bad=0)
    result = check(scene.before, scene.after, TURN, FOCAL, THRESHOLD_PX, planar=True)
    assert result.model is Model.HOMOGRAPHY
    assert result.inliers.mean() < 0.9  # what stands out of it counts as outliers


def test_turn_without_parallax_is_judged_by_the_gyro() -> None:
    scene = Scene(plane=False, shift=np.zeros(3))
    result = check(scene.before, scene.after, TURN, FOCAL, THRESHOLD_PX, planar=False)
    assert result.model is Model.ROTATION
    assert (result.inliers == ~scene.bad).all()


def test_disparity_is_without_the_rotation() -> None:
    scene = Scene(plane=True, shift=np.array([0.08, 0.0, 0.0]), bad=0)
    result = check(scene.before, scene.after, TURN, FOCAL, THRESHOLD_PX, planar=True)
    assert result.disparity_px == pytest.approx(FOCAL * 0.08 / 8, rel=0.05)


@pytest.mark.parametrize("planar", [False, True])
@pytest.mark.parametrize("plane", [False, True])
def test_same_points_same_inliers(plane: bool, planar: bool) -> None:
    scene = Scene(plane=plane)
    first, second = (check(scene.before, scene.after, TURN, FOCAL, THRESHOLD_PX, planar=planar) for _ in range(2))
    assert (first.inliers == second.inliers).all()
    assert first.model is second.model


def test_wider_threshold_lets_more_in() -> None:
    scene = Scene(plane=True)
    narrow, wide = (check(scene.before, scene.after, TURN, FOCAL, px, planar=True).inliers.sum() for px in (0.3, 3.0))
    assert narrow < wide


@pytest.mark.parametrize("count", [0, 1, 7])
def test_too_few_points_have_no_model(count: int) -> None:
    scene = Scene(plane=True, bad=0)
    result = check(scene.before[:count], scene.after[:count], TURN, FOCAL, THRESHOLD_PX, planar=True)
    assert (result.inliers.tolist(), result.model) == ([False] * count, None)


@pytest.mark.parametrize("planar", [False, True])
def test_chance_has_no_model(planar: bool) -> None:
    rng = np.random.default_rng(2)
    before, after = rng.uniform(-0.5, 0.5, (2, 12, 2))
    result = check(before, after, np.eye(3), FOCAL, 0.1, planar=planar)
    assert result.model is None
    assert not result.inliers.any()


def test_points_that_the_gyro_puts_behind_the_camera_are_no_trouble() -> None:
    scene = Scene(plane=True, bad=0)
    result = check(scene.before, scene.after, so3_exp(np.array([0.0, 2.5, 0.0])), FOCAL, THRESHOLD_PX, planar=True)
    assert (result.model, result.disparity_px) == (Model.HOMOGRAPHY, 0.0)
    assert result.inliers.mean() > 0.9


def test_median_is_of_the_points_that_stay_in_front() -> None:
    scene = Scene(plane=True, rotation=np.eye(3), shift=np.zeros(3), bad=0)
    turn = so3_exp(np.array([0.0, -1.3, 0.0]))
    result = check(scene.before, scene.after, turn, FOCAL, THRESHOLD_PX, planar=True)
    assert np.isnan(rotated(turn, scene.before)).any()
    assert np.isfinite(result.disparity_px)


def test_rotated_points_are_where_a_turned_camera_sees_them() -> None:
    points = np.array([[0.1, 0.2, 1.0], [-0.4, 0.3, 2.0]])
    turned = points @ TURN.T
    assert np.allclose(rotated(TURN, points[:, :2] / points[:, 2:]), turned[:, :2] / turned[:, 2:])


def test_points_behind_the_camera_are_nowhere() -> None:
    assert np.isnan(rotated(so3_exp(np.array([np.pi, 0.0, 0.0])), np.array([[0.1, 0.2]]))).all()
