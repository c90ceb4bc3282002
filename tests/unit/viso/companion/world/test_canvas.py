# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A canvas keeps to its bounds, and to its materials."""

import numpy as np
import pytest

from viso.companion.world.canvas import Canvas, Material, power_of_two


@pytest.fixture
def canvas() -> Canvas:
    shape = (40, 40)
    tone = np.full(shape, 100, np.float32)
    return Canvas(tone, np.zeros(shape, np.uint8), np.zeros(shape, np.float32), 0.5, np.random.default_rng(0))


def test_lengths_are_turned_into_pixels(canvas: Canvas) -> None:
    assert canvas.px(3.0) == 6.0


def test_places_are_one_for_so_much_land(canvas: Canvas) -> None:
    places = canvas.anywhere(each_m2=40)
    assert places.shape == (10, 2)
    assert ((places >= 0) & (places < 40)).all()


@pytest.mark.parametrize("place", [(20.0, 20.0), (0.0, 39.9), (-3.0, 20.0), (44.0, 41.0), (-30.0, 90.0)])
def test_patch_is_what_is_on_the_canvas(canvas: Canvas, place: tuple[float, float]) -> None:
    patch, x, y = canvas.patch(*place, 5.0)
    assert canvas.tone[patch].shape == (len(y), x.shape[1])
    rows, columns = np.nonzero(np.hypot(*np.meshgrid(np.arange(40) - place[0], np.arange(40) - place[1])) < 5)
    inside = np.hypot(x, y) < 5
    assert inside.sum() == len(rows)
    assert canvas.tone[patch][inside].size == len(columns)


def test_only_the_chosen_pixels_are_covered(canvas: Canvas) -> None:
    patch, x, y = canvas.patch(20.0, 20.0, 5.0)
    canvas.lay(patch, x * x + y * y < 9, np.full_like(x + y, 50), Material.LEAF)
    assert canvas.tone[20, 20] == 50
    assert canvas.tone[20, 24] == 100
    assert canvas.is_any(np.array([20.4, 20.4]), Material.LEAF)
    assert not canvas.is_any(np.array([24.0, 20.0]), Material.LEAF, Material.TILE)


def test_shade_darkens_and_keeps_the_material(canvas: Canvas) -> None:
    patch, x, y = canvas.patch(20.0, 20.0, 5.0)
    canvas.shade(patch, x + y < 100)
    assert canvas.tone[20, 20] == pytest.approx(38)
    assert canvas.tone[0, 0] == 100
    assert not canvas.material.any()


@pytest.mark.parametrize(("length", "power"), [(0.3, 2), (2.0, 2), (3.0, 4), (100.0, 128), (200.0, 256)])
def test_power_of_two_is_the_nearest(length: float, power: int) -> None:
    assert power_of_two(length) == power
