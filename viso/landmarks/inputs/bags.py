# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Bags of ROS 1 and ROS 2, MCAP among them, through rosbags (the extra ``bags``).

A topic may be missing from a bag, but not all of them. Odometry (or a stamped pose) is in ENU unless said to be in NED;
``CameraInfo`` and ``NavSatFix`` are ROS messages, and the others are JSON in ``std_msgs/String``, as
``viso.landmarks.inputs.json_lines`` describes it.
"""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

from viso.landmarks.inputs.base import (
    LARGEST_M,
    LARGEST_S,
    InputFileError,
    Refused,
    counted,
    not_null_island,
    pose_from_enu,
    pose_from_ned,
    rotation_of_quat,
)
from viso.landmarks.inputs.json_lines import JsonReader
from viso.landmarks.types import CameraInfo, Event, GeodeticPoint, GlobalFix
from viso.streams.bag_formats import opened_bag

STRING: Final = "std_msgs/msg/String"
POSES: Final = frozenset(
    {"nav_msgs/msg/Odometry", "geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/PoseWithCovarianceStamped"}
)
CAMERA_INFO: Final = "sensor_msgs/msg/CameraInfo"
FIX: Final = "sensor_msgs/msg/NavSatFix"


_TOPICS: Final[Mapping[str, frozenset[str]]] = MappingProxyType(
    {
        "/mavros/local_position/odom": POSES,
        "/stereo/left/camera_info": frozenset({CAMERA_INFO}),
        "/mavros/global_position/global": frozenset({FIX}),
        "/mavros/global_position/raw/fix": frozenset({FIX}),
        "/vo/landmarks": frozenset({STRING}),
        "/vo/landmark_observations": frozenset({STRING}),
        "/adsb/adsb_aircraft_state_vectors_node/aircraft_state_vectors": frozenset({STRING}),
        "/adsb/rtl_adsb_decoder_node/estimated_position": frozenset({STRING}),
    }
)
"""The record types of each topic; any JSON record may come on any text topic, and fixes are above the ellipsoid."""


class BagFile:
    """A .bag, .mcap or .db3 file, or the folder of a ROS 2 bag.

    Times are those of the stamps, or of the recording for messages without one. Odometry in NED has its body in FRD.
    """

    def __init__(self, path: Path, *, odometry_is_ned: bool = False) -> None:
        self._path = path
        self._is_ned = odometry_is_ned
        self._json = JsonReader()
        self.refused: Counter[str] = self._json.refused
        self._readers: Mapping[str, Callable[[float, Any], list[Event]]] = {
            STRING: lambda bag_s, message: self._json.take(message.data, bag_s),
            CAMERA_INFO: self._camera_info,
            FIX: self._fix,
            **dict.fromkeys(POSES, self._pose),
        }

    def events(self) -> Iterator[Event]:
        """Yield the bag's events. Raises InputFileError if it cannot be read, or has none of the topics."""
        with opened_bag(self._path, InputFileError) as reader:
            for connection, time_ns, data in reader.messages(self._chosen(reader.connections)):
                message = reader.deserialize(data, connection.msgtype)
                events: list[Event] = []
                with counted(self.refused):
                    events = self._readers[connection.msgtype](time_ns * 1e-9, message)
                yield from events

    def _chosen(self, connections: list[Any]) -> list[Any]:
        chosen = [c for c in connections if c.msgtype in _TOPICS.get(c.topic, ())]
        if not chosen:
            there = ", ".join(sorted({f"{c.topic} ({c.msgtype})" for c in connections})) or "none at all"
            raise InputFileError(f"{self._path}: none of the topics that are read; there are: {there}")
        return chosen

    def _pose(self, bag_s: float, message: Any) -> list[Event]:
        pose = message.pose.pose if hasattr(message.pose, "pose") else message.pose
        at, quat = pose.position, pose.orientation
        attitude = rotation_of_quat((quat.w, quat.x, quat.y, quat.z))
        make = pose_from_ned if self._is_ned else pose_from_enu
        return [make(_time_s(bag_s, message), (at.x, at.y, at.z), attitude)]

    def _camera_info(self, bag_s: float, message: Any) -> list[Event]:
        # ROS 1 has its name in upper case.
        fx_px, _, cx_px, _, fy_px, cy_px, *_ = map(float, message.k if hasattr(message, "k") else message.K)
        size = int(message.width), int(message.height)
        return [CameraInfo(_time_s(bag_s, message), *size, fx_px, fy_px, cx_px, cy_px)]

    def _fix(self, bag_s: float, message: Any) -> list[Event]:
        if message.status.status < 0:
            raise Refused("a fix that is none")
        not_null_island(message.latitude, message.longitude)
        if not abs(message.altitude) <= LARGEST_M:
            raise Refused("a fix without a height")
        point = GeodeticPoint(float(message.latitude), float(message.longitude), float(message.altitude))
        return [GlobalFix(_time_s(bag_s, message), point)]


def _time_s(bag_s: float, message: Any) -> float:
    stamp = message.header.stamp
    t_s = (int(stamp.sec) + int(stamp.nanosec) * 1e-9) or bag_s
    if not abs(t_s) <= LARGEST_S:
        raise Refused("time is out of range")
    return t_s
