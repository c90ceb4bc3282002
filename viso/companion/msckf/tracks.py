# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The tracks of points through the window, and when they are used. Each sighting is used once."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from viso.geometry.rotation import Array

MOST_TRACKS: Final = 45
RIPE: Final = 6

_Sightings = dict[int, tuple[float, float]]


@dataclass(frozen=True, slots=True, eq=False)
class Tracks:
    """Where points were seen, in arrays padded to the longest track.

    Attributes:
        clones: [T, M], which of the window's poses each sighting belongs to; 0 where there is none.
        seen: [T, M], whether there is a sighting; a track's sightings come first, in their order.
        normalised: [T, M, 2]; 0 where there is none.
    """

    clones: npt.NDArray[np.int64]
    seen: npt.NDArray[np.bool_]
    normalised: Array

    def __len__(self) -> int:
        return len(self.seen)

    def lasts(self) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
        """Return the index of each track's last sighting in arrays [T, M, ...]."""
        return np.arange(len(self)), self.seen.sum(axis=1) - 1


class TrackBook:
    """Collects sightings until they are used.

    Args:
        fewest: least number of useful sightings: 3, or 2 on a known plane.
        ripe: number of sightings after which a point is used while it is still tracked.
    """

    def __init__(self, fewest: int, ripe: int = RIPE) -> None:
        self._fewest, self._ripe = fewest, max(fewest, ripe)
        self._open: dict[int, _Sightings] = {}

    def note(self, number: int, ids: Iterable[int], normalised: Iterable[Sequence[float]]) -> list[_Sightings]:
        """Add the sightings of a frame; return the tracks to use now, the longest first.

        Args:
            normalised: [N, 2].
        """
        live = self._open
        self._open = {}
        for point, (u, v) in zip(ids, normalised, strict=True):
            track = self._open[point] = live.pop(point, {})
            track[number] = (u, v)
        ended = [track for track in live.values() if len(track) >= self._fewest]
        ripe = {point: track for point, track in self._open.items() if len(track) >= self._ripe}
        used = sorted([*ended, *ripe.values()], key=len, reverse=True)[:MOST_TRACKS]
        taken = {id(track) for track in used}
        for point, track in ripe.items():
            if id(track) in taken:
                self._open[point] = {}
        return used

    def longest(self, fewest: int) -> list[_Sightings]:
        """Return the longest tracks of points that are still tracked, with at least ``fewest`` sightings."""
        tracks = [track for track in self._open.values() if len(track) >= fewest]
        return sorted(tracks, key=len, reverse=True)[:MOST_TRACKS]

    def forget(self, points: Iterable[int]) -> None:
        """Forget the sightings of points."""
        for point in points:
            self._open.pop(point, None)

    def drop(self, number: int) -> None:
        """Forget the sightings of a frame whose pose is no longer known."""
        for track in self._open.values():
            track.pop(number, None)


def padded(tracks: Sequence[_Sightings], clone_of: dict[int, int]) -> Tracks:
    """Return tracks as arrays.

    Args:
        tracks: sightings by the numbers of frames.
        clone_of: which of the window's poses belongs to a frame.
    """
    shape = len(tracks), max(map(len, tracks), default=0)
    result = Tracks(np.zeros(shape, np.int64), np.zeros(shape, np.bool_), np.zeros((*shape, 2)))
    for row, track in enumerate(tracks):
        count = len(track)
        result.clones[row, :count] = [clone_of[number] for number in track]
        result.seen[row, :count] = True
        result.normalised[row, :count] = list(track.values())
    return result
