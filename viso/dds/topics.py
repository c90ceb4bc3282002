# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the autopilot tells on topics of ROS 2, how often, and in which frames.

A message lives as long as its topic: what is unknown at the moment keeps its last value.
Source: AP_DDS/AP_DDS_Topic_Table.h, AP_DDS/AP_DDS_config.h and AP_DDS/AP_DDS_Client.cpp, update_topic.
"""

from collections.abc import Callable
from typing import Any, Final, NamedTuple

from ap_core.fmath import f32, sqrtf
from ap_core.location import Location
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from mav_handlers.senders.inertial import accel_mss
from viso.dds import messages as ros
from viso.dds.graph import LATCHED, SENSOR_DATA, Qos
from viso.vehicle.vehicle import Vehicle

BASE_LINK: Final = "base_link"
BASE_LINK_NED: Final = "base_link_ned"
APM_ARDUCOPTER: Final = 2
FS_EKF: Final = 24

_TIMES: Final = Qos(reliable=True, lasting=False, depth=20)
_HALF_ROOT_2: Final = sqrtf(f32(2)) * f32(0.5)
_QUARTER_TURN: Final = Quaternion(_HALF_ROOT_2, 0, 0, _HALF_ROOT_2)
# FIRMWARE PARITY: literals are float32, so a place on earth is given to some decimetres.
_1E_7: Final = f32(1e-7)
_CENTI: Final = f32(0.01)


def now(vehicle: Vehicle) -> ros.Time:
    """Return the time of day, or since boot while that is unknown."""
    time_us = vehicle.rtc.utc_us() or vehicle.clock.micros64()
    return ros.Time(time_us // 1_000_000, time_us % 1_000_000 * 1000)


def _stamp(header: ros.Header, vehicle: Vehicle, frame_id: str) -> None:
    header.stamp, header.frame_id = now(vehicle), frame_id


def _put(target: Any, values: tuple[Any, Any, Any]) -> None:
    target.x, target.y, target.z = map(float, values)


def _enu(ned: Vector3f) -> tuple[Any, Any, Any]:
    return ned.y, ned.x, -ned.z


def _put_attitude(target: ros.Quaternion, vehicle: Vehicle) -> None:
    """Tell the attitude of the body with x forward, y left, z up in east, north, up."""
    quat = vehicle.ahrs.get_quaternion()
    if quat is None:
        target.w, target.x, target.y, target.z = 1.0, 0.0, 0.0, 0.0
        return
    turned = Quaternion(quat.q1, quat.q3, quat.q2, -quat.q4) * _QUARTER_TURN
    target.w, target.x, target.y, target.z = map(float, turned.to_wxyz())


def _put_place(target: ros.GeoPoint, place: Location | None) -> None:
    if place is not None:
        target.latitude, target.longitude = float(f32(place.lat) * _1E_7), float(f32(place.lng) * _1E_7)
        target.altitude = float(f32(place.alt_cm) * _CENTI)


def _time(vehicle: Vehicle, message: ros.Time) -> bool:
    time = now(vehicle)
    message.sec, message.nanosec = time.sec, time.nanosec
    return True


def _pose(vehicle: Vehicle, message: ros.PoseStamped) -> bool:
    _stamp(message.header, vehicle, BASE_LINK)
    home, place = vehicle.copter.home.place, vehicle.ahrs.get_location()
    if home is not None and place is not None:
        _put(message.pose.position, _enu(home.distance_ned(place)))
    _put_attitude(message.pose.orientation, vehicle)
    return True


def _twist(vehicle: Vehicle, message: ros.TwistStamped) -> bool:
    _stamp(message.header, vehicle, BASE_LINK)
    velocity = vehicle.ahrs.get_velocity_NED()
    if velocity is not None:
        _put(message.twist.linear, _enu(velocity))
    rates = vehicle.ahrs.get_gyro()
    _put(message.twist.angular, (rates.x, -rates.y, -rates.z))
    return True


def _imu(vehicle: Vehicle, message: ros.Imu) -> bool:
    _stamp(message.header, vehicle, BASE_LINK_NED)
    quat = vehicle.ahrs.get_quaternion() or Quaternion(0, 0, 0, 1)
    # FIRMWARE PARITY: w, x, y, z of body to NED stand where x, y, z, w should; without an attitude it is the identity.
    q = message.orientation
    q.x, q.y, q.z, q.w = map(float, quat.to_wxyz())
    acceleration, rates = vehicle.ahrs.get_imu() or (accel_mss(vehicle), vehicle.ahrs.get_gyro())
    _put(message.linear_acceleration, acceleration.to_tuple())
    _put(message.angular_velocity, rates.to_tuple())
    for covariance in (
        message.orientation_covariance,
        message.angular_velocity_covariance,
        message.linear_acceleration_covariance,
    ):
        covariance[0] = vehicle.firmware.dds.unknown_covariance
    return True


def _geo_pose(vehicle: Vehicle, message: ros.GeoPoseStamped) -> bool:
    _stamp(message.header, vehicle, BASE_LINK)
    _put_place(message.pose.position, vehicle.ahrs.get_location())
    _put_attitude(message.pose.orientation, vehicle)
    return True


def _clock(vehicle: Vehicle, message: ros.Clock) -> bool:
    return _time(vehicle, message.clock)


def _origin(vehicle: Vehicle, message: ros.GeoPointStamped) -> bool:
    _stamp(message.header, vehicle, BASE_LINK)
    _put_place(message.position, vehicle.ahrs.origin())
    return True


def _status(vehicle: Vehicle, message: ros.Status) -> bool:
    """Return what has changed, and in some releases now and then what has not."""
    copter, last = vehicle.copter, message.header.stamp
    values = (
        APM_ARDUCOPTER,
        copter.is_armed(),
        copter.custom_mode(),
        not copter.is_landed(),
        True,
        [FS_EKF] if copter.is_in_failsafe() else [],
    )
    before = message.vehicle_type, message.armed, message.mode, message.flying, message.external_control
    stamp, again_ms = now(vehicle), vehicle.firmware.dds.status_again_ms
    since_ms = (stamp.sec - last.sec) * 1000 + (stamp.nanosec - last.nanosec) // 1_000_000
    is_new = values[:5] != before or len(values[5]) != len(message.failsafe)
    if not is_new and (again_ms is None or since_ms <= again_ms):
        return False
    message.vehicle_type, message.armed, message.mode, message.flying, message.external_control = values[:5]
    message.failsafe = values[5]
    message.header.stamp = stamp
    return True


def static_transforms(vehicle: Vehicle) -> ros.TFMessage:
    """Return where the antenna of the GPS is: in the IMU (AP_DDS_Client::populate_static_transforms)."""
    if vehicle.params.get_int("GPS1_TYPE") == 0:
        return ros.TFMessage()
    transform = ros.TransformStamped(child_frame_id="GPS_0")
    _stamp(transform.header, vehicle, BASE_LINK)
    _put(transform.transform.translation, (0.0, -0.0, -0.0))
    return ros.TFMessage([transform])


class Topic(NamedTuple):
    """A topic that the autopilot writes once more than ``delay_ms`` have passed.

    ``update`` makes the message say what is so now, and returns whether it is to be written.
    """

    name: str
    message: type[Any]
    qos: Qos
    delay_ms: int
    update: Callable[[Vehicle, Any], bool]


STATIC_TF: Final = "/ap/tf_static"
TOPICS: Final = (
    Topic("/ap/time", ros.Time, _TIMES, 10, _time),
    Topic("/ap/pose/filtered", ros.PoseStamped, SENSOR_DATA, 33, _pose),
    Topic("/ap/twist/filtered", ros.TwistStamped, SENSOR_DATA, 33, _twist),
    Topic("/ap/imu/experimental/data", ros.Imu, SENSOR_DATA, 5, _imu),
    Topic("/ap/geopose/filtered", ros.GeoPoseStamped, SENSOR_DATA, 33, _geo_pose),
    Topic("/ap/clock", ros.Clock, _TIMES, 10, _clock),
    Topic("/ap/gps_global_origin/filtered", ros.GeoPointStamped, SENSOR_DATA, 1000, _origin),
    Topic("/ap/status", ros.Status, LATCHED, 100, _status),
)
"""In the firmware's order; /ap/tf_static is written once, at boot."""
