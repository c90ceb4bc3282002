# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The canvas of a landscape: a tone (the brightness) and a material for each pixel."""

import enum
import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from viso.companion.vio.types import Pixels
from viso.companion.world.texture import Field

Patch = tuple[slice, slice]
Mask = npt.NDArray[np.bool_]

SUN: Final = (0.75, 0.66)  # columns and rows that the shadow of 1 pixel of height falls
_SHADOW: Final = np.float32(0.38)


class Material(enum.IntEnum):
    """The material of the ground; the first four are vegetation or fields."""

    GRASS = 0
    MEADOW = 1
    SOIL = 2
    STUBBLE = 3
    ASPHALT = 4
    GRAVEL = 5
    LEAF = 6
    TILE = 7
    SLATE = 8
    PAINT = 9


PARCELS: Final = (Material.GRASS, Material.MEADOW, Material.SOIL, Material.STUBBLE)
TONE: Final = np.array([104, 122, 112, 146, 138, 168, 92, 112, 84, 205], np.float32)


@dataclass(slots=True)
class Canvas:
    """A square piece of land in the making.

    Attributes:
        tone: [N, N] in grey levels.
        material: [N, N], numbers of :class:`Material`.
        leaves: [N, N], noise of mean 0 and deviation 1 for whatever is ragged.
        metres_per_pixel: side of a pixel on the ground.
    """

    tone: Field
    material: Pixels
    leaves: Field
    metres_per_pixel: float
    rng: np.random.Generator

    @property
    def size(self) -> int:
        """Rows, and columns."""
        return len(self.tone)

    def px(self, metres: float) -> float:
        """Return a length in pixels."""
        return metres / self.metres_per_pixel

    def anywhere(self, each_m2: float) -> npt.NDArray[np.float64]:
        """Return random places [n, 2], column and row, one for so much land."""
        count = round((self.size * self.metres_per_pixel) ** 2 / each_m2)
        return self.rng.uniform(0, self.size, (count, 2))

    def is_any(self, place: npt.NDArray[np.float64], *materials: Material) -> bool:
        """Return whether a place, column and row, is of one of some materials."""
        return int(self.material[int(place[1]), int(place[0])]) in materials

    def patch(self, column: float, row: float, reach: float) -> tuple[Patch, Field, Field]:
        """Return the part of the canvas about a place, and the columns and rows from there to its pixels."""
        left, top = max(int(column - reach), 0), max(int(row - reach), 0)
        right, bottom = max(int(column + reach) + 2, left), max(int(row + reach) + 2, top)
        right, bottom = min(right, self.size), min(bottom, self.size)
        x = np.arange(left, right, dtype=np.float32)[None, :] - np.float32(column)
        y = np.arange(top, bottom, dtype=np.float32)[:, None] - np.float32(row)
        return (slice(top, bottom), slice(left, right)), x, y

    def lay(self, patch: Patch, where: Mask, tone: Field, material: Material) -> None:
        """Cover a part of a patch."""
        np.copyto(self.tone[patch], tone, where=where)
        np.copyto(self.material[patch], np.uint8(material), where=where)

    def shade(self, patch: Patch, where: Mask) -> None:
        """Darken a part of a patch."""
        self.tone[patch][where] *= _SHADOW


def power_of_two(pixels: float) -> int:
    """Return the power of two, from 2, that is nearest to a length in pixels."""
    return 1 << max(round(math.log2(pixels)), 1)
