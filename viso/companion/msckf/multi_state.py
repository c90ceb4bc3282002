# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the tracks of points say about the poses that they were seen from.

Each track's point is triangulated and then eliminated: only what does not depend on where it is counts (Mourikis and
Roumeliotis, 2007). A scene that is a known plane adds an equation for the height of each point. All tracks are computed
at once, in arrays padded to the longest track: rows of padding are zero and say nothing.
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.special import chdtri

from viso.companion.msckf.tracks import Tracks
from viso.companion.msckf.triangulation import Mask, on_plane, triangulate
from viso.companion.msckf.window_filter import CLONE, MOTION, WindowFilter
from viso.companion.vio.se3 import SE3, Array

_REFUSED: Final = 0.05  # of good tracks, by the gate
_WIDEST_GATE: Final = 25.0
_FEWEST_FOUND: Final = 0.2  # share of tracks whose points can be found, below which those are found by chance
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
class TracksUsed:
    """What became of tracks; without any that was used, only the first number says something.

    Attributes:
        offered: tracks whose points could be found.
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
    """The equations of all tracks, in units of sigma; what depends on the points is gone.

    Attributes:
        jacobian: [T, K, S] with respect to the window's poses.
        residual: [T, K].
        dof: [T], degrees of freedom.
        error: [T], mean reprojection error.
        depth_m: [T], along the camera's axis when a point was seen first.
    """

    jacobian: Array
    residual: Array
    dof: Array
    error: Array
    depth_m: Array

    def only(self, mask: Mask) -> "_Stack":
        return _Stack(self.jacobian[mask], self.residual[mask], self.dof[mask], self.error[mask], self.depth_m[mask])


def use_tracks(
    state: WindowFilter, B_T_C: SE3, tracks: Tracks, sigma: float, plane: Plane | None, inflation: float, passes: int
) -> TracksUsed:
    """Take tracks into a filter.

    Args:
        state: the filter.
        B_T_C: from the camera into the body.
        tracks: sightings from the window's poses.
        sigma: of a normalised coordinate.
        plane: the ground, if all points lie on it.
        inflation: of the measurement's covariance, 1 or more.
        passes: how often the equations are made anew. Each pass counts as one of so many parts of the measurement, so
            that all together it is used once: for a state that is far off, as after a start, one pass would not do.
    """
    result = TracksUsed()
    for index in range(passes):
        stack = _equations(state, B_T_C, tracks, sigma, plane)
        if len(stack.dof) < _FEWEST_FOUND * len(tracks):
            break
        good = stack.only(_gate(state, stack))
        if not len(good.dof):
            return result if result.used else TracksUsed(len(stack.dof))
        jacobian, residual, variance = _compressed(good)
        jacobian = np.concatenate([np.zeros((len(residual), MOTION)), jacobian], axis=1)
        nis = result.nis_per_dof if index else state.nis(jacobian, residual, math.sqrt(variance)) / len(residual)
        state.update(jacobian, residual, math.sqrt(max(variance, inflation) * passes))
        error, depth_m = float(good.error.mean()), float(np.median(good.depth_m))
        result = TracksUsed(len(stack.dof), len(good.dof), nis, error, depth_m)
    return result


def _equations(state: WindowFilter, B_T_C: SE3, tracks: Tracks, sigma: float, plane: Plane | None) -> _Stack:
    rotations = np.array([clone.R.dot(B_T_C.R) for clone in state.clones])[tracks.clones]
    positions = np.array([clone.p + clone.R.dot(B_T_C.t) for clone in state.clones])[tracks.clones]
    points, good = (
        triangulate(rotations, positions, tracks)
        if plane is None
        else on_plane(rotations, positions, tracks, plane.height_m)
    )
    local = np.einsum("tmji,tmj->tmi", rotations, points[:, None] - positions)
    good = good & ((local[..., 2] > 1e-3) | ~tracks.seen).all(axis=1)
    depth = np.where(tracks.seen & good[:, None], local[..., 2], np.inf)
    projected = local[..., :2] / depth[..., None]
    residual = np.where(np.isfinite(depth)[..., None], tracks.normalised - projected, 0.0) / sigma
    by_point = _projection(projected, depth, rotations) / sigma
    stack = _eliminated(*_by_poses(by_point, residual, points, tracks, len(state.clones)), points, plane)
    error = np.sqrt((residual**2).sum(axis=2)).sum(axis=1) / tracks.seen.sum(axis=1)
    dof = 2 * tracks.seen.sum(axis=1) - 3 + (plane is not None)
    return _Stack(*stack, dof.astype(np.float64), error, local[:, 0, 2]).only(good)


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
    cross = np.zeros((count, 3, 3))
    cross[:, 0, 1], cross[:, 0, 2], cross[:, 1, 2] = -points[:, 2], points[:, 1], -points[:, 0]
    cross -= np.swapaxes(cross, 1, 2)
    by_pose = np.concatenate([by_point @ cross[:, None], -by_point], axis=-1)
    jacobian = np.zeros((count, longest, 2, clones, CLONE))
    rows, columns = np.indices((count, longest))
    jacobian[rows, columns, :, tracks.clones] = by_pose
    shape = count, 2 * longest
    return jacobian.reshape(*shape, -1), by_point.reshape(*shape, 3), residual.reshape(shape)


def _eliminated(
    jacobian: Array, by_point: Array, residual: Array, points: Array, plane: Plane | None
) -> tuple[Array, Array]:
    if plane is not None:  # one more equation each, for the height
        flat = np.zeros((len(points), 1, 3))
        flat[..., 2] = 1 / plane.sigma_m
        off = (plane.height_m - points[:, 2:]) / plane.sigma_m
        jacobian = np.concatenate([jacobian, np.zeros((len(points), 1, jacobian.shape[2]))], axis=1)
        by_point, residual = np.concatenate([by_point, flat], axis=1), np.concatenate([residual, off], axis=1)
    basis, _ = np.linalg.qr(by_point)
    turned = np.swapaxes(basis, 1, 2)
    return jacobian - basis @ (turned @ jacobian), residual - (basis @ (turned @ residual[..., None]))[..., 0]


def _gate(state: WindowFilter, stack: _Stack) -> Mask:
    """Return which tracks agree with the state; the gate opens where most of them do not, as the state is off then."""
    if not len(stack.dof):
        return np.zeros(0, np.bool_)
    cov = state.cov[MOTION:, MOTION:]
    innovation = stack.jacobian @ cov @ np.swapaxes(stack.jacobian, 1, 2) + np.eye(stack.jacobian.shape[1])
    solved = np.linalg.solve(innovation, stack.residual[..., None])[..., 0]
    squared = np.einsum("tk,tk->t", stack.residual, solved)
    opening = min(max(1.0, float(np.median(squared / stack.dof))), _WIDEST_GATE)
    mask: Mask = squared < opening * chdtri(stack.dof, _REFUSED)
    return mask


def _compressed(stack: _Stack) -> tuple[Array, Array, float]:
    """Return an equation for each direction that the tracks tell about, and the variance of what is left over."""
    rows = stack.jacobian.reshape(-1, stack.jacobian.shape[2])
    residual = stack.residual.ravel()
    values, vectors = np.linalg.eigh(rows.T.dot(rows))
    told = values > _WEAKEST * values[-1]
    root = np.sqrt(values[told])
    jacobian, right = root[:, None] * vectors[:, told].T, vectors[:, told].T.dot(rows.T.dot(residual)) / root
    rest, left = float(residual.dot(residual) - right.dot(right)), float(stack.dof.sum()) - len(right)
    return jacobian, right, max(1.0, rest / left) if left >= 1 else 1.0
