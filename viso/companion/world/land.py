# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Land divided into parcels of grass, soil and stubble, with roads and paths between them."""

import math
from typing import Final

import numpy as np
import numpy.typing as npt

from viso.companion.world.canvas import PARCELS, TONE, Canvas, Material, Patch, power_of_two
from viso.companion.world.texture import fractal_noise

Plan = npt.NDArray[np.int16]

_BEND_M: Final = 3.5
_GRAIN: Final = np.array([15, 17, 15, 14, 6, 11, 0, 0, 0, 4], np.float32)  # by material, in grey levels
_ROAD, _PATH, _LINE = range(3)
_WAYS: Final = (Material.ASPHALT, Material.GRAVEL, Material.PAINT)


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
