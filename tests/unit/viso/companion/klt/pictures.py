# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures for tests of the front end: textures, and views of them."""

from typing import Any, cast

import cv2
import numpy as np

from viso.companion.vio.types import CameraCalibration, DistortionModel, Pixels
from viso.geometry.pose import SE3
from viso.geometry.rotation import Array

WIDTH, HEIGHT, FOCAL = 320, 240, 250.0


def calibration(**changed: Any) -> CameraCalibration:
    fields: dict[str, Any] = {
        "camera_id": "cam",
        "unit": "7",
        "width": WIDTH,
        "height": HEIGHT,
        "fx": FOCAL,
        "fy": FOCAL,
        "cx": 0.5 * (WIDTH - 1),
        "cy": 0.5 * (HEIGHT - 1),
        "distortion_model": DistortionModel.NONE,
        "distortion": np.empty(0),
        "B_T_C": SE3.identity(),
    }
    return CameraCalibration(**(fields | changed))


def texture(seed: int = 0, width: int = WIDTH, height: int = HEIGHT, blur_px: float = 2.0) -> Pixels:
    """Return random blobs, dark and bright, a few pixels wide."""
    noise = np.random.default_rng(seed).normal(0, 1, (height, width)).astype(np.float32)
    smooth = cv2.GaussianBlur(noise, (0, 0), blur_px)
    scaled = 128 + 45 * smooth / smooth.std()
    return cast(Pixels, np.clip(scaled, 0, 255).astype(np.uint8))


def noise(seed: int = 0, sigma: float = 3.0, level: float = 12.0) -> Pixels:
    """Return what a camera in the dark sees."""
    grey = np.random.default_rng(seed).normal(level, sigma, (HEIGHT, WIDTH))
    return cast(Pixels, np.clip(grey, 0, 255).astype(np.uint8))


def moved(image: Pixels, homography: Array, size: tuple[int, int] | None = None) -> Pixels:
    """Return a picture whose pixels have gone where a map [3, 3] of pixels says; mirrored where nothing came from."""
    size = size or (image.shape[1], image.shape[0])
    return cast(
        Pixels, cv2.warpPerspective(image, homography, size, flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT)
    )


def zoomed_out(image: Pixels, factor: float) -> Pixels:
    """Return the picture of usual size whose middle is that of a larger one, shrunk by a factor."""
    x, y = 0.5 * (WIDTH - 1) - 0.5 * factor * image.shape[1], 0.5 * (HEIGHT - 1) - 0.5 * factor * image.shape[0]
    return moved(image, np.array([[factor, 0.0, x], [0.0, factor, y], [0.0, 0.0, 1.0]]), (WIDTH, HEIGHT))


def shifted(image: Pixels, dx_px: float, dy_px: float) -> Pixels:
    return moved(image, np.array([[1.0, 0.0, dx_px], [0.0, 1.0, dy_px], [0.0, 0.0, 1.0]]))


def turned(image: Pixels, rotation: Array) -> Pixels:
    """Return a picture after the camera has turned: ``x2 ~ R x1``."""
    matrix = calibration().matrix()
    return moved(image, matrix @ rotation @ np.linalg.inv(matrix))
