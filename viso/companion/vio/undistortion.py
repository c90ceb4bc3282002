# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Conversion between pixels and viewing directions.

The models are OpenCV's: radial-tangential (Brown 1966) with k1 k2 p1 p2 [k3], and the fisheye's equidistant one
(Kannala and Brandt, A generic camera model, 2006) with k1 k2 k3 k4. Normalised coordinates are x/z and y/z in the
camera's frame.
"""

from typing import Final

import numpy as np

from viso.companion.vio.types import CameraCalibration, DistortionModel
from viso.geometry.rotation import Array

_MAX_ITERATIONS: Final = 20
# Newton's method squares the error: a last step of this length leaves one below 1e-9.
_LAST_STEP: Final = 3e-6


def distort(calibration: CameraCalibration, normalised: Array) -> Array:
    """Return the pixels [N, 2] that normalised coordinates [N, 2] are seen at."""
    x, y = normalised[:, 0], normalised[:, 1]
    if calibration.distortion_model is DistortionModel.RADTAN:
        x, y = _radtan(calibration.distortion, x, y)
    elif calibration.distortion_model is DistortionModel.EQUIDISTANT:
        radius = np.hypot(x, y)
        theta = np.arctan(radius)
        scale = np.ones_like(radius)
        np.divide(_equidistant(calibration.distortion, theta), radius, out=scale, where=radius > 0)
        x, y = scale * x, scale * y
    return np.stack([calibration.fx * x + calibration.cx, calibration.fy * y + calibration.cy], axis=1)


def undistort(calibration: CameraCalibration, pixels: Array) -> Array:
    """Return the normalised coordinates [N, 2] of pixels [N, 2], to 1e-9.

    A pixel that the lens model does not reach (outside the picture, as a rule) gives NaN.
    """
    x = (pixels[:, 0] - calibration.cx) / calibration.fx
    y = (pixels[:, 1] - calibration.cy) / calibration.fy
    if calibration.distortion_model is DistortionModel.RADTAN:
        x, y = _undistort_radtan(calibration.distortion, x, y)
    elif calibration.distortion_model is DistortionModel.EQUIDISTANT:
        x, y = _undistort_equidistant(calibration.distortion, x, y)
    return np.stack([x, y], axis=1)


def _radtan(distortion: Array, x: Array, y: Array) -> tuple[Array, Array]:
    k1, k2, p1, p2, k3 = _five(distortion)
    square = x * x + y * y
    factor = 1 + square * (k1 + square * (k2 + square * k3)) + 2 * (p2 * x + p1 * y)
    return factor * x + p2 * square, factor * y + p1 * square


def _undistort_radtan(distortion: Array, x_seen: Array, y_seen: Array) -> tuple[Array, Array]:
    k1, k2, p1, p2, k3 = _five(distortion)
    x, y = x_seen, y_seen
    good = np.zeros(x.shape, dtype=bool)
    with np.errstate(all="ignore"):  # diverging values become NaN below
        for _ in range(_MAX_ITERATIONS):
            # As in _radtan, but what the Jacobian has in common with it is computed once.
            xx, yy = x * x, y * y
            square = xx + yy
            factor = 1 + square * (k1 + square * (k2 + square * k3)) + 2 * (p2 * x + p1 * y)
            x_off, y_off = factor * x + p2 * square - x_seen, factor * y + p1 * square - y_seen
            slope = 2 * k1 + square * (4 * k2 + square * (6 * k3))
            # The Jacobian [[a, b], [b, d]] is symmetric.
            a, d = factor + slope * xx + 4 * p2 * x, factor + slope * yy + 4 * p1 * y
            b = slope * x * y + 2 * (p1 * x + p2 * y)
            determinant = a * d - b * b
            x_step, y_step = (d * x_off - b * y_off) / determinant, (a * y_off - b * x_off) / determinant
            x, y = x - x_step, y - y_step
            # Where the picture folds back on itself, the determinant is negative.
            good = (np.abs(x_step) + np.abs(y_step) < _LAST_STEP) & (determinant > 0) & (a > 0)
            if good.all():
                break
    return np.where(good, x, np.nan), np.where(good, y, np.nan)


def _five(distortion: Array) -> tuple[float, float, float, float, float]:
    k1, k2, p1, p2, *k3 = distortion.tolist()
    return k1, k2, p1, p2, k3[0] if k3 else 0.0


def _equidistant(distortion: Array, theta: Array) -> Array:
    k1, k2, k3, k4 = distortion.tolist()
    square = theta * theta
    distorted: Array = theta * (1 + square * (k1 + square * (k2 + square * (k3 + square * k4))))
    return distorted


def _undistort_equidistant(distortion: Array, x_seen: Array, y_seen: Array) -> tuple[Array, Array]:
    k1, k2, k3, k4 = distortion.tolist()
    distorted = np.hypot(x_seen, y_seen)
    theta, good = distorted, np.zeros(distorted.shape, dtype=bool)
    with np.errstate(all="ignore"):
        for _ in range(_MAX_ITERATIONS):
            square = theta * theta
            slope = 1 + square * (3 * k1 + square * (5 * k2 + square * (7 * k3 + square * (9 * k4))))
            step = (distorted - _equidistant(distortion, theta)) / slope
            theta = theta + step
            good = (np.abs(step) < _LAST_STEP) & (slope > 0) & (theta >= 0) & (theta < 0.5 * np.pi)
            if good.all():
                break
        scale = np.where(distorted > 0, np.tan(theta) / np.where(distorted > 0, distorted, 1.0), 1.0)
    scale = np.where(good, scale, np.nan)
    return scale * x_seen, scale * y_seen
