# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Faults of the estimate: where the vehicle is, how it is turned and how fast it moves.

Axes are those of the message's local frame, x, y, z; for SITL's parameters they are north, east, down.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

from ekf_stub.core.vectors import Vec3, add, cross, rotated, scaled
from mav_handlers.wire.messages import (
    DISTANCE_SENSOR,
    ODOMETRY,
    OPTICAL_FLOW,
    VISION_POSITION_DELTA,
    VISION_SPEED_ESTIMATE,
)
from viso.faults.fault import ContentFault, Moment, parameter
from viso.faults.poses import (
    attitude_of,
    has_euler_angles,
    has_quaternion,
    position_of,
    turned_about_origin,
    with_body_velocity_added,
    with_flow,
    with_position,
    with_velocity_added,
    with_yaw_added,
)
from viso.faults.stamps import stamp_of, with_stamp

FAR_M = 1e7
FAST_M_S = 1e6


def _moved(message: Any, by: Vec3) -> Any:
    position = position_of(message)
    return None if position is None else with_position(message, add(position, by))


def _gauss(moment: Moment, sd: float) -> Vec3:
    return moment.random.gauss(0.0, sd), moment.random.gauss(0.0, sd), moment.random.gauss(0.0, sd)


@dataclass(slots=True)
class PositionGlitch(ContentFault):
    """The position has an offset.

    Attributes:
        x_m, y_m, z_m: by how much.
    """

    sitl: ClassVar[str] = "SIM_VICON_GLIT_X, _Y, _Z"
    x_m: float = parameter(0.0, -FAR_M, FAR_M)
    y_m: float = parameter(0.0, -FAR_M, FAR_M)
    z_m: float = parameter(0.0, -FAR_M, FAR_M)

    def change(self, message: Any, moment: Moment) -> Any:
        return _moved(message, (self.x_m, self.y_m, self.z_m))


@dataclass(slots=True)
class VelocityGlitch(ContentFault):
    """The velocity has an offset in the local frame, also that of ODOMETRY, which is in the body frame.

    Attributes:
        x_m_s, y_m_s, z_m_s: by how much.
    """

    sitl: ClassVar[str] = "SIM_VICON_VGLI_X, _Y, _Z"
    x_m_s: float = parameter(0.0, -FAST_M_S, FAST_M_S)
    y_m_s: float = parameter(0.0, -FAST_M_S, FAST_M_S)
    z_m_s: float = parameter(0.0, -FAST_M_S, FAST_M_S)

    def change(self, message: Any, moment: Moment) -> Any:
        return with_velocity_added(message, (self.x_m_s, self.y_m_s, self.z_m_s))


@dataclass(slots=True)
class PositionNoise(ContentFault):
    """The position is noisy on each axis.

    Attributes:
        sd_m: standard deviation.
    """

    sitl: ClassVar[str] = "SIM_VICON_P_SD"
    lasts: ClassVar[bool] = True
    sd_m: float = parameter(0.1, 0.0, FAR_M)

    def change(self, message: Any, moment: Moment) -> Any:
        return _moved(message, _gauss(moment, self.sd_m))


@dataclass(slots=True)
class VelocityNoise(ContentFault):
    """The velocity is noisy on each axis.

    Attributes:
        sd_m_s: standard deviation.
    """

    sitl: ClassVar[str] = "SIM_VICON_V_SD"
    lasts: ClassVar[bool] = True
    sd_m_s: float = parameter(0.1, 0.0, FAST_M_S)

    def change(self, message: Any, moment: Moment) -> Any:
        return with_velocity_added(message, _gauss(moment, self.sd_m_s))


@dataclass(slots=True)
class SensorPlace(ContentFault):
    """The camera is not where the autopilot expects it: position, and velocity of ODOMETRY, are those of another point.

    Attributes:
        x_m, y_m, z_m: of the camera on the vehicle: forward, right, down.
    """

    sitl: ClassVar[str] = "SIM_VICON_POS_X, _Y, _Z"
    lasts: ClassVar[bool] = True
    x_m: float = parameter(0.0, -100.0, 100.0)
    y_m: float = parameter(0.0, -100.0, 100.0)
    z_m: float = parameter(0.0, -100.0, 100.0)

    def change(self, message: Any, moment: Moment) -> Any:
        """Report for the place of the camera what was said about that of the vehicle."""
        attitude, offset = attitude_of(message), (self.x_m, self.y_m, self.z_m)
        if attitude is None:
            return None
        if isinstance(message, ODOMETRY):
            rates = message.rollspeed, message.pitchspeed, message.yawspeed
            if all(map(math.isfinite, rates)):  # NaN for unknown
                message = with_body_velocity_added(message, cross(rates, offset))
        return _moved(message, rotated(attitude, offset))


@dataclass(slots=True)
class FrameYaw(ContentFault):
    """The local frame is rotated about its origin, as if north were elsewhere.

    Attributes:
        yaw_deg: of the local frame, clockwise; yaw is less by as much.
    """

    sitl: ClassVar[str] = "SIM_VICON_YAW"
    lasts: ClassVar[bool] = True
    yaw_deg: float = parameter(90.0, -360.0, 360.0)

    def change(self, message: Any, moment: Moment) -> Any:
        return turned_about_origin(message, -math.radians(self.yaw_deg))


@dataclass(slots=True)
class YawError(ContentFault):
    """The yaw has an offset, the position has none.

    Attributes:
        yaw_deg: by how much, clockwise.
    """

    sitl: ClassVar[str] = "SIM_VICON_YAWERR"
    yaw_deg: float = parameter(20.0, -360.0, 360.0)

    def change(self, message: Any, moment: Moment) -> Any:
        return with_yaw_added(message, math.radians(self.yaw_deg))


@dataclass(slots=True)
class Drift(ContentFault):
    """Position and yaw drift away; the velocity does not show it.

    Attributes:
        x_m_s, y_m_s, z_m_s: how fast the position drifts.
        yaw_deg_s: how fast the yaw drifts, clockwise.
    """

    lasts: ClassVar[bool] = True
    x_m_s: float = parameter(0.0, -FAST_M_S, FAST_M_S)
    y_m_s: float = parameter(0.0, -FAST_M_S, FAST_M_S)
    z_m_s: float = parameter(0.0, -FAST_M_S, FAST_M_S)
    yaw_deg_s: float = parameter(0.0, -3600.0, 3600.0)

    def change(self, message: Any, moment: Moment) -> Any:
        moved = _moved(message, scaled((self.x_m_s, self.y_m_s, self.z_m_s), moment.since_s))
        if moved is None or not self.yaw_deg_s:
            return moved
        return with_yaw_added(moved, math.radians(self.yaw_deg_s) * moment.since_s)


@dataclass(slots=True)
class Scale(ContentFault):
    """Positions, velocities, changes of position, flow or distances have a wrong scale.

    Attributes:
        factor: 1000 for millimetres, 10 for distances in mm in place of cm.
    """

    lasts: ClassVar[bool] = True
    factor: float = parameter(1.1, -1e6, 1e6)

    def change(self, message: Any, moment: Moment) -> Any:
        if isinstance(message, OPTICAL_FLOW):
            return with_flow(message, lambda x, y: (self.factor * x, self.factor * y))
        if isinstance(message, DISTANCE_SENSOR):
            return replace(message, current_distance=round(self.factor * message.current_distance))
        if isinstance(message, VISION_POSITION_DELTA):
            return replace(message, position_delta=tuple(self.factor * delta for delta in message.position_delta))
        if isinstance(message, ODOMETRY):
            vx, vy, vz = scaled((message.vx, message.vy, message.vz), self.factor)
            message = replace(message, vx=vx, vy=vy, vz=vz)
        elif not isinstance(message, VISION_SPEED_ESTIMATE) and position_of(message) is None:
            return None
        return with_position(message, scaled((message.x, message.y, message.z), self.factor))


def _sensor_of(message: Any) -> tuple[int, ...]:
    if isinstance(message, DISTANCE_SENSOR):
        return message.id, message.orientation
    return (message.sensor_id,) if isinstance(message, OPTICAL_FLOW) else ()


@dataclass(slots=True)
class Frozen(ContentFault):
    """Each sensor repeats the data of its first message, with stamps that advance."""

    lasts: ClassVar[bool] = True
    _first: dict[tuple[object, ...], Any] = field(default_factory=dict, init=False, repr=False)

    def change(self, message: Any, moment: Moment) -> Any:
        first = self._first.setdefault((type(message), *_sensor_of(message)), message)
        if isinstance(message, DISTANCE_SENSOR):
            return replace(first, time_boot_ms=message.time_boot_ms)
        stamp_us = stamp_of(message)
        return None if stamp_us is None else with_stamp(first, stamp_us)


@dataclass(slots=True)
class Reset(ContentFault):
    """The odometry restarts: the local frame is rotated about its origin and shifted, and the reset counter changes.

    Attributes:
        x_m, y_m, z_m: how far positions jump.
        yaw_deg: how far everything turns, clockwise.
        count: added to the reset counter; 0 for a reset that is not announced.
    """

    lasts: ClassVar[bool] = True
    x_m: float = parameter(0.0, -FAR_M, FAR_M)
    y_m: float = parameter(0.0, -FAR_M, FAR_M)
    z_m: float = parameter(0.0, -FAR_M, FAR_M)
    yaw_deg: float = parameter(0.0, -360.0, 360.0)
    count: int = parameter(1, 0, 255)

    def change(self, message: Any, moment: Moment) -> Any:
        after: Any = None
        if position_of(message) is not None or isinstance(message, VISION_SPEED_ESTIMATE):
            after = turned_about_origin(message, math.radians(self.yaw_deg)) if self.yaw_deg else message
            after = _moved(after, (self.x_m, self.y_m, self.z_m)) or after
        if after is not None and hasattr(after, "reset_counter"):
            after = replace(after, reset_counter=(after.reset_counter + self.count) % 256)
        return after


@dataclass(slots=True)
class Degrees(ContentFault):
    """Roll, pitch and yaw, or their changes, are in degrees."""

    lasts: ClassVar[bool] = True

    def change(self, message: Any, moment: Moment) -> Any:
        if isinstance(message, VISION_POSITION_DELTA):
            return replace(message, angle_delta=tuple(map(math.degrees, message.angle_delta)))
        if not has_euler_angles(message):
            return None
        roll, pitch, yaw = map(math.degrees, (message.roll, message.pitch, message.yaw))
        return replace(message, roll=roll, pitch=pitch, yaw=yaw)


def _changed_quat(message: Any, change: Callable[[tuple[float, ...]], tuple[float, ...]]) -> Any:
    return replace(message, q=change(message.q)) if has_quaternion(message) else None


@dataclass(slots=True)
class QuatXyzw(ContentFault):
    """The quaternion is in the order x, y, z, w, as in ROS, in place of w, x, y, z."""

    lasts: ClassVar[bool] = True

    def change(self, message: Any, moment: Moment) -> Any:
        return _changed_quat(message, lambda q: (*q[1:], q[0]))


@dataclass(slots=True)
class QuatNorm(ContentFault):
    """The length of the quaternion is not 1.

    Attributes:
        norm: its length.
    """

    lasts: ClassVar[bool] = True
    norm: float = parameter(0.5, 0.0, 1e6)

    def change(self, message: Any, moment: Moment) -> Any:
        return _changed_quat(message, lambda q: tuple(self.norm * element for element in q))
