# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The formats of recorded trajectories, one row each, and which of them a file has."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Final

from viso.geometry.trajectory import Trajectory
from viso.geometry.trajectory_files import (
    EUROC,
    OKVIS,
    OPENVINS,
    TUM,
    Records,
    TrajectoryError,
    detect,
    kitti_records,
    read_text,
    table_records,
    usable,
)
from viso.streams.bag_formats import POSE_TYPES, bag_records

_POSES: Final = ", ".join(kind.rpartition("/")[2] for kind in POSE_TYPES)


@dataclass(frozen=True, slots=True)
class Source:
    """A file, or the folder of a bag, with the bag's topic (None for the only one) and the file of KITTI's times."""

    path: Path
    topic: str | None = None
    times: Path | None = None


@dataclass(frozen=True, slots=True)
class Format:
    """A format of trajectories: what reads it or raises TrajectoryError, what a record holds, and who writes it."""

    read: Callable[[Source], Records]
    content: str
    writers: str


def _bag(source: Source) -> Records:
    return bag_records(source.path, source.topic)


FORMATS: Final[Mapping[str, Format]] = MappingProxyType(
    {
        "tum": Format(
            lambda source: table_records(source.path, TUM),
            "text: t x y z qx qy qz qw; t in s, or in ns when that large",
            "evo, ORB-SLAM, most others",
        ),
        "openvins": Format(
            lambda source: table_records(source.path, OPENVINS),
            "text: as TUM, then the upper triangles of the covariances of rotation and of position",
            "OpenVINS (pose_to_file)",
        ),
        "euroc": Format(
            lambda source: table_records(source.path, EUROC),
            "csv: ns, x, y, z, qw, qx, qy, qz, and velocity if there is one",
            "EuRoC's ground truth, VINS-Mono, VINS-Fusion",
        ),
        "okvis": Format(
            lambda source: table_records(source.path, OKVIS),
            "csv: ns, x, y, z, qx, qy, qz, qw, and velocity if there is one",
            "OKVIS2",
        ),
        "kitti": Format(
            lambda source: kitti_records(source.path, source.times),
            "text: the upper three rows of a homogeneous matrix; times in s in a file of their own",
            "KITTI, visual odometries compared on it",
        ),
        "ros1": Format(_bag, f"bag (.bag): {_POSES}", "ROS 1"),
        "ros2": Format(_bag, f"bag (folder, .db3, .mcap): {_POSES}", "ROS 2"),
    }
)

_BY_ENDING: Final = MappingProxyType({".bag": "ros1", ".mcap": "ros2", ".db3": "ros2"})


def format_of(path: Path) -> str:
    """Return the name of the format of a file, by its ending or else by its content.

    Raises TrajectoryError if it has none of them, or cannot be read.
    """
    if path.is_dir():
        return "ros2"
    found = _BY_ENDING.get(path.suffix.lower()) or detect(read_text(path))
    if found is None:
        raise TrajectoryError(f"{path}: none of the formats {', '.join(FORMATS)}")
    return found


def load_records(source: Source, format_name: str | None = None) -> Records:
    """Read what a file holds, as it stands there, in a format of ``FORMATS`` or, for None, in the one that it has.

    Raises TrajectoryError if it cannot be read; one line that names the file.
    """
    name = format_name or format_of(source.path)
    if name not in FORMATS:
        raise TrajectoryError(f"no format {name!r}; there are {', '.join(FORMATS)}")
    return FORMATS[name].read(source)


def load_trajectory(source: Source, format_name: str | None = None, *, from_anywhere: bool = False) -> Trajectory:
    """Read the trajectory of what a file holds; arguments and errors as of ``load_records`` and ``usable``.

    Raises TrajectoryError also if fewer than 2 records can be used; messages without a stamp have the time of the bag.
    """
    return usable(load_records(source, format_name), from_anywhere=from_anywhere)
