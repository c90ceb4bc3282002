# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Triangulation: exact points, padding, and points that cannot be found."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from viso.companion.msckf.tracks import Tracks, padded
from viso.companion.msckf.triangulation import on_plane, triangulate
from viso.geometry.pose import SE3
from viso.geometry.rotation import Array, so3_exp

DOWN = np.array([[0.0, -1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])


def cameras(count: int = 5, step_m: float = 2.0, height_m: float = 30.0) -> list[SE3]:
    """Return cameras that look down, along a line, each turned and tilted a little."""
    rng = np.random.default_rng(7)
    return [
        SE3(DOWN @ so3_exp(rng.normal(0, 0.1, 3)), np.array([index * step_m, 0.3 * index, height_m + 0.2 * index]))
        for index in range(count)
    ]


def sightings(points: Array, poses: list[SE3], lengths: list[int]) -> tuple[Array, Array, Tracks]:
    """Return rotations, positions and tracks of points, each seen from the first few cameras."""
    rows = []
    for point, length in zip(points, lengths, strict=True):
        local = [pose.inverse().map(point) for pose in poses[:length]]
        rows.append({index: (float(xyz[0] / xyz[2]), float(xyz[1] / xyz[2])) for index, xyz in enumerate(local)})
    tracks = padded(rows, {index: index for index in range(len(poses))})
    rotations, positions = np.array([pose.R for pose in poses]), np.array([pose.t for pose in poses])
    return rotations[tracks.clones], positions[tracks.clones], tracks


@pytest.mark.slow
@given(
    st.lists(
        st.tuples(st.floats(-8, 12), st.floats(-8, 8), st.floats(-5, 20), st.integers(2, 5)), min_size=1, max_size=12
    )
)
def test_points_are_where_their_rays_meet(drawn: list[tuple[float, float, float, int]]) -> None:
    points = np.array([point[:3] for point in drawn])
    found, good = triangulate(*sightings(points, cameras(), [point[3] for point in drawn]))
    assert good.all()
    assert np.abs(found - points).max() < 1e-3


def test_padding_says_nothing() -> None:
    points = np.array([[1.0, 2.0, 3.0], [4.0, -2.0, 1.0]])
    alone, _ = triangulate(*sightings(points[:1], cameras(), [3]))
    beside, good = triangulate(*sightings(points, cameras(), [3, 5]))
    assert good.all()
    assert np.allclose(alone[0], beside[0], atol=1e-9)


def test_point_minimises_the_reprojection_error() -> None:
    poses, point = cameras(), np.array([2.0, 1.0, 4.0])
    rotations, positions, tracks = sightings(point[None], poses, [5])
    noisy = Tracks(tracks.clones, tracks.seen, tracks.normalised + np.random.default_rng(1).normal(0, 1e-3, (1, 5, 2)))

    def cost(at: Array) -> float:
        local = np.array([pose.inverse().map(at) for pose in poses])
        return float(((local[:, :2] / local[:, 2:] - noisy.normalised[0]) ** 2).sum())

    (found,), _ = triangulate(rotations, positions, noisy)
    best = cost(found)
    assert best < cost(point)
    for direction in np.eye(3):
        assert best <= min(cost(found + 0.02 * direction), cost(found - 0.02 * direction))


def test_point_without_parallax_is_not_found() -> None:
    poses = [SE3(DOWN @ so3_exp(np.array([0.02 * index, 0, 0])), np.array([0.0, 0.0, 30.0])) for index in range(5)]
    _, good = triangulate(*sightings(np.array([[1.0, 2.0, 0.0]]), poses, [5]))
    assert not good.any()


def test_point_too_far_to_tell_is_not_found() -> None:
    _, good = triangulate(*sightings(np.array([[1.0, 2.0, -5000.0]]), cameras(step_m=100.0), [5]))
    assert not good.any()


def test_point_behind_the_cameras_is_not_found() -> None:
    rotations, positions, tracks = sightings(np.array([[1.0, 2.0, 3.0], [4.0, 0.0, 1.0]]), cameras(), [5, 5])
    backwards = tracks.normalised[:, ::-1].copy()  # as if the cameras had gone the other way
    _, good = triangulate(rotations, positions, Tracks(tracks.clones, tracks.seen, backwards))
    assert not good.any()


def test_bad_point_does_not_disturb_the_others() -> None:
    points = np.array([[1.0, 2.0, 3.0], [1.0, 2.0, 80.0], [4.0, -2.0, 1.0]])  # the second one is above
    found, good = triangulate(*sightings(points, cameras(), [5, 5, 4]))
    assert good.tolist() == [True, False, True]
    assert np.allclose(found[good], points[good], atol=1e-3)
    assert np.isfinite(found).all()


class TestPlane:
    """Points on a plane."""

    def test_point_is_the_mean_of_where_the_rays_meet_the_plane(self) -> None:
        points = np.array([[1.0, 2.0, 3.0], [4.0, -2.0, 3.0]])
        found, good = on_plane(*sightings(points, cameras(), [5, 2]), 3.0)
        assert good.all()
        assert np.allclose(found, points, atol=1e-9)

    def test_wrong_height_still_puts_points_on_the_plane(self) -> None:
        found, _ = on_plane(*sightings(np.array([[1.0, 2.0, 3.0]]), cameras(), [5]), 4.0)
        assert found[0, 2] == pytest.approx(4.0)
        assert found[0, 0] != pytest.approx(1.0, abs=1e-3)

    def test_ray_that_does_not_go_down_meets_nothing(self) -> None:
        level = [SE3(np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]]), pose.t) for pose in cameras()]
        tracks = padded(
            [{0: (0.0, 0.1), 1: (0.0, 0.1)}, {0: (0.0, 0.0), 1: (0.0, 0.1)}, {0: (0.0, -0.1)}], {0: 0, 1: 1}
        )
        rotations, positions = np.array([pose.R for pose in level]), np.array([pose.t for pose in level])
        found, good = on_plane(rotations[tracks.clones], positions[tracks.clones], tracks, 0.0)
        assert good.tolist() == [True, False, False]
        assert np.isfinite(found).all()

    def test_camera_below_the_plane_sees_none_of_it(self) -> None:
        _, good = on_plane(*sightings(np.array([[1.0, 2.0, 3.0]]), cameras(), [5]), 40.0)
        assert not good.any()
