# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A rendered frame shows the ground where the calibration says, no finer than its pixels, and the same each time."""

import dataclasses
import importlib
import math
import sys
from functools import cache

import cv2
import numpy as np
import pytest

from viso.companion.vio.types import CameraCalibration, DistortionModel, Pixels
from viso.companion.vio.undistortion import distort
from viso.companion.world.flight import nadir_calibration
from viso.companion.world.ground import generate_texture
from viso.companion.world.renderer import PlaneRenderer
from viso.companion.world.texture import DEFAULT_NOISE_SIGMA, GroundTexture
from viso.geometry.pose import SE3
from viso.geometry.rotation import Array, so3_exp

CALIBRATION = nadir_calibration()
RADTAN = dataclasses.replace(
    CALIBRATION,
    distortion_model=DistortionModel.RADTAN,
    distortion=np.array([-0.28, 0.07, 2e-4, 2e-5]),
)
EQUIDISTANT = dataclasses.replace(
    CALIBRATION,
    distortion_model=DistortionModel.EQUIDISTANT,
    distortion=np.array([-0.02, 0.01, -0.003, 0.001]),
)
MIDDLING = np.full((8, 8), 128, np.uint8)  # detail that does nothing


def above(east: float, north: float, height: float, yaw_rad: float = 0.0, tilt: tuple[float, float] = (0, 0)) -> SE3:
    rotation = so3_exp(np.array([0, 0, yaw_rad])) @ so3_exp(np.array([*tilt, 0.0]))
    return SE3(rotation, np.array([east, north, height]))


def flat(tone: int = 128) -> GroundTexture:
    return GroundTexture(np.full((64, 64), tone, np.uint8), 1.0, MIDDLING)


@cache
def blob(east: float, north: float, height: float) -> GroundTexture:
    """Return dark ground with a bright blob, both as large as a camera at a height needs them."""
    metres, sigma = height / 800, height / 150
    x, y = metres * (np.arange(2000) - 999.5) - east, metres * (799.5 - np.arange(1600)) - north
    bright = 250 * np.outer(np.exp(-0.5 * (y / sigma) ** 2), np.exp(-0.5 * (x / sigma) ** 2))
    return GroundTexture(bright.astype(np.uint8), metres, MIDDLING)


def centroid(pixels: Pixels) -> Array:
    weight = np.clip(pixels.astype(np.float64) - 3, 0, None)
    rows, columns = np.indices(pixels.shape)
    middle: Array = np.array([(weight * columns).sum(), (weight * rows).sum()]) / weight.sum()
    return middle


def expected_pixel(calibration: CameraCalibration, world_T_body: SE3, point: Array) -> Array:
    seen = (world_T_body @ calibration.B_T_C).inverse().map(point)
    pixel: Array = distort(calibration, (seen[:2] / seen[2])[None])[0]
    return pixel


@pytest.fixture(scope="module")
def countryside() -> GroundTexture:
    return generate_texture(1, size_px=512)


@pytest.fixture(scope="module")
def camera(countryside: GroundTexture) -> PlaneRenderer:
    """Return a camera without noise."""
    return PlaneRenderer(countryside, CALIBRATION, noise_sigma=0.0)


@pytest.fixture(scope="module")
def noisy() -> PlaneRenderer:
    return PlaneRenderer(flat(), CALIBRATION, 3)


@pytest.mark.parametrize("calibration", [CALIBRATION, RADTAN, EQUIDISTANT], ids=["none", "radtan", "equidistant"])
@pytest.mark.parametrize(
    ("pose", "size"),
    [
        (above(2, 1, 20), (400, 300)),
        (above(0, 4, 60, yaw_rad=-1.0, tilt=(0.15, -0.1)), (400, 300)),
        pytest.param(above(6, -3, 40, yaw_rad=2.0), (640, 480), marks=pytest.mark.slow),
        pytest.param(above(-9, 4, 55, yaw_rad=0.7, tilt=(-0.2, 0.2)), (640, 480), marks=pytest.mark.slow),
        pytest.param(above(5, 5, 140, yaw_rad=3.0, tilt=(0.05, 0.05)), (640, 480), marks=pytest.mark.slow),
    ],
)
def test_point_of_the_plane_appears_where_the_calibration_says(
    calibration: CameraCalibration, pose: SE3, size: tuple[int, int]
) -> None:
    width, height = size
    cx, cy = 0.5 * (width - 1), 0.5 * (height - 1)
    calibration = dataclasses.replace(calibration, width=width, height=height, cx=cx, cy=cy)
    point = np.array([3.0, -2.0, 0.0])
    renderer = PlaneRenderer(blob(3.0, -2.0, pose.t[2]), calibration, noise_sigma=0.0)
    seen = centroid(renderer.render(pose, 0, 0).pixels)
    assert seen == pytest.approx(expected_pixel(calibration, pose, point), abs=0.05)


@pytest.mark.slow
def test_tracks_between_two_frames_follow_the_homography_of_the_plane(countryside: GroundTexture) -> None:
    renderer = PlaneRenderer(countryside, CALIBRATION)
    first, second = above(1, 2, 40), above(3.1, 0.6, 42, yaw_rad=0.06, tilt=(0.02, -0.03))
    before, after = renderer.render(first, 0, 0).pixels, renderer.render(second, 1, 0).pixels
    # The homography of a plane with unit normal n at a distance d: R + t n' / d (Hartley and Zisserman, 13.1).
    camera = first @ CALIBRATION.B_T_C
    moved = (second @ CALIBRATION.B_T_C).inverse() @ camera
    normal = camera.R.T @ [0, 0, -1]
    plane = moved.R + np.outer(moved.t, normal) / camera.t[2]
    homography = CALIBRATION.matrix() @ plane @ np.linalg.inv(CALIBRATION.matrix())
    back = cv2.warpPerspective(after, homography, (640, 480), flags=cv2.INTER_CUBIC | cv2.WARP_INVERSE_MAP)
    points = cv2.goodFeaturesToTrack(before[60:420, 60:580], 150, 0.02, 12) + 60
    tracked, found, _ = cv2.calcOpticalFlowPyrLK(before, back, points, points.copy())
    errors = (tracked - points)[found[:, 0] == 1][:, 0]
    assert len(errors) > 60
    assert np.median(np.linalg.norm(errors, axis=1)) < 0.05
    assert np.abs(np.median(errors, axis=0)).max() < 0.01


@pytest.mark.parametrize(
    "height_m", [45.0, *(pytest.param(one, marks=pytest.mark.slow) for one in (60.0, 100.0)), 130.0]
)
def test_what_is_finer_than_a_pixel_is_averaged(height_m: float) -> None:
    board = (255 * (np.indices((800, 800)).sum(axis=0) % 2)).astype(np.uint8)
    renderer = PlaneRenderer(GroundTexture(board, 0.04, MIDDLING), CALIBRATION, noise_sigma=0.0)
    pixels = renderer.render(above(0, 0, height_m, yaw_rad=0.3), 0, 0).pixels
    assert pixels.mean() == pytest.approx(127, abs=3)
    assert pixels.std() < 0.12 * board.std()


def test_what_is_coarser_than_a_pixel_keeps_its_contrast() -> None:
    board = (255 * ((np.indices((800, 800)) // 20).sum(axis=0) % 2)).astype(np.uint8)
    renderer = PlaneRenderer(GroundTexture(board, 0.04, MIDDLING), CALIBRATION, noise_sigma=0.0)
    assert renderer.render(above(0, 0, 60), 0, 0).pixels.std() > 0.8 * board.std()


@pytest.mark.parametrize("pose", [pytest.param(above(0.3, 0.2, 0.3), marks=pytest.mark.slow), above(0, 0, 40)])
def test_ground_goes_on_for_ever_mirrored(countryside: GroundTexture, camera: PlaneRenderer, pose: SE3) -> None:
    width, height = countryside.extent_m
    away = SE3(pose.R, pose.t + np.array([200 * width, -40 * height, 0]))  # beyond 16 bits of pixels
    here, there = (camera.render(at, 0, 0).pixels.astype(int) for at in (pose, away))
    assert np.quantile(np.abs(here - there), 0.99) <= 3


def test_ground_is_mirrored_at_the_edge(countryside: GroundTexture, camera: PlaneRenderer) -> None:
    edge = SE3(above(0, 0, 45, yaw_rad=0.5 * math.pi).R, np.array([0.5 * countryside.extent_m[0], -0.1, 45]))
    pixels = camera.render(edge, 0, 0).pixels.astype(int)
    assert np.quantile(np.abs(pixels - pixels[:, ::-1]), 0.99) <= 3


def test_detail_shows_from_the_height_of_a_landing_gear() -> None:
    ground = dataclasses.replace(generate_texture(size_px=64), pixels=flat().pixels, metres_per_pixel=0.075)
    renderer = PlaneRenderer(ground, CALIBRATION, noise_sigma=0.0)
    pixels = renderer.render(above(0, 0, 0.25), 0, 0).pixels
    assert len(cv2.goodFeaturesToTrack(pixels, 200, 0.01, 12)) == 200
    assert pixels.std() > 5


def test_detail_vanishes_in_the_height(countryside: GroundTexture, camera: PlaneRenderer) -> None:
    bare = PlaneRenderer(dataclasses.replace(countryside, detail=MIDDLING), CALIBRATION, noise_sigma=0.0)
    poses = [
        above(0, 0, height) for height in (20.0, 35.0, 38.0)
    ]  # at 38 m a pixel sees what one of the texture's does
    differences = [
        np.abs(camera.render(pose, 0, 0).pixels.astype(int) - bare.render(pose, 0, 0).pixels).mean() for pose in poses
    ]
    assert differences[0] > 1 > differences[1] > differences[2] == 0


def test_same_arguments_give_the_same_frame(countryside: GroundTexture) -> None:
    frames = [PlaneRenderer(countryside, CALIBRATION, 3).render(above(0, 0, 40), 7, 5_000_000) for _ in range(2)]
    assert np.array_equal(frames[0].pixels, frames[1].pixels)
    assert frames[0].frame_id == frames[1].frame_id


@pytest.mark.parametrize(("seed", "sequence"), [(3, 8), (4, 7)])
def test_noise_differs_from_frame_to_frame_and_seed_to_seed(noisy: PlaneRenderer, seed: int, sequence: int) -> None:
    frame = noisy.render(above(0, 0, 40), 7, 0)
    renderer = noisy if seed == 3 else PlaneRenderer(flat(), CALIBRATION, seed)
    other = renderer.render(above(0, 0, 40), sequence, 0)
    together = np.corrcoef(frame.pixels.ravel(), other.pixels.ravel())[0, 1]
    assert abs(together) < 0.02


@pytest.mark.parametrize("sigma", [DEFAULT_NOISE_SIGMA, 5.0])
def test_noise_has_its_deviation(noisy: PlaneRenderer, sigma: float) -> None:
    renderer = noisy if sigma == DEFAULT_NOISE_SIGMA else PlaneRenderer(flat(), CALIBRATION, noise_sigma=sigma)
    pixels = renderer.render(above(0, 0, 40), 0, 0).pixels
    assert pixels.std() == pytest.approx(sigma, rel=0.05)
    assert pixels.mean() == pytest.approx(128, abs=0.1)


def test_frame_says_what_it_is(noisy: PlaneRenderer) -> None:
    frame = noisy.render(above(0, 0, 40), 7, 5_000_000)
    assert (frame.sequence, frame.capture_timestamp, frame.camera_id) == (7, 5_000_000, "synthetic")
    assert frame.pixels.shape == (480, 640)


@pytest.mark.slow
def test_frame_ids_increase() -> None:
    renderer = PlaneRenderer(flat(), CALIBRATION)
    ids = [renderer.render(above(0, 0, 40), k, k * 300_000_000).frame_id for k in range(5)]
    assert ids == sorted(set(ids))


def test_covered_lens_shows_nothing_but_noise(noisy: PlaneRenderer) -> None:
    pixels = noisy.covered(0, 0).pixels
    assert pixels.shape == (480, 640)
    assert 0 < pixels.mean() < 2


@pytest.mark.parametrize(
    ("pose", "message"),
    [
        (above(0, 0, 40, tilt=(0.0, 1.2)), "the horizon is in the picture"),
        (above(0, 0, 40, tilt=(3.1, 0.0)), "the horizon is in the picture"),
        (above(0, 0, 0.04), "the camera is not above the ground"),
    ],
)
def test_view_of_more_than_ground_is_refused(noisy: PlaneRenderer, pose: SE3, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        noisy.render(pose, 0, 0)


@pytest.mark.slow
def test_lens_that_does_not_reach_the_corners_is_refused() -> None:
    folded = dataclasses.replace(RADTAN, distortion=np.array([-2.0, 0.0, 0.0, 0.0]))
    with pytest.raises(ValueError, match="the lens does not reach the corners"):
        PlaneRenderer(flat(), folded)


@pytest.mark.slow
def test_full_size_frames_are_possible(countryside: GroundTexture) -> None:
    renderer = PlaneRenderer(countryside, nadir_calibration(5472, 3648, 4500.0))
    assert renderer.render(above(0, 0, 40), 0, 0).pixels.shape == (3648, 5472)


def test_without_opencv_the_error_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "cv2", None)
    monkeypatch.delitem(sys.modules, "viso.companion.world.renderer")
    with pytest.raises(ModuleNotFoundError, match=r"pip install 'ardupilot-viso\[vio\]'"):
        importlib.import_module("viso.companion.world.renderer")
