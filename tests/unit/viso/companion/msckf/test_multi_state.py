# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tracks as measurements: what they teach, what they cannot, and which of them are refused."""

import functools
import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

from tests.unit.viso.companion.msckf.point_world import B_T_C, SIGMA
from viso.companion.msckf.estimator import UNSURE_PASSES
from viso.companion.msckf.multi_state import Below, Plane, TracksUsed, parallax_of, relief_of, use_tracks
from viso.companion.msckf.tracks import Tracks, padded
from viso.companion.msckf.window_filter import CLONE, MOTION, Clone, WindowFilter
from viso.companion.vio.config import ImuNoise
from viso.companion.vio.types import ImuBias
from viso.geometry.pose import SE3
from viso.geometry.rotation import Array, so3_exp

CLONES, POINTS = 8, 30
SIZE = MOTION + CLONE * CLONES
FLAT = Plane(0.0, 0.01)
ROTATION_SIGMA, POSITION_SIGMA = 1e-3, 0.05


def true_poses() -> list[SE3]:
    """Return poses of a body that flies at 40 m, 3 m from one to the next, and leans a little."""
    rng = np.random.default_rng(11)
    return [
        SE3(so3_exp(rng.normal(0, 0.05, 3)), np.array([3.0 * index - 10, 0.4 * index, 40 + 0.2 * index]))
        for index in range(CLONES)
    ]


class Window:
    """A window of poses with errors, and what was seen from the true ones.

    Args:
        seed: of errors and noise.
        relief_m: by which the points differ in height.
        errors: in units of what the covariance admits.
        noise: in units of the sigma of a sighting.
        gauge: sigma of a shift (m) and a turn (rad) of the whole world that comes on top of the covariance.
    """

    def __init__(
        self, seed: int = 0, *, relief_m: float = 0.0, errors: float = 1.0, noise: float = 1.0, gauge: float = 0.0
    ) -> None:
        rng = np.random.default_rng(seed)
        self.poses = true_poses()
        pose_sigmas = [ROTATION_SIGMA] * 3 + [POSITION_SIGMA] * 3
        cov = np.diag(np.array(pose_sigmas + [1.0] * (MOTION - CLONE) + pose_sigmas * CLONES) ** 2)
        drawn = errors * rng.multivariate_normal(np.zeros(SIZE), cov)
        last = self.poses[-1]
        self.state = WindowFilter(ImuNoise(), last.R, last.t, np.zeros(3), ImuBias.zero(), cov[:MOTION, :MOTION])
        for index, pose in enumerate(self.poses):
            off = SE3.exp(drawn[MOTION + CLONE * index : MOTION + CLONE * (index + 1)]) @ pose
            self.state.clones.append(Clone(index, off.R.copy(), off.t.copy()))
        self.state.cov = cov + gauge**2 * common_motions() @ common_motions().T
        self._cov_before = self.state.cov.copy()
        points = rng.uniform((-15, -12, -relief_m), (20, 15, relief_m + 1e-9), (POINTS, 3))
        self.tracks = self._seen(points, noise * SIGMA, rng)

    def _seen(self, points: Array, sigma: float, rng: np.random.Generator) -> Tracks:
        rows = []
        for point in points:
            first, count = int(rng.integers(0, 4)), int(rng.integers(3, 6))
            row = {}
            for index in range(first, min(first + count, CLONES)):
                x, y, z = (self.poses[index] @ B_T_C).inverse().map(point)
                row[index] = (x / z + rng.normal(0, sigma), y / z + rng.normal(0, sigma))
            rows.append(row)
        return padded(rows, {index: index for index in range(CLONES)})

    def use(self, plane: Plane | None = None, inflation: float = 1.0, passes: int = 1) -> TracksUsed:
        return use_tracks(self.state, B_T_C, self.tracks, SIGMA, plane, inflation, passes)

    def relative_errors(self) -> Array:
        """Return the errors [N - 1, 6] of the poses relative to the first one."""
        mine = [SE3(clone.R, clone.p) for clone in self.state.clones]
        pairs = zip(mine[1:], self.poses[1:], strict=True)
        return np.array(
            [((self.poses[0].inverse() @ true).inverse() @ mine[0].inverse() @ pose).log() for pose, true in pairs]
        )

    def relative_cov(self) -> Array:
        """Return the covariance [6, 6] of the last pose relative to the first one."""
        last = self.state.clones[-1]
        adjoint = SE3(last.R, last.p).inverse().adjoint()
        jacobian = np.zeros((CLONE, SIZE))
        jacobian[:, MOTION : MOTION + CLONE], jacobian[:, -CLONE:] = -adjoint, adjoint
        cov: Array = jacobian @ self.state.cov @ jacobian.T
        return cov

    def gained(self) -> Array:
        """Return the information [S, S] that has come in, in units of what was there before."""
        sigma = np.sqrt(self._cov_before.diagonal())
        gained = np.linalg.inv(self.state.cov) - np.linalg.inv(self._cov_before)
        in_units: Array = gained * np.outer(sigma, sigma)
        return in_units

    def disturb_tracks(self, which: Any, by: Array) -> None:
        normalised = self.tracks.normalised.copy()
        normalised[which] += by
        self.tracks = Tracks(self.tracks.clones, self.tracks.seen, normalised)


@dataclass(frozen=True)
class Updated:
    """Outcome of windows that took in their tracks, one number each.

    Attributes:
        nis_per_dof: of the innovation.
        nees_per_dof: of the last pose relative to the first one.
        errors, errors_left: of the same, before and after, both in units of the covariance before.
    """

    nis_per_dof: list[float] = field(default_factory=list)
    nees_per_dof: list[float] = field(default_factory=list)
    errors: list[float] = field(default_factory=list)
    errors_left: list[float] = field(default_factory=list)


@functools.cache
def updated_windows(relief_m: float, plane: Plane | None) -> Updated:
    result = Updated()
    for seed in range(25):
        window = Window(seed, relief_m=relief_m)
        cov, error = window.relative_cov(), window.relative_errors()[-1]
        result.nis_per_dof.append(window.use(plane).nis_per_dof)
        left = window.relative_errors()[-1]
        result.errors.append(per_dof(error, cov))
        result.errors_left.append(per_dof(left, cov))
        result.nees_per_dof.append(per_dof(left, window.relative_cov()))
    return result


def per_dof(error: Array, cov: Array) -> float:
    return float(error @ np.linalg.solve(cov, error)) / len(error)


def common_motions() -> Array:
    """Return the errors [S, 4] of a state whose whole world is shifted along x, y and z, or turned about z."""
    motions = np.zeros((SIZE, 4))
    for first in (0, *range(MOTION, SIZE, CLONE)):
        motions[first + 3 : first + 6, :3] = np.eye(3)
        motions[first + 2, 3] = 1.0
    return motions


def certainty_of_common_motions(state: WindowFilter) -> Array:
    """Return the information [4, 4] about the shift and the turn of the whole world."""
    motions = common_motions()
    information: Array = motions.T @ np.linalg.solve(state.cov, motions)
    return information


@pytest.mark.parametrize(("relief_m", "plane"), [(5.0, None), (0.0, FLAT)])
class TestBoth:
    """Scenes with relief, and planes."""

    def test_perfect_sightings_change_a_perfect_state_by_nothing(self, relief_m: float, plane: Plane | None) -> None:
        window = Window(relief_m=relief_m, errors=0.0, noise=0.0)
        used = window.use(plane)
        assert used.used == used.offered == POINTS
        assert used.nis_per_dof < 1e-6
        assert np.abs(window.relative_errors()).max() < 1e-6

    @pytest.mark.slow
    def test_relative_poses_get_better(self, relief_m: float, plane: Plane | None) -> None:
        windows = updated_windows(relief_m, plane)
        assert np.mean(windows.errors_left) < 0.8 * np.mean(windows.errors)

    @pytest.mark.slow
    def test_innovation_is_as_large_as_stated(self, relief_m: float, plane: Plane | None) -> None:
        # A little below 1, as the gate refuses the worst of the good tracks. With 41 degrees of freedom or more, three
        # standard errors of the mean of 25 are 0.13.
        assert np.mean(updated_windows(relief_m, plane).nis_per_dof) == pytest.approx(0.95, abs=0.13)

    @pytest.mark.slow
    def test_errors_left_are_as_large_as_stated(self, relief_m: float, plane: Plane | None) -> None:
        # With 6 degrees of freedom, three standard errors of the mean of 25 are 0.35.
        assert np.mean(updated_windows(relief_m, plane).nees_per_dof) == pytest.approx(1.0, abs=0.35)

    def test_covariance_stays_symmetric_and_positive(self, relief_m: float, plane: Plane | None) -> None:
        window = Window(relief_m=relief_m)
        window.use(plane)
        assert (window.state.cov == window.state.cov.T).all()
        assert np.linalg.eigvalsh(window.state.cov)[0] > 0

    def test_inflated_measurement_teaches_as_much_less(self, relief_m: float, plane: Plane | None) -> None:
        plain, inflated = (Window(relief_m=relief_m, errors=0.0, noise=0.0) for _ in range(2))
        plain.use(plane)
        inflated.use(plane, inflation=9.0)
        assert np.allclose(plain.gained(), 9 * inflated.gained(), atol=1e-9 * np.abs(plain.gained()).max())

    def test_passes_together_teach_as_much_as_one(self, relief_m: float, plane: Plane | None) -> None:
        once, thrice = (Window(relief_m=relief_m, errors=0.0, noise=0.0) for _ in range(2))
        once.use(plane)
        thrice.use(plane, passes=3)
        assert np.allclose(once.gained(), thrice.gained(), atol=1e-9 * np.abs(once.gained()).max())

    def test_outliers_are_refused(self, relief_m: float, plane: Plane | None) -> None:
        window = Window(relief_m=relief_m)
        window.disturb_tracks((slice(0, 5), 1), np.array([0.0, 0.2]))
        used = window.use(plane)
        assert used.offered - used.used >= 5
        assert used.used > 0.7 * (POINTS - 5)

    def test_all_is_refused_where_nothing_agrees(self, relief_m: float, plane: Plane | None) -> None:
        window = Window(relief_m=relief_m)
        before = window.state.cov.copy()
        window.disturb_tracks(
            window.tracks.seen, np.random.default_rng(0).normal(0, 0.05, (window.tracks.seen.sum(), 2))
        )
        used = window.use(plane)
        assert used.offered > 5
        assert used.used == 0
        assert (window.state.cov == before).all()

    def test_gate_opens_for_a_state_that_is_off(self, relief_m: float, plane: Plane | None) -> None:
        window = Window(relief_m=relief_m, errors=4.0)
        assert window.use(plane).used > 0.8 * POINTS

    @pytest.mark.slow
    def test_noise_beyond_what_is_stated_counts(self, relief_m: float, plane: Plane | None) -> None:
        ratios = []
        for seed in range(5):
            plain, noisy = Window(seed, relief_m=relief_m), Window(seed, relief_m=relief_m, noise=3.0)
            plain.use(plane)
            noisy.use(plane)
            ratios.append(np.trace(plain.gained()) / np.trace(noisy.gained()))
        # 9, less what the gate refuses. A variance from about 100 degrees of freedom is right to a share of 0.14, so
        # that three standard errors of the mean of 5 are 1.7.
        assert np.mean(ratios) == pytest.approx(8.5, abs=1.7)

    def test_error_and_depth_are_those_of_the_points(self, relief_m: float, plane: Plane | None) -> None:
        window = Window(relief_m=relief_m, errors=0.0)
        used = window.use(plane)
        seen = window.tracks.seen.sum(axis=1)
        # Of two numbers for each sighting, a point takes up 3, or 2 on a plane; about 80 sightings' worth is left, of
        # which the mean length is right to 0.17 (three standard errors).
        left = np.sqrt(1 - (3 if plane is None else 2) / (2 * seen)).mean()
        assert used.mre_sigmas == pytest.approx(math.sqrt(math.pi / 2) * left, rel=0.17)
        assert used.depth_m == pytest.approx(40.0, rel=0.05)


@pytest.mark.slow
def test_passes_bring_a_state_that_is_far_off_nearer() -> None:
    """By relief, whose points are found again with each pass."""
    once: list[float] = []
    often: list[float] = []
    for seed in range(6):
        for errors, passes in ((once, 1), (often, UNSURE_PASSES)):
            window = Window(seed, relief_m=5.0, errors=30.0)
            window.state.cov *= 30.0**2
            window.use(passes=passes)
            errors.append(float(np.linalg.norm(window.relative_errors())))
    assert math.hypot(*often) < 0.8 * math.hypot(*once)


class TestUnobservable:
    """What cameras cannot see: a shift of the whole world and its turn about gravity."""

    @pytest.mark.parametrize("errors", [0.0, 1.0, 10.0])
    @pytest.mark.parametrize("passes", [1, 3])
    def test_nothing_is_learnt_about_place_and_heading(self, errors: float, passes: int) -> None:
        window = Window(relief_m=5.0, errors=errors, gauge=1.0)
        if errors > 1:
            window.state.cov[MOTION:, MOTION:] *= errors**2
        before = certainty_of_common_motions(window.state)
        assert window.use(passes=passes).used > POINTS / 2
        assert np.allclose(certainty_of_common_motions(window.state), before, rtol=1e-6, atol=1e-9)

    @pytest.mark.parametrize("passes", [1, 3])
    def test_each_pass_says_as_little_about_scale_as_one(self, passes: int) -> None:
        # Where the world is, how it is turned, its scale, and two of the last pose, which shows two points only.
        window = Window(relief_m=5.0, errors=5.0)
        window.use(passes=passes)
        gained = np.linalg.eigvalsh(window.gained()[MOTION:, MOTION:])
        assert np.count_nonzero(gained < 1e-9 * gained[-1]) == 9

    def test_no_pose_becomes_more_certain_than_its_world(self) -> None:
        window = Window(relief_m=5.0, errors=3.0, gauge=1.0)
        for _ in range(10):
            window.use()
        for first in range(MOTION, SIZE, CLONE):
            place_and_yaw = window.state.cov[first + 2 : first + 6, first + 2 : first + 6]
            assert np.linalg.eigvalsh(place_and_yaw)[0] > 1.0

    def test_plane_teaches_the_height_and_nothing_sideways(self) -> None:
        window = Window(errors=3.0, gauge=1.0)
        before = certainty_of_common_motions(window.state)
        window.use(FLAT)
        after = certainty_of_common_motions(window.state)
        sideways = np.array([0, 1, 3])
        assert np.allclose(after[np.ix_(sideways, sideways)], before[np.ix_(sideways, sideways)], rtol=1e-6, atol=1e-9)
        assert after[2, 2] > 2 * before[2, 2]

    def test_body_itself_rises_with_its_past_poses(self) -> None:
        window = Window(errors=0.0, noise=0.0, gauge=1.0)
        before = window.state.p[2], window.state.clones[-1].p[2]
        window.use(Plane(0.3, 0.01))
        assert window.state.clones[-1].p[2] - before[1] == pytest.approx(0.3, rel=0.1)
        assert window.state.p[2] - before[0] == pytest.approx(window.state.clones[-1].p[2] - before[1], rel=0.05)


def test_points_that_few_tracks_find_are_found_by_chance() -> None:
    """As when a body is thought to go the wrong way: most points then come to lie behind it."""
    window = Window(relief_m=5.0, errors=0.0)
    normalised = window.tracks.normalised.copy()
    for row, seen in enumerate(window.tracks.seen):
        if row > 3:
            normalised[row, seen] = normalised[row, seen][::-1]
    window.tracks = Tracks(window.tracks.clones, window.tracks.seen, normalised)
    before = window.state.cov.copy()
    assert window.use() == TracksUsed()
    assert (window.state.cov == before).all()


def test_points_above_the_cameras_are_not_on_the_ground() -> None:
    window = Window(errors=0.0)
    assert window.use(Plane(100.0, 0.01)).used == 0


def test_two_sightings_teach_on_a_plane() -> None:
    window = Window()
    tracks = window.tracks
    window.tracks = Tracks(tracks.clones[:, :2], tracks.seen[:, :2], tracks.normalised[:, :2])
    before = window.state.cov.trace()
    assert window.use(FLAT).used > 0.8 * POINTS
    assert window.state.cov.trace() < before


def test_height_above_ground_that_slopes_is_that_right_below() -> None:
    rng = np.random.default_rng(0)
    points = np.column_stack([rng.uniform(-15, 15, (POINTS, 2)), np.zeros(POINTS)])
    points[:, 2] = 5.0 + 0.3 * points[:, 0]
    weight, residual = Below(35.0, 0.3).rows(points, np.array([0.0, 0.0, 40.0]))
    near = np.hypot(*points[:, :2].T) < 7.0
    np.testing.assert_array_equal(weight > 0, near)
    assert near.any()
    assert np.abs(residual).max() < 0.1


def test_relief_is_told_from_flat_ground() -> None:
    flat, hilly = (Window(relief_m=relief_m, errors=0.0) for relief_m in (0.0, 5.0))
    shares = [relief_of(window.state.clones, B_T_C, window.tracks) for window in (flat, hilly)]
    assert shares[0] is not None
    assert shares[1] is not None
    assert shares[0] < 0.01
    assert 0.05 < shares[1] < 0.15


def test_relief_cannot_be_told_by_sightings_that_disagree() -> None:
    window = Window(errors=0.0, noise=50.0)
    assert relief_of(window.state.clones, B_T_C, window.tracks) is None


def test_sightings_that_agree_tell_little_relief() -> None:
    window = Window(relief_m=0.8, errors=0.0, noise=0.1)
    assert relief_of(window.state.clones, B_T_C, window.tracks) == pytest.approx(0.6 / 40, rel=0.3)


def test_doubt_is_what_the_last_pass_has_left() -> None:
    window, variances = Window(relief_m=5.0), list[float]()

    def doubt(state: WindowFilter) -> float:
        variances.append(float(state.cov.trace()))
        return 0.0

    use_tracks(window.state, B_T_C, window.tracks, SIGMA, None, 1.0, 3, doubt)
    assert len(variances) == 3
    assert max(variances[1:]) < variances[0]


def test_state_stays_where_the_passes_lead_to_different_places() -> None:
    window = Window(relief_m=5.0, errors=30.0)
    window.state.cov *= 30.0**2
    before = window.state.copy()
    used = window.use(passes=2)
    assert used.offered > 0 == used.used
    assert all((mine.p == its.p).all() for mine, its in zip(window.state.clones, before.clones, strict=True))
    assert (window.state.cov == before.cov).all()


def test_parallax_is_the_way_by_the_distance_whatever_the_turns() -> None:
    window = Window(errors=0.0, noise=0.0)
    assert parallax_of(window.state.clones, B_T_C, window.tracks) == pytest.approx(3 * 3.0 / 40, rel=0.4)
