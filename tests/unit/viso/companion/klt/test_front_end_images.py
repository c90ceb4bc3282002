# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Working images: their size, where things are in them, and whose memory they are."""

import numpy as np
import pytest

from tests.unit.viso.companion.klt.pictures import calibration, texture
from viso.companion.klt.front_end import WorkingImages, shrink_factor
from viso.companion.vio.calibration import scaled
from viso.companion.vio.types import Pixels
from viso.geometry.rotation import Array


@pytest.mark.parametrize(
    ("width", "working_px", "factor"),
    [(5472, 1400, 4), (640, 1400, 1), (1400, 1400, 1), (1401, 1400, 2), (2800, 1400, 2), (2801, 1400, 3)],
)
def test_factor_is_the_smallest_that_brings_the_width_down(width: int, working_px: int, factor: int) -> None:
    assert shrink_factor(width, working_px) == factor


def test_grey_of_equal_channels_is_the_channel() -> None:
    grey = texture()
    assert (WorkingImages(1).make(np.repeat(grey[:, :, None], 3, axis=2)) == grey).all()


def test_colours_are_blue_first() -> None:
    pixels = np.zeros((4, 4, 3), np.uint8)
    pixels[:, :, 2] = 200
    red = WorkingImages(1).make(pixels)[0, 0]
    pixels = pixels[:, :, ::-1].copy()
    blue = WorkingImages(1).make(pixels)[0, 0]
    assert red > 2 * blue > 0


def test_pixel_is_the_mean_of_its_block() -> None:
    pixels = np.array([[10, 20, 0, 0], [30, 40, 0, 100]], np.uint8)
    assert WorkingImages(2).make(pixels).tolist() == [[25, 25]]


def test_rows_and_columns_that_fill_no_block_are_cut_off() -> None:
    pixels = np.zeros((7, 9), np.uint8)
    pixels[6:], pixels[:, 8:] = 255, 255
    small = WorkingImages(2).make(pixels)
    assert small.shape == (3, 4)
    assert not small.any()


def centroid(image: Pixels) -> Array:
    rows, columns = np.indices(image.shape)
    weight = image.astype(np.float64)
    centre: Array = np.array([(columns * weight).sum(), (rows * weight).sum()]) / weight.sum()
    return centre


@pytest.mark.parametrize("divisor", [1, 2, 3, 4])
def test_calibration_of_the_working_image_says_where_things_are(divisor: int) -> None:
    full = calibration(width=240, height=120)
    at_px = np.array([101.3, 47.8])
    rows, columns = np.indices((full.height, full.width))
    pixels = 250 * np.exp(-((columns - at_px[0]) ** 2 + (rows - at_px[1]) ** 2) / (2 * 6.0**2))
    small = WorkingImages(divisor).make(np.rint(pixels).astype(np.uint8))
    direction = np.linalg.solve(full.matrix(), [*at_px, 1.0])
    expected = (scaled(full, divisor).matrix() @ direction)[:2]
    assert centroid(small) == pytest.approx(expected, abs=0.02)


@pytest.mark.parametrize("shape", [(24, 32), (24, 32, 3)])
@pytest.mark.parametrize("divisor", [1, 2])
@pytest.mark.parametrize("clahe", [False, True])
def test_memory_is_never_that_of_the_picture(shape: tuple[int, ...], divisor: int, clahe: bool) -> None:
    pixels = np.full(shape, 100, np.uint8)
    small = WorkingImages(divisor, clahe=clahe).make(pixels)
    before = small.copy()
    pixels[:] = 0
    assert not np.shares_memory(small, pixels)
    assert (small == before).all()


@pytest.mark.parametrize("divisor", [1, 2])
def test_picture_that_cannot_be_written_to_is_fine(divisor: int) -> None:
    pixels = texture()
    pixels.flags.writeable = False
    assert WorkingImages(divisor).make(pixels).shape == (pixels.shape[0] // divisor, pixels.shape[1] // divisor)


def test_contrast_is_equalised_on_request() -> None:
    faint = (120 + texture() // 16).astype(np.uint8)
    assert WorkingImages(1, clahe=True).make(faint).std() > 1.5 * faint.std()
    assert (WorkingImages(1).make(faint) == faint).all()
