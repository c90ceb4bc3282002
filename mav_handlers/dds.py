# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""External navigation as transforms of ROS 2, over DDS instead of MAVLink.

The stamps are not corrected: they are taken as the autopilot's own time since boot. Errors, reset counter and quality
are 0, as a transform has none.
Source: AP_DDS/AP_DDS_External_Odom.cpp, AP_DDS/AP_DDS_Type_Conversions.cpp, AP_DDS/AP_DDS_Client.cpp.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final, NamedTuple

from ap_core.cint import float_of_u64, u32, u64
from ap_core.fmath import f32, ieee754
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ap_core.verdict import Verdict
from mav_handlers.verdicts import TF_EMPTY, TF_FRAMES, TF_TOO_MANY

if TYPE_CHECKING:
    from viso.vehicle.vehicle import Vehicle

MOST_TRANSFORMS: Final = 8
ODOM_PARENT: Final = "odom"
ODOM_CHILD: Final = "base_link"
EMPTY_TEXT: Final = "DDS: Received tf2_msgs/TFMessage: TF is empty"

_MAV_SEVERITY_INFO: Final = 6
_MILLI: Final = f32(1e-3)
_NO_ERR: Final = f32(0)


class Transform(NamedTuple):
    """A ROS 2 transform: x forward, y left, z up, in metres; the stamp in seconds and nanoseconds."""

    frame_id: str
    child_frame_id: str
    sec: int
    nanosec: int
    translation: tuple[float, float, float]
    rotation_xyzw: tuple[float, float, float, float]


def time_u64_micros(sec: int, nanosec: int) -> int:
    """Return a stamp in us, as an unsigned 64-bit integer."""
    return u64(sec * 1_000_000 + nanosec // 1000)


def time_ms_of(remote_time_us: int) -> int:
    """Return the time of a sample in ms since boot, from its stamp in us.

    The firmware multiplies in float32, so a stamp of days or years is rounded to seconds or minutes. The result wraps
    at 32 bits, as on x86-64.
    """
    return u32(int(float_of_u64(remote_time_us) * _MILLI))


def convert_transform(transform: Transform) -> tuple[Vector3f, Quaternion]:
    """Return the position (m, NED or FRD) and the attitude quaternion, which is not normalised.

    Source: AP_DDS_External_Odom::convert_transform.
    """
    x, y, z = transform.translation
    qx, qy, qz, qw = transform.rotation_xyzw
    return Vector3f(x, -y, -z), Quaternion(qw, qx, -qy, -qz)


def is_odometry_frame(transform: Transform) -> bool:
    """Return whether the firmware accepts a transform's frames (AP_DDS_External_Odom::is_odometry_frame)."""
    return transform.frame_id == ODOM_PARENT and transform.child_frame_id == ODOM_CHILD


@ieee754
def receive_transforms(vehicle: Vehicle, transforms: Sequence[Transform]) -> list[Verdict]:
    """Handle a TFMessage of the topic /ap/tf; return a verdict for each transform, or one for the whole message.

    Source: AP_DDS_Client::on_topic.
    """
    if not transforms:
        vehicle.texts.send_text(_MAV_SEVERITY_INFO, EMPTY_TEXT)
        return [TF_EMPTY]
    if len(transforms) > MOST_TRANSFORMS:
        return [TF_TOO_MANY]
    return [_handle_external_odom(vehicle, transform) for transform in transforms]


def _handle_external_odom(vehicle: Vehicle, transform: Transform) -> Verdict:
    """Handle one transform (AP_DDS_External_Odom::handle_external_odom)."""
    if not is_odometry_frame(transform):
        return TF_FRAMES
    remote_time_us = time_u64_micros(transform.sec, transform.nanosec)
    position, rotation = convert_transform(transform)
    rotation = rotation.normalized(vehicle.internal_errors)
    time_ms = time_ms_of(remote_time_us)
    return vehicle.visual_odom.handle_pose_estimate(remote_time_us, time_ms, position, rotation, _NO_ERR, _NO_ERR, 0, 0)
