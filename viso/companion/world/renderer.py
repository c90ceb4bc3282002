# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The camera's picture of a plane: the ground texture through the lens, at the pixels' resolution, with noise.

Needs OpenCV: ``pip install 'ardupilot-viso[vio]'``.
"""

import abc
import math
from dataclasses import dataclass
from typing import Any, Final, cast

import numpy as np
import numpy.typing as npt

from viso.companion.vio.types import CameraCalibration, DistortionModel, NavCameraFrame, Pixels, frame_uuid
from viso.companion.vio.undistortion import undistort
from viso.companion.world.texture import DEFAULT_NOISE_SIGMA, DETAIL_SCALES, GroundTexture, pixel_from_ground
from viso.extras import pip_install
from viso.geometry.pose import SE3
from viso.geometry.rotation import Array

try:
    import cv2
except ModuleNotFoundError as error:
    raise ModuleNotFoundError(f"the renderer needs OpenCV: {pip_install('vio')}", name="cv2") from error

_LEVELS_PER_OCTAVE: Final = 2
_DETAIL_OCTAVES: Final = 3  # from where detail begins to fade to where it is gone, as pixels see more and more ground
_NOISE_BLOCK: Final = 1 << 19
_STRIP_ROWS: Final = 512
_LOWEST_VIEW: Final = 0.05  # cosine to the vertical of the flattest ray; a flatter one sees the horizon
_NO_MAP: Final = np.empty(0)  # OpenCV's second map, when the first has both coordinates
_NS_PER_MS: Final = 1_000_000


class Renderer(abc.ABC):
    """A camera with its noise, in grey levels; the same arguments give the same frame."""

    def __init__(self, calibration: CameraCalibration, seed: int = 0, noise_sigma: float = DEFAULT_NOISE_SIGMA) -> None:
        self.calibration = calibration
        self._seed = seed
        # As long as two blocks: wherever a block's noise begins, there is enough of it.
        noise = np.random.default_rng([seed, 4]).standard_normal(2 * _NOISE_BLOCK, dtype=np.float32)
        self._noise = np.rint(noise_sigma * noise).astype(np.int16)

    def render(self, world_T_body: SE3, sequence: int, time_ns: int) -> NavCameraFrame:
        """Return the frame of a place amid the exposure. Raises ValueError where there is nothing to see."""
        return self._frame(self._view(world_T_body @ self.calibration.B_T_C), sequence, time_ns)

    def covered(self, sequence: int, time_ns: int) -> NavCameraFrame:
        """Return the frame of a covered lens: black, but for the noise."""
        shape = (self.calibration.height, self.calibration.width)
        return self._frame(np.zeros(shape, np.uint8), sequence, time_ns)

    @abc.abstractmethod
    def _view(self, world_T_camera: SE3) -> Pixels:
        """Return the picture from a pose, without noise."""

    def _frame(self, pixels: Pixels, sequence: int, time_ns: int) -> NavCameraFrame:
        rng = np.random.default_rng([self._seed, 5, sequence])
        self._add_noise(pixels, rng)
        frame_id = frame_uuid(time_ns // _NS_PER_MS, sequence, int(rng.integers(1 << 62)))
        return NavCameraFrame(frame_id, sequence, time_ns, pixels, self.calibration.camera_id)

    def _add_noise(self, pixels: Pixels, rng: np.random.Generator) -> None:
        flat = pixels.reshape(-1)
        for start in range(0, flat.size, _NOISE_BLOCK):
            block = flat[start : start + _NOISE_BLOCK]
            at = int(rng.integers(self._noise.size - block.size + 1))
            cv2.add(block, self._noise[at : at + block.size], dst=block, dtype=cv2.CV_8U)


class PlaneRenderer(Renderer):
    """A camera above a plane at z = 0 of the world.

    Raises ValueError if the lens model does not reach the corners of the picture.
    """

    def __init__(
        self,
        texture: GroundTexture,
        calibration: CameraCalibration,
        seed: int = 0,
        noise_sigma: float = DEFAULT_NOISE_SIGMA,
    ) -> None:
        super().__init__(calibration, seed, noise_sigma)
        self._ground = Pyramid(texture.pixels, texture.extent_m)
        rows, columns = texture.detail.shape
        sides_m = [scale * texture.metres_per_pixel for scale in DETAIL_SCALES]
        self._details = [(side, Pyramid(texture.detail, (columns * side, rows * side))) for side in sides_m]
        self._lens = None if calibration.distortion_model is DistortionModel.NONE else directions(calibration)
        corners = [(u, v) for u in (0, calibration.width - 1) for v in (0, calibration.height - 1)]
        rays = np.column_stack([undistort(calibration, np.array(corners, np.float64)), np.ones(4)])
        if not np.isfinite(rays).all():
            raise ValueError("distortion: the lens does not reach the corners of the picture")
        self._corners = (rays / np.linalg.norm(rays, axis=1, keepdims=True)).T

    def _view(self, world_T_camera: SE3) -> Pixels:
        to_ground = _ground_from_normalised(world_T_camera)
        calibration = self.calibration
        if (to_ground[2] @ self._corners).min() < _LOWEST_VIEW:
            raise ValueError("world_T_body: the horizon is in the picture")
        # How much ground a unit of the picture's area shows, at its principal point.
        area = abs(float(np.linalg.det(to_ground))) / float(to_ground[2, 2]) ** 3
        pixel_m = math.sqrt(area / (calibration.fx * calibration.fy))
        pixels = self._through_lens(self._ground.seen_at(pixel_m), to_ground)
        for side_m, detail in self._details:
            weight = 1 - math.log2(max(pixel_m / side_m, 1.0)) / _DETAIL_OCTAVES
            if weight > 0:
                _overlay(pixels, self._through_lens(detail.seen_at(pixel_m), to_ground), weight)
        return pixels

    def _through_lens(self, picture: "Picture", to_ground: Array) -> Pixels:
        rows, columns = picture.pixels.shape[:2]
        to_picture = picture.from_ground @ to_ground
        middle = to_picture[:2, 2] / to_picture[2, 2]
        # The same place of another mirrored copy, for OpenCV counts the pixels of a source in 16 bits.
        away = np.floor(middle / (2 * columns, 2 * rows)) * (2 * columns, 2 * rows)
        to_picture = np.array([[1, 0, -away[0]], [0, 1, -away[1]], [0, 0, 1]]) @ to_picture
        if self._lens is not None:
            at = cv2.perspectiveTransform(self._lens, to_picture)
            return as_bytes(cv2.remap(picture.pixels, at, _NO_MAP, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT))
        matrix = to_picture @ np.linalg.inv(self.calibration.matrix())
        size = (self.calibration.width, self.calibration.height)
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        return as_bytes(cv2.warpPerspective(picture.pixels, matrix, size, flags=flags, borderMode=cv2.BORDER_REFLECT))


@dataclass(frozen=True, slots=True, eq=False)
class Picture:
    pixels: Pixels
    from_ground: Array


class Pyramid:
    """A picture of the ground in as many sizes as are asked for, each the mean over areas of the finest."""

    def __init__(self, pixels: Pixels, extent_m: tuple[float, float]) -> None:
        self._extent_m = extent_m
        self._levels = {0: Picture(pixels, pixel_from_ground(pixels.shape, extent_m))}

    def seen_at(self, pixel_m: float) -> Picture:
        """Return the picture whose pixels are as large as a camera's or a little larger: sampling it does not alias."""
        finest = self._levels[0]
        rows, columns = finest.pixels.shape[:2]
        steps = math.ceil(_LEVELS_PER_OCTAVE * math.log2(pixel_m * columns / self._extent_m[0]))
        level = min(max(steps, 0), _LEVELS_PER_OCTAVE * int(math.log2(min(rows, columns))))
        if level not in self._levels:
            shrink = 2 ** (level / _LEVELS_PER_OCTAVE)
            size = (max(round(columns / shrink), 1), max(round(rows / shrink), 1))
            pixels = as_bytes(cv2.resize(finest.pixels, size, interpolation=cv2.INTER_AREA))
            self._levels[level] = Picture(pixels, pixel_from_ground(pixels.shape, self._extent_m))
        return self._levels[level]


def _ground_from_normalised(world_T_camera: SE3) -> Array:
    """Return the matrix from (x/z, y/z, 1) in a camera to where the ray meets the ground, (east, north, 1) w.

    Its third row gives w as the cosine to the vertical, down, if the ray's length is 1. Raises ValueError if the camera
    is not above the ground.
    """
    east, north, up = world_T_camera.t.tolist()
    if up <= 0:
        raise ValueError("world_T_body: the camera is not above the ground")
    meet: Array = np.array([[up, 0, -east], [0, up, -north], [0, 0, -1]]) @ world_T_camera.R
    return meet


def directions(calibration: CameraCalibration) -> npt.NDArray[np.float32]:
    """Return the normalised coordinates [H, W, 2] that each pixel looks at."""
    directions = np.empty((calibration.height, calibration.width, 2), np.float32)
    across = np.arange(calibration.width)
    for row in range(calibration.height):
        pixels = np.stack([across, np.full_like(across, row)], axis=1).astype(np.float64)
        directions[row] = undistort(calibration, pixels)
    return directions


def _overlay(pixels: Pixels, detail: Pixels, weight: float) -> None:
    """Add what is lighter than the mean in a picture, and take off what is darker."""
    for row in range(0, len(pixels), _STRIP_ROWS):  # in strips, which takes no memory
        part, fine = pixels[row : row + _STRIP_ROWS], detail[row : row + _STRIP_ROWS]
        cv2.addWeighted(part, 1.0, fine, weight, -128.0 * weight, dst=part)


def as_bytes(picture: npt.NDArray[Any]) -> Pixels:
    """Tell the type checker what OpenCV's stubs do not: bytes in, bytes out."""
    return cast(Pixels, picture)
