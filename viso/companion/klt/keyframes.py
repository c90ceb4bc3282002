# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""When a frame becomes a keyframe."""

import uuid
from typing import Final

import numpy as np

from viso.companion.klt.front_end import Sighting, common_points
from viso.companion.klt.outliers import rotated
from viso.companion.vio.se3 import Array

MIN_DISPARITY_PX: Final = 20.0
MIN_COMMON: Final = 40
MAX_AGE_NS: Final = 1_000_000_000


class Keyframe:
    """A frame that later ones are compared with.

    Args:
        number: of the frame, in the estimator's window.
        camera_rotation: [3, 3] from the camera to the world.
    """

    def __init__(self, frame_id: uuid.UUID, number: int, t_ns: int, camera_rotation: Array, sighting: Sighting) -> None:
        self.frame_id, self.number, self.t_ns = frame_id, number, t_ns
        self._rotation = camera_rotation
        self._sighting = sighting

    def is_outdated(self, t_ns: int, camera_rotation: Array, sighting: Sighting, focal_px: float) -> bool:
        """Return whether a later frame, taken in motion, is to be the next keyframe.

        Args:
            t_ns, camera_rotation, sighting: of the later frame.
            focal_px: of the working image.
        """
        then, now = common_points(self._sighting, sighting)
        if len(then) < MIN_COMMON or t_ns - self.t_ns >= MAX_AGE_NS:
            return True
        expected = rotated(camera_rotation.T.dot(self._rotation), then)
        disparity_px = focal_px * np.hypot(*(expected - now).T)
        return not float(np.median(disparity_px)) <= MIN_DISPARITY_PX  # true for NaN: a turn by a right angle or more
