# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Bags of ROS 1 and ROS 2: every topic, both frames, times, and bags that are broken."""

import builtins
import json
import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rosbags", reason="rosbags is not installed")

from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

from viso.landmarks.inputs.bags import BagFile
from viso.landmarks.inputs.base import InputFileError
from viso.landmarks.types import (
    AircraftReport,
    CameraInfo,
    Detection,
    Detections,
    EstimatedPosition,
    Event,
    GeodeticPoint,
    GlobalFix,
    Landmark,
    LandmarkMap,
    VehiclePose,
)

STORE = {1: get_typestore(Stores.ROS1_NOETIC), 2: get_typestore(Stores.ROS2_HUMBLE)}
TOPICS = SimpleNamespace(
    odometry="/mavros/local_position/odom",
    landmarks="/vo/landmarks",
    observations="/vo/landmark_observations",
    camera_info="/stereo/left/camera_info",
    aircraft="/adsb/adsb_aircraft_state_vectors_node/aircraft_state_vectors",
    estimated_position="/adsb/rtl_adsb_decoder_node/estimated_position",
    fix="/mavros/global_position/global",
)
ODOMETRY, STRING = "nav_msgs/msg/Odometry", "std_msgs/msg/String"
LEVEL = (1.0, 0.0, 0.0, 0.0)
MCAP = StoragePlugin.MCAP  # the quickest to write

# A topic, a type, a time in s and a message.
Messages = list[tuple[str, str, float, Any]]


def new(kind: str, *args: Any, version: int = 2) -> Any:
    return STORE[version].types[kind](*args)


def header(sec: int, version: int = 2) -> Any:
    before = (0,) if version == 1 else ()  # ROS 1 has a sequence number
    return new(
        "std_msgs/msg/Header",
        *before,
        new("builtin_interfaces/msg/Time", sec, 500_000_000 if sec else 0, version=version),
        "map",
        version=version,
    )


def pose(quat_wxyz: tuple[float, ...] = LEVEL, version: int = 2) -> Any:
    w, x, y, z = quat_wxyz
    point = new("geometry_msgs/msg/Point", 1.0, 2.0, 3.0, version=version)
    turned = new("geometry_msgs/msg/Quaternion", x, y, z, w, version=version)
    return new("geometry_msgs/msg/Pose", point, turned, version=version)


def odometry(sec: int, quat_wxyz: tuple[float, ...] = LEVEL, version: int = 2) -> Any:
    still = [new("geometry_msgs/msg/Vector3", 0.0, 0.0, 0.0, version=version) for _ in range(2)]
    twist = new("geometry_msgs/msg/Twist", *still, version=version)
    parts = [
        new("geometry_msgs/msg/PoseWithCovariance", pose(quat_wxyz, version), np.zeros(36), version=version),
        new("geometry_msgs/msg/TwistWithCovariance", twist, np.zeros(36), version=version),
    ]
    return new(ODOMETRY, header(sec, version), "base_link", *parts, version=version)


def fix(sec: int, latitude_deg: float = 47.4, status: int = 0, altitude_m: float = 432.5, version: int = 2) -> Any:
    longitude_deg = 8.5 if latitude_deg else 0.0
    return new(
        "sensor_msgs/msg/NavSatFix",
        header(sec, version),
        new("sensor_msgs/msg/NavSatStatus", status, 1, version=version),
        latitude_deg,
        longitude_deg,
        altitude_m,
        np.zeros(9),
        0,
        version=version,
    )


def camera_info(sec: int, version: int = 2) -> Any:
    region = new("sensor_msgs/msg/RegionOfInterest", 0, 0, 0, 0, False, version=version)
    matrix = np.array([1000.0, 0, 640, 0, 1001, 512, 0, 0, 1])
    size, rest = (1024, 1280), (np.eye(3).ravel(), np.zeros(12), 0, 0, region)
    return new(
        "sensor_msgs/msg/CameraInfo", header(sec, version), *size, "none", np.zeros(0), matrix, *rest, version=version
    )


def text(record: Any, version: int = 2) -> Any:
    return new(STRING, record if isinstance(record, str) else json.dumps(record), version=version)


def write(path: Path, messages: Messages, version: int = 2, storage: StoragePlugin = StoragePlugin.SQLITE3) -> Path:
    store = STORE[version]
    writer: Any = Writer1(path) if version == 1 else Writer2(path, version=9, storage_plugin=storage)
    with writer:
        opened: dict[tuple[str, str], Any] = {}
        for topic, kind, time_s, message in messages:
            if (topic, kind) not in opened:
                opened[topic, kind] = writer.add_connection(topic, kind, typestore=store)
            serialize = store.serialize_ros1 if version == 1 else store.serialize_cdr
            writer.write(opened[topic, kind], round(time_s * 1e9), serialize(message, kind))
    return path


def every_topic(version: int) -> Messages:
    origin = {"lat": 47.4, "lon": 8.5, "alt_m": 432.5}
    raw = {"latitude": 47.5, "longitude": 8.6, "altitude_ft": 5000, "speed_kts": 250, "heading_deg": 90}
    vectors = {
        "header": {"stamp": {"sec": 16, "nanosec": 0}, "origin_lla": origin},
        "aircraft": [{"icao": "3C6DD1", "raw": raw}],
    }
    return [
        (TOPICS.camera_info, "sensor_msgs/msg/CameraInfo", 10, camera_info(11, version)),
        (TOPICS.odometry, ODOMETRY, 11, odometry(12, version=version)),
        (TOPICS.landmarks, STRING, 12, text({"landmarks": [{"id": 0, "x": 1, "y": 2}]}, version)),
        (TOPICS.observations, STRING, 13, text({"observations": [{"id": 0, "u": 320, "v": 256}]}, version)),
        (TOPICS.fix, "sensor_msgs/msg/NavSatFix", 14, fix(15, version=version)),
        (TOPICS.aircraft, STRING, 15, text(vectors, version)),
        (TOPICS.estimated_position, STRING, 16, text({"kf_lat": 47.0, "kf_lon": 8.0}, version)),
    ]


EVERY_EVENT: list[Event] = [
    CameraInfo(11.5, 1280, 1024, 1000.0, 1001.0, 640.0, 512.0),
    LandmarkMap(12.0, (Landmark("0", 1.0, 2.0),)),
    Detections(13.0, (Detection("0", 320.0, 256.0),)),
    GlobalFix(15.5, GeodeticPoint(47.4, 8.5, 432.5)),
    AircraftReport(16.0, "3C6DD1", 47.5, 8.6, 5000.0, 250.0, 90.0),
    EstimatedPosition(16.0, GeodeticPoint(47.0, 8.0)),
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a bag of each storage."""
    path = tmp_path_factory.mktemp("bags")
    write(path / "a.bag", every_topic(1), 1)
    write(path / "db3", every_topic(2))
    write(path / "mcap", every_topic(2), 2, MCAP)
    return path


@pytest.mark.parametrize("what", ["a.bag", "db3", "db3/*.db3", "mcap/*.mcap"])
def test_every_topic_is_read_from_every_kind_of_bag(folder: Path, what: str) -> None:
    file = BagFile(next(folder.glob(what)))
    events = list(file.events())
    [found] = [event for event in events if isinstance(event, VehiclePose)]
    assert (found.t_s, found.x_m, found.y_m, found.z_m, found.yaw_rad) == (12.5, 1, 2, 3, 0)
    assert [event for event in events if not isinstance(event, VehiclePose)] == EVERY_EVENT
    assert events.index(found) == 1
    assert not file.refused


def poses_of(path: Path, *messages: tuple[str, Any], **how: Any) -> list[VehiclePose]:
    """Return the poses of messages, each a type and a content, that come at 1 s, 2 s and so on."""
    rows: Messages = [(TOPICS.odometry, kind, time_s, message) for time_s, (kind, message) in enumerate(messages, 1)]
    found = list(BagFile(write(path, rows, 2, MCAP), **how).events())
    return [event for event in found if isinstance(event, VehiclePose)]


def test_stamped_poses_will_do_as_odometry_and_the_time_of_the_bag_as_a_stamp(tmp_path: Path) -> None:
    posed, with_covariance = "geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/PoseWithCovarianceStamped"
    content = new("geometry_msgs/msg/PoseWithCovariance", pose(), np.zeros(36))
    found = poses_of(
        tmp_path / "a",
        (posed, new(posed, header(5), pose())),
        (with_covariance, new(with_covariance, header(5), content)),
        (ODOMETRY, odometry(0)),
    )
    assert [(one.t_s, one.x_m, one.y_m) for one in found] == [(5.5, 1, 2), (5.5, 1, 2), (3.0, 1, 2)]


def test_odometry_in_ned_is_turned_with_its_yaw(tmp_path: Path) -> None:
    heading_rad = math.radians(30)
    turned = (math.cos(heading_rad / 2), 0.0, 0.0, math.sin(heading_rad / 2))
    [found] = poses_of(tmp_path / "a", (ODOMETRY, odometry(5, turned)), odometry_is_ned=True)
    assert (found.x_m, found.y_m, found.z_m) == (2, 1, -3)
    assert found.yaw_rad == pytest.approx(math.radians(60))


def test_what_is_of_no_use_is_counted(tmp_path: Path) -> None:
    nav = "sensor_msgs/msg/NavSatFix"
    messages: Messages = [
        (TOPICS.odometry, ODOMETRY, 1, odometry(1, (0.0, 0.0, 0.0, 0.0))),
        (TOPICS.landmarks, STRING, 2, text("hello")),
        (TOPICS.fix, nav, 3, fix(3, status=-1)),
        (TOPICS.fix, nav, 4, fix(4, latitude_deg=0.0)),
        (TOPICS.fix, nav, 5, fix(5, altitude_m=math.nan)),
        (TOPICS.fix, nav, 6, fix(6, latitude_deg=math.nan)),
    ]
    file = BagFile(write(tmp_path / "a", messages, 2, MCAP))
    assert list(file.events()) == []
    assert file.refused == {
        "an attitude that is no rotation": 1,
        "not JSON": 1,
        "a fix that is none": 1,
        "no fix: (0, 0)": 1,
        "a fix without a height": 1,
        "bad latitude_deg": 1,
    }


def complaint(path: Path) -> str:
    with pytest.raises(InputFileError) as raised:
        list(BagFile(path).events())
    assert len(str(raised.value).splitlines()) == 1
    return str(raised.value)


def test_bag_without_the_topics_says_what_there_is(tmp_path: Path) -> None:
    path = write(tmp_path / "a", [("/other", STRING, 1, text("x")), (TOPICS.odometry, STRING, 1, text("x"))], 2, MCAP)
    there = f"{TOPICS.odometry} ({STRING}), /other ({STRING})"
    assert complaint(path) == f"{path}: none of the topics that are read; there are: {there}"


@pytest.mark.parametrize("name", ["none.bag", "none.mcap", "none.db3", "none"])
def test_bag_that_is_not_there_is_one_line(tmp_path: Path, name: str) -> None:
    assert complaint(tmp_path / name).startswith(f"{tmp_path / name}: not a readable bag: ")


def test_bag_that_is_cut_short_is_one_line(folder: Path, tmp_path: Path) -> None:
    path = tmp_path / "a.bag"
    path.write_bytes((folder / "a.bag").read_bytes()[:-100])
    assert complaint(path).startswith(f"{path}: not a readable bag: ")


def test_missing_rosbags_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = builtins.__import__

    def without(name: str, *args: Any) -> Any:
        if name.startswith("rosbags"):
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
        return whole(name, *args)

    monkeypatch.setattr(builtins, "__import__", without)
    path = tmp_path / "a.bag"
    assert complaint(path) == f"{path}: bags are read with rosbags; install it with: pip install 'ardupilot-viso[bags]'"
