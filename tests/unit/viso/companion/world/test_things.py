# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Things stand on the land, and their shadows lie beside them."""

from collections.abc import Callable

import cv2
import numpy as np
import pytest

from viso.companion.world.canvas import Canvas, Material
from viso.companion.world.ground import build, plant, scatter_stones

NO_BORDERS = np.zeros((0, 2), np.intp)


def lawn(seed: int = 0, material: Material = Material.GRASS) -> Canvas:
    shape = (400, 400)
    return Canvas(
        np.full(shape, 100, np.float32),
        np.full(shape, material, np.uint8),
        np.zeros(shape, np.float32),
        0.1,
        np.random.default_rng(seed),
    )


def put_up_trees(canvas: Canvas) -> None:
    plant(canvas, NO_BORDERS)


@pytest.mark.parametrize("put_up", [scatter_stones, put_up_trees, build])
def test_things_cover_a_part_of_the_land_and_shade_another(put_up: Callable[[Canvas], None]) -> None:
    canvas = lawn()
    put_up(canvas)
    covered, lawn_left = canvas.material != Material.GRASS, canvas.material == Material.GRASS
    assert 0.005 < covered.mean() < 0.6
    shaded = lawn_left & (canvas.tone < 50)
    assert 0.002 < shaded.mean() < 0.5


def test_shadows_fall_to_the_south_east() -> None:
    canvas = lawn(1)
    scatter_stones(canvas)
    shadows = np.argwhere((canvas.material == Material.GRASS) & (canvas.tone < 50))
    near_one = [shadows[np.abs(shadows - stone).max(axis=1) < 6] - stone for stone in _middles(canvas)]
    offset = np.concatenate(near_one).mean(axis=0)
    assert (offset > 0.5).all()


def _middles(canvas: Canvas) -> list[np.ndarray]:
    stones = (canvas.material == Material.GRAVEL).astype(np.uint8)
    _, _, _, middles = cv2.connectedComponentsWithStats(stones)
    return [middle[::-1] for middle in middles[1:]]


def test_trees_follow_borders() -> None:
    canvas = lawn()
    border = np.stack([np.arange(400), np.full(400, 200)], axis=1)
    plant(canvas, border)
    leaves = canvas.material == Material.LEAF
    assert leaves[180:220].mean() > 2 * leaves[:100].mean()


def test_cars_are_parked_on_roads_only() -> None:
    grass, road = lawn(), lawn(material=Material.ASPHALT)
    build(grass)
    build(road)
    assert not (grass.material == Material.PAINT).any()
    assert (road.material == Material.PAINT).any()


def test_houses_are_not_built_on_roads() -> None:
    road = lawn(material=Material.ASPHALT)
    build(road)
    assert not np.isin(road.material, (Material.TILE, Material.SLATE)).any()
