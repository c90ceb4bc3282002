# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A picture of the ground has a scale, an origin, and detail below its pixels."""

import numpy as np
import pytest

from viso.companion.world.texture import GroundTexture, fractal_noise, grit, pixel_from_ground

NO_DETAIL = np.full((8, 8), 128, np.uint8)


def noise(seed: int = 0, size: int = 200) -> np.ndarray:
    return fractal_noise(np.random.default_rng(seed), size, coarsest_px=32)


def test_noise_is_the_same_for_the_same_seed() -> None:
    assert np.array_equal(noise(1), noise(1))
    assert not np.array_equal(noise(1), noise(2))


def test_noise_has_the_size_asked_for_and_deviation_1() -> None:
    assert noise(size=201).shape == (201, 201)
    assert noise().std() == pytest.approx(1.0, abs=1e-5)


@pytest.mark.parametrize("block", [2, 4, 8, 16])
def test_noise_has_structure_at_every_scale(block: int) -> None:
    field = fractal_noise(np.random.default_rng(0), 512, coarsest_px=32, roughness=1.0)
    means = field.reshape(512 // block, block, 512 // block, block).mean(axis=(1, 3))
    finer = field - means.repeat(block, axis=0).repeat(block, axis=1)
    assert min(means.std(), finer.std()) > 0.2  # of white noise, the means would have 1 / block


def test_noise_has_no_structure_above_the_coarsest_scale() -> None:
    field = noise(size=512)
    assert field.reshape(2, 256, 2, 256).mean(axis=(1, 3)).std() < 0.25


def test_detail_neither_darkens_nor_brightens() -> None:
    detail = grit(3)
    assert detail.mean() == pytest.approx(128, abs=0.5)
    assert 10 < detail.std() < 30


def test_first_pixel_shows_the_north_west_corner() -> None:
    corner = pixel_from_ground((20, 30), (60.0, 40.0)) @ [-30, 20, 1]
    assert corner == pytest.approx([-0.5, -0.5, 1])


def test_middle_of_the_picture_is_the_origin() -> None:
    assert pixel_from_ground((20, 30), (60.0, 40.0)) @ [0, 0, 1] == pytest.approx([14.5, 9.5, 1])


def test_extent_is_that_of_the_pixels() -> None:
    assert GroundTexture(np.zeros((20, 30), np.uint8), 0.5, NO_DETAIL).extent_m == (15.0, 10.0)


@pytest.mark.parametrize("scale", [0.0, -1.0, float("nan"), float("inf")])
def test_scale_is_a_length(scale: float) -> None:
    with pytest.raises(ValueError, match="metres_per_pixel"):
        GroundTexture(np.zeros((20, 30), np.uint8), scale, NO_DETAIL)
