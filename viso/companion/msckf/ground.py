# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Knowledge of the ground below: its height, and whether it is a plane that fills the picture."""

import math
from typing import Final

import numpy as np

from viso.companion.klt.outliers import Model
from viso.companion.msckf.multi_state import Plane
from viso.companion.msckf.window_filter import POS, WindowFilter, sigma_of
from viso.companion.vio.config import AglSource, Scene, VioConfig
from viso.geometry.pose import SE3
from viso.geometry.rotation import Array

ROUGHNESS_SHARE: Final = 0.005  # of the height: how far each point is off a plane, independently of the others
MIN_PLANE_HEIGHT_M: Final = 0.5
SCALE_KNOWN: Final = 0.05  # share of the distance that may be uncertain
_NEAR_M: Final = 3.0
ROUGH_SHARE: Final = 0.01  # of the height: ground with more relief is no plane
UNKNOWN_SHARE: Final = 0.02  # relief, before anything is known about it
_TOGETHER: Final = 4.0  # root of the number of points that relief moves together, as a slope does
_RELIEF_KEPT: Final = 0.6
_KEPT: Final = 0.9
_DOUBTED_SIGMAS: Final = 3.0
_MOSTLY: Final = 0.8  # share of frames


class Ground:
    """The ground in a filter's world, from the configuration and the pictures.

    Args:
        origin_z_m: of the filter's world, in the world of the configuration.

    Attributes:
        z_m: of the plane, in the filter's world.
        is_rough: whether a configured plane is not confirmed as a plane, or is refuted.
    """

    def __init__(self, config: VioConfig, origin_z_m: float) -> None:
        self.z_m = self._local_z_m = config.ground_z_m - origin_z_m
        self._scene = config.scene
        self._has_height = config.agl_source is not AglSource.NONE
        self._planar_share = 0.0
        self._relief_share = UNKNOWN_SHARE  # of the height
        self.is_rough = config.scene is Scene.PLANAR and self._has_height

    def note(self, model: Model | None) -> None:
        """Note the model that the points in a frame agreed with."""
        self._planar_share += (1 - _KEPT) * ((model is Model.HOMOGRAPHY) - self._planar_share)

    def note_relief(self, share: float | None) -> None:
        """Note the height differences of a frame's points as a share of the distance; None if unknown."""
        if share is None:
            return
        # Relief counts at once, because a filter that assumes a plane tilts until the ground fits one.
        mean = _RELIEF_KEPT * self._relief_share + (1 - _RELIEF_KEPT) * share
        self._relief_share = max(share, mean) if share > ROUGH_SHARE else mean
        self.is_rough = self._relief_share > ROUGH_SHARE

    def take_height(self, state: WindowFilter, height_m: float, sigma_m: float) -> None:
        """Set the height of ground that is not a plane from a height measurement.

        Args:
            height_m: of the body above the ground.
        """
        self._local_z_m = float(state.p[2]) - height_m
        off_m = abs(self._local_z_m - self.z_m)
        if off_m > _DOUBTED_SIGMAS * math.hypot(sigma_m, math.sqrt(state.cov[5, 5])):
            self.note_relief(off_m / max(height_m, MIN_PLANE_HEIGHT_M))

    def plane(self, world_T_camera: SE3) -> Plane | None:
        """Return the plane, if all of the camera's view is known to lie on it."""
        is_plane = self._scene is Scene.PLANAR or (self._scene is Scene.AUTO and self._planar_share > _MOSTLY)
        height_m = float(world_T_camera.t[2]) - self.z_m
        if not is_plane or self.is_rough or not self._has_height or height_m < MIN_PLANE_HEIGHT_M:
            return None
        return Plane(self.z_m, math.hypot(ROUGHNESS_SHARE, _TOGETHER * self._relief_share) * height_m)

    def expected_map(self, before: SE3, after: SE3) -> Array:
        """Return the map [3, 3] from directions to those expected after the camera's motion.

        Args:
            before, after: world_T_camera.
        """
        rotation: Array = after.R.T.dot(before.R)
        plane = self.plane(before)
        if plane is None and not self.is_rough:
            return rotation
        ground_m = self._local_z_m if plane is None else plane.height_m
        if before.t[2] - ground_m < MIN_PLANE_HEIGHT_M:
            return rotation
        normal = before.R[2] / (ground_m - before.t[2])  # in the camera before, by its distance
        return rotation + np.outer(after.R.T.dot(before.t - after.t), normal)

    def depth_guess_m(self, state: WindowFilter) -> float:
        """Return a low guess of the distance of points, used while it is unknown."""
        return max(_NEAR_M, 0.5 * (float(state.p[2]) - self.z_m))

    def leaves_scale_open(self, state: WindowFilter) -> bool:
        """Return whether neither a height nor an accelerated motion has fixed the scale yet."""
        if self._scene is not Scene.PLANAR or self._has_height:
            return False
        return sigma_of(state.cov[POS, POS]) > SCALE_KNOWN * float(np.linalg.norm(state.p))
