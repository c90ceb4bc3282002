# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Selection of landmarks from tracked points, and the positions of new ones."""

import math
from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from viso.companion.klt.front_end import Sighting
from viso.companion.msckf.multi_state import reprojected
from viso.companion.msckf.tracks import MOST_TRACKS, Tracks, padded
from viso.companion.msckf.triangulation import Mask, directions_of, triangulate
from viso.companion.smoother.lag_smoother import LandmarkSighting
from viso.geometry.pose import SE3
from viso.geometry.rotation import Array

MOST_LANDMARKS: Final = 50  # at a time; more take longer and hardly help
FEWEST_SIGHTINGS: Final = 3
MOST_SIGHTINGS: Final = 4  # of a landmark, in motion: tracked points wander
FEWEST_LEFT: Final = MOST_LANDMARKS // 2  # when old ones are given up: the body may stop and show no more
MIN_PARALLAX_RAD: Final = math.radians(1.0)
MAX_ERROR_SIGMAS: Final = 8.0
_MIN_DEPTH_M: Final = 1e-3
_FEWEST_MOVING: Final = 8  # points that say whether the body moves

_Track = dict[int, tuple[float, float]]


@dataclass(frozen=True, slots=True, eq=False)
class NewLandmark:
    """A point that becomes a landmark.

    Attributes:
        position: [3] in the world.
        sightings: of it so far, none of them used yet.
    """

    landmark: int
    position: Array
    sightings: tuple[LandmarkSighting, ...]


class LandmarkBook:
    """Collects sightings of points until they can become landmarks, and stores the landmarks' numbers.

    Args:
        sigma: of a normalised coordinate.
    """

    def __init__(self, B_T_C: SE3, sigma: float) -> None:
        self._B_T_C = B_T_C
        self._sigma = sigma
        self._tracks: dict[int, _Track] = {}
        self._landmarks: dict[int, int] = {}  # by the numbers of points
        self._next = 0

    @property
    def count(self) -> int:
        """How many landmarks there are."""
        return len(self._landmarks)

    def forget(self) -> None:
        """Forget all sightings and landmarks."""
        self._tracks.clear()
        self._landmarks.clear()

    def note(self, number: int, sighting: Sighting) -> list[LandmarkSighting]:
        """Add the sightings of a node; return those of landmarks. Points that it does not show are dropped for good."""
        before, self._tracks = self._tracks, {}
        seen = []
        for point, (u, v) in zip(sighting.ids.tolist(), sighting.normalised.tolist(), strict=True):
            self._tracks[point] = before.get(point, {}) | {number: (u, v)}
            if point in self._landmarks:
                seen.append(LandmarkSighting(number, self._landmarks[point], np.array([u, v])))
        self._landmarks = {point: number for point, number in self._landmarks.items() if point in self._tracks}
        return seen

    def discover(self, poses: Mapping[int, SE3]) -> list[NewLandmark]:
        """Return points that become landmarks: seen often enough, from positions far enough apart.

        Old landmarks are dropped while there is enough motion to triangulate their points again.

        Args:
            poses: world_T_body of nodes; sightings from others do not count.
        """
        cameras = {number: pose @ self._B_T_C for number, pose in poses.items()}
        self._retire(cameras)
        free = {point: _within(track, cameras) for point, track in self._tracks.items() if point not in self._landmarks}
        # The youngest first: their points have wandered least.
        points = sorted(
            (point for point, track in free.items() if len(track) >= FEWEST_SIGHTINGS), key=lambda p: len(free[p])
        )
        room = MOST_LANDMARKS - len(self._landmarks)
        if not points or room <= 0:
            return []
        positions, good = self._positions(_Sightings.of(cameras, [free[point] for point in points]))
        chosen = np.flatnonzero(good)[:room].tolist()
        return [self._new(points[row], positions[row], free[points[row]]) for row in chosen]

    def parallax_rad(self, poses: Mapping[int, SE3], numbers: Sequence[int]) -> float:
        """Return the median parallax of points within some nodes; NaN if too few have been seen.

        Args:
            poses: world_T_body of nodes.
        """
        cameras = {number: poses[number] @ self._B_T_C for number in numbers}
        tracks = [_within(track, cameras) for track in self._tracks.values()]
        tracks = [track for track in tracks if len(track) >= FEWEST_SIGHTINGS]
        return (
            float(np.median(_Sightings.of(cameras, tracks).parallax_rad()))
            if len(tracks) >= _FEWEST_MOVING
            else math.nan
        )

    def longest(self, numbers: Container[int]) -> list[_Track]:
        """Return the longest tracks within some nodes."""
        tracks = [_within(track, numbers) for track in self._tracks.values()]
        return sorted((track for track in tracks if len(track) >= FEWEST_SIGHTINGS), key=len)[-MOST_TRACKS:]

    def drop(self, landmarks: Container[int]) -> None:
        """Remove landmarks and their sightings; their points may become new ones."""
        for point in [point for point, landmark in self._landmarks.items() if landmark in landmarks]:
            del self._landmarks[point]
            self._tracks[point] = {}

    def _retire(self, cameras: Mapping[int, SE3]) -> None:
        old = [point for point in self._landmarks if len(self._tracks[point]) >= MOST_SIGHTINGS]
        old.sort(key=lambda point: -len(self._tracks[point]))
        steps = [_within(dict(list(self._tracks[point].items())[-2:]), cameras) for point in old]
        if steps:
            moved = _Sightings.of(cameras, steps).parallax_rad() >= 0.5 * MIN_PARALLAX_RAD
            spare = max(len(self._landmarks) - FEWEST_LEFT, 0)
            self.drop({self._landmarks[old[row]] for row in np.flatnonzero(moved)[:spare].tolist()})

    def _positions(self, seen: "_Sightings") -> tuple[Array, Mask]:
        rotations, places, tracks = seen.rotations, seen.places, seen.tracks
        points, good = triangulate(rotations, places, tracks)
        depth, residual = reprojected(rotations, places, tracks, points, good)
        close = np.linalg.norm(residual, axis=-1).max(axis=1) < MAX_ERROR_SIGMAS * self._sigma
        ahead = (depth > _MIN_DEPTH_M).all(axis=1)
        return points, good & ahead & close & (seen.parallax_rad() >= MIN_PARALLAX_RAD)

    def _new(self, point: int, position: Array, track: _Track) -> NewLandmark:
        self._next += 1
        self._landmarks[point] = self._next
        sightings = tuple(LandmarkSighting(number, self._next, np.array(seen)) for number, seen in track.items())
        return NewLandmark(self._next, position, sightings)


@dataclass(frozen=True, slots=True, eq=False)
class _Sightings:
    """Tracks as arrays, with the camera of each sighting: rotations [T, M, 3, 3] and places [T, M, 3], in the world."""

    rotations: Array
    places: Array
    tracks: Tracks

    @classmethod
    def of(cls, cameras: Mapping[int, SE3], tracks: Sequence[_Track]) -> "_Sightings":
        arrays = padded(tracks, {number: index for index, number in enumerate(cameras)})
        rotations = np.array([camera.R for camera in cameras.values()])
        places = np.array([camera.t for camera in cameras.values()])
        return cls(rotations[arrays.clones], places[arrays.clones], arrays)

    def parallax_rad(self) -> Array:
        """Return the angles [T] between the first ray and the last."""
        directions = directions_of(self.rotations, self.tracks)
        last = directions[self.tracks.lasts()]
        angles: Array = np.arccos(np.clip(np.einsum("ti,ti->t", directions[:, 0], last), -1.0, 1.0))
        return angles


def _within(track: _Track, numbers: Container[int]) -> _Track:
    return {number: seen for number, seen in track.items() if number in numbers}
