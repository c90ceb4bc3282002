# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The geometric check: which tracked points agree with a rigid scene. It only removes outliers."""

import enum
from dataclasses import dataclass
from typing import Any, Final

import cv2
import numpy as np

from viso.companion.klt.grid import Mask
from viso.geometry.rotation import Array

_CONFIDENCE: Final = 0.999
_ITERATIONS: Final = 500
_FEWEST: Final = 8
PLANAR_SHARE: Final = 0.8
NO_PARALLAX_PX: Final = 1.0
_ROTATION_SLACK: Final = 3.0  # the gyro's prediction is not as good as a fitted model


class Model(enum.StrEnum):
    """The model that the inliers agree with."""

    ESSENTIAL = "E"
    HOMOGRAPHY = "H"
    ROTATION = "R"


@dataclass(frozen=True, slots=True, eq=False)
class Agreement:
    """The result of the check.

    Attributes:
        inliers: [N], whether each point agrees.
        model: the fitted model; None if none could be fitted.
        disparity_px: median movement in the picture beyond the rotation; 0 if unknown.
    """

    inliers: Mask
    model: Model | None
    disparity_px: float


def rotated(rotation: Array, normalised: Array) -> Array:
    """Return normalised coordinates [N, 2] after a rotation of the camera, ``x2 ~ R x1``; NaN for points behind it.

    Args:
        rotation: [3, 3] from the camera before to the camera after, or any other map of directions.
        normalised: [N, 2] before.
    """
    moved = normalised @ rotation[:, :2].T + rotation[:, 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        coordinates: Array = moved[:, :2] / np.where(moved[:, 2:] > 1e-6, moved[:, 2:], np.nan)
    return coordinates


def check(
    before: Array, after: Array, rotation: Array, focal_px: float, threshold_px: float, *, planar: bool
) -> Agreement:
    """Find the points that agree with a rigid scene.

    Args:
        before, after: normalised coordinates [N, 2].
        rotation: [3, 3] from the camera before to the camera after.
        focal_px: focal length of the working image.
        threshold_px: largest error of an inlier.
    """
    if len(before) < _FEWEST:
        return Agreement(np.zeros(len(before), np.bool_), None, 0.0)
    error_px = focal_px * np.hypot(*(rotated(rotation, before) - after).T)
    known_px = error_px[np.isfinite(error_px)]
    disparity_px = float(np.median(known_px)) if len(known_px) else 0.0
    if len(known_px) and disparity_px < NO_PARALLAX_PX:
        return Agreement(error_px < _ROTATION_SLACK * threshold_px, Model.ROTATION, disparity_px)
    # In pixels: OpenCV's homography is not found among numbers as small as normalised coordinates.
    return _fitted(focal_px * before, focal_px * after, focal_px, threshold_px, disparity_px, planar=planar)


def _fitted(
    before_px: Array, after_px: Array, focal_px: float, threshold_px: float, disparity_px: float, *, planar: bool
) -> Agreement:
    homography = _inliers(
        *cv2.findHomography(
            before_px, after_px, cv2.USAC_MAGSAC, threshold_px, maxIters=_ITERATIONS, confidence=_CONFIDENCE
        )
    )
    essential = None
    if homography is None or not planar:  # a known plane needs no second model
        camera = np.diag([focal_px, focal_px, 1.0])
        found: Any = cv2.findEssentialMat(
            before_px, after_px, camera, cv2.USAC_MAGSAC, _CONFIDENCE, threshold_px, maxIters=_ITERATIONS
        )
        essential = _inliers(*found)
    if essential is None and homography is None:
        return Agreement(np.zeros(len(before_px), np.bool_), None, disparity_px)
    kept = 0 if homography is None else np.count_nonzero(homography)
    if homography is not None and (essential is None or kept >= PLANAR_SHARE * np.count_nonzero(essential)):
        return Agreement(homography, Model.HOMOGRAPHY, disparity_px)
    assert essential is not None
    return Agreement(essential, Model.ESSENTIAL, disparity_px)


def _inliers(model: Any, mask: Any) -> Mask | None:
    if model is None or mask is None:
        return None
    inliers: Mask = mask.ravel().astype(np.bool_)
    return inliers if np.count_nonzero(inliers) >= _FEWEST else None
