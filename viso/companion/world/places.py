# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a flight may take place other than over flat ground: rolling hills, or a room."""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Protocol

import numpy as np

from viso.companion.vio.se3 import Array
from viso.companion.vio.types import CameraCalibration
from viso.companion.world.texture import GroundTexture

if TYPE_CHECKING:
    from viso.companion.world.renderer import Renderer

_WAVES_M: Final = (90.0, 140.0)  # lengths of the hills, from and to
_WAVES: Final = 4


class Place(Protocol):
    """What a camera sees, and how high the ground is."""

    def renderer(
        self, texture: GroundTexture, calibration: CameraCalibration, seed: int, noise_sigma: float
    ) -> "Renderer":
        """Return what makes pictures of it; needs OpenCV."""

    def ground_m(self, east_m: Array, north_m: Array) -> Array:
        """Return how high the ground is, z of the world in m, at places of any shape."""


@dataclass(frozen=True, slots=True)
class Hills:
    """Ground that rolls up and down about z = 0, by at most ``height_m``."""

    height_m: float = 8.0
    seed: int = 0

    def renderer(
        self, texture: GroundTexture, calibration: CameraCalibration, seed: int, noise_sigma: float
    ) -> "Renderer":
        from viso.companion.world.scenery import HillsRenderer

        return HillsRenderer(self.ground_m, texture, calibration, seed, noise_sigma)

    def ground_m(self, east_m: Array, north_m: Array) -> Array:
        rng = np.random.default_rng([self.seed, 10])
        lengths, courses = rng.uniform(*_WAVES_M, _WAVES), rng.uniform(0, math.pi, _WAVES)
        phases = rng.uniform(0, 2 * math.pi, _WAVES)
        up = np.zeros_like(east_m)
        for length, course, phase in zip(lengths, courses, phases, strict=True):
            turn = 2 * math.pi / length
            up = up + np.sin(turn * math.cos(course) * east_m + turn * math.sin(course) * north_m + phase)
        return self.height_m * np.tanh(up / math.sqrt(_WAVES))


@dataclass(frozen=True, slots=True)
class Room:
    """A room about the origin, its floor at z = 0; walls, floor and ceiling bear the texture, a sixth as large.

    Its size is that to the east, to the north, and up.
    """

    size_m: tuple[float, float, float] = (8.0, 6.0, 3.5)

    def renderer(
        self, texture: GroundTexture, calibration: CameraCalibration, seed: int, noise_sigma: float
    ) -> "Renderer":
        from viso.companion.world.scenery import RoomRenderer

        return RoomRenderer(self.size_m, texture, calibration, seed, noise_sigma)

    def ground_m(self, east_m: Array, north_m: Array) -> Array:
        return np.zeros_like(east_m)
