# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Detection of a vehicle at rest from inertial data and pictures, its state there, and the filter's update at rest."""

import math
from collections import deque
from typing import Final

import numpy as np

from viso.companion.klt.front_end import FrontEnd, Sighting, common_points
from viso.companion.msckf.window_filter import ATT, GYRO, VEL, WindowFilter, default_cov
from viso.companion.vio.config import ImuNoise, VioConfig
from viso.companion.vio.imu import steps_of
from viso.companion.vio.preintegration import preintegrate
from viso.companion.vio.types import CameraCalibration, ImuBias, ImuSample, ImuWindow, Pixels, WarmStartPose
from viso.geometry.pose import SE3
from viso.geometry.rotation import Array, skew

MAX_DISPARITY_PX: Final = 0.4
MAX_GYRO_STD_RAD_S: Final = 0.02
MAX_ACCEL_STD_M_S2: Final = 0.25
SPAN_NS: Final = 250_000_000
START_SPAN_NS: Final = 500_000_000
RENEWAL_NS: Final = 1_000_000_000
_FEWEST_SAMPLES: Final = 10
_FEWEST_POINTS: Final = 8

STILL_VELOCITY_SIGMA_M_S: Final = 0.02
STILL_GYRO_SIGMA_RAD_S: Final = 0.003

_GATE: Final = 16.3  # of 3 degrees of freedom, 99.9 %
# Of tilt and yaw in rad, velocity in m/s, gyro bias in rad/s, accelerometer bias in m/s^2.
_START_SIGMAS: Final = (0.02, 1e-6, 0.02, 0.003, 0.1)


class Stillness:
    """Stores the last inertial data, and since when pictures have not moved.

    A picture is compared with the first one at rest, not with the previous one, so that slow motion shows at any frame
    rate. The rotation is not taken out, because a body that turns is not at rest.
    """

    def __init__(self, focal_px: float) -> None:
        self._focal_px = focal_px
        self._samples: deque[ImuSample] = deque()
        self._now_ns = 0
        self._since_ns = 0
        self._reference: tuple[int, Sighting] | None = None  # what to compare with, and when it was seen

    def note(self, window: ImuWindow, sighting: Sighting) -> None:
        """Take in a frame."""
        now_ns = self._now_ns = window.end_t_ns
        last_ns = self._samples[-1].t_ns if self._samples else -1
        self._samples.extend([sample for sample in window.samples if last_ns < sample.t_ns <= now_ns])
        while self._samples and self._samples[0].t_ns < now_ns - START_SPAN_NS:
            self._samples.popleft()
        if self._reference is None or sighting.model is None or self._has_moved(self._reference[1], sighting):
            self._reference, self._since_ns = (now_ns, sighting), now_ns
        elif now_ns - self._reference[0] >= RENEWAL_NS:  # points wander a little, and their number falls
            self._reference = now_ns, sighting

    def is_still(self) -> bool:
        """Return whether nothing has moved for long enough for a zero-velocity update (0.25 s)."""
        return self._rests(SPAN_NS)

    def is_start(self) -> bool:
        """Return whether nothing has moved for long enough to begin with (0.5 s)."""
        return self._rests(START_SPAN_NS)

    def means(self) -> tuple[Array, Array]:
        """Return the means of rotation rate (rad/s) and specific force (m/s^2), both [3], FLU, of the last 0.25 s."""
        gyro, accel = self._since(SPAN_NS)
        return gyro.mean(axis=0), accel.mean(axis=0)

    def _has_moved(self, earlier: Sighting, later: Sighting) -> bool:
        then, now = common_points(earlier, later)
        if len(then) < _FEWEST_POINTS:
            return True
        return not self._focal_px * float(np.median(np.hypot(*(now - then).T))) < MAX_DISPARITY_PX

    def _rests(self, span_ns: int) -> bool:
        if self._now_ns - self._since_ns < span_ns:
            return False
        gyro, accel = self._since(span_ns)
        if len(gyro) < _FEWEST_SAMPLES:
            return False
        return bool(gyro.std(axis=0).max() < MAX_GYRO_STD_RAD_S and accel.std(axis=0).max() < MAX_ACCEL_STD_M_S2)

    def _since(self, span_ns: int) -> tuple[Array, Array]:
        samples = [sample for sample in self._samples if sample.t_ns >= self._now_ns - span_ns]
        gyro = np.array([sample.gyro for sample in samples]).reshape(-1, 3)
        return gyro, np.array([sample.accel for sample in samples]).reshape(-1, 3)


def level_rotation(accel: Array) -> Array:
    """Return the attitude [3, 3], body to world and without yaw, of a body at rest from its specific force [3]."""
    up = accel / np.linalg.norm(accel)
    ahead = np.array([1.0, 0.0, 0.0]) - up[0] * up
    if np.linalg.norm(ahead) < 1e-3:  # on its tail or nose: the yaw is that of what was down
        ahead = np.array([0.0, 0.0, -np.sign(up[0])])
        ahead = ahead - ahead.dot(up) * up
    ahead = ahead / np.linalg.norm(ahead)
    return np.stack([ahead, np.cross(up, ahead), up])


def stand_still(state: WindowFilter, mean_gyro: Array, share: float = 1.0) -> bool:
    """Update with zero velocity, and with the gyro's mean as bias; return whether that passes the gate.

    High up, a body may move without visible motion in the pictures.

    Args:
        mean_gyro: [3] in rad/s, FLU.
        share: of the gyro's mean that is new, above 0; the weight of the update.
    """
    size = len(state.cov)
    by_velocity = np.zeros((3, size))
    by_velocity[:, VEL], by_velocity[:, ATT] = np.eye(3), -skew(state.v)
    if state.nis(by_velocity, -state.v, STILL_VELOCITY_SIGMA_M_S) > _GATE:
        return False
    state.update(by_velocity, -state.v, STILL_VELOCITY_SIGMA_M_S)
    by_bias = np.zeros((3, size))
    by_bias[:, GYRO] = np.eye(3)
    state.update(by_bias, mean_gyro - state.gyro_bias, STILL_GYRO_SIGMA_RAD_S / math.sqrt(share))
    return True


def state_at_rest(stillness: Stillness) -> WarmStartPose:
    """Return the state of a body that stands still, in a world that begins there, without yaw."""
    gyro, accel = stillness.means()
    body_T_world = SE3(level_rotation(accel).T, np.zeros(3))
    return WarmStartPose(
        body_T_world, np.zeros(3), ImuBias(np.zeros(3), gyro), default_cov(*_START_SIGMAS, body_T_world.R.T)
    )


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
