# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Trajectories in bags of ROS 1 and ROS 2, MCAP among them, through rosbags (the extra ``bags``)."""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final, TypeAlias

from viso.extras import pip_install
from viso.geometry.rotation import rotation_from_quat_wxyz
from viso.geometry.trajectory import TIME_END_NS
from viso.geometry.trajectory_files import Records, TrajectoryError

MISSING_EXTRA: Final = f"bags are read with rosbags; install it with: {pip_install('bags')}"
LONGEST_REASON: Final = 200  # some quote what they could not parse
_UNKNOWN: Final = (math.nan,) * 36


@dataclass(frozen=True, slots=True)
class _Record:
    """A pose; velocity in the body, or in the world where ``velocity_in_world``; 36 numbers of covariance."""

    position: Any
    quat: Any
    velocity: Any = None
    velocity_in_world: bool = False
    covariance: Any = _UNKNOWN


def _odometry(message: Any) -> _Record:
    pose = message.pose.pose
    # The velocity is in the child's frame by the definition. VINS names no child, or the world, and means the world.
    in_world = message.child_frame_id in ("", message.header.frame_id)
    return _Record(pose.position, pose.orientation, message.twist.twist.linear, in_world, message.pose.covariance)


def _pose(message: Any) -> _Record:
    return _Record(message.pose.position, message.pose.orientation)


def _pose_with_covariance(message: Any) -> _Record:
    pose = message.pose.pose
    return _Record(pose.position, pose.orientation, covariance=message.pose.covariance)


def _transform(message: Any) -> _Record:
    return _Record(message.transform.translation, message.transform.rotation)


POSE_TYPES: Final[Mapping[str, Callable[[Any], _Record]]] = MappingProxyType(
    {
        "nav_msgs/msg/Odometry": _odometry,
        "geometry_msgs/msg/PoseStamped": _pose,
        "geometry_msgs/msg/PoseWithCovarianceStamped": _pose_with_covariance,
        "geometry_msgs/msg/TransformStamped": _transform,
    }
)

_WITHOUT_STAMP: Final[Mapping[str, str]] = MappingProxyType(
    {
        "geometry_msgs/msg/Pose": "geometry_msgs/msg/PoseStamped",
        "geometry_msgs/msg/Pose2D": "geometry_msgs/msg/PoseStamped",
        "geometry_msgs/msg/PoseWithCovariance": "geometry_msgs/msg/PoseWithCovarianceStamped",
        "geometry_msgs/msg/Transform": "geometry_msgs/msg/TransformStamped",
    }
)
FRAME_TYPES: Final = frozenset({"tf2_msgs/msg/TFMessage", "tf/msg/tfMessage"})
PoseMessage: TypeAlias = tuple[int, str, Any]
"""When it came in ns, its type, one of ``POSE_TYPES``, and its content."""


def bag_records(path: Path, topic: str | None) -> Records:
    """Read the poses of a topic, by default of the only one that has any; of transforms it is ``/tf:PARENT.CHILD``.

    Raises TrajectoryError if the bag cannot be read, rosbags is missing, or the topic is not clear.
    """
    with opened_bag(path, TrajectoryError) as reader:
        connections = _transforming(reader.connections, topic)
        chosen = connections or _choose(path, reader.connections, topic)
        messages = (
            (time_ns, connection.msgtype, reader.deserialize(data, connection.msgtype))
            for connection, time_ns, data in reader.messages(chosen)
        )
        return collect(str(path), _of_frames(path, messages, topic or "/tf") if connections else messages)


@contextmanager
def opened_bag(path: Path, error_type: type[Exception]) -> Iterator[Any]:
    """Open a bag with rosbags' AnyReader, and turn whatever reading raises into one line that names the file.

    An error of that type passes as it is.
    """
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore

        # Old bags of ROS 2 do not hold their types.
        with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
            yield reader
    except error_type:
        raise
    except ModuleNotFoundError as error:
        raise error_type(f"{path}: {MISSING_EXTRA}") from error
    except Exception as error:  # what damage makes rosbags and what is below it raise has no common base
        reason = getattr(error, "strerror", None) or str(error) or type(error).__name__
        raise error_type(f"{path}: not a readable bag: {reason[:LONGEST_REASON]}") from error


def _choose(path: Path, connections: list[Any], topic: str | None) -> list[Any]:
    fitting = [connection for connection in connections if connection.msgtype in POSE_TYPES]
    names = sorted({connection.topic for connection in fitting})
    if topic is None and len(names) == 1:
        topic = names[0]
    chosen = [connection for connection in fitting if connection.topic == topic]
    if chosen:
        return chosen
    types = {connection.topic: connection.msgtype for connection in fitting}
    listed = ", ".join(f"{name} ({types[name]})" for name in names) or f"none of {', '.join(POSE_TYPES)}"
    unstamped = {one.topic: one.msgtype for one in connections if one.msgtype in _WITHOUT_STAMP}
    if topic in unstamped or (unstamped and topic is None and not names):
        name = topic if topic in unstamped else min(unstamped)
        instead = _WITHOUT_STAMP[unstamped[name]]
        raise TrajectoryError(
            f"{path}: {name} is {unstamped[name]}, which has no time of its own: nothing tells when a pose was "
            f"measured; publish and record {instead}"
        )
    what = "which topic is not clear" if topic is None else f"no poses on the topic {topic}"
    raise TrajectoryError(f"{path}: {what}; there are: {listed}")


def _transforming(connections: list[Any], topic: str | None) -> list[Any]:
    """Return the connections of transforms between frames, if the topic names them or there are no other poses."""
    if topic is None and any(connection.msgtype in POSE_TYPES for connection in connections):
        return []
    name = "/tf" if topic is None else topic.partition(":")[0]
    return [one for one in connections if one.msgtype in FRAME_TYPES and one.topic == name]


def _of_frames(path: Path, messages: Iterator[PoseMessage], topic: str) -> Iterator[PoseMessage]:
    """Return the transforms from one frame to another, named ``/tf:PARENT.CHILD``, or those of the only two."""
    name, _, wanted = topic.partition(":")
    found: dict[str, list[PoseMessage]] = {}
    for time_ns, _kind, message in messages:
        for one in message.transforms:
            frames = f"{one.header.frame_id}.{one.child_frame_id}"
            found.setdefault(frames, []).append((time_ns, "geometry_msgs/msg/TransformStamped", one))
    if not wanted and len(found) == 1:
        (wanted,) = found
    if wanted not in found:
        listed = ", ".join(f"{name}:{frames} ({len(found[frames])} times)" for frames in sorted(found)) or "none"
        what = f"no transforms {wanted}" if wanted else "which transforms between frames is not clear"
        raise TrajectoryError(f"{path}: {what}; there are: {listed}")
    return iter(found[wanted])


def collect(source: str, messages: Iterable[PoseMessage]) -> Records:
    """Return what messages hold, as it stands there; raises TrajectoryError, naming their source, for no time."""
    times_ns: list[int] = []
    arrivals_ns: list[int] = []
    records: list[_Record] = []
    for number, (bag_time_ns, kind, message) in enumerate(messages, 1):
        stamp = message.header.stamp
        time_ns = int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)
        if not 0 <= (time_ns or bag_time_ns) < TIME_END_NS:
            raise TrajectoryError(f"{source}: message {number}: not a time: {time_ns or bag_time_ns} ns")
        times_ns.append(time_ns)
        arrivals_ns.append(bag_time_ns)
        records.append(POSE_TYPES[kind](message))
    has_arrivals = all(0 <= time_ns < TIME_END_NS for time_ns in arrivals_ns)
    has_velocity = all(record.velocity is not None for record in records)
    return Records(
        source,
        times_ns,
        [_xyz(record.position) for record in records],
        [_wxyz(record.quat) for record in records],
        [_world_velocity(record) for record in records] if has_velocity else None,
        [[record.covariance[row : row + 6] for row in range(0, 36, 6)] for record in records],
        arrivals_ns if has_arrivals else None,
    )


def _xyz(vector: Any) -> list[float]:
    return [vector.x, vector.y, vector.z]


def _wxyz(quat: Any) -> list[float]:
    return [quat.w, quat.x, quat.y, quat.z]


def _world_velocity(record: _Record) -> list[float]:
    velocity = _xyz(record.velocity)
    if record.velocity_in_world:
        return velocity
    try:
        return list((rotation_from_quat_wxyz(_wxyz(record.quat)) @ velocity).tolist())
    except ValueError:  # no rotation: the record will be left out
        return velocity
