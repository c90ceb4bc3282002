# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""ROS 2 messages as cyclonedds sends them: with ROS 2's own DDS type names, members and order of bytes.

A class is named as the message; its module needs the extra ``ros2``, so import it after ``viso.dds.graph``'s
``require_cyclonedds``. All members have defaults. Units and frames are those of the messages: metres, seconds, radians,
x forward, y left, z up in a body, and x east, y north, z up on a map.
"""

from dataclasses import dataclass, field
from typing import Final

from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import array, float64, int32, int64, sequence, uint8, uint32, uint64


def _name(package: str, message: str, kind: str = "msg") -> str:
    """Return the name of a message's type in DDS, such as tf2_msgs::msg::dds_::TFMessage_."""
    return f"{package}::{kind}::dds_::{message}_"


@dataclass
class Time(IdlStruct, typename=_name("builtin_interfaces", "Time")):
    """A time: seconds, which may be negative, and nanoseconds."""

    sec: int32 = 0
    nanosec: uint32 = 0


@dataclass
class Header(IdlStruct, typename=_name("std_msgs", "Header")):
    """The time of a message, and the frame in which it is given."""

    stamp: Time = field(default_factory=Time)
    frame_id: str = ""


@dataclass
class Vector3(IdlStruct, typename=_name("geometry_msgs", "Vector3")):
    """A vector."""

    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0


@dataclass
class Point(IdlStruct, typename=_name("geometry_msgs", "Point")):
    """A place, m."""

    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0


@dataclass
class Quaternion(IdlStruct, typename=_name("geometry_msgs", "Quaternion")):
    """A rotation; w is the scalar, and comes last."""

    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0
    w: float64 = 1.0


@dataclass
class Pose(IdlStruct, typename=_name("geometry_msgs", "Pose")):
    """A place and an attitude."""

    position: Point = field(default_factory=Point)
    orientation: Quaternion = field(default_factory=Quaternion)


@dataclass
class PoseStamped(IdlStruct, typename=_name("geometry_msgs", "PoseStamped")):
    """A pose at a time."""

    header: Header = field(default_factory=Header)
    pose: Pose = field(default_factory=Pose)


def _zeros(count: int) -> list[float]:
    return [0.0] * count


@dataclass
class PoseWithCovariance(IdlStruct, typename=_name("geometry_msgs", "PoseWithCovariance")):
    """A pose and its 36 covariances, by rows: x, y, z, and rotations about x, y, z."""

    pose: Pose = field(default_factory=Pose)
    covariance: array[float64, 36] = field(default_factory=lambda: _zeros(36))


@dataclass
class PoseWithCovarianceStamped(IdlStruct, typename=_name("geometry_msgs", "PoseWithCovarianceStamped")):
    """A pose with covariance at a time."""

    header: Header = field(default_factory=Header)
    pose: PoseWithCovariance = field(default_factory=PoseWithCovariance)


@dataclass
class Twist(IdlStruct, typename=_name("geometry_msgs", "Twist")):
    """A velocity in m/s, and a turn rate in rad/s."""

    linear: Vector3 = field(default_factory=Vector3)
    angular: Vector3 = field(default_factory=Vector3)


@dataclass
class TwistStamped(IdlStruct, typename=_name("geometry_msgs", "TwistStamped")):
    """A twist at a time."""

    header: Header = field(default_factory=Header)
    twist: Twist = field(default_factory=Twist)


@dataclass
class TwistWithCovariance(IdlStruct, typename=_name("geometry_msgs", "TwistWithCovariance")):
    """A twist and its 36 covariances, by rows."""

    twist: Twist = field(default_factory=Twist)
    covariance: array[float64, 36] = field(default_factory=lambda: _zeros(36))


@dataclass
class Transform(IdlStruct, typename=_name("geometry_msgs", "Transform")):
    """Where a child's frame is in its parent's."""

    translation: Vector3 = field(default_factory=Vector3)
    rotation: Quaternion = field(default_factory=Quaternion)


@dataclass
class TransformStamped(IdlStruct, typename=_name("geometry_msgs", "TransformStamped")):
    """A transform at a time; the parent is in the header."""

    header: Header = field(default_factory=Header)
    child_frame_id: str = ""
    transform: Transform = field(default_factory=Transform)


@dataclass
class TFMessage(IdlStruct, typename=_name("tf2_msgs", "TFMessage")):
    """Any number of transforms."""

    transforms: sequence[TransformStamped] = field(default_factory=list)


@dataclass
class Odometry(IdlStruct, typename=_name("nav_msgs", "Odometry")):
    """A pose in the header's frame, and a twist in the child's."""

    header: Header = field(default_factory=Header)
    child_frame_id: str = ""
    pose: PoseWithCovariance = field(default_factory=PoseWithCovariance)
    twist: TwistWithCovariance = field(default_factory=TwistWithCovariance)


@dataclass
class Imu(IdlStruct, typename=_name("sensor_msgs", "Imu")):
    """An attitude, a turn rate in rad/s, an acceleration in m/s2, and 9 covariances each."""

    header: Header = field(default_factory=Header)
    orientation: Quaternion = field(default_factory=Quaternion)
    orientation_covariance: array[float64, 9] = field(default_factory=lambda: _zeros(9))
    angular_velocity: Vector3 = field(default_factory=Vector3)
    angular_velocity_covariance: array[float64, 9] = field(default_factory=lambda: _zeros(9))
    linear_acceleration: Vector3 = field(default_factory=Vector3)
    linear_acceleration_covariance: array[float64, 9] = field(default_factory=lambda: _zeros(9))


@dataclass
class GeoPoint(IdlStruct, typename=_name("geographic_msgs", "GeoPoint")):
    """A place on earth: degrees, and m."""

    latitude: float64 = 0.0
    longitude: float64 = 0.0
    altitude: float64 = 0.0


@dataclass
class GeoPointStamped(IdlStruct, typename=_name("geographic_msgs", "GeoPointStamped")):
    """A place on earth at a time."""

    header: Header = field(default_factory=Header)
    position: GeoPoint = field(default_factory=GeoPoint)


@dataclass
class GeoPose(IdlStruct, typename=_name("geographic_msgs", "GeoPose")):
    """A place on earth and an attitude."""

    position: GeoPoint = field(default_factory=GeoPoint)
    orientation: Quaternion = field(default_factory=Quaternion)


@dataclass
class GeoPoseStamped(IdlStruct, typename=_name("geographic_msgs", "GeoPoseStamped")):
    """A place on earth and an attitude at a time."""

    header: Header = field(default_factory=Header)
    pose: GeoPose = field(default_factory=GeoPose)


@dataclass
class Clock(IdlStruct, typename=_name("rosgraph_msgs", "Clock")):
    """The time that all go by."""

    clock: Time = field(default_factory=Time)


@dataclass
class Status(IdlStruct, typename=_name("ardupilot_msgs", "Status")):
    """What ArduPilot says about the vehicle: type, mode, failsafes."""

    header: Header = field(default_factory=Header)
    vehicle_type: uint8 = 0
    armed: bool = False
    mode: uint8 = 0
    flying: bool = False
    external_control: bool = False
    failsafe: sequence[uint8] = field(default_factory=list)


@dataclass
class RequestId(IdlStruct, typename="rmw_cyclonedds::RequestId"):
    """Who asks, and his how manyth request it is: what rmw_cyclonedds puts before a request and its reply."""

    guid: uint64 = 0
    seq: int64 = 0


@dataclass
class ArmMotorsRequest(IdlStruct, typename=_name("ardupilot_msgs", "ArmMotors_Request", "srv")):
    """Arm, or disarm."""

    id: RequestId = field(default_factory=RequestId)
    arm: bool = False


@dataclass
class ArmMotorsResponse(IdlStruct, typename=_name("ardupilot_msgs", "ArmMotors_Response", "srv")):
    """Whether it worked."""

    id: RequestId = field(default_factory=RequestId)
    result: bool = False


@dataclass
class ModeSwitchRequest(IdlStruct, typename=_name("ardupilot_msgs", "ModeSwitch_Request", "srv")):
    """Enter a mode."""

    id: RequestId = field(default_factory=RequestId)
    mode: uint8 = 0


@dataclass
class ModeSwitchResponse(IdlStruct, typename=_name("ardupilot_msgs", "ModeSwitch_Response", "srv")):
    """Whether it worked, and the mode now."""

    id: RequestId = field(default_factory=RequestId)
    status: bool = False
    curr_mode: uint8 = 0


@dataclass
class TriggerRequest(IdlStruct, typename=_name("std_srvs", "Trigger_Request", "srv")):
    """Nothing, for which ROS 2 has a member that means nothing."""

    id: RequestId = field(default_factory=RequestId)
    structure_needs_at_least_one_member: uint8 = 0


@dataclass
class TriggerResponse(IdlStruct, typename=_name("std_srvs", "Trigger_Response", "srv")):
    """Whether it worked, in a word and in words."""

    id: RequestId = field(default_factory=RequestId)
    success: bool = False
    message: str = ""


POSES: Final = {
    "nav_msgs/msg/Odometry": Odometry,
    "geometry_msgs/msg/PoseStamped": PoseStamped,
    "geometry_msgs/msg/PoseWithCovarianceStamped": PoseWithCovarianceStamped,
    "geometry_msgs/msg/TransformStamped": TransformStamped,
    "tf2_msgs/msg/TFMessage": TFMessage,
}
"""Messages that carry a pose, by ROS 2's name of their type."""
