# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes streams as those who record odometry would: TUM, EuRoC's csv, bags of ROS 1 and ROS 2, MCAP."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import numpy as np
import quaternion

from mav_handlers.wire.codec import Codec, Received
from mav_handlers.wire.messages import ODOMETRY, VISION_POSITION_ESTIMATE, VISION_SPEED_ESTIMATE
from viso.geometry.rotation import quats_from_euler, rotate
from viso.streams.stream_kinds import Stream

UNKNOWN: Final = (math.nan,) * 3


@dataclass(slots=True)
class Row:
    """A pose in the autopilot's axes: times in us, m, w x y z, m/s in the world, and 21 numbers of covariance."""

    arrival_us: int
    stamp_us: int
    position: tuple[float, ...]
    quat_wxyz: tuple[float, ...]
    velocity: tuple[float, ...] = UNKNOWN
    covariance: tuple[float, ...] = ()


def rows_of(stream: Stream) -> list[Row]:
    """Return what the poses of a stream say; a velocity of its own belongs to the pose of its stamp."""
    codec, rows, speeds = Codec(0, 0), [], {}
    for message in stream.messages:
        codec.feed(message.frame)
        received = codec.next_received()
        if not isinstance(received, Received):
            continue
        told, arrival_us = received.message, message.arrival_us or 0
        if isinstance(told, VISION_SPEED_ESTIMATE):
            speeds[told.usec] = told.x, told.y, told.z
        elif isinstance(told, VISION_POSITION_ESTIMATE):
            quat = quats_from_euler([[told.roll, told.pitch, told.yaw]])[0]
            rows.append(Row(arrival_us, told.usec, (told.x, told.y, told.z), tuple(quat), covariance=told.covariance))
        elif isinstance(told, ODOMETRY):
            body = np.array([[told.vx, told.vy, told.vz]])
            velocity = tuple(rotate(np.array([told.q]), body)[0])
            place = told.x, told.y, told.z
            rows.append(Row(arrival_us, told.time_usec, place, told.q, velocity, told.pose_covariance))
    for row in rows:
        row.velocity = speeds.get(row.stamp_us, row.velocity)
    return rows


def as_ros(rows: Sequence[Row]) -> list[Row]:
    """Return rows in the axes of ROS, ENU and FLU; covariances are left out."""
    world, body = quaternion.quaternion(0, math.sqrt(0.5), math.sqrt(0.5), 0), quaternion.quaternion(0, 1, 0, 0)

    def enu(x: float, y: float, z: float) -> tuple[float, ...]:
        return y, x, -z

    return [
        Row(
            row.arrival_us,
            row.stamp_us,
            enu(*row.position),
            tuple(quaternion.as_float_array(world * quaternion.quaternion(*row.quat_wxyz) * body)),
            enu(*row.velocity),
        )
        for row in rows
    ]


def _text(folder: Path, name: str, lines: list[str]) -> Path:
    path = folder / name
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def _xyzw(quat_wxyz: Sequence[float]) -> tuple[float, ...]:
    return (*quat_wxyz[1:], quat_wxyz[0])


def tum(folder: Path, rows: Sequence[Row]) -> Path:
    """Write poses alone."""
    return _text(
        folder,
        "poses.tum",
        [
            " ".join([f"{row.stamp_us / 1e6:.6f}", *map(repr, map(float, (*row.position, *_xyzw(row.quat_wxyz))))])
            for row in rows
        ],
    )


def euroc(folder: Path, rows: Sequence[Row]) -> Path:
    """Write poses with velocities."""
    return _text(
        folder,
        "poses.csv",
        ["#timestamp [ns],x,y,z,qw,qx,qy,qz,vx,vy,vz"]
        + [
            ",".join([str(row.stamp_us * 1000), *map(repr, map(float, (*row.position, *row.quat_wxyz, *row.velocity)))])
            for row in rows
        ],
    )


def _matrix(covariance: tuple[float, ...]) -> Any:
    matrix = np.zeros((6, 6))
    if covariance:
        matrix[np.triu_indices(6)] = covariance
        matrix += np.triu(matrix, 1).T
    return matrix.flatten()


def _odometry(version: int, store: Any, row: Row, sequence: int) -> Any:
    """Return nav_msgs/Odometry, whose velocity is in the body."""

    def new(kind: str, *args: Any) -> Any:
        return store.types[kind](*args)

    def three(kind: str, values: Sequence[float]) -> Any:
        return new(f"geometry_msgs/msg/{kind}", *map(float, values))

    seconds, rest_us = divmod(row.stamp_us, 1_000_000)
    stamp = new("builtin_interfaces/msg/Time", seconds, rest_us * 1000)
    header = new("std_msgs/msg/Header", *((sequence,) if version == 1 else ()), stamp, "odom")
    attitude = three("Quaternion", _xyzw(row.quat_wxyz))
    pose = new("geometry_msgs/msg/Pose", three("Point", row.position), attitude)
    back = np.array([row.quat_wxyz]) * np.array([1.0, -1.0, -1.0, -1.0])
    body = rotate(back, np.array([row.velocity]))[0]
    twist = new("geometry_msgs/msg/Twist", three("Vector3", body), three("Vector3", (0, 0, 0)))
    return new(
        "nav_msgs/msg/Odometry",
        header,
        "base_link",
        new("geometry_msgs/msg/PoseWithCovariance", pose, _matrix(row.covariance)),
        new("geometry_msgs/msg/TwistWithCovariance", twist, np.zeros(36)),
    )


def _bag(version: int, writer: Any, rows: Sequence[Row]) -> None:
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if version == 1 else Stores.ROS2_HUMBLE)
    kind = "nav_msgs/msg/Odometry"
    serialize = store.serialize_ros1 if version == 1 else store.serialize_cdr
    with writer:
        connection = writer.add_connection("/odometry", kind, typestore=store)
        for sequence, row in enumerate(rows):
            data = serialize(_odometry(version, store, row, sequence), kind)
            writer.write(connection, row.arrival_us * 1000, data)


def bag(folder: Path, rows: Sequence[Row]) -> Path:
    """Write a bag of ROS 1, with the times of arrival."""
    from rosbags.rosbag1 import Writer

    path = folder / "poses.bag"
    _bag(1, Writer(path), rows)
    return path


def db3(folder: Path, rows: Sequence[Row]) -> Path:
    """Write a bag of ROS 2 as SQLite; return its folder."""
    from rosbags.rosbag2 import StoragePlugin, Writer

    _bag(2, Writer(folder / "poses", version=9, storage_plugin=StoragePlugin.SQLITE3), rows)
    return folder / "poses"


def mcap(folder: Path, rows: Sequence[Row]) -> Path:
    """Write a bag of ROS 2 as MCAP; return that file."""
    from rosbags.rosbag2 import StoragePlugin, Writer

    _bag(2, Writer(folder / "poses", version=9, storage_plugin=StoragePlugin.MCAP), rows)
    return next((folder / "poses").glob("*.mcap"))


WRITERS: Final[Mapping[str, Callable[[Path, Sequence[Row]], Path]]] = MappingProxyType(
    {"tum": tum, "euroc": euroc, "bag": bag, "db3": db3, "mcap": mcap}
)
