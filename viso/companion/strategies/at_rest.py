# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The state of a body that stands still, from its pictures and inertial data. Needs the extra vio."""

from typing import Final

import numpy as np

from viso.companion.klt.front_end import FrontEnd
from viso.companion.msckf.stillness import Stillness, level_rotation
from viso.companion.msckf.window_filter import default_cov
from viso.companion.vio.config import ImuNoise, VioConfig
from viso.companion.vio.imu import steps_of
from viso.companion.vio.preintegration import preintegrate
from viso.companion.vio.types import CameraCalibration, ImuBias, ImuWindow, Pixels, WarmStartPose
from viso.geometry.pose import SE3
from viso.geometry.rotation import Array

# Of tilt and yaw in rad, velocity in m/s, gyro bias in rad/s, accelerometer bias in m/s^2.
_SIGMAS: Final = (0.02, 1e-6, 0.02, 0.003, 0.1)


def state_at_rest(stillness: Stillness) -> WarmStartPose:
    """Return the state of a body that stands still, in a world that begins there, without yaw."""
    gyro, accel = stillness.means()
    body_T_world = SE3(level_rotation(accel).T, np.zeros(3))
    return WarmStartPose(body_T_world, np.zeros(3), ImuBias(np.zeros(3), gyro), default_cov(*_SIGMAS, body_T_world.R.T))


def turn_of_camera(window: ImuWindow, noise: ImuNoise, B_R_C: Array) -> Array:
    """Return the rotation [3, 3] from the camera at a window's begin to the camera at its end, by the gyro alone."""
    if window.end_t_ns == window.start_t_ns:
        return np.eye(3)
    turn = preintegrate(steps_of(window), noise, ImuBias.zero()).dR
    rotation: Array = B_R_C.T.dot(turn.T).dot(B_R_C)
    return rotation


class RestWatch:
    """Detects that a body stands still, for an engine that cannot begin without motion.

    Args:
        calibration: of the working image.
    """

    def __init__(self, calibration: CameraCalibration, config: VioConfig) -> None:
        self._front = FrontEnd(calibration, config)
        self._stillness = Stillness(self._front.focal_px)
        self._noise, self._B_R_C = config.imu_noise, calibration.B_T_C.R

    def update(self, image: Pixels, window: ImuWindow) -> WarmStartPose | None:
        """Process a working image and the inertial data before it; return the state after 0.5 s at rest, else None."""
        self._stillness.note(window, self._front.track(image, turn_of_camera(window, self._noise, self._B_R_C)))
        return state_at_rest(self._stillness) if self._stillness.is_start() else None
