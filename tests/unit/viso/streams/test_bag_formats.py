# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Poses in bags of ROS 1 and ROS 2: every type, every storage, and damage."""

import builtins
import math
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

pytest.importorskip("rosbags", reason="rosbags is not installed")

from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

from tests.unit.viso.trajectories import outcome_of
from viso.geometry.trajectory import Trajectory
from viso.geometry.trajectory_files import NO_ROTATION, TrajectoryError, usable
from viso.streams.bag_formats import POSE_TYPES, bag_records, collect

STORE = {1: get_typestore(Stores.ROS1_NOETIC), 2: get_typestore(Stores.ROS2_HUMBLE)}
STAMPS_S = (5, 6)
S = math.sqrt(0.5)
ODOMETRY = "nav_msgs/msg/Odometry"

Messages = list[tuple[str, str, int, Any]]


def new(version: int, kind: str, *args: Any) -> Any:
    return STORE[version].types[kind](*args)


def header(version: int, sec: int, frame_id: str = "odom") -> Any:
    stamp = new(version, "builtin_interfaces/msg/Time", sec, 250)
    before = (0,) if version == 1 else ()  # ROS 1 has a sequence number
    return new(version, "std_msgs/msg/Header", *before, stamp, frame_id)


def vector(version: int, kind: str, x: float) -> Any:
    return new(version, f"geometry_msgs/msg/{kind}", x, 2.0, 3.0)


def message(version: int, kind: str, sec: int, child: str = "base_link", covariance: Any = None) -> Any:
    """Make a message of a pose: x in m as the time in s, a quarter turn to the left."""
    turned = new(version, "geometry_msgs/msg/Quaternion", 0.0, 0.0, S, S)
    head = header(version, sec)
    if kind.endswith("TransformStamped"):
        transform = new(version, "geometry_msgs/msg/Transform", vector(version, "Vector3", float(sec)), turned)
        return new(version, kind, head, child, transform)
    pose = new(version, "geometry_msgs/msg/Pose", vector(version, "Point", float(sec)), turned)
    if kind.endswith("PoseStamped"):
        return new(version, kind, head, pose)
    numbers = np.zeros(36) if covariance is None else covariance
    with_covariance = new(version, "geometry_msgs/msg/PoseWithCovariance", pose, numbers)
    if kind.endswith("PoseWithCovarianceStamped"):
        return new(version, kind, head, with_covariance)
    ahead, still = new(version, "geometry_msgs/msg/Vector3", 1.0, 0.0, 0.0), vector(version, "Vector3", 0.0)
    twist = new(version, "geometry_msgs/msg/Twist", ahead, still)
    with_twist = new(version, "geometry_msgs/msg/TwistWithCovariance", twist, np.zeros(36))
    return new(version, kind, head, child, with_covariance, with_twist)


def write(path: Path, version: int, messages: Messages, storage: StoragePlugin = StoragePlugin.SQLITE3) -> Path:
    """Write a bag with messages, each a topic, a type, a time in s and a content; return what to open."""
    store = STORE[version]
    writer: Any = Writer1(path) if version == 1 else Writer2(path, version=9, storage_plugin=storage)
    with writer:
        opened: dict[str, Any] = {}
        for topic, kind, time_s, content in messages:
            if topic not in opened:
                opened[topic] = writer.add_connection(topic, kind, typestore=store)
            serialize = store.serialize_ros1 if version == 1 else store.serialize_cdr
            writer.write(opened[topic], time_s * 10**9, serialize(content, kind))
    return path


def poses(version: int, kind: str = ODOMETRY, topic: str = "/pose", **fields: Any) -> Messages:
    return [(topic, kind, 100 + sec, message(version, kind, sec, **fields)) for sec in STAMPS_S]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path / "flight"


BAGS = ("bag", "db3", "mcap", "folder of db3", "folder of mcap")
TYPES = tuple(POSE_TYPES)


@pytest.fixture(params=BAGS)
def make_bag(request: pytest.FixtureRequest, tmp_path: Path) -> Callable[..., Path]:
    """Return a function that writes messages, made by a function of the version of ROS, in every kind of bag."""

    def make(messages: Callable[[int], Messages]) -> Path:
        what = str(request.param)
        if what == "bag":
            return write(tmp_path / "flight.bag", 1, messages(1))
        storage = StoragePlugin.MCAP if "mcap" in what else StoragePlugin.SQLITE3
        path = write(tmp_path / "flight", 2, messages(2), storage)
        return path if what.startswith("folder") else next(path.glob(f"*.{what}"))

    return make


def read_bag(path: Path, topic: str | None) -> Trajectory:
    return usable(bag_records(path, topic))


def collected(messages: Messages) -> Trajectory:
    """Return what can be used of messages as a bag gives them."""
    return usable(collect("a bag", ((time_s * 10**9, kind, content) for _, kind, time_s, content in messages)))


def complaint(path: Path, topic: str | None = None) -> str:
    return line_of(lambda: read_bag(path, topic))


def line_of(read: Callable[[], object]) -> str:
    with pytest.raises(TrajectoryError) as raised:
        read()
    assert len(str(raised.value).splitlines()) == 1
    return str(raised.value)


# The usual run has each kind of bag and each type, but not each with each.
@pytest.mark.parametrize(
    ("make_bag", "kind"),
    [
        pytest.param(bag, kind, marks=() if kind == TYPES[number % len(TYPES)] else pytest.mark.slow)
        for number, bag in enumerate(BAGS)
        for kind in TYPES
    ],
    indirect=["make_bag"],
)
def test_every_type_is_read_from_every_kind_of_bag(make_bag: Callable[..., Path], kind: str) -> None:
    trajectory = read_bag(make_bag(lambda version: poses(version, kind)), None)
    assert trajectory.times_ns.tolist() == [5_000_000_250, 6_000_000_250]
    assert trajectory.positions.tolist() == [[5.0, 2.0, 3.0], [6.0, 2.0, 3.0]]
    np.testing.assert_allclose(trajectory.quats_wxyz, [[S, 0.0, 0.0, S]] * 2)


def test_velocity_of_odometry_is_in_the_body() -> None:
    trajectory = collected(poses(2))
    np.testing.assert_allclose(trajectory.world_velocities[0], [0.0, 1.0, 0.0], atol=1e-12)


@pytest.mark.parametrize("child", ["odom", ""])
def test_velocity_of_vins_is_in_the_world(child: str) -> None:
    trajectory = collected(poses(2, child=child))
    np.testing.assert_allclose(trajectory.world_velocities[0], [1.0, 0.0, 0.0], atol=1e-12)


def test_odometry_without_an_attitude_is_left_out() -> None:
    messages = [*poses(2), ("/pose", ODOMETRY, 107, message(2, ODOMETRY, 7))]
    turned = messages[1][3].pose.pose.orientation
    turned.z = turned.w = 0.0
    trajectory = collected(messages)
    assert (len(trajectory), dict(trajectory.left_out)) == (2, {NO_ROTATION: 1})


def test_velocity_of_a_pose_follows_from_positions() -> None:
    assert collected(poses(2, "geometry_msgs/msg/PoseStamped")).velocities is None


@pytest.mark.parametrize("kind", [ODOMETRY, "geometry_msgs/msg/PoseWithCovarianceStamped"])
def test_covariance_is_read_row_by_row(kind: str) -> None:
    matrix = np.diag([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    matrix[0, 1] = matrix[1, 0] = 0.5
    covariance = collected(poses(2, kind, covariance=matrix.flatten())).pose(0).covariance
    assert covariance is not None
    np.testing.assert_array_equal(covariance, matrix)


def test_message_without_a_stamp_has_the_time_of_the_bag() -> None:
    messages = poses(2)
    for _, _, _, content in messages:
        content.header.stamp.sec = content.header.stamp.nanosec = 0
    assert collected(messages).times_ns.tolist() == [105 * 10**9, 106 * 10**9]


@pytest.fixture(scope="module")
def two_topics(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a bag with odometry and poses, each on a topic of its own, the later name first."""
    messages = [*poses(2, topic="/b"), *poses(2, "geometry_msgs/msg/PoseStamped", topic="/a")]
    return write(tmp_path_factory.mktemp("bags") / "flight", 2, messages)


def test_topic_is_chosen_by_its_name(two_topics: Path) -> None:
    assert read_bag(two_topics, "/b").velocities is not None
    assert read_bag(two_topics, "/a").velocities is None


def test_several_topics_are_listed(two_topics: Path) -> None:
    listed = "there are: /a (geometry_msgs/msg/PoseStamped), /b (nav_msgs/msg/Odometry)"
    assert complaint(two_topics) == f"{two_topics}: which topic is not clear; {listed}"
    assert complaint(two_topics, "/x") == f"{two_topics}: no poses on the topic /x; {listed}"


def transforms(version: int, *children: str) -> Messages:
    """Return messages of two transforms each, as ROS 2 and late ROS 1 send them."""
    kind = "tf2_msgs/msg/TFMessage"
    both = [
        (sec, [message(version, "geometry_msgs/msg/TransformStamped", sec, one) for one in children]) for sec in (5, 6)
    ]
    return [("/tf", kind, 100 + sec, new(version, kind, several)) for sec, several in both]


def test_transforms_alone_are_read_by_their_frames(folder: Path) -> None:
    bag = write(folder, 2, transforms(2, "base_link", "wheel"), StoragePlugin.MCAP)
    told = "/tf:odom.base_link (2 times), /tf:odom.wheel (2 times)"
    assert complaint(bag) == f"{bag}: which transforms between frames is not clear; there are: {told}"
    assert complaint(bag, "/tf:map.odom") == f"{bag}: no transforms map.odom; there are: {told}"
    assert read_bag(bag, "/tf:odom.wheel").positions.tolist() == [[5, 2, 3], [6, 2, 3]]


def test_transforms_of_one_pair_of_frames_need_no_name_and_yield_to_poses(tmp_path: Path) -> None:
    assert len(read_bag(write(tmp_path / "tf", 2, transforms(2, "base_link"), StoragePlugin.MCAP), None)) == 2
    both = write(tmp_path / "both", 2, [*transforms(2, "base_link"), *poses(2)], StoragePlugin.MCAP)
    assert read_bag(both, None).velocities is not None
    assert read_bag(both, "/tf").velocities is None


def test_bag_without_poses_says_what_would_fit(folder: Path) -> None:
    other = [("/time", "builtin_interfaces/msg/Time", 1, new(2, "builtin_interfaces/msg/Time", 1, 2))]
    assert complaint(write(folder, 2, other, StoragePlugin.MCAP)).endswith(
        f"there are: none of {', '.join(POSE_TYPES)}"
    )


def test_poses_without_a_stamp_are_named(folder: Path) -> None:
    pose = message(2, "geometry_msgs/msg/PoseStamped", 1).pose
    bag = write(folder, 2, [("/vicon", "geometry_msgs/msg/Pose", 1, pose)], StoragePlugin.MCAP)
    told = "publish and record geometry_msgs/msg/PoseStamped"
    assert complaint(bag).startswith(f"{bag}: /vicon is geometry_msgs/msg/Pose, which has no time of its own")
    assert complaint(bag).endswith(told)
    assert complaint(bag, "/vicon").endswith(told)


def test_time_before_1970_names_the_message() -> None:
    messages = poses(2)
    messages[1][3].header.stamp.sec = -5
    assert line_of(lambda: collected(messages)).startswith("a bag: message 2: not a time: -4")


@pytest.mark.parametrize("name", ["none.bag", "none.mcap", "none.db3", "none"])
def test_bag_that_is_not_there_is_one_line(tmp_path: Path, name: str) -> None:
    assert complaint(tmp_path / name).startswith(f"{tmp_path / name}: not a readable bag: ")


def test_missing_rosbags_says_what_to_install(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = builtins.__import__

    def without(name: str, *args: Any) -> Any:
        if name.startswith("rosbags"):
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
        return whole(name, *args)

    monkeypatch.setattr(builtins, "__import__", without)
    assert (
        complaint(folder)
        == f"{folder}: bags are read with rosbags; install it with: pip install 'ardupilot-viso[bags]'"
    )


@pytest.fixture(scope="module")
def sound_bags(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Return a bag of every storage."""
    folder = tmp_path_factory.mktemp("bags")
    found = [write(folder / "flight.bag", 1, poses(1))]
    for storage in (StoragePlugin.SQLITE3, StoragePlugin.MCAP):
        found += sorted(write(folder / storage.name, 2, poses(2), storage).glob("*.[dm]*"))
    return [path for path in found if path.suffix != ".yaml"]


@pytest.mark.slow
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    which=st.integers(0, 2),
    place=st.floats(0, 1),
    damage=st.binary(max_size=8),
    cut=st.booleans(),
)
def test_damaged_bag_raises_nothing_but_the_one_error(
    sound_bags: list[Path], tmp_path: Path, which: int, place: float, damage: bytes, cut: bool
) -> None:
    path = tmp_path / sound_bags[which].name
    shutil.copyfile(sound_bags[which], path)
    data = bytearray(path.read_bytes())
    start = int(place * len(data))
    data[start : start + len(damage)] = damage
    path.write_bytes(data[:start] if cut else data)
    result = outcome_of(lambda: read_bag(path, None))
    assert result.startswith(f"{path}: ") if isinstance(result, str) else len(result) == 2
