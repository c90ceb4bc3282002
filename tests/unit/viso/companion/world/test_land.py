# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Land is divided into parcels, with ways between them."""

from typing import Any

import numpy as np
import pytest

from viso.companion.world.canvas import PARCELS, Canvas, Material
from viso.companion.world.ground import lay_parcels


def bare(seed: int = 0, size: int = 600, metres_per_pixel: float = 0.2) -> Canvas:
    shape = (size, size)
    tone, material = np.full(shape, np.nan, np.float32), np.full(shape, 255, np.uint8)
    return Canvas(tone, material, np.zeros(shape, np.float32), metres_per_pixel, np.random.default_rng(seed))


@pytest.fixture(scope="module")
def laid() -> tuple[Canvas, Any]:
    """Return land with its parcels, and the places of their borders."""
    canvas = bare()
    return canvas, lay_parcels(canvas)


@pytest.fixture(scope="module")
def canvas(laid: tuple[Canvas, Any]) -> Canvas:
    return laid[0]


def test_nothing_is_left_bare(canvas: Canvas) -> None:
    assert np.isfinite(canvas.tone).all()
    assert canvas.material.max() <= max(Material)


def test_most_of_the_land_is_tilled_or_grown(canvas: Canvas) -> None:
    assert 0.6 < np.isin(canvas.material, PARCELS).mean() < 0.98


@pytest.mark.parametrize("material", [Material.ASPHALT, Material.GRAVEL, Material.PAINT])
def test_roads_have_a_line_and_a_verge(canvas: Canvas, material: Material) -> None:
    assert (canvas.material == material).any()


def test_borders_are_where_one_thing_meets_another(laid: tuple[Canvas, Any]) -> None:
    canvas, places = laid
    columns, rows = places.T
    material = canvas.material
    below, aside = material[rows + 1, columns + 1], material[rows + 1, columns]
    assert ((below != aside) | (below != material[rows, columns + 1])).mean() > 0.5  # some parcels are of one material


def test_small_piece_of_land_is_one_parcel_without_borders() -> None:
    assert len(lay_parcels(bare(size=64, metres_per_pixel=0.1))) == 0


@pytest.mark.slow
def test_same_chance_gives_the_same_land() -> None:
    first, second = bare(4), bare(4)
    lay_parcels(first)
    lay_parcels(second)
    assert np.array_equal(first.tone, second.tone)
