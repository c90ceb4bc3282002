# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The ground from above: a picture with a scale, repeated without end by mirroring."""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from viso.companion.vio.types import Pixels
from viso.geometry.rotation import Array

Field = npt.NDArray[np.float32]

DEFAULT_NOISE_SIGMA: Final = 2.0  # of a pixel, in grey levels
DETAIL_SCALES: Final = (1 / 8, 1 / 64)  # of the side of a detail's pixel to one of the texture's
_DETAIL_SIZE: Final = 1024
_DETAIL_SIGMA: Final = 20.0


@dataclass(frozen=True, slots=True, eq=False)
class GroundTexture:
    """The ground as seen from straight above, north at the top, its middle at the world's origin.

    Attributes:
        pixels: uint8, [H, W] grey.
        metres_per_pixel: side of a pixel on the ground.
        detail: uint8 [D, D] grey, 128 on average: what the picture is too coarse for, in the scales of
            ``DETAIL_SCALES``; so there is something to see from the height of a landing gear, too.
    """

    pixels: Pixels
    metres_per_pixel: float
    detail: Pixels

    def __post_init__(self) -> None:
        if not (math.isfinite(self.metres_per_pixel) and self.metres_per_pixel > 0):
            raise ValueError("metres_per_pixel: not a positive length")

    @property
    def extent_m(self) -> tuple[float, float]:
        """The extent of the picture to the east and to the north before it is mirrored."""
        height, width = self.pixels.shape[:2]
        return width * self.metres_per_pixel, height * self.metres_per_pixel


def pixel_from_ground(shape: tuple[int, ...], extent_m: tuple[float, float]) -> Array:
    """Return the matrix [3, 3] from (east, north, 1) in m to (column, row, 1) of a picture of the ground.

    Args:
        shape: of the picture, rows and columns first; the middle of its first pixel is (0, 0).
        extent_m: what it shows, to the east and to the north, about the origin.
    """
    rows, columns = shape[:2]
    east, north = extent_m
    return np.array(
        [[columns / east, 0, 0.5 * (columns - 1)], [0, -rows / north, 0.5 * (rows - 1)], [0, 0, 1]], dtype=np.float64
    )


def grit(seed: int) -> Pixels:
    """Return the detail of a texture: pebbles and blades, darker and lighter than the mean."""
    rng = np.random.default_rng([seed, _DETAIL_SIZE])
    field = fractal_noise(rng, _DETAIL_SIZE, coarsest_px=8, roughness=0.7)
    field = np.tanh(field)  # edges rather than hills
    field -= field.mean()
    return to_pixels(128 + _DETAIL_SIGMA / float(field.std()) * field)


def fractal_noise(rng: np.random.Generator, size: int, *, coarsest_px: int, roughness: float = 0.6) -> Field:
    """Return noise of all scales up to a coarsest one, [size, size], of mean about 0 and deviation 1.

    Args:
        coarsest_px: size of the largest structures; a power of two.
        roughness: amplitude of each scale as a share of that of the next coarser one.
    """
    octaves = max(coarsest_px.bit_length() - 1, 1)
    cells = -(-size // 2**octaves) + 2  # doubling takes 2, which have no neighbour
    field = rng.standard_normal((cells, cells), dtype=np.float32)
    for octave in range(1, octaves + 1):
        cells = -(-size // 2 ** (octaves - octave)) + 2
        field = _doubled(field)[:cells, :cells]
        field += np.float32(roughness**octave) * rng.standard_normal(field.shape, dtype=np.float32)
    field = field[:size, :size]
    return np.ascontiguousarray(field / field.std())


def _doubled(field: Field) -> Field:
    """Return a field of twice the size less two, interpolated linearly."""
    for _ in range(2):  # once along each axis
        near = np.float32(0.75) * field
        far = np.float32(0.25) * field
        doubled = np.empty((2 * field.shape[0] - 2, field.shape[1]), np.float32)
        doubled[0::2] = near[:-1] + far[1:]
        doubled[1::2] = far[:-1] + near[1:]
        field = doubled.T
    return field


def to_pixels(tone: Field) -> Pixels:
    """Return grey levels rounded and kept within 0 to 255."""
    return np.clip(np.rint(tone), 0, 255).astype(np.uint8)
