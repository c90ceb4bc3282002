# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The filter with its tracks, updated with each frame."""

from typing import Final

import numpy as np

from viso.companion.klt.front_end import Sighting
from viso.companion.msckf.chain import Chain
from viso.companion.msckf.held_points import FEWEST_HELD, HeldPoints
from viso.companion.msckf.multi_state import Below, Plane, TracksUsed, parallax_of, relief_of, use_tracks
from viso.companion.msckf.tracks import RIPE, TrackBook, padded
from viso.companion.msckf.window_filter import VEL, WindowFilter, sigma_of
from viso.companion.vio.imu import bracketed
from viso.companion.vio.types import ImuWindow
from viso.geometry.pose import SE3

UNSURE_VELOCITY_M_S: Final = 0.1
UNSURE_PASSES: Final = 6
_RATIO_KEPT: Final = 0.9
_ENOUGH_TRACKS: Final = 8  # of which none has a point that can be found: the body hardly moves
_MOST_PARALLAX: Final = 0.02  # rad, of a body that hardly moves
_MOST_ANCHORS: Final = 3
_FEWEST_FOR_RELIEF: Final = 3  # sightings


class WindowEstimator:
    """A filter fed by the front end.

    Args:
        sigma: of a normalised coordinate.
        window_clones: largest number of poses kept.
        fewest_sightings: of a track that is used: 3, or 2 on a known plane.

    Attributes:
        innovation_ratio: running mean of the normalised innovation squared per degree of freedom.
        chain: of the poses since the start, whose first one is kept; None before there is one.
    """

    def __init__(
        self, state: WindowFilter, B_T_C: SE3, sigma: float, window_clones: int, fewest_sightings: int
    ) -> None:
        self.state = state
        self.innovation_ratio = 1.0
        self._B_T_C = B_T_C
        self._sigma = sigma
        self._window_clones = window_clones
        self._tracks = TrackBook(fewest_sightings, min(RIPE, window_clones))
        self.chain: Chain | None = None
        self._held = HeldPoints(state, B_T_C, sigma)
        self._depth_m: float | None = None  # of the points that were used last

    def propagate(self, window: ImuWindow) -> None:
        """Propagate by inertial data or, without them, with the last motion."""
        self.state.carry_on(window, bracketed(window))

    def compare(self, sighting: Sighting) -> None:
        """Update with the sightings of the held points."""
        nis = self._held.see(sighting)
        if nis is not None:
            self._note_ratio(nis)

    def add_frame(
        self, number: int, sighting: Sighting, plane: Plane | Below | None, keep: int | None, depth_m: float = 1.0
    ) -> TracksUsed:
        """Add a frame in motion: keep its pose, and use the tracks that are due.

        Args:
            number: of the frame, larger than those before.
            plane: the ground, if all points lie on it or its height right below is known.
            keep: a frame whose pose must stay in the window.
            depth_m: a low guess of the distance of points.
        """
        state = self.state
        state.clone(number)
        free = np.isin(sighting.ids, list(self._held.numbers), invert=True)
        chosen = self._tracks.note(number, sighting.ids[free].tolist(), sighting.normalised[free].tolist())
        used = TracksUsed()
        if chosen:
            tracks = padded(chosen, self._clone_of())
            steps = max(1.0, self.innovation_ratio), self._passes(), velocity_doubt
            used = use_tracks(state, self._B_T_C, tracks, self._sigma, plane, *steps)
        if used.used:
            self._note_ratio(used.nis_per_dof)
            self._depth_m = used.depth_m
        elif (
            not isinstance(plane, Plane)
            and not used.offered
            and len(chosen) >= _ENOUGH_TRACKS
            and parallax_of(state.clones, self._B_T_C, tracks) < _MOST_PARALLAX  # else the state is wrong
        ):
            self.hold(number, sighting, depth_m)
        self._shorten(keep)
        return used

    def hold(self, number: int, sighting: Sighting, depth_m: float) -> None:
        """Hold points of the window's last frame, as many as there is room for."""
        held = self._held
        if len(held.numbers) >= FEWEST_HELD:
            return
        for anchor in sorted(held.anchors)[: 1 - _MOST_ANCHORS]:
            self.state.release({point.number for point in self.state.points if point.anchor == anchor})
        known = self._depth_m
        held.take(number, sighting, known or depth_m, known is not None)
        self._tracks.forget(held.numbers)

    def relief_share(self) -> float | None:
        """Return the height differences of points as a share of their distance; None if unknown."""
        tracks = self._tracks.longest(_FEWEST_FOR_RELIEF)
        if len(tracks) < _ENOUGH_TRACKS:
            return None
        return relief_of(self.state.clones, self._B_T_C, padded(tracks, self._clone_of()))

    def _clone_of(self) -> dict[int, int]:
        return {clone.number: index for index, clone in enumerate(self.state.clones)}

    def _note_ratio(self, nis_per_dof: float) -> None:
        self.innovation_ratio = _RATIO_KEPT * self.innovation_ratio + (1 - _RATIO_KEPT) * nis_per_dof

    def _passes(self) -> int:
        return UNSURE_PASSES if sigma_of(self.state.cov[VEL, VEL]) > UNSURE_VELOCITY_M_S else 1

    def _shorten(self, keep: int | None) -> None:
        origin = None if self.chain is None else self.chain.origin
        kept = self._held.anchors | {keep, origin}
        while len(self.state.clones) > self._window_clones + len(kept - {keep}):
            oldest = next(clone.number for clone in self.state.clones if clone.number not in kept)
            self.state.drop(oldest)
            self._tracks.drop(oldest)


def velocity_doubt(state: WindowFilter) -> float:
    """Return the variance of the velocity as a share of its square, at most 1."""
    speed_m_s = float(np.linalg.norm(state.v))
    return min(1.0, sigma_of(state.cov[VEL, VEL]) / max(speed_m_s, 1e-3)) ** 2
