# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""From a pose to the messages that carry external navigation, as MAVLink's definitions have them."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from mav_handlers.wire.messages import (
    ATT_POS_MOCAP,
    ODOMETRY,
    VISION_POSITION_DELTA,
    VISION_POSITION_ESTIMATE,
    VISION_SPEED_ESTIMATE,
    Message,
)
from viso.companion.odometry.message import (
    MAV_ESTIMATOR_TYPE_VIO,
    MAV_FRAME_BODY_FRD,
    MAV_FRAME_LOCAL_FRD,
    UNKNOWN,
    encoded,
)
from viso.companion.vio.config import CovarianceEncoding
from viso.geometry.rotation import Array, euler_from_rotations, rotation_from_quat_wxyz, so3_log
from viso.geometry.trajectory import Pose

MAX_DELTA_US: Final = 1_000_000
"""A change over a longer time says nothing of the velocity at its end, and is not sent."""

_UNKNOWN_SPEED: Final = (math.nan,) + (0.0,) * 8


@dataclass(frozen=True, slots=True)
class Report:
    """What is to be told of one moment.

    Attributes:
        time_us: on the sender's clock.
        pose: of the vehicle: FRD body, NED or FRD world.
        previous: the report before; None for the first, and for the first after a reset.
        reset_counter: 0 to 255, one more after each reset.
        quality: -1 failed, 0 unknown, 1 to 100.
    """

    time_us: int
    pose: Pose
    previous: "Report | None" = None
    reset_counter: int = 0
    quality: int = 0
    encoding: CovarianceEncoding = CovarianceEncoding.VARIANCE

    @property
    def rotation(self) -> Array:
        """From body to world, [3, 3]."""
        return rotation_from_quat_wxyz(self.pose.quat_wxyz)

    @property
    def velocity_body(self) -> tuple[float, float, float]:
        """In m/s, in the body."""
        return _three(self.rotation.T @ self.pose.velocity)

    @property
    def angles_rad(self) -> tuple[float, float, float]:
        """Roll, pitch and yaw."""
        return _three(euler_from_rotations(self.rotation))

    @property
    def covariance(self) -> tuple[float, ...]:
        """The 21 numbers of the pose's covariance; the first is NaN when it is unknown."""
        return encoded(self.pose.covariance, self.encoding)


def _three(vector: Array) -> tuple[float, float, float]:
    x, y, z = vector.tolist()
    return x, y, z


def _quat(pose: Pose) -> tuple[float, ...]:
    return tuple(pose.quat_wxyz.tolist())


def odometry(report: Report) -> tuple[Message, ...]:
    """Return ODOMETRY in the frames that ArduPilot takes; rates of rotation are unknown, and so NaN."""
    pose = report.pose
    return (
        ODOMETRY(
            report.time_us,
            MAV_FRAME_LOCAL_FRD,
            MAV_FRAME_BODY_FRD,
            *_three(pose.position),
            _quat(pose),
            *report.velocity_body,
            *(math.nan,) * 3,
            report.covariance,
            UNKNOWN,
            report.reset_counter,
            MAV_ESTIMATOR_TYPE_VIO,
            report.quality,
        ),
    )


def vision_position_estimate(report: Report) -> tuple[Message, ...]:
    position, angles = _three(report.pose.position), report.angles_rad
    return (VISION_POSITION_ESTIMATE(report.time_us, *position, *angles, report.covariance, report.reset_counter),)


def vision_with_speed(report: Report) -> tuple[Message, ...]:
    speed = _three(report.pose.velocity)
    estimate = VISION_SPEED_ESTIMATE(report.time_us, *speed, _UNKNOWN_SPEED, report.reset_counter)
    return (*vision_position_estimate(report), estimate)


def vision_position_delta(report: Report) -> tuple[Message, ...]:
    """Return VISION_POSITION_DELTA since the report before, in the body as it is turned now; nothing without one."""
    previous = report.previous
    if previous is None or not 0 < report.time_us - previous.time_us <= MAX_DELTA_US:
        return ()
    rotation = report.rotation
    angle = so3_log(previous.rotation.T @ rotation)
    moved = rotation.T @ (report.pose.position - previous.pose.position)
    elapsed_us = report.time_us - previous.time_us
    confidence = float(max(report.quality, 0))
    return (VISION_POSITION_DELTA(report.time_us, elapsed_us, _three(angle), _three(moved), confidence),)


def att_pos_mocap(report: Report) -> tuple[Message, ...]:
    pose = report.pose
    return (ATT_POS_MOCAP(report.time_us, _quat(pose), *_three(pose.position), report.covariance),)


@dataclass(frozen=True, slots=True)
class Form:
    """What to play a trajectory as: what makes the messages of a report, and what they carry."""

    encode: Callable[[Report], tuple[Message, ...]]
    summary: str
    tells_velocity: bool = False


FORMS: Final[Mapping[str, Form]] = MappingProxyType(
    {
        "odometry": Form(odometry, "ODOMETRY: pose, velocity, covariance, quality, resets", tells_velocity=True),
        "vision": Form(vision_position_estimate, "VISION_POSITION_ESTIMATE: pose, covariance, resets"),
        "vision+speed": Form(
            vision_with_speed, "VISION_POSITION_ESTIMATE and VISION_SPEED_ESTIMATE", tells_velocity=True
        ),
        "delta": Form(vision_position_delta, "VISION_POSITION_DELTA: changes of the pose, confidence"),
        "mocap": Form(att_pos_mocap, "ATT_POS_MOCAP: pose alone"),
    }
)
