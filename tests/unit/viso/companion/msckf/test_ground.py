# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The ground: when it is all that there is to see, and what that means for points and the scale."""

from typing import Any

import numpy as np
import pytest

from tests.unit.viso.companion.msckf.point_world import filter_at
from viso.companion.klt.outliers import Model, rotated
from viso.companion.msckf.ground import Ground
from viso.companion.msckf.window_filter import WindowFilter
from viso.companion.vio.config import VioConfig
from viso.companion.vio.frames import MOUNTINGS
from viso.geometry.pose import SE3
from viso.geometry.rotation import so3_exp

PLANAR = {"scene": "planar", "agl_source": "rangefinder"}
CAMERA = SE3(MOUNTINGS["nadir"], np.array([1.0, 2.0, 40.0]))


def ground(origin_z_m: float = 0.0, **config: Any) -> Ground:
    return Ground(VioConfig(**(PLANAR | config)), origin_z_m)


def flat(origin_z_m: float = 0.0, **config: Any) -> Ground:
    """Return ground that has shown no relief for long."""
    shown = ground(origin_z_m, **config)
    for _ in range(20):
        shown.note_relief(0.0)
    return shown


def at(height_m: float, sigma_m: float) -> WindowFilter:
    state = filter_at(SE3(np.eye(3), np.array([0.0, 0.0, height_m])), np.zeros(3))
    state.cov[5, 5] = sigma_m**2
    return state


def test_plane_is_where_the_configuration_says() -> None:
    plane = flat(10.0, ground_z_m=3.0).plane(CAMERA)
    assert plane is not None
    assert plane.height_m == ground(10.0, ground_z_m=3.0).z_m == -7.0


def test_plane_is_rougher_from_a_greater_height() -> None:
    plane = flat().plane(CAMERA)
    assert plane is not None
    assert plane.sigma_m == pytest.approx(0.005 * 40.0, rel=1e-3)


def test_little_relief_counts_more_than_once_as_points_of_a_slope_err_together() -> None:
    sloping = flat()
    for _ in range(20):
        sloping.note_relief(0.008)
    plane = sloping.plane(CAMERA)
    assert plane is not None
    assert plane.sigma_m > 3 * 0.008 * 40.0


def test_ground_said_to_be_a_plane_has_to_show_it() -> None:
    seen = []
    said = ground()
    for _ in range(5):
        seen.append(said.plane(CAMERA) is not None)
        said.note_relief(None)
        said.note_relief(0.0)
    assert not any(seen[:2])
    assert seen[-1]


def test_hills_that_begin_with_a_slope_are_never_a_plane() -> None:
    hills = ground()
    for share in (0.015, 0.008, 0.012, 0.006, 0.02, 0.01):
        hills.note_relief(share)
        assert hills.plane(CAMERA) is None


def test_relief_is_no_plane_until_it_is_smooth_for_a_while() -> None:
    hills = flat()
    seen = []
    for share in (0.01, 0.2, *[0.0] * 12):
        hills.note_relief(share)
        seen.append(hills.plane(CAMERA) is not None)
    assert seen[:2] == [True, False]
    assert not any(seen[2:7])
    assert seen[-1]


@pytest.mark.parametrize(("sigma_m", "is_elsewhere"), [(1.0, True), (10.0, False)])
def test_ground_that_a_height_says_to_be_elsewhere_is_no_plane(sigma_m: float, is_elsewhere: bool) -> None:
    hills = flat()
    hills.take_height(at(40.0, sigma_m), 30.0, 0.4)
    assert (hills.plane(CAMERA) is None) == hills.is_rough == is_elsewhere


@pytest.mark.parametrize("config", [{"scene": "general"}, {"agl_source": "none"}, {"scene": "auto"}])
def test_there_is_no_plane_to_rely_on(config: dict[str, Any]) -> None:
    assert ground(**config).plane(CAMERA) is None


def test_camera_on_the_ground_sees_no_plane() -> None:
    assert flat().plane(SE3(CAMERA.R, np.array([0.0, 0.0, 0.4]))) is None
    assert flat().plane(SE3(CAMERA.R, np.array([0.0, 0.0, 0.6]))) is not None


def test_scene_that_looks_like_a_plane_for_long_is_one() -> None:
    unknown = ground(scene="auto")
    seen = []
    for _ in range(30):
        unknown.note(Model.HOMOGRAPHY)
        seen.append(unknown.plane(CAMERA) is not None)
    assert not any(seen[:10])
    assert all(seen[20:])
    for _ in range(5):
        unknown.note(Model.ESSENTIAL)
    assert unknown.plane(CAMERA) is None


def test_points_of_a_plane_are_expected_where_they_will_be() -> None:
    before = CAMERA
    after = SE3(CAMERA.R @ so3_exp(np.array([0.03, -0.05, 0.2])), CAMERA.t + np.array([2.0, -1.0, 0.5]))
    points = np.array([[3.0, 1.0, 0.0], [-5.0, 8.0, 0.0], [0.0, 0.0, 0.0]])
    local = before.inverse().map(points), after.inverse().map(points)
    expected = rotated(ground().expected_map(before, after), local[0][:, :2] / local[0][:, 2:])
    assert np.allclose(expected, local[1][:, :2] / local[1][:, 2:], atol=1e-12)


def test_points_of_no_plane_are_expected_to_turn() -> None:
    after = SE3(CAMERA.R @ so3_exp(np.array([0.03, -0.05, 0.2])), CAMERA.t + np.array([2.0, -1.0, 0.5]))
    assert np.allclose(ground(scene="general").expected_map(CAMERA, after), after.R.T @ CAMERA.R)


class TestScale:
    """Whether it is known."""

    def test_it_is_open_until_the_way_is_long_beside_the_uncertainty(self) -> None:
        state = filter_at(SE3(np.eye(3), np.array([10.0, 0.0, 0.0])), np.zeros(3), sigmas=(0, 0, 0, 0, 0))
        state.cov[3, 3] = 1.0
        assert ground(agl_source="none").leaves_scale_open(state)
        state.p *= 3
        assert not ground(agl_source="none").leaves_scale_open(state)

    @pytest.mark.parametrize("config", [{}, {"scene": "general", "agl_source": "none"}, {"scene": "auto"}])
    def test_it_is_not_asked_for_elsewhere(self, config: dict[str, Any]) -> None:
        state = filter_at(SE3.identity(), np.zeros(3))
        state.cov[3, 3] = 1.0
        assert not ground(**config).leaves_scale_open(state)
