# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Triangulation of points from several known poses, for all tracks at once."""

from typing import Final

import numpy as np
import numpy.typing as npt

from viso.companion.msckf.tracks import Tracks
from viso.geometry.rotation import Array

Mask = npt.NDArray[np.bool_]

_ITERATIONS: Final = 5
_MIN_DEPTH_M: Final = 0.1
_MIN_INVERSE_DEPTH: Final = 1 / 1000.0
_PARALLAX: Final = 1e-4  # smallest eigenvalue of the sum of projections across the rays: the sine squared, about


def directions_of(rotations: Array, tracks: Tracks) -> Array:
    """Return the directions [T, M, 3] in the world, of length 1, in which points were seen; rotations as below."""
    rays = _rays(tracks)
    directions: Array = np.einsum("tmij,tmj->tmi", rotations, rays / np.linalg.norm(rays, axis=-1, keepdims=True))
    return directions


def _rays(tracks: Tracks) -> Array:
    return np.concatenate([tracks.normalised, np.ones_like(tracks.normalised[..., :1])], axis=-1)


def triangulate(rotations: Array, positions: Array, tracks: Tracks) -> tuple[Array, Mask]:
    """Return points [T, 3] in the world, and which of them are in front of the cameras and near enough.

    Args:
        rotations, positions: [T, M, 3, 3] and [T, M, 3], from the cameras to the world, of each sighting.
    """
    directions = directions_of(rotations, tracks)
    # The point nearest to all rays.
    across = (np.eye(3) - directions[..., :, None] * directions[..., None, :]) * tracks.seen[..., None, None]
    normal = across.sum(axis=1)
    good = np.linalg.eigvalsh(normal)[:, 0] > _PARALLAX
    normal[~good] = np.eye(3)
    points = np.linalg.solve(normal, np.einsum("tmij,tmj->ti", across, positions)[..., None])[..., 0]
    return _refined(rotations, positions, tracks, points, good)


def _refined(rotations: Array, positions: Array, tracks: Tracks, points: Array, good: Mask) -> tuple[Array, Mask]:
    """Minimise the reprojection error over direction and inverse depth, in the camera that saw a point last."""
    anchor_rotation, anchor = rotations[tracks.lasts()], positions[tracks.lasts()]
    local = np.einsum("tji,tj->ti", anchor_rotation, points - anchor)
    good = good & (local[:, 2] > _MIN_DEPTH_M)
    local[~good] = [0.0, 0.0, 1.0]
    # u, v, 1/depth
    guess = np.stack([local[:, 0], local[:, 1], np.ones(len(local))], axis=1) / local[:, 2:]
    turn = np.einsum("tmji,tjk->tmik", rotations, anchor_rotation)
    shift = np.einsum("tmji,tmj->tmi", rotations, anchor[:, None] - positions)
    slope = np.concatenate([turn[..., :2], shift[..., None]], axis=-1)
    for _ in range(_ITERATIONS):
        ray = np.einsum("tmij,tj->tmi", slope, guess) + turn[..., 2]
        good = good & ((ray[..., 2] > 1e-3) | ~tracks.seen).all(axis=1)
        depth = np.where((ray[..., 2] > 1e-3) & tracks.seen & good[:, None], ray[..., 2], np.inf)
        projected = ray[..., :2] / depth[..., None]
        jacobian = (slope[..., :2, :] - projected[..., None] * slope[..., 2:, :]) / depth[..., None, None]
        error = np.where(np.isfinite(depth)[..., None], tracks.normalised - projected, 0.0)
        normal = np.einsum("tmki,tmkj->tij", jacobian, jacobian) + 1e-9 * np.eye(3)
        guess = guess + np.linalg.solve(normal, np.einsum("tmki,tmk->ti", jacobian, error)[..., None])[..., 0]
    good = good & (guess[:, 2] > _MIN_INVERSE_DEPTH) & (guess[:, 2] < 1 / _MIN_DEPTH_M)
    inverse = np.where(good, guess[:, 2], 1.0)
    local = np.stack([guess[:, 0], guess[:, 1], np.ones(len(guess))], axis=1) / inverse[:, None]
    return np.einsum("tij,tj->ti", anchor_rotation, local) + anchor, good


def on_plane(rotations: Array, positions: Array, tracks: Tracks, height_m: float) -> tuple[Array, Mask]:
    """Return points [T, 3] on a horizontal plane, each the mean of its rays' intersections, and which are valid.

    Args:
        rotations, positions: as for :func:`triangulate`.
        height_m: of the plane, in the world.
    """
    directions = np.einsum("tmij,tmj->tmi", rotations, _rays(tracks))
    drop = height_m - positions[..., 2]
    depth = drop / np.where(directions[..., 2] == 0, np.inf, directions[..., 2])
    good: Mask = np.where(tracks.seen, depth, np.inf).min(axis=1) > _MIN_DEPTH_M
    met = np.where(tracks.seen[..., None], positions + depth[..., None] * directions, 0.0)
    points: Array = met.sum(axis=1) / tracks.seen.sum(axis=1)[:, None]
    return points, good
