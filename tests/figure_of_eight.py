# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A figure of eight as ROS 2 tells it, and as VISION_POSITION_ESTIMATE does, with the same bits.

The autopilot scales an attitude of ROS 2 to length 1, and makes one of MAVLink from its angles. So the angles here are
those whose quaternion is of length 1 as it is.
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from ap_core.fmath import f32
from ap_core.internal_error import InternalErrors
from ap_core.quaternion import Quaternion
from mav_handlers.dds import Transform
from mav_handlers.wire.messages import VISION_POSITION_ESTIMATE

ROLL_RAD, PITCH_RAD = f32(0.03), f32(-0.02)
PERIOD_S = 12.0
STANDS_S = 2.0


class Pose(NamedTuple):
    """Where the vehicle is: m in NED, and roll, pitch, yaw in rad; all of them float32."""

    place_ned_m: tuple[float, float, float]
    rpy_rad: tuple[np.float32, np.float32, np.float32]

    def transform(self, time_us: int, frame_id: str = "odom", child_frame_id: str = "base_link") -> Transform:
        """Return it as a transform of ROS 2."""
        x, y, z = self.place_ned_m
        qw, qx, qy, qz = map(float, Quaternion.from_euler(*self.rpy_rad).to_wxyz())
        sec, us = divmod(time_us, 1_000_000)
        return Transform(frame_id, child_frame_id, sec, us * 1000, (x, -y, -z), (qx, -qy, -qz, qw))

    def message(self, time_us: int) -> VISION_POSITION_ESTIMATE:
        """Return it as MAVLink."""
        roll, pitch, yaw = map(float, self.rpy_rad)
        return VISION_POSITION_ESTIMATE(time_us, *self.place_ned_m, roll, pitch, yaw, (0.0,) * 21, 0)


def _of_length_1(yaw: np.float32) -> np.float32:
    while (quat := Quaternion.from_euler(ROLL_RAD, PITCH_RAD, yaw)) != quat.normalized(InternalErrors()):
        yaw = np.nextafter(yaw, f32(10))
    return yaw


def figure_of_eight(rate_hz: float, seconds: float) -> Iterator[Pose]:
    """Yield poses: at rest for 2 s, then through the eight, with the nose along it."""
    for step in range(round(rate_hz * seconds)):
        phase = max(0.0, step / rate_hz - STANDS_S) / PERIOD_S * math.tau
        amount = min(1.0, phase)
        north, east = 3 * math.sin(phase) * amount, 1.5 * math.sin(2 * phase) * amount
        yaw = _of_length_1(f32(0.6 + 0.4 * math.sin(phase) * amount))
        place = float(f32(north)), float(f32(east)), float(f32(-0.5 * amount))
        yield Pose(place, (ROLL_RAD, PITCH_RAD, yaw))
