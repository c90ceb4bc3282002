# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The messages of a Karma drone in its camera's video: ATTITUDE and LOCAL_POSITION_NED of its autopilot.

The camera hangs in a gimbal that keeps it level and follows the drone's heading. That gives the attitude to start with;
what the camera's IMU then shows beyond the drone's acceleration and gravity is its bias.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from viso.companion.vio.frames import ENU_TO_NED, FLU_TO_FRD, GRAVITY_MSS
from viso.companion.vio.types import ImuBias, ImuSample, WarmStartPose
from viso.geometry.pose import SE3
from viso.geometry.rotation import Array, quat_wxyz_from_rotation, rotations_from_euler, so3_exp
from viso.geometry.trajectory import Trajectory

DELAY_S: Final = 0.2
"""The delay of the drone's messages at which its accelerations agree best with the camera's."""
LONGEST_S: Final = 1e6
MEAN_S: Final = 1.0
"""Over how long the IMU and the drone's acceleration are averaged for the state to start with."""
_X, _Y, _Z = np.eye(3)
_LEVEL = _X + _Y  # the axes about which the gimbal does not let the camera turn


@dataclass(frozen=True, slots=True, eq=False)
class DroneTrack:
    """The autopilot's data, by the time of the video.

    Attributes:
        t_s: [N], strictly increasing.
        position_w: [N, 3] in m, ENU, from the autopilot's origin.
        velocity_w: [N, 3] in m/s, ENU.
        yaw_rad: [N], ENU, of the airframe.
        quats_wxyz: [N, 4], from the airframe (FLU) to ENU.
    """

    t_s: Array
    position_w: Array
    velocity_w: Array
    yaw_rad: Array
    quats_wxyz: Array

    def poses(self) -> Trajectory:
        """Return where the drone was; the attitude is the airframe's, not the camera's."""
        return Trajectory(np.round(self.t_s * 1e9).astype(np.int64), self.position_w, self.quats_wxyz)

    def start_at(self, t_s: float, samples: Iterable[ImuSample]) -> WarmStartPose:
        """Return the camera's state at a time within the track, a second before its end.

        Raises ValueError if there are no samples of the camera's IMU then.
        """
        end_s = t_s + MEAN_S
        during = [sample for sample in samples if t_s <= sample.t_ns * 1e-9 <= end_s]
        if not during:
            raise ValueError(f"no inertial data at {t_s:.1f} s")
        velocity_w = self._at(t_s, self.velocity_w)
        force_w = (self._at(end_s, self.velocity_w) - velocity_w) / MEAN_S + GRAVITY_MSS * _Z
        rotation = so3_exp(float(np.interp(t_s, self.t_s, self.yaw_rad)) * _Z)
        accel_bias = np.mean([sample.accel for sample in during], axis=0) - rotation.T.dot(force_w)
        gyro_bias = np.mean([sample.gyro for sample in during], axis=0) * _LEVEL
        world_T_body = SE3(rotation, self._at(t_s, self.position_w))
        return WarmStartPose(world_T_body.inverse(), rotation.T.dot(velocity_w), ImuBias(accel_bias, gyro_bias))

    def _at(self, t_s: float, columns: Array) -> Array:
        return np.array([np.interp(t_s, self.t_s, column) for column in columns.T])


def drone_track(attitudes: Array, positions: Array, spans: Sequence[tuple[float, float, float, float]]) -> DroneTrack:
    """Return the track of messages.

    Args:
        attitudes: [M, 4] or more: time since boot in s, roll, pitch and yaw in rad.
        positions: [N, 7]: time since boot in s, position in m and velocity in m/s, NED.
        spans: of each part of ``positions``: start and end of the video's time in which it came, then the times since
            boot of its first and its last message.

    Raises ValueError if times do not increase.
    """
    boot_s, attitude_s = positions[:, 0], attitudes[:, 0]
    if not (np.diff(boot_s) > 0).all() or not (np.diff(attitude_s) > 0).all():
        raise ValueError("times since boot do not increase")
    if np.abs(boot_s).max() > LONGEST_S:
        raise ValueError("times since boot of more than eleven days")
    angles = [np.interp(boot_s, attitude_s, np.unwrap(column)) for column in attitudes[:, 1:4].T]
    attitudes = ENU_TO_NED.T @ rotations_from_euler(np.column_stack(angles)) @ FLU_TO_FRD
    return DroneTrack(
        boot_s - _boot_of_video_s(spans) - DELAY_S,
        positions[:, 1:4] @ ENU_TO_NED,
        positions[:, 4:7] @ ENU_TO_NED,
        0.5 * math.pi - angles[2],
        np.array([quat_wxyz_from_rotation(attitude) for attitude in attitudes]),
    )


def _boot_of_video_s(spans: Sequence[tuple[float, float, float, float]]) -> float:
    """Return the time since boot at which the video begins: no message came before it was made, nor much later.

    Each part says that its messages came within its span; what fits all of them, or most of them best, is the middle.
    """
    latest = min(first_s - start_s for start_s, _, first_s, _ in spans)
    earliest = max(last_s - end_s for _, end_s, _, last_s in spans)
    return 0.5 * (latest + earliest)
