# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenery other than flat ground, and the camera's pictures of it: hills, a room."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, cast

import cv2
import numpy as np
import numpy.typing as npt

from viso.companion.vio.types import CameraCalibration, Pixels
from viso.companion.world.renderer import Pyramid, Renderer, as_bytes, directions
from viso.companion.world.texture import GroundTexture
from viso.geometry.pose import SE3
from viso.geometry.rotation import Array

_STEP_PX: Final = 4  # hills bend little from one pixel to the next: rays are met only so often
_MEETINGS: Final = 12  # iterations until a ray has met a slope
_ROOM_SCALE: Final = 1 / 6
_WAVES_M: Final = (90.0, 140.0)  # lengths of the hills, from and to
_WAVES: Final = 4
_NO_MAP: Final = np.empty(0)

Rays = npt.NDArray[np.float64]


class HillsRenderer(Renderer):
    """A camera above hills, whose height ``ground_m`` tells by east and north; the texture is as seen from above."""

    def __init__(
        self,
        ground_m: Callable[[Array, Array], Array],
        texture: GroundTexture,
        calibration: CameraCalibration,
        seed: int,
        noise_sigma: float,
    ) -> None:
        super().__init__(calibration, seed, noise_sigma)
        self._ground_m = ground_m
        self._ground = Pyramid(texture.pixels, texture.extent_m)
        self._rays = _rays(calibration)[::_STEP_PX, ::_STEP_PX]
        if (calibration.width - 1) % _STEP_PX or (calibration.height - 1) % _STEP_PX:  # the last pixels lie between
            self._rays = _extended(self._rays)

    def _view(self, world_T_camera: SE3) -> Pixels:
        rays, camera = self._rays @ world_T_camera.R.T, world_T_camera.t
        if rays[..., 2].max() >= 0:
            raise ValueError("world_T_body: the horizon is in the picture")
        up = np.zeros(rays.shape[:2])
        for _ in range(_MEETINGS):
            distance = (up - camera[2]) / rays[..., 2]
            east, north = camera[0] + distance * rays[..., 0], camera[1] + distance * rays[..., 1]
            up = self._ground_m(east, north)
        picture = self._ground.seen_at(float(np.median(distance)) / self.calibration.fx)
        to_picture = picture.from_ground
        at = np.stack(
            [to_picture[axis, axis] * place + to_picture[axis, 2] for axis, place in enumerate((east, north))]
        )
        rows, columns = picture.pixels.shape[:2]
        turns = np.floor(at.mean(axis=(1, 2)) / (2 * columns, 2 * rows)) * (2 * columns, 2 * rows)
        coarse = np.moveaxis(at - turns[:, None, None], 0, -1).astype(np.float32)
        size = (self.calibration.width, self.calibration.height)
        grow = np.array([[1 / _STEP_PX, 0, 0], [0, 1 / _STEP_PX, 0]])
        fine = np.dstack([_grown(coarse[..., axis], grow, size) for axis in range(2)])
        return as_bytes(cv2.remap(picture.pixels, fine, _NO_MAP, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT))


class RoomRenderer(Renderer):
    """A camera in a room; walls, floor and ceiling show another part of the texture each."""

    def __init__(
        self,
        size_m: tuple[float, float, float],
        texture: GroundTexture,
        calibration: CameraCalibration,
        seed: int,
        noise_sigma: float,
    ) -> None:
        super().__init__(calibration, seed, noise_sigma)
        east, north, up = size_m
        self._low = np.array([-east / 2, -north / 2, 0.0], np.float32)
        self._high = np.array([east / 2, north / 2, up], np.float32)
        extent = texture.extent_m
        self._paper = Pyramid(texture.pixels, (_ROOM_SCALE * extent[0], _ROOM_SCALE * extent[1]))
        self._rays = _rays(calibration).astype(np.float32)

    def _view(self, world_T_camera: SE3) -> Pixels:
        camera = world_T_camera.t.astype(np.float32)
        rays = (self._rays.reshape(-1, 3) @ world_T_camera.R.T.astype(np.float32)).reshape(self._rays.shape)
        if (camera <= self._low).any() or (camera >= self._high).any():
            raise ValueError("world_T_body: the camera is not in the room")
        with np.errstate(divide="ignore"):
            distance = np.where(rays > 0, self._high - camera, self._low - camera) / rays
        axis = np.where(rays == 0, np.inf, distance).argmin(axis=-1)
        nearest = np.take_along_axis(distance, axis[..., None], axis=-1)
        points = camera + nearest * rays
        face = 2 * axis + (np.take_along_axis(rays, axis[..., None], axis=-1)[..., 0] > 0)
        picture = self._paper.seen_at(float(np.median(nearest)) / self.calibration.fx)
        to_picture = picture.from_ground
        rows, columns = picture.pixels.shape[:2]
        across = np.where(axis == 0, points[..., 1], points[..., 0])
        along = np.where(axis == 2, points[..., 1], points[..., 2])
        at = np.empty((*face.shape, 2), np.float32)
        at[..., 0] = to_picture[0, 0] * across + (0.13 + 0.31 * face) % 1 * columns
        at[..., 1] = to_picture[1, 1] * along + (0.29 + 0.47 * face) % 1 * rows
        return as_bytes(cv2.remap(picture.pixels, at, _NO_MAP, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT))


@dataclass(frozen=True, slots=True)
class Hills:
    """Ground that rolls up and down about z = 0, by at most ``height_m``."""

    height_m: float = 8.0
    seed: int = 0

    def renderer(
        self, texture: GroundTexture, calibration: CameraCalibration, seed: int, noise_sigma: float
    ) -> Renderer:
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
    ) -> Renderer:
        return RoomRenderer(self.size_m, texture, calibration, seed, noise_sigma)

    def ground_m(self, east_m: Array, north_m: Array) -> Array:
        return np.zeros_like(east_m)


def _rays(calibration: CameraCalibration) -> Rays:
    """Return the directions [H, W, 3], z = 1, that the pixels look in."""
    flat = directions(calibration).astype(np.float64)
    return np.concatenate([flat, np.ones_like(flat[..., :1])], axis=-1)


def _extended(rays: Rays) -> Rays:
    """Return rays with one more row and column, by the last two."""
    rays = np.concatenate([rays, 2 * rays[-1:] - rays[-2:-1]])
    return np.concatenate([rays, 2 * rays[:, -1:] - rays[:, -2:-1]], axis=1)


def _grown(coarse: npt.NDArray[np.float32], matrix: Array, size: tuple[int, int]) -> npt.NDArray[np.float32]:
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    grown = cv2.warpAffine(coarse, matrix, size, flags=flags, borderMode=cv2.BORDER_REPLICATE)
    return cast(npt.NDArray[np.float32], grown)
