# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A generated texture: countryside out of random numbers, painted from the ground up.

First the land, divided into parcels of grass, soil and stubble, with roads and paths between them. Then objects with
shadows: stones, shrubs and trees, houses and cars.
"""

import math
from typing import Final

import numpy as np
import numpy.typing as npt

from viso.companion.world.canvas import PARCELS, SUN, TONE, Canvas, Mask, Material, Patch, power_of_two
from viso.companion.world.texture import Field, GroundTexture, fractal_noise, grit, to_pixels

Plan = npt.NDArray[np.int16]
Places = npt.NDArray[np.float64]

DEFAULT_SIZE_PX: Final = 2048
DEFAULT_METRES_PER_PIXEL: Final = 0.075
MIN_METRES_PER_PIXEL: Final = 0.01
MAX_METRES_PER_PIXEL: Final = 0.5
_BEND_M: Final = 3.5
_GRAIN: Final = np.array([15, 17, 15, 14, 6, 11, 0, 0, 0, 4], np.float32)  # by material, in grey levels
_ROAD, _PATH, _LINE = range(3)
_WAYS: Final = (Material.ASPHALT, Material.GRAVEL, Material.PAINT)


def generate_texture(
    seed: int = 0,
    *,
    size_px: int = DEFAULT_SIZE_PX,
    metres_per_pixel: float = DEFAULT_METRES_PER_PIXEL,
) -> GroundTexture:
    """Make a piece of countryside.

    Args:
        seed: the same one gives the same picture.
        size_px: rows and columns, from 64.
        metres_per_pixel: side of a pixel on the ground, 0.01 to 0.5.

    Raises:
        ValueError: if an argument is out of its range.
    """
    if size_px < 64:
        raise ValueError("size_px: below 64")
    if not MIN_METRES_PER_PIXEL <= metres_per_pixel <= MAX_METRES_PER_PIXEL:
        raise ValueError(f"metres_per_pixel: not from {MIN_METRES_PER_PIXEL} to {MAX_METRES_PER_PIXEL}")
    rng = np.random.default_rng([seed, size_px])
    leaves = fractal_noise(rng, size_px, coarsest_px=power_of_two(1.5 / metres_per_pixel), roughness=0.85)
    tone, material = np.empty((size_px, size_px), np.float32), np.empty((size_px, size_px), np.uint8)
    canvas = Canvas(tone, material, leaves, metres_per_pixel, rng)
    borders = lay_parcels(canvas)
    scatter_stones(canvas)
    plant(canvas, borders)
    build(canvas)
    return GroundTexture(to_pixels(canvas.tone), metres_per_pixel, grit(seed))


def lay_parcels(canvas: Canvas) -> npt.NDArray[np.intp]:
    """Paint the land, and return the places [n, 2] (column, row) where one thing ends and another begins."""
    plan, kinds = _planned(canvas)
    plan = _bent(canvas, plan)
    materials = np.array(kinds, np.uint8)
    tones = TONE[materials] + np.where(_tilled_or_grown(materials), canvas.rng.uniform(-14, 14, len(kinds)), 0)
    grain = fractal_noise(canvas.rng, canvas.size, coarsest_px=power_of_two(canvas.px(12)), roughness=0.9)
    for row, parcels in enumerate(plan):  # by rows, which takes no memory
        canvas.material[row] = materials[parcels]
        canvas.tone[row] = tones[parcels] + _GRAIN[canvas.material[row]] * grain[row]
    _plough(canvas, plan, materials)
    rows, columns = np.nonzero((plan[1:, 1:] != plan[:-1, 1:]) | (plan[1:, 1:] != plan[1:, :-1]))
    return np.stack([columns, rows], axis=1)


def _planned(canvas: Canvas) -> tuple[Plan, list[Material]]:
    """Cut the square into parcels, with ways along some of the cuts; return numbers and the material of each."""
    rng, size = canvas.rng, canvas.size
    plan = np.zeros((size, size), np.int16)
    kinds = list(_WAYS)
    ways: list[tuple[Patch, int]] = []
    land = [(0, 0, size, size)]
    while land:
        top, left, bottom, right = land.pop()
        length = max(bottom - top, right - left)
        if length < canvas.px(22) or (length < canvas.px(48) and rng.random() < 0.45):
            plan[top:bottom, left:right] = len(kinds)
            kinds.append(PARCELS[rng.integers(len(PARCELS))])
        elif bottom - top > right - left:
            cut = top + round(length * rng.uniform(0.35, 0.65))
            ways += [((over, along), kind) for over, along, kind in _ways(canvas, cut, left, right, length)]
            land += [(top, left, cut, right), (cut, left, bottom, right)]
        else:
            cut = left + round(length * rng.uniform(0.35, 0.65))
            ways += [((along, over), kind) for over, along, kind in _ways(canvas, cut, top, bottom, length)]
            land += [(top, left, bottom, cut), (top, cut, bottom, right)]
    for patch, kind in reversed(ways):  # the first cuts are the main roads, and go over the others
        plan[patch] = kind
    return plan, kinds


def _ways(canvas: Canvas, cut: int, start: int, end: int, length: int) -> list[tuple[slice, slice, int]]:
    """Return what is painted over and along a cut, the topmost first: a road with its line, a path, or nothing."""

    def over(width_m: float) -> slice:
        low = max(round(cut - canvas.px(width_m / 2)), 0)
        return slice(low, low + max(round(canvas.px(width_m)), 1))

    whole, chance = slice(start, end), canvas.rng.random()
    if length > canvas.px(60) and chance < 0.75:
        dash = max(round(canvas.px(2.0)), 1)
        line = [(over(0.16), slice(at, min(at + dash, end)), _LINE) for at in range(start, end, 3 * dash)]
        return [*line, (over(5.5), whole, _ROAD), (over(7.0), whole, _PATH)]
    if chance < 0.5:
        return [(over(canvas.rng.uniform(0.8, 2.6)), whole, _PATH)]
    return []


def _bent(canvas: Canvas, plan: Plan) -> Plan:
    """Bend straight cuts as land is bent."""
    coarsest_px, last = power_of_two(canvas.px(40)), canvas.size - 1
    up, aside = (fractal_noise(canvas.rng, canvas.size, coarsest_px=coarsest_px, roughness=0.33) for _ in range(2))
    reach, columns = canvas.px(_BEND_M), np.arange(canvas.size)
    bent = np.empty_like(plan)
    for row in range(canvas.size):
        rows_from = np.clip(row + np.rint(reach * up[row]).astype(np.intp), 0, last)
        bent[row] = plan[rows_from, np.clip(columns + np.rint(reach * aside[row]).astype(np.intp), 0, last)]
    return bent


def _plough(canvas: Canvas, plan: Plan, materials: npt.NDArray[np.uint8]) -> None:
    """Draw the furrows of fields and the mown stripes of meadows."""
    rng, count = canvas.rng, len(materials)
    tilled = (materials == Material.SOIL) | (materials == Material.STUBBLE)
    period = canvas.px(1.0) * np.where(tilled, rng.uniform(0.7, 1.6, count), rng.uniform(2.0, 4.0, count))
    angle = rng.uniform(0, math.pi, count)
    wave_x, wave_y = (2 * math.pi / period * np.array([np.cos(angle), np.sin(angle)])).astype(np.float32)
    depth = (np.where(tilled, 9, 4) * _tilled_or_grown(materials)).astype(np.float32)
    columns = np.arange(canvas.size, dtype=np.float32)
    for row, parcels in enumerate(plan):
        wave = wave_x[parcels] * columns + wave_y[parcels] * np.float32(row) + np.float32(0.6) * canvas.leaves[row]
        canvas.tone[row] += depth[parcels] * np.sin(wave)


def _tilled_or_grown(materials: npt.NDArray[np.uint8]) -> npt.NDArray[np.bool_]:
    return materials < len(PARCELS)


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
