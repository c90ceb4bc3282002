# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Trajectories of a log for other tools: TUM, CSV, MCAP.

TUM and MCAP are in the axes of ROS (REP 103): x east, y north, z up; the body x forward, y left, z up. CSV is as the
log is: north, east, down. Times are seconds since boot; vision is stamped with the time that its measurement is of.
"""

import csv
import io
import math
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np

from viso.errors import InputError
from viso.estimators.series import Array
from viso.geometry.frame_change import axes_matrix
from viso.geometry.rotation import quat_wxyz_from_rotation, rotations_from_euler
from viso.report.agreement import Poses, ekf_poses, interpolated, lag_ms, vision_poses
from viso.report.flight_data import Material, position_moves
from viso.streams.bag_formats import MISSING_EXTRA

VISION_TOPIC: Final = "/vision/pose"
EKF_TOPIC: Final = "/ekf/odometry"
_FRAME: Final = "map"
_BODY: Final = "base_link"
_WORLD: Final = axes_matrix("ENU").T  # from NED
_FROM_FLU: Final = axes_matrix("FLU")
_CSV_NUMBERS: Final = ("north_m", "east_m", "down_m", "roll_deg", "pitch_deg", "yaw_deg", "vn_m_s", "ve_m_s", "vd_m_s")
_CSV_HEAD: Final = (
    "time_s",
    *(f"vision_{name}" for name in _CSV_NUMBERS),
    *(f"ekf_{name}" for name in _CSV_NUMBERS),
    "logged_s",
    "lag_ms",
    "reset_counter",
    "withheld",
    "quality",
)


def usable(poses: Poses) -> Poses:
    """Return poses that a trajectory can have: finite, and each later than the one before."""
    known = np.isfinite(np.column_stack([poses.time_s, poses.pos_ned, poses.rpy_deg]))
    kept = poses.where(np.asarray(known.all(axis=1)))
    _, first = np.unique(kept.time_s, return_index=True)
    return kept.where(first)


def trajectories(material: Material) -> dict[str, Poses]:
    """Return the trajectories that a log has, by the names vision and ekf."""
    found = {"vision": usable(vision_poses(material)), "ekf": usable(ekf_poses(material))}
    return {name: poses for name, poses in found.items() if len(poses.time_s)}


def in_ros_axes(poses: Poses) -> Iterator[tuple[float, Array, Array, Array]]:
    """Yield time in s, position ENU in m, quaternion w, x, y, z from FLU to ENU, and velocity FLU in m/s."""
    matrices = rotations_from_euler(np.radians(poses.rpy_deg))
    for time_s, pos, vel, matrix in zip(poses.time_s, poses.pos_ned, poses.vel_ned, matrices, strict=True):
        body_to_world = _WORLD @ matrix @ _FROM_FLU
        yield float(time_s), _WORLD @ pos, quat_wxyz_from_rotation(body_to_world), body_to_world.T @ (_WORLD @ vel)


def tum_text(poses: Poses) -> str:
    """Return a trajectory in the TUM format: time in s, position in m, quaternion x, y, z, w."""
    lines = ["# timestamp tx ty tz qx qy qz qw; seconds since boot, ENU, FLU"]
    for time_s, pos, quat, _ in in_ros_axes(poses):
        numbers = " ".join(f"{value:.6f}" for value in (*pos, *quat[1:], quat[0]))
        lines.append(f"{time_s:.6f} {numbers}")
    return "\n".join(lines) + "\n"


def csv_text(material: Material) -> str:
    """Return a row for each pose of vision with the EKF's at the same instant; without vision, the EKF's rows."""
    vision, ekf, visp = vision_poses(material), ekf_poses(material), material.visp
    has_vision = bool(len(vision.time_s))
    if not has_vision:
        nothing = np.full((len(ekf.time_s), 3), np.nan)
        vision = Poses(ekf.time_s, nothing, nothing, nothing)
    beside = interpolated(ekf, vision.time_s, position_moves(material.xkf4)[0]) if has_vision else ekf
    extra = np.full((len(vision.time_s), 5), np.nan)
    if has_vision:
        extra = np.column_stack([visp.time_s, lag_ms(visp), visp["Rst"], visp["Ign"], visp["Q"]])
    parts = (vision.pos_ned, vision.rpy_deg, vision.vel_ned, beside.pos_ned, beside.rpy_deg, beside.vel_ned, extra)
    table = np.column_stack([vision.time_s, *parts])
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(_CSV_HEAD)
    writer.writerows([["" if math.isnan(value) else f"{value:.9g}" for value in row] for row in table.tolist()])
    return text.getvalue()


def mcap_bytes(material: Material, on_progress: Callable[[int, int], None]) -> bytes:
    """Return a bag of ROS 2 as one MCAP file with its message definitions.

    Vision is geometry_msgs/PoseStamped on VISION_TOPIC, the EKF nav_msgs/Odometry on EKF_TOPIC.

    Raises:
        InputError: without the extra ``bags``.
    """
    try:
        from rosbags.rosbag2 import StoragePlugin, Writer
        from rosbags.typesys import Stores, get_typestore
    except ModuleNotFoundError as error:
        raise InputError(f"--mcap: {MISSING_EXTRA}") from error
    store = get_typestore(Stores.ROS2_HUMBLE)
    kinds = {
        "vision": (VISION_TOPIC, "geometry_msgs/msg/PoseStamped", _pose_stamped),
        "ekf": (EKF_TOPIC, "nav_msgs/msg/Odometry", _odometry),
    }
    rows = [
        (round(sample[0] * 1e9), name, sample)
        for name, poses in trajectories(material).items()
        for sample in in_ros_axes(poses)
    ]
    rows.sort(key=lambda row: row[0])
    with tempfile.TemporaryDirectory() as folder:
        bag = Path(folder) / "bag"
        with Writer(bag, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
            connections = {
                name: writer.add_connection(topic, kind, typestore=store) for name, (topic, kind, _) in kinds.items()
            }
            for number, (time_ns, name, sample) in enumerate(rows):
                _, kind, make = kinds[name]
                message = make(store.types, time_ns, *sample[1:])
                writer.write(connections[name], time_ns, store.serialize_cdr(message, kind))
                on_progress(number, len(rows))
        (path,) = bag.glob("*.mcap")
        return path.read_bytes()


def _header(types: Any, time_ns: int) -> Any:
    seconds, rest = divmod(time_ns, 1_000_000_000)
    stamp = types["builtin_interfaces/msg/Time"](sec=seconds, nanosec=rest)
    return types["std_msgs/msg/Header"](stamp=stamp, frame_id=_FRAME)


def _pose(types: Any, pos: Array, quat_wxyz: Array) -> Any:
    point = types["geometry_msgs/msg/Point"](*map(float, pos))
    w, x, y, z = map(float, quat_wxyz)
    return types["geometry_msgs/msg/Pose"](
        position=point, orientation=types["geometry_msgs/msg/Quaternion"](x, y, z, w)
    )


def _pose_stamped(types: Any, time_ns: int, pos: Array, quat_wxyz: Array, _: Array) -> Any:
    return types["geometry_msgs/msg/PoseStamped"](header=_header(types, time_ns), pose=_pose(types, pos, quat_wxyz))


def _odometry(types: Any, time_ns: int, pos: Array, quat_wxyz: Array, vel_flu: Array) -> Any:
    vector, nothing = types["geometry_msgs/msg/Vector3"], np.zeros(36)
    twist = types["geometry_msgs/msg/Twist"](linear=vector(*map(float, vel_flu)), angular=vector(0.0, 0.0, 0.0))
    return types["nav_msgs/msg/Odometry"](
        header=_header(types, time_ns),
        child_frame_id=_BODY,
        pose=types["geometry_msgs/msg/PoseWithCovariance"](pose=_pose(types, pos, quat_wxyz), covariance=nothing),
        twist=types["geometry_msgs/msg/TwistWithCovariance"](twist=twist, covariance=nothing),
    )
