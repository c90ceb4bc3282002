# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The front end: tracks points through pictures and checks them."""

import uuid
from dataclasses import dataclass
from typing import Any, Final, cast

import cv2
import numpy as np
import numpy.typing as npt

from viso.companion.klt.grid import FeatureGrid, Mask, Points
from viso.companion.klt.outliers import Agreement, Model, check, rotated
from viso.companion.klt.tracker import KltTracker
from viso.companion.vio.config import Scene, VioConfig
from viso.companion.vio.types import CameraCalibration, Pixels
from viso.companion.vio.undistortion import distort, undistort
from viso.geometry.rotation import Array

_CLAHE_LIMIT: Final = 2.0
_CLAHE_TILES: Final = (8, 8)


def shrink_factor(width: int, working_width_px: int) -> int:
    """Return the smallest divisor that brings a width down to the working width or less."""
    return -(-width // working_width_px)


class WorkingImages:
    """Makes working images of pictures.

    Args:
        divisor: of the picture's sides, from :func:`shrink_factor`.
        clahe: whether contrast is equalised (contrast limited, 8 x 8 tiles).
    """

    def __init__(self, divisor: int, *, clahe: bool = False) -> None:
        self._divisor = divisor
        self._clahe = cv2.createCLAHE(_CLAHE_LIMIT, _CLAHE_TILES) if clahe else None

    def make(self, pixels: Pixels) -> Pixels:
        """Return the working image [H', W'] of a picture, BGR [H, W, 3] or grey [H, W], always as a copy."""
        image: Any = cv2.cvtColor(pixels, cv2.COLOR_BGR2GRAY) if pixels.ndim == 3 else pixels
        if self._divisor > 1:
            height, width = (side // self._divisor for side in image.shape)
            whole = image[: height * self._divisor, : width * self._divisor]
            image = cv2.resize(whole, (width, height), interpolation=cv2.INTER_AREA)
        if self._clahe is not None:
            image = self._clahe.apply(image)
        return cast(Pixels, image.copy() if image is pixels else image)


Ids = npt.NDArray[np.int64]

MIN_DISPARITY_PX: Final = 20.0  # of a keyframe
MIN_COMMON: Final = 40
MAX_AGE_NS: Final = 1_000_000_000
_ENOUGH: Final = 0.85  # of the most features: above it none are looked for


@dataclass(frozen=True, slots=True, eq=False)
class Sighting:
    """The points in a picture.

    Attributes:
        ids: [N], identifiers of the points, kept while they are tracked.
        normalised: [N, 2], undistorted; first the points found again, then the new ones.
        tracked, lost, new: numbers of points of the last picture found again and not, and of points detected in this
        one.
        inliers: number of points found again that agree with a rigid scene. Outliers are dropped, and so are some
            points where they crowd.
        model: the model that they agree with; None if none could be fitted.
        disparity_px: median movement since the last picture, without the rotation.
        coverage: share of the grid's cells with an inlier.
    """

    ids: Ids
    normalised: Array
    tracked: int
    lost: int
    new: int
    inliers: int
    model: Model | None
    disparity_px: float
    coverage: float


class FrontEnd:
    """Tracks points through the pictures of one camera.

    Args:
        calibration: of the working image.
        config: max_features, fb_threshold_px, ransac_threshold_px and whether the scene is known to be a plane.
    """

    def __init__(self, calibration: CameraCalibration, config: VioConfig) -> None:
        self._calibration = calibration
        self._max_features = config.max_features
        self._threshold_px = config.ransac_threshold_px
        self.planar = config.scene is Scene.PLANAR
        self._grid = FeatureGrid(calibration.width, calibration.height, config.max_features)
        self._tracker = KltTracker(calibration.width, calibration.height, config.fb_threshold_px)
        self.forget()

    @property
    def focal_px(self) -> float:
        """Mean focal length of the working image."""
        return 0.5 * (self._calibration.fx + self._calibration.fy)

    def forget(self) -> None:
        """Discard all tracks and the last picture."""
        self._image: Pixels | None = None
        self._pixels: Points = np.zeros((0, 2), np.float32)
        self._normalised: Array = np.zeros((0, 2))
        self._ids: Ids = np.zeros(0, np.int64)
        self._next_id = 0

    def track(self, image: Pixels, rotation: Array, prior: Array | None = None) -> Sighting:
        """Track the points into a picture; detect new ones in cells that have too few.

        Args:
            image: grey working image, kept until the next one.
            rotation: [3, 3] from the camera at the last picture to the camera now.
            prior: [3, 3] map from directions to expected directions; the rotation if None.
        """
        before = len(self._ids)
        agreement = self._follow(image, rotation, rotation if prior is None else prior)
        tracked, inliers = len(agreement.inliers), len(self._ids)
        coverage = self._grid.coverage(self._pixels)
        self._keep(self._grid.uncrowded(self._pixels))
        new = self._replenish(image)
        self._image = image
        return Sighting(
            self._ids,
            self._normalised,
            tracked,
            before - tracked,
            new,
            inliers,
            agreement.model,
            agreement.disparity_px,
            coverage,
        )

    def _follow(self, image: Pixels, rotation: Array, prior: Array) -> Agreement:
        """Keep the points that are found again and agree; return the agreement of those found again."""
        if self._image is None or not len(self._ids):
            return Agreement(np.zeros(0, np.bool_), None, 0.0)
        there, found = self._tracker.track(self._image, image, self._pixels, self._expected(prior))
        after = undistort(self._calibration, there.astype(np.float64))
        found &= np.isfinite(after).all(axis=1)
        before, after = self._normalised[found], after[found]
        agreement = check(before, after, rotation, self.focal_px, self._threshold_px, planar=self.planar)
        self._pixels, self._normalised, self._ids = there[found], after, self._ids[found]
        self._keep(agreement.inliers)
        return agreement

    def _keep(self, mask: Mask) -> None:
        self._pixels, self._normalised, self._ids = self._pixels[mask], self._normalised[mask], self._ids[mask]

    def _expected(self, prior: Array) -> Points:
        guess = distort(self._calibration, rotated(prior, self._normalised))
        size = np.array([self._calibration.width, self._calibration.height])
        near = np.abs(guess - 0.5 * size) < size  # not so for NaN, a direction behind the camera
        return np.where(near.all(axis=1, keepdims=True), guess, self._pixels).astype(np.float32)

    def _replenish(self, image: Pixels) -> int:
        if len(self._ids) >= _ENOUGH * self._max_features:
            return 0
        pixels = self._grid.detect(image, self._pixels)
        normalised = undistort(self._calibration, pixels.astype(np.float64))
        good = np.isfinite(normalised).all(axis=1)
        pixels, normalised = pixels[good], normalised[good]
        self._pixels = np.concatenate([self._pixels, pixels])
        self._normalised = np.concatenate([self._normalised, normalised])
        self._ids = np.concatenate([self._ids, np.arange(self._next_id, self._next_id + len(pixels))])
        self._next_id += len(pixels)
        return len(pixels)


def common_points(earlier: Sighting, later: Sighting) -> tuple[Array, Array]:
    """Return the normalised coordinates [N, 2] of the common points in both sightings."""
    _, then, now = np.intersect1d(earlier.ids, later.ids, assume_unique=True, return_indices=True)
    return earlier.normalised[then], later.normalised[now]


class Keyframe:
    """A frame that later ones are compared with.

    Args:
        number: of the frame, in the estimator's window.
        camera_rotation: [3, 3] from the camera to the world.
    """

    def __init__(self, frame_id: uuid.UUID, number: int, t_ns: int, camera_rotation: Array, sighting: Sighting) -> None:
        self.frame_id, self.number, self.t_ns = frame_id, number, t_ns
        self._rotation = camera_rotation
        self._sighting = sighting

    def is_outdated(self, t_ns: int, camera_rotation: Array, sighting: Sighting, focal_px: float) -> bool:
        """Return whether a later frame, taken in motion, should become the next keyframe."""
        then, now = common_points(self._sighting, sighting)
        if len(then) < MIN_COMMON or t_ns - self.t_ns >= MAX_AGE_NS:
            return True
        expected = rotated(camera_rotation.T.dot(self._rotation), then)
        disparity_px = focal_px * np.hypot(*(expected - now).T)
        return not float(np.median(disparity_px)) <= MIN_DISPARITY_PX  # true for NaN: a turn by a right angle or more
