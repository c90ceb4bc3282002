# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The messages of external navigation, position, attitude and velocity in them, flow, and how to turn those.

Quaternions are w, x, y, z and turn the body into the local frame; angles are in rad. Numbers need not be finite.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any, Final

from ekf_stub.core.vectors import (
    Quat,
    Vec3,
    add,
    conjugate,
    euler_of,
    is_finite,
    quat_of_euler,
    rotated,
    times,
)
from mav_handlers.wire.messages import (
    ATT_POS_MOCAP,
    GLOBAL_VISION_POSITION_ESTIMATE,
    ODOMETRY,
    OPTICAL_FLOW,
    VICON_POSITION_ESTIMATE,
    VISION_POSITION_DELTA,
    VISION_POSITION_ESTIMATE,
    VISION_SPEED_ESTIMATE,
    Message,
)

VISION_TYPES: Final[tuple[type[Message], ...]] = (
    ODOMETRY,
    VISION_POSITION_ESTIMATE,
    VISION_SPEED_ESTIMATE,
    VISION_POSITION_DELTA,
    VICON_POSITION_ESTIMATE,
    GLOBAL_VISION_POSITION_ESTIMATE,
    ATT_POS_MOCAP,
)
_EULER: Final = (VISION_POSITION_ESTIMATE, GLOBAL_VISION_POSITION_ESTIMATE, VICON_POSITION_ESTIMATE)
_POSED: Final = (*_EULER, ATT_POS_MOCAP, ODOMETRY)
_NO_QUAT: Final = (math.nan, math.nan, math.nan, math.nan)


def position_of(message: Any) -> Vec3 | None:
    """Return the position in m, in the axes of the message; None if it has none."""
    return (message.x, message.y, message.z) if isinstance(message, _POSED) else None


def with_position(message: Any, position: Vec3) -> Any:
    """Return a message whose x, y and z are a position, or a speed, with others."""
    x, y, z = position
    return replace(message, x=x, y=y, z=z)


def has_euler_angles(message: Any) -> bool:
    """Return whether the attitude is in roll, pitch and yaw."""
    return isinstance(message, _EULER)


def has_quaternion(message: Any) -> bool:
    """Return whether the attitude is in a quaternion."""
    return isinstance(message, ODOMETRY | ATT_POS_MOCAP)


def attitude_of(message: Any) -> Quat | None:
    """Return the attitude, None if the message has none."""
    if has_euler_angles(message):
        angles = message.roll, message.pitch, message.yaw
        return quat_of_euler(*angles) if is_finite(angles) else _NO_QUAT
    return tuple(message.q) if has_quaternion(message) else None


def with_attitude(message: Any, quat_wxyz: Quat) -> Any:
    """Return a message that has an attitude with another."""
    if has_quaternion(message):
        return replace(message, q=quat_wxyz)
    is_known = all(map(math.isfinite, quat_wxyz))
    roll, pitch, yaw = euler_of(quat_wxyz) if is_known else (math.nan, math.nan, math.nan)
    return replace(message, roll=roll, pitch=pitch, yaw=yaw)


def with_yaw_added(message: Any, yaw_rad: float) -> Any:
    """Return the message with its attitude turned about the vertical axis, None if it has none."""
    if has_euler_angles(message):
        yaw = message.yaw + yaw_rad
        return replace(message, yaw=math.remainder(yaw, math.tau) if math.isfinite(yaw) else yaw)
    if not has_quaternion(message):
        return None
    return replace(message, q=times(quat_of_euler(0.0, 0.0, yaw_rad), tuple(message.q)))


def with_velocity_added(message: Any, vel_local: Vec3) -> Any:
    """Return the message with a velocity, in m/s in the local frame, added to its own; None if it has none."""
    if isinstance(message, VISION_SPEED_ESTIMATE):
        return with_position(message, add((message.x, message.y, message.z), vel_local))
    if not isinstance(message, ODOMETRY):
        return None
    q: Any = message.q
    return with_body_velocity_added(message, rotated(conjugate(tuple(q)), vel_local))


def with_body_velocity_added(message: ODOMETRY, vel_body: Vec3) -> ODOMETRY:
    """Return the message with a velocity, in m/s in the body frame, added to its own."""
    vx, vy, vz = add((message.vx, message.vy, message.vz), vel_body)
    return replace(message, vx=vx, vy=vy, vz=vz)


def with_flow(message: OPTICAL_FLOW, change: Callable[[float, float], tuple[float, float]]) -> OPTICAL_FLOW:
    """Return the message with its rates about x and y changed, in all the fields that tell them."""
    x, y = change(message.flow_x, message.flow_y)
    m_x, m_y = change(message.flow_comp_m_x, message.flow_comp_m_y)
    rate_x, rate_y = change(message.flow_rate_x, message.flow_rate_y)
    message = replace(message, flow_x=round(x), flow_y=round(y), flow_comp_m_x=m_x, flow_comp_m_y=m_y)
    return replace(message, flow_rate_x=rate_x, flow_rate_y=rate_y)


def turned_about_origin(message: Any, yaw_rad: float) -> Any:
    """Return the message as of a local frame that is turned about its origin, None if that makes no difference."""
    turn = quat_of_euler(0.0, 0.0, yaw_rad)
    if isinstance(message, VISION_SPEED_ESTIMATE):
        return with_position(message, rotated(turn, (message.x, message.y, message.z)))
    position = position_of(message)
    return None if position is None else with_position(with_yaw_added(message, yaw_rad), rotated(turn, position))
