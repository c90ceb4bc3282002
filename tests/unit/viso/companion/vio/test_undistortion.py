# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Lens models, against OpenCV's."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from viso.companion.vio.types import CameraCalibration
from viso.companion.vio.undistortion import distort, undistort
from viso.geometry.pose import SE3
from viso.geometry.rotation import Array

EUROC = [-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05]
WITH_K3 = [-0.3, 0.12, -0.002, 0.003, -0.02]
FISHEYE = [-0.013, 0.021, -0.0055, 0.0012]


def camera(model: str, coefficients: list[float]) -> CameraCalibration:
    lens = 458.654, 457.296, 367.215, 248.375
    return CameraCalibration("cam0", "0", 752, 480, *lens, model, np.array(coefficients), SE3.identity())  # type: ignore[arg-type]  # a name will do


CAMERAS = [camera("none", []), camera("radtan", EUROC), camera("radtan", WITH_K3), camera("equidistant", FISHEYE)]
NAMES = ["none", "radtan", "radtan with k3", "equidistant"]


def picture() -> Array:
    """Return pixels all over the picture, its corners and the principal point included."""
    columns, rows = np.meshgrid(np.linspace(-0.5, 751.5, 20), np.linspace(-0.5, 479.5, 15))
    return np.concatenate([np.stack([columns.ravel(), rows.ravel()], axis=1), [[367.215, 248.375]]])


def normalised(calibration: CameraCalibration, pixels: Array) -> Array:
    linear = (pixels - [calibration.cx, calibration.cy]) / [calibration.fx, calibration.fy]
    return np.asarray(linear, dtype=np.float64)


@pytest.mark.parametrize("calibration", CAMERAS, ids=NAMES)
def test_pixels_come_back(calibration: CameraCalibration) -> None:
    assert np.allclose(distort(calibration, undistort(calibration, picture())), picture(), atol=1e-7)


@pytest.mark.parametrize("calibration", CAMERAS, ids=NAMES)
@given(x=st.floats(-0.7, 0.7), y=st.floats(-0.5, 0.5))
def test_directions_come_back_to_1e_9(calibration: CameraCalibration, x: float, y: float) -> None:
    assert np.allclose(undistort(calibration, distort(calibration, np.array([[x, y]]))), [[x, y]], atol=1e-9)


def test_no_distortion_is_the_matrix_alone() -> None:
    assert np.allclose(distort(CAMERAS[0], np.array([[0.1, -0.2]])), [[367.215 + 45.8654, 248.375 - 91.4592]])
    assert np.allclose(undistort(CAMERAS[0], picture()), normalised(CAMERAS[0], picture()))


@pytest.mark.parametrize("calibration", CAMERAS[1:3], ids=NAMES[1:3])
def test_radtan_is_opencv_s(calibration: CameraCalibration) -> None:
    cv2 = pytest.importorskip("cv2")
    directions = undistort(calibration, picture())
    points = np.concatenate([directions, np.ones((len(directions), 1))], axis=1)
    theirs, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), calibration.matrix(), calibration.distortion)
    assert np.allclose(distort(calibration, directions), theirs[:, 0], atol=1e-8)
    exact = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 200, 1e-12)
    back = cv2.undistortPointsIter(picture()[:, None], calibration.matrix(), calibration.distortion, None, None, exact)
    assert np.allclose(directions, back[:, 0], atol=1e-9)


def test_equidistant_is_opencv_s_fisheye() -> None:
    cv2 = pytest.importorskip("cv2")
    calibration = CAMERAS[3]
    directions = undistort(calibration, picture())
    theirs = cv2.fisheye.distortPoints(directions[:, None], calibration.matrix(), calibration.distortion)
    assert np.allclose(distort(calibration, directions), theirs[:, 0], atol=1e-8)
    exact = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 200, 1e-12)
    matrix, coefficients = calibration.matrix(), calibration.distortion
    back = cv2.fisheye.undistortPoints(picture()[:, None], matrix, coefficients, criteria=exact)
    assert np.allclose(directions, back[:, 0], atol=1e-9)


@pytest.mark.parametrize("calibration", CAMERAS, ids=NAMES)
def test_principal_point_looks_straight_ahead(calibration: CameraCalibration) -> None:
    assert undistort(calibration, np.array([[367.215, 248.375]])).tolist() == [[0, 0]]
    assert distort(calibration, np.zeros((1, 2))).tolist() == [[367.215, 248.375]]


@pytest.mark.parametrize("calibration", CAMERAS, ids=NAMES)
def test_no_points_are_no_points(calibration: CameraCalibration) -> None:
    assert undistort(calibration, np.empty((0, 2))).shape == (0, 2)
    assert distort(calibration, np.empty((0, 2))).shape == (0, 2)


@pytest.mark.parametrize("calibration", CAMERAS[2:], ids=NAMES[2:])
def test_pixel_that_the_lens_does_not_reach_is_nan_and_spoils_no_other(calibration: CameraCalibration) -> None:
    directions = undistort(calibration, np.array([[5000.0, 4000.0], [400.0, 300.0]]))
    assert np.isnan(directions[0]).all()
    assert np.allclose(distort(calibration, directions[1:]), [[400, 300]])


def test_direction_beyond_the_fold_is_not_taken_for_the_one_before_it() -> None:
    barrel = camera("radtan", [-0.3, 0, 0, 0])
    # The picture of the x axis ends where the derivative 1 - 0.9 x^2 vanishes.
    last = 1 / np.sqrt(0.9)
    before = distort(barrel, np.array([[0.9 * last, 0]]))
    assert np.allclose(undistort(barrel, before), [[0.9 * last, 0]], atol=1e-9)
    assert np.isnan(undistort(barrel, distort(barrel, np.array([[last, 0]])) + np.array([1.0, 0]))).all()


def test_fisheye_sees_almost_a_half_space() -> None:
    wide = camera("equidistant", [0.0] * 4)
    direction = np.array([[np.tan(1.5), 0]])
    assert distort(wide, direction)[0, 0] == pytest.approx(367.215 + 1.5 * 458.654)
    assert np.allclose(undistort(wide, distort(wide, direction)), direction)
    assert np.isnan(undistort(wide, np.array([[367.215 + 1.6 * 458.654, 248.375]]))).all()
