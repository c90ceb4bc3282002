# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A generated texture: countryside out of random numbers, painted from the ground up."""

from typing import Final

import numpy as np

from viso.companion.world.canvas import Canvas, power_of_two
from viso.companion.world.land import lay_parcels
from viso.companion.world.texture import GroundTexture, fractal_noise, grit, to_pixels
from viso.companion.world.things import build, plant, scatter_stones

DEFAULT_SIZE_PX: Final = 2048
DEFAULT_METRES_PER_PIXEL: Final = 0.075
MIN_METRES_PER_PIXEL: Final = 0.01
MAX_METRES_PER_PIXEL: Final = 0.5


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
