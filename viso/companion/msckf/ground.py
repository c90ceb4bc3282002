# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What is known about the ground below: whether it is a plane and all that there is to see, and where it is."""

from typing import Final

import numpy as np

from viso.companion.klt.outliers import Model
from viso.companion.msckf.multi_state import Plane
from viso.companion.msckf.window_filter import POS, WindowFilter, sigma_of
from viso.companion.vio.config import AglSource, Scene, VioConfig
from viso.companion.vio.se3 import SE3, Array

ROUGHNESS_SHARE: Final = 0.01  # of the height: how rough a ground is that counts as a plane
MIN_PLANE_HEIGHT_M: Final = 0.5
SCALE_KNOWN: Final = 0.05  # share of the distance that may be uncertain
_KEPT: Final = 0.9
_MOSTLY: Final = 0.8  # share of frames


class Ground:
    """The ground in a filter's world, as the configuration and the pictures tell.

    Args:
        config: the configuration.
        origin_z_m: of the filter's world, in the world of the configuration.

    Attributes:
        z_m: of the plane, in the filter's world.
    """

    def __init__(self, config: VioConfig, origin_z_m: float) -> None:
        self.z_m = config.ground_z_m - origin_z_m
        self._scene = config.scene
        self._has_height = config.agl_source is not AglSource.NONE
        self._planar_share = 0.0

    def note(self, model: Model | None) -> None:
        """Note what the points in a frame agreed with."""
        self._planar_share += (1 - _KEPT) * ((model is Model.HOMOGRAPHY) - self._planar_share)

    def plane(self, world_T_camera: SE3) -> Plane | None:
        """Return the plane, if all that the camera sees is known to lie on it."""
        is_plane = self._scene is Scene.PLANAR or (self._scene is Scene.AUTO and self._planar_share > _MOSTLY)
        height_m = float(world_T_camera.t[2]) - self.z_m
        if not is_plane or not self._has_height or height_m < MIN_PLANE_HEIGHT_M:
            return None
        return Plane(self.z_m, ROUGHNESS_SHARE * height_m)

    def expected_map(self, before: SE3, after: SE3) -> Array:
        """Return the map [3, 3] of directions that says where points are expected after the camera has moved.

        Args:
            before, after: world_T_camera.
        """
        rotation: Array = after.R.T.dot(before.R)
        plane = self.plane(before)
        if plane is None:
            return rotation
        normal = before.R[2] / (plane.height_m - before.t[2])  # in the camera before, by its distance
        return rotation + np.outer(after.R.T.dot(before.t - after.t), normal)

    def leaves_scale_open(self, state: WindowFilter) -> bool:
        """Tell whether nothing has fixed the scale yet: neither a height nor, by its excitation, the accelerometer."""
        if self._scene is not Scene.PLANAR or self._has_height:
            return False
        return sigma_of(state.cov[POS, POS]) > SCALE_KNOWN * float(np.linalg.norm(state.p))
