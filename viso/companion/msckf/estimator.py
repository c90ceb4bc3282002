# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The filter with its tracks: what happens to both with each frame."""

from typing import Final

from viso.companion.klt.front_end import Sighting
from viso.companion.msckf.multi_state import Plane, TracksUsed, use_tracks
from viso.companion.msckf.tracks import RIPE, TrackBook, padded
from viso.companion.msckf.window_filter import VEL, WindowFilter, sigma_of
from viso.companion.vio.imu_window import bracketed
from viso.companion.vio.se3 import SE3
from viso.companion.vio.types import ImuWindow

UNSURE_VELOCITY_M_S: Final = 0.1
UNSURE_PASSES: Final = 3
_RATIO_KEPT: Final = 0.9


class WindowEstimator:
    """A filter that is fed with what the front end sees.

    Args:
        state: the filter.
        B_T_C: from the camera into the body.
        sigma: of a normalised coordinate.
        window_clones: the most poses kept.
        fewest_sightings: of a track that is used: 3, or 2 on a known plane.

    Attributes:
        state: the filter.
        innovation_ratio: running mean of the normalised innovation squared per degree of freedom.
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

    def propagate(self, window: ImuWindow) -> None:
        """Move on by inertial data or, where there are none, as the body moved last."""
        self.state.carry_on(window, bracketed(window))

    def add_frame(self, number: int, sighting: Sighting, plane: Plane | None, keep: int | None) -> TracksUsed:
        """Take in a frame in motion: keep its pose, and use the tracks whose turn it is.

        Args:
            number: of the frame, larger than those before.
            sighting: what it shows.
            plane: the ground, if all points lie on it.
            keep: a frame whose pose is not to be forgotten.
        """
        state = self.state
        state.clone(number)
        chosen = self._tracks.note(number, sighting.ids.tolist(), sighting.normalised.tolist())
        used = TracksUsed()
        if chosen:
            clone_of = {clone.number: index for index, clone in enumerate(state.clones)}
            used = use_tracks(
                state, self._B_T_C, padded(chosen, clone_of), self._sigma, plane, self._inflation(), self._passes()
            )
        if used.used:
            self.innovation_ratio = _RATIO_KEPT * self.innovation_ratio + (1 - _RATIO_KEPT) * used.nis_per_dof
        self._shorten(keep)
        return used

    def _inflation(self) -> float:
        return max(1.0, self.innovation_ratio)

    def _passes(self) -> int:
        return UNSURE_PASSES if sigma_of(self.state.cov[VEL, VEL]) > UNSURE_VELOCITY_M_S else 1

    def _shorten(self, keep: int | None) -> None:
        while len(self.state.clones) > self._window_clones:
            oldest = next(clone.number for clone in self.state.clones if clone.number != keep)
            self.state.drop(oldest)
            self._tracks.drop(oldest)
