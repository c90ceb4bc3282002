# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Messages have the type names and the bytes that ROS 2 gives them; rosbags' types are the oracle."""

from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from viso.dds import messages as ros
from viso.dds.graph import service_names, topic_name

OTHERS = {
    "geographic_msgs/msg/GeoPoint": "float64 latitude\nfloat64 longitude\nfloat64 altitude\n",
    "geographic_msgs/msg/GeoPointStamped": "std_msgs/Header header\ngeographic_msgs/GeoPoint position\n",
    "geographic_msgs/msg/GeoPose": "geographic_msgs/GeoPoint position\ngeometry_msgs/Quaternion orientation\n",
    "geographic_msgs/msg/GeoPoseStamped": "std_msgs/Header header\ngeographic_msgs/GeoPose pose\n",
    "ardupilot_msgs/msg/Status": "std_msgs/Header header\nuint8 vehicle_type\nbool armed\nuint8 mode\nbool flying\n"
    "bool external_control\nuint8[] failsafe\n",
}
"""Of packages that rosbags does not have."""

HEADER = ros.Header(ros.Time(-3, 999_999_999), "odom")
POSE = ros.Pose(ros.Point(1.5, -2.0, 1e300), ros.Quaternion(0.1, 0.2, 0.3, 0.4))
TWIST = ros.Twist(ros.Vector3(1.0, 2.0, 3.0), ros.Vector3(-4.0, float("nan"), float("inf")))
TRANSFORM = ros.TransformStamped(
    HEADER, "base_link", ros.Transform(ros.Vector3(7.0, 8.0, 9.0), ros.Quaternion(1.0, 0.0, 0.0, 0.0))
)
COVARIANCE = [float(number) for number in range(36)]
GEO_POINT = ros.GeoPoint(-35.36, 149.16, 584.0)
SAMPLES = {
    "builtin_interfaces/msg/Time": ros.Time(7, 8),
    "std_msgs/msg/Header": HEADER,
    "geometry_msgs/msg/PoseStamped": ros.PoseStamped(HEADER, POSE),
    "geometry_msgs/msg/PoseWithCovarianceStamped": ros.PoseWithCovarianceStamped(
        HEADER, ros.PoseWithCovariance(POSE, COVARIANCE)
    ),
    "geometry_msgs/msg/TwistStamped": ros.TwistStamped(HEADER, TWIST),
    "geometry_msgs/msg/TransformStamped": TRANSFORM,
    "tf2_msgs/msg/TFMessage": ros.TFMessage([TRANSFORM, ros.TransformStamped(child_frame_id="a")]),
    "nav_msgs/msg/Odometry": ros.Odometry(
        HEADER, "b", ros.PoseWithCovariance(POSE, COVARIANCE), ros.TwistWithCovariance(TWIST, COVARIANCE)
    ),
    "sensor_msgs/msg/Imu": ros.Imu(HEADER, linear_acceleration=ros.Vector3(0.0, 0.0, 9.8)),
    "rosgraph_msgs/msg/Clock": ros.Clock(ros.Time(1, 2)),
    "geographic_msgs/msg/GeoPointStamped": ros.GeoPointStamped(HEADER, GEO_POINT),
    "geographic_msgs/msg/GeoPoseStamped": ros.GeoPoseStamped(HEADER, ros.GeoPose(GEO_POINT)),
    "ardupilot_msgs/msg/Status": ros.Status(HEADER, 2, True, 4, False, True, [24, 21]),
}


@pytest.fixture(scope="module")
def store() -> Any:
    found = get_typestore(Stores.ROS2_HUMBLE)
    for name, text in OTHERS.items():
        found.register(get_types_from_msg(text, name))
    return found


def in_store(store: Any, sample: Any) -> Any:
    """Return the same message as rosbags has it, found by the DDS name of its type."""
    package, kind, _, name = sample.__idl__.idl_transformed_typename.split("::")
    kept = store.types[f"{package}/{kind}/{name.removesuffix('_')}"]
    return kept(**{member.name: _value(store, getattr(sample, member.name)) for member in fields(sample)})


def _value(store: Any, value: Any) -> Any:
    if is_dataclass(value):
        return in_store(store, value)
    if isinstance(value, list) and not any(map(is_dataclass, value)):
        return np.array(value, np.float64 if len(value) > 2 else np.uint8)
    return [in_store(store, each) for each in value] if isinstance(value, list) else value


@pytest.mark.parametrize("name", SAMPLES)
def test_bytes_and_type_name_are_those_of_ros_2(store: Any, name: str) -> None:
    sample: Any = SAMPLES[name]
    theirs = bytes(store.serialize_cdr(in_store(store, sample), name))
    ours = bytes(sample.serialize())
    # What pads the end of a message to 4 bytes is said in its head, and none of it.
    assert (ours[:2], ours[4 : len(theirs)]) == (theirs[:2], theirs[4:])
    assert len(ours) - len(theirs) in range(4)
    assert sample.deserialize(theirs).serialize() == sample.serialize()


def test_names_are_those_that_ros_2_has_in_dds() -> None:
    assert topic_name("/ap/tf") == topic_name("ap/tf") == "rt/ap/tf"
    assert service_names("/ap/arm_motors") == ("rq/ap/arm_motorsRequest", "rr/ap/arm_motorsReply")
    assert ros.TFMessage.__idl__.idl_transformed_typename == "tf2_msgs::msg::dds_::TFMessage_"
    assert ros.ArmMotorsRequest.__idl__.idl_transformed_typename == "ardupilot_msgs::srv::dds_::ArmMotors_Request_"


def test_request_begins_with_who_asks_and_its_number() -> None:
    asked = ros.ModeSwitchRequest(ros.RequestId(0x1122334455667788, 9), 4)
    assert bytes(asked.serialize())[4:21].hex() == "8877665544332211" + "09" + "00" * 7 + "04"
