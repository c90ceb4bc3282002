# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Generated countryside is the same for the same seed, and gives a tracker something to hold on to."""

from functools import cache

import cv2
import numpy as np
import pytest

from viso.companion.world.ground import generate_texture
from viso.companion.world.texture import GroundTexture


@cache
def small(seed: int) -> GroundTexture:
    return generate_texture(seed, size_px=512, metres_per_pixel=0.1)


@pytest.mark.slow
def test_same_seed_gives_the_same_ground() -> None:
    assert np.array_equal(small(3).pixels, small.__wrapped__(3).pixels)


@pytest.mark.slow
def test_another_seed_gives_another_ground() -> None:
    assert np.abs(small(3).pixels.astype(int) - small(4).pixels).mean() > 10


SEEDS = pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(1, 4))])


@SEEDS
def test_corners_are_everywhere(seed: int) -> None:
    corners = cv2.goodFeaturesToTrack(small(seed).pixels, 1000, 0.01, 8)
    cells = {(int(x) // 64, int(y) // 64) for x, y in corners[:, 0]}
    assert len(cells) >= 60  # of 64


@SEEDS
def test_ground_is_neither_flat_nor_noise(seed: int) -> None:
    pixels = small(seed).pixels
    blocks = pixels.reshape(32, 16, 32, 16).mean(axis=(1, 3))
    assert 15 < blocks.std() < pixels.std() < 60


def test_few_pixels_are_saturated() -> None:
    pixels = small(0).pixels
    assert ((pixels == 0) | (pixels == 255)).mean() < 0.02


@pytest.mark.parametrize(("size_px", "metres_per_pixel"), [(64, 0.01), (100, 0.02), (96, 0.5)])
def test_land_may_be_small_or_coarse(size_px: int, metres_per_pixel: float) -> None:
    assert generate_texture(size_px=size_px, metres_per_pixel=metres_per_pixel).pixels.shape == (size_px, size_px)


@pytest.mark.parametrize(("size_px", "metres_per_pixel"), [(63, 0.1), (256, 0.0), (256, 0.6), (256, float("nan"))])
def test_arguments_out_of_range_are_refused(size_px: int, metres_per_pixel: float) -> None:
    with pytest.raises(ValueError, match=r"size_px|metres_per_pixel"):
        generate_texture(size_px=size_px, metres_per_pixel=metres_per_pixel)
