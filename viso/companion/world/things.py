# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects with shadows: stones, shrubs and trees, houses and cars."""

import math

import numpy as np
import numpy.typing as npt

from viso.companion.world.canvas import PARCELS, SUN, TONE, Canvas, Mask, Material, Patch
from viso.companion.world.texture import Field

Places = npt.NDArray[np.float64]


def scatter_stones(canvas: Canvas) -> None:
    """Put stones everywhere, lit from the north-west."""
    for column, row in canvas.anywhere(each_m2=14):
        radius = canvas.px(canvas.rng.uniform(0.1, 0.45))
        patch, x, y = canvas.patch(column, row, 3 * radius)
        squeeze, lean = canvas.rng.uniform(0.6, 1.0), canvas.rng.uniform(-0.5, 0.5)
        canvas.shade(patch, (x - SUN[0] * radius) ** 2 + (y - SUN[1] * radius) ** 2 < radius**2)
        stone = (x + lean * y) ** 2 + (y / squeeze) ** 2 < radius**2
        tone = np.float32(canvas.rng.uniform(120, 215)) - np.float32(25 / radius) * (x + y)
        canvas.lay(patch, stone, tone, Material.GRAVEL)


def plant(canvas: Canvas, borders: npt.NDArray[np.intp]) -> None:
    """Plant shrubs and trees, along borders [n, 2] more than elsewhere: first all shadows, then all crowns."""
    rng = canvas.rng
    places = canvas.anywhere(each_m2=90)
    if len(borders):
        hedges = borders[rng.integers(len(borders), size=2 * len(places))]
        places = np.concatenate([hedges + rng.normal(0, canvas.px(0.8), hedges.shape), places])
    radii = canvas.px(1.0) * np.minimum(rng.lognormal(-0.1, 0.65, len(places)), 4.5)
    shades = rng.uniform(0.75, 1.25, len(places)).astype(np.float32)
    heights = 1.4 * radii[:, None] * SUN
    for (column, row), radius in zip(places + heights, radii.tolist(), strict=True):
        patch, x, y = canvas.patch(column, row, 1.4 * radius)
        gaps = canvas.leaves[patch] < -1.3
        canvas.shade(patch, _crown(canvas, patch, x, y, radius) & ~gaps)
    for (column, row), radius, shade in zip(places, radii.tolist(), shades, strict=True):
        patch, x, y = canvas.patch(column, row, 1.4 * radius)
        tone = shade * TONE[Material.LEAF] + np.float32(30) * canvas.leaves[patch] - np.float32(16 / radius) * (x + y)
        canvas.lay(patch, _crown(canvas, patch, x, y, radius), tone, Material.LEAF)


def _crown(canvas: Canvas, patch: Patch, x: Field, y: Field, radius: float) -> Mask:
    """Return where leaves are: a disc with a ragged edge."""
    ragged: Mask = x * x + y * y < (radius * (1 + np.float32(0.22) * canvas.leaves[patch])) ** 2
    return ragged


def build(canvas: Canvas) -> None:
    """Put up houses on parcels, and park cars on roads and paths."""
    for place in canvas.anywhere(each_m2=1000):
        if canvas.is_any(place, *PARCELS):
            half = canvas.px(1.0) * canvas.rng.uniform((3.5, 2.5), (7.0, 4.5))
            roof = Material.TILE if canvas.rng.random() < 0.6 else Material.SLATE
            _box(canvas, place, half, canvas.px(3.5), roof, canvas.rng.uniform(-15, 25))
    for place in canvas.anywhere(each_m2=120):
        if canvas.is_any(place, Material.ASPHALT, Material.GRAVEL):
            half = canvas.px(1.0) * np.array([2.1, 0.9])
            _box(canvas, place, half, canvas.px(0.9), Material.PAINT, canvas.rng.choice([-150, -110, -20, 25]))


def _box(canvas: Canvas, place: Places, half: Places, height: float, material: Material, tone: float) -> None:
    """Draw a box with a gabled roof, and its shadow; sizes are in pixels, the tone is added to the material's."""
    angle = canvas.rng.uniform(0, math.pi)
    cos, sin = np.float32(math.cos(angle)), np.float32(math.sin(angle))
    patch, x, y = canvas.patch(place[0], place[1], float(np.hypot(*half)) + 1.5 * height)

    def seen(x: Field, y: Field) -> tuple[Mask, Field, Field]:
        along, across = cos * x + sin * y, cos * y - sin * x
        return (np.abs(along) < half[0]) & (np.abs(across) < half[1]), along, across

    shadow, _, _ = seen(x, y)
    for level in np.linspace(0, height, math.ceil(2 * height / half[1]) + 1)[1:].astype(np.float32):
        shadow |= seen(x - level * np.float32(SUN[0]), y - level * np.float32(SUN[1]))[0]
    canvas.shade(patch, shadow)
    roof, along, across = seen(x, y)
    lit = np.float32(18) * np.sign(across) * np.sign(sin - cos)
    rows = np.float32(5) * np.sign(np.sin(along * np.float32(2 * math.pi / canvas.px(0.9))))
    ridge = np.float32(30) * (np.abs(across) < 0.06 * half[1])
    canvas.lay(patch, roof, np.float32(TONE[material] + tone) + lit + rows + ridge, material)
