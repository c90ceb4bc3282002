# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Points that are held while a body hardly moves.

A track gives no information until its point can be triangulated, and none at all while the body hovers high up. So some
points then become part of the state, with a guessed inverse depth (Civera et al., Inverse depth parametrization for
monocular SLAM, 2008) and the uncertainty of a guess. Each picture is compared with that of one past pose, so the
position drifts only as far as the points wander, however long the hover lasts.
"""

from collections.abc import Mapping
from typing import Final

import numpy as np
from scipy.special import chdtri

from viso.companion.klt.front_end import Sighting
from viso.companion.msckf.triangulation import Mask
from viso.companion.msckf.window_filter import CLONE, MOTION, POINT, POSE, HeldPoint, WindowFilter
from viso.geometry.pose import SE3
from viso.geometry.rotation import Array, skew

MOST_HELD: Final = 24
FEWEST_HELD: Final = 12  # with fewer, new ones are added
SIGMA_SHARE: Final = 2.0  # of a sighting, in those of a track: the same corner is seen again and again
WANDER_SHARE: Final = 0.1  # how far a point wanders from picture to picture, in sigmas of a track
DEPTH_SPREAD: Final = 0.3  # of points in one picture, as a share of the inverse depth
_REFUSED: Final = 0.05
_WIDEST_GATE: Final = 9.0


class HeldPoints:
    """The held points of a filter.

    Args:
        sigma: of a normalised coordinate in a track.
    """

    def __init__(self, state: WindowFilter, B_T_C: SE3, sigma: float) -> None:
        self._state = state
        self._B_T_C = B_T_C
        self._sigma = sigma

    @property
    def numbers(self) -> set[int]:
        """The points held."""
        return {point.number for point in self._state.points}

    @property
    def anchors(self) -> set[int]:
        """The frames whose poses they are relative to."""
        return {point.anchor for point in self._state.points}

    def take(self, anchor: int, sighting: Sighting, depth_m: float, depth_is_known: bool) -> None:
        """Hold points of the last picture, as many as there is room for, spread over it.

        Args:
            anchor: number of the picture's frame, whose pose is the last in the window.
            depth_m: their approximate distance, if no point is held yet.
            depth_is_known: whether the distance is more than a guess.
        """
        state, held = self._state, self.numbers
        for row in _spread(sighting, MOST_HELD - len(held)):
            number = int(sighting.ids[row])
            if number in held:
                continue
            at = np.append(sighting.normalised[row], 1 / depth_m)
            like = len(state.points) // 2 if state.points else None
            if like is not None:
                at[2] = state.points[like].at[2]
            share = DEPTH_SPREAD if like is not None or depth_is_known else 1.0
            state.hold(HeldPoint(number, anchor, at), SIGMA_SHARE * self._sigma, share * at[2], like)

    def see(self, sighting: Sighting) -> float | None:
        """Update with a sighting of the points; return the mean normalised innovation squared, or None."""
        state = self._state
        normalised_of = dict(zip(sighting.ids.tolist(), sighting.normalised, strict=True))
        state.release(self.numbers - normalised_of.keys())
        if not state.points:
            return None
        state.blur_points(WANDER_SHARE * self._sigma)
        jacobian, residual, ahead = self._equations(normalised_of)
        sigma = SIGMA_SHARE * self._sigma
        innovation = jacobian @ state.cov @ jacobian.T
        own = np.arange(len(state.points))
        blocks = innovation.reshape(len(own), 2, len(own), 2)[own, :, own] + sigma**2 * np.eye(2)
        pairs = residual.reshape(-1, 2)
        nis = np.einsum("ni,ni->n", pairs, np.linalg.solve(blocks, pairs[..., None])[..., 0])
        opening = min(max(1.0, float(np.median(nis)) / 2), _WIDEST_GATE)
        good = ahead & (nis < opening * chdtri(2, _REFUSED))
        rows = np.repeat(good, 2)
        if good.any():
            state.update(jacobian[rows], residual[rows], sigma)
        state.release({point.number for point, is_good in zip(state.points, good.tolist(), strict=True) if not is_good})
        return float(np.median(nis)) / 2

    def _equations(self, normalised_of: Mapping[int, Array]) -> tuple[Array, Array, Mask]:
        """Return jacobian [2N, size], residual [2N], and which points [N] are ahead of the camera."""
        state, count = self._state, len(self._state.points)
        cameras = {clone.number: SE3(clone.R, clone.p) @ self._B_T_C for clone in state.clones}
        columns = {clone.number: MOTION + CLONE * index for index, clone in enumerate(state.clones)}
        now = state.pose @ self._B_T_C
        jacobian, residual = np.zeros((count, 2, len(state.cov))), np.zeros((count, 2))
        ahead = np.zeros(count, np.bool_)
        for row, point in enumerate(state.points):
            anchor, inverse = cameras[point.anchor], point.at[2]
            ray = anchor.R @ np.array([point.at[0], point.at[1], 1.0])
            local = now.R.T @ (ray + inverse * (anchor.t - now.t))
            if local[2] <= 1e-3:
                continue
            ahead[row] = True
            by_local = np.array([[1.0, 0.0, -local[0] / local[2]], [0.0, 1.0, -local[1] / local[2]]]) / local[2]
            by_world = by_local @ now.R.T
            point_w = ray + inverse * anchor.t  # times its inverse depth
            by_pose = by_world @ np.concatenate([skew(-point_w), inverse * np.eye(3)], axis=1)
            first = columns[point.anchor]
            jacobian[row, :, first : first + CLONE] = by_pose
            jacobian[row, :, POSE] = -by_pose
            own = state.clones_end + POINT * row
            jacobian[row, :, own : own + 2] = by_world @ anchor.R[:, :2]
            jacobian[row, :, own + 2] = by_world @ (anchor.t - now.t)
            residual[row] = normalised_of[point.number] - local[:2] / local[2]
        return jacobian.reshape(2 * count, -1), residual.ravel(), ahead


def _spread(sighting: Sighting, count: int) -> list[int]:
    """Return rows of a sighting, chosen one by one as the point farthest from those before."""
    at = sighting.normalised
    if count <= 0 or not len(at):
        return []
    rows = [int(np.hypot(*(at - at.mean(axis=0)).T).argmin())]
    away = np.hypot(*(at - at[rows[0]]).T)
    while len(rows) < min(count, len(at)):
        rows.append(int(away.argmax()))
        away = np.minimum(away, np.hypot(*(at - at[rows[-1]]).T))
    return rows
