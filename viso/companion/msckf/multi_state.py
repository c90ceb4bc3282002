# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Updates of the filter's poses from tracks of points.

Each track's point is triangulated and then eliminated, so that the equations do not depend on its position (Mourikis
and Roumeliotis, 2007). A known plane adds an equation for the height of each point. All tracks are computed at once, in
arrays padded to the longest track; padding rows are zero and have no effect.
"""

import dataclasses
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.special import chdtri

from viso.companion.msckf.tracks import Tracks
from viso.companion.msckf.triangulation import Mask, directions_of, on_plane, triangulate
from viso.companion.msckf.window_filter import CLONE, MOTION, Clone, WindowFilter
from viso.geometry.pose import SE3
from viso.geometry.rotation import Array, skews

_REFUSED: Final = 0.05  # of good tracks, by the gate
_WIDEST_GATE: Final = 25.0
_FEWEST_FOUND: Final = 0.2  # share of triangulated tracks, below which those are found by chance
_BELOW_SHARE: Final = 0.2  # of the height: how far aside a point may be
_SLOPE_SHARE: Final = 0.4  # of the height: how far aside a point may be that tells the ground's slope
_BEND: Final = 0.1  # of the ground, by which points aside are higher or lower than its slope says
_BENT: Final = 0.3  # share of the parallax times the doubt that the equations miss
_CONVERGED_SIGMAS: Final = 1.0  # by which the last pass may have led elsewhere
_RELIEF_ERROR: Final = 0.02  # of a distance, as a share: points that are farther off do not tell the relief
_FEWEST_FOR_RELIEF: Final = 8
_NORMAL: Final = 1.4826  # sigma of what is spread normally, by the median of its absolute
_WEAKEST: Final = 1e-10  # information, of the strongest direction's, below which there is none


@dataclass(frozen=True, slots=True)
class Plane:
    """The ground.

    Attributes:
        height_m: of the plane, in the world.
        sigma_m: how rough it is.
    """

    height_m: float
    sigma_m: float


@dataclass(frozen=True, slots=True)
class Below:
    """The ground right below the body, if it is not a plane.

    Attributes:
        height_m: of the body above it, at the last pose of the window.
    """

    height_m: float
    sigma_m: float

    def rows(self, points: Array, body: Array) -> tuple[Array, Array]:
        """Return the weights [T] of an equation for each point's height, 0 for points aside, and its residual [T].

        Args:
            points: [T, 3] in the world.
            body: [3], the last pose's.
        """
        off = points - body
        aside_m = np.hypot(*off[:, :2].T)
        near = aside_m < _BELOW_SHARE * self.height_m
        # They share the error of one height.
        sigma_m = np.sqrt(max(1.0, float(np.count_nonzero(near))) * self.sigma_m**2 + (_BEND * aside_m) ** 2)
        weight = np.where(near, 1 / sigma_m, 0.0)
        return weight, weight * (
            off[:, :2].dot(_slope(off, aside_m < _SLOPE_SHARE * self.height_m)) - self.height_m - off[:, 2]
        )


def _slope(points: Array, chosen: Mask) -> Array:
    """Return the slope [2] of the ground under points [T, 3], to the east and to the north; zero for too few points."""
    if np.count_nonzero(chosen) < _FEWEST_FOR_RELIEF:
        return np.zeros(2)
    across = np.column_stack([points[chosen, :2], np.ones(np.count_nonzero(chosen))])
    ridge = np.diag([float(np.square(points[chosen, :2]).sum()) * 1e-3] * 2 + [0.0])
    fitted: Array = np.linalg.solve(across.T.dot(across) + ridge, across.T.dot(points[chosen, 2]))[:2]
    return fitted


@dataclass(frozen=True, slots=True)
class TracksUsed:
    """Outcome of an update with tracks; only ``offered`` is meaningful if none was used.

    Attributes:
        offered: tracks whose points could be triangulated.
        used: those of them that passed the gate.
        nis_per_dof: normalised innovation squared of the compressed residual, per degree of freedom.
        mre_sigmas: mean reprojection error of the tracks used, in sigmas.
        depth_m: median distance of their points along the camera's axis.
    """

    offered: int = 0
    used: int = 0
    nis_per_dof: float = 1.0
    mre_sigmas: float = 0.0
    depth_m: float = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class _Stack:
    """The equations of all tracks, in units of sigma, with the points eliminated.

    Attributes:
        jacobian: [T, K, S] with respect to the window's poses.
        residual: [T, K].
        dof: [T], degrees of freedom.
        error: [T], mean reprojection error.
        depth_m: [T], along the camera's axis at a point's first sighting.
        parallax: [T], distance moved by the camera as a share of that.
    """

    jacobian: Array
    residual: Array
    dof: Array
    error: Array
    depth_m: Array
    parallax: Array

    def only(self, mask: Mask) -> "_Stack":
        return _Stack(
            self.jacobian[mask],
            self.residual[mask],
            self.dof[mask],
            self.error[mask],
            self.depth_m[mask],
            self.parallax[mask],
        )


def use_tracks(
    state: WindowFilter,
    B_T_C: SE3,
    tracks: Tracks,
    sigma: float,
    plane: Plane | Below | None,
    inflation: float,
    passes: int,
    doubt: Callable[[WindowFilter], float] = lambda _: 0.0,
) -> TracksUsed:
    """Update a filter with tracks.

    Args:
        sigma: of a normalised coordinate.
        plane: the ground, if all points lie on it or its height right below is known.
        inflation: of the measurement's covariance, 1 or more.
        passes: how often the equations are made again, each time where the last pass has led, but for the state as it
            was before: for one that is far off, as after a start, one pass would not do. Only the last one counts, as
            equations that were made in different places would together say more than any of them. If it has led
            elsewhere than the one before, they hold nowhere, and the state stays what it was.
        doubt: returns the variance of a filter's velocity as a share of its square: by that share of their parallax the
            tracks may be off what the equations, which are linear, say. The least that a pass has left of it counts.
    """
    result = TracksUsed()
    before, moved = state.copy() if passes > 1 else state, np.zeros(len(state.cov))
    step, left = moved, 1.0
    for index in range(passes):
        stack, left = _equations(state, B_T_C, tracks, sigma, plane), min(left, doubt(state))
        if len(stack.dof) < _FEWEST_FOUND * len(tracks):
            break
        stack = dataclasses.replace(stack, residual=stack.residual + stack.jacobian @ moved[MOTION : state.clones_end])
        good = stack.only(_gate(before, stack))
        if not len(good.dof):
            return result if result.used else TracksUsed(len(stack.dof))
        jacobian, residual, variance = _compressed(good)
        width = MOTION, len(state.cov) - state.clones_end
        jacobian = np.pad(jacobian, ((0, 0), width))
        if index:
            state.go_back(before)
        nis = result.nis_per_dof if index else state.nis(jacobian, residual, math.sqrt(variance)) / len(residual)
        bend = _BENT * left * float(np.median(good.parallax)) / sigma
        # All tracks bend alike, as it is one velocity that is wrong: many are no better than one.
        noise = max(variance, inflation) + len(good.dof) * bend * bend
        step, moved = -moved, state.update(jacobian, residual, math.sqrt(noise))
        step = step + moved
        error, depth_m = float(good.error.mean()), float(np.median(good.depth_m))
        result = TracksUsed(len(stack.dof), len(good.dof), nis, error, depth_m)
    if passes > 1 and (np.abs(step) > _CONVERGED_SIGMAS * np.sqrt(state.cov.diagonal())).any():
        state.go_back(before)
        return TracksUsed(result.offered)
    return result


def parallax_of(clones: Sequence[Clone], B_T_C: SE3, tracks: Tracks) -> float:
    """Return the median angle in rad by which points have moved since their first sighting, without rotations.

    Args:
        clones: the poses that the points were seen from.
    """
    rotations, _ = _cameras(clones, B_T_C, tracks)
    rays = directions_of(rotations, tracks)
    return float(np.median(np.linalg.norm(rays[tracks.lasts()] - rays[:, 0], axis=1)))


def relief_of(clones: Sequence[Clone], B_T_C: SE3, tracks: Tracks) -> float | None:
    """Return the height differences of points as a share of their distance; None for too few usable points.

    The part that their errors explain is taken out. The disagreement of the sightings gives the size of the errors.

    Args:
        clones: the poses that the points were seen from.
        tracks: sightings from those, 3 or more of each point.
    """
    rotations, positions = _cameras(clones, B_T_C, tracks)
    points, good = triangulate(rotations, positions, tracks)
    _, residual = reprojected(rotations, positions, tracks, points, good)
    count = tracks.seen.sum(axis=1)
    rays = points - positions[:, 0], points - positions[tracks.lasts()]
    lengths = [np.maximum(np.linalg.norm(ray, axis=1), 1e-6) for ray in rays]
    parallax = np.linalg.norm(rays[0] / lengths[0][:, None] - rays[1] / lengths[1][:, None], axis=1)
    noise = math.sqrt(float((residual[good] ** 2).sum()) / max(float((2 * count[good] - 3).sum()), 1.0))
    error = math.sqrt(2) * noise / np.maximum(parallax, 1e-9)
    good = good & (error < _RELIEF_ERROR)
    if np.count_nonzero(good) < _FEWEST_FOR_RELIEF:
        return None
    up = points[good, 2]
    spread = _NORMAL * float(np.median(np.abs(up - np.median(up)))) / float(np.median(lengths[1][good]))
    return math.sqrt(max(spread**2 - float(np.median(error[good])) ** 2, 0.0))


def _cameras(clones: Sequence[Clone], B_T_C: SE3, tracks: Tracks) -> tuple[Array, Array]:
    """Return the rotations [T, M, 3, 3] and positions [T, M, 3] of the cameras of all sightings."""
    rotations = np.array([clone.R.dot(B_T_C.R) for clone in clones])
    positions = np.array([clone.p + clone.R.dot(B_T_C.t) for clone in clones])
    return rotations[tracks.clones], positions[tracks.clones]


def _equations(state: WindowFilter, B_T_C: SE3, tracks: Tracks, sigma: float, plane: Plane | Below | None) -> _Stack:
    rotations, positions = _cameras(state.clones, B_T_C, tracks)
    points, good = (
        on_plane(rotations, positions, tracks, plane.height_m)
        if isinstance(plane, Plane)
        else triangulate(rotations, positions, tracks)
    )
    local = np.einsum("tmji,tmj->tmi", rotations, points[:, None] - positions)
    good = good & ((local[..., 2] > 1e-3) | ~tracks.seen).all(axis=1)
    depth, residual = reprojected(rotations, positions, tracks, points, good)
    residual = residual / sigma
    by_point = _projection(local[..., :2] / depth[..., None], depth, rotations) / sigma
    equations = _by_poses(by_point, residual, points, tracks, len(state.clones))
    known = np.zeros(len(tracks))
    if plane is not None:
        equations, known = _with_heights(*equations, points, plane, state.clones[-1].p)
    count, first_m = tracks.seen.sum(axis=1), local[:, 0, 2]
    error = np.sqrt((residual**2).sum(axis=2)).sum(axis=1) / count
    dof = 2 * count - 3 + known
    way_m = np.linalg.norm(positions[tracks.lasts()] - positions[:, 0], axis=1)
    return _Stack(
        *_eliminated(*equations), dof.astype(np.float64), error, first_m, way_m / np.maximum(first_m, 1e-3)
    ).only(good)


def reprojected(rotations: Array, positions: Array, tracks: Tracks, points: Array, good: Mask) -> tuple[Array, Array]:
    """Return the depths [T, M] and the reprojection errors [T, M, 2] of points.

    Without a sighting or a good point, these are infinite and 0.
    """
    local = np.einsum("tmji,tmj->tmi", rotations, points[:, None] - positions)
    depth = np.where(tracks.seen & good[:, None], local[..., 2], np.inf)
    residual = tracks.normalised - local[..., :2] / depth[..., None]
    return depth, np.where(np.isfinite(depth)[..., None], residual, 0.0)


def _projection(projected: Array, depth: Array, rotations: Array) -> Array:
    """Return the derivatives [T, M, 2, 3] of normalised coordinates with respect to a point of the world."""
    by_local = np.zeros((*projected.shape, 3))
    by_local[..., 0, 0] = by_local[..., 1, 1] = 1.0
    by_local[..., 2] = -projected
    by_point: Array = (by_local / depth[..., None, None]) @ np.swapaxes(rotations, -1, -2)
    return by_point


def _by_poses(
    by_point: Array, residual: Array, points: Array, tracks: Tracks, clones: int
) -> tuple[Array, Array, Array]:
    """Return the derivatives [T, 2M, 6N] by the poses, those [T, 2M, 3] by the points, and the residual [T, 2M]."""
    count, longest = tracks.seen.shape
    by_pose = np.concatenate([by_point @ skews(points)[:, None], -by_point], axis=-1)
    jacobian = np.zeros((count, longest, 2, clones, CLONE))
    rows, columns = np.indices((count, longest))
    jacobian[rows, columns, :, tracks.clones] = by_pose
    shape = count, 2 * longest
    return jacobian.reshape(*shape, -1), by_point.reshape(*shape, 3), residual.reshape(shape)


def _with_heights(
    jacobian: Array, by_point: Array, residual: Array, points: Array, plane: Plane | Below, body: Array
) -> tuple[tuple[Array, Array, Array], Array]:
    """Return the equations with one more for each point's height, and for which [T] of them it has effect."""
    by_last = np.zeros((len(points), 1, jacobian.shape[2]))
    if isinstance(plane, Plane):
        weight = np.full(len(points), 1 / plane.sigma_m)
        off = (plane.height_m - points[:, 2]) / plane.sigma_m
    else:
        weight, off = plane.rows(points, body)
        # The last pose turns about the world's origin and shifts, and so does the point that it sees.
        by_last[:, 0, -CLONE:] = weight[:, None] * np.array([-body[1], body[0], 0.0, 0.0, 0.0, -1.0])
    flat = np.zeros((len(points), 1, 3))
    flat[:, 0, 2] = weight
    extended = np.concatenate([jacobian, by_last], axis=1), np.concatenate([by_point, flat], axis=1)
    return (*extended, np.concatenate([residual, off[:, None]], axis=1)), (weight > 0).astype(np.float64)


def _eliminated(jacobian: Array, by_point: Array, residual: Array) -> tuple[Array, Array]:
    basis, _ = np.linalg.qr(by_point)
    turned = np.swapaxes(basis, 1, 2)
    return jacobian - basis @ (turned @ jacobian), residual - (basis @ (turned @ residual[..., None]))[..., 0]


def _gate(state: WindowFilter, stack: _Stack) -> Mask:
    """Return which tracks agree with the state; the gate widens if most do not, because the state is then off."""
    if not len(stack.dof):
        return np.zeros(0, np.bool_)
    clones = slice(MOTION, state.clones_end)
    cov = state.cov[clones, clones]
    innovation = stack.jacobian @ cov @ np.swapaxes(stack.jacobian, 1, 2) + np.eye(stack.jacobian.shape[1])
    solved = np.linalg.solve(innovation, stack.residual[..., None])[..., 0]
    squared = np.einsum("tk,tk->t", stack.residual, solved)
    opening = min(max(1.0, float(np.median(squared / stack.dof))), _WIDEST_GATE)
    mask: Mask = squared < opening * chdtri(stack.dof, _REFUSED)
    return mask


def _compressed(stack: _Stack) -> tuple[Array, Array, float]:
    """Return an equation for each observed direction, and the variance of the remainder."""
    rows = stack.jacobian.reshape(-1, stack.jacobian.shape[2])
    residual = stack.residual.ravel()
    values, vectors = np.linalg.eigh(rows.T.dot(rows))
    known = values > _WEAKEST * values[-1]
    root = np.sqrt(values[known])
    jacobian, right = root[:, None] * vectors[:, known].T, vectors[:, known].T.dot(rows.T.dot(residual)) / root
    rest, left = float(residual.dot(residual) - right.dot(right)), float(stack.dof.sum()) - len(right)
    return jacobian, right, max(1.0, rest / left) if left >= 1 else 1.0
