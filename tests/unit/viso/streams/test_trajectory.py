# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Trajectories become streams, as ``viso play`` would send them."""

from pathlib import Path
from typing import Any

import pytest

from mav_handlers.wire.codec import Codec, Received
from mav_handlers.wire.messages import HEARTBEAT, ODOMETRY
from tests.places import DATA
from tests.unit.viso.command_line import Viso
from viso.errors import InputError
from viso.streams.stream_kinds import Stream, TrajectoryOptions, read_stream

FLIGHT = DATA / "trajectories" / "flight.tum"
LEAD_US = 5_000_000
TUM = "1.0 1 2 3 0 0 0 1\n1.1 1.5 2 3 0 0 0 1\n1.2 2 2 3 0 0 0 1\n"
EUROC = "#timestamp,x,y,z,qw,qx,qy,qz\n" + "".join(f"{n}00000000,{n},2,3,1,0,0,0\n" for n in (10, 11, 12))
KITTI = "".join(f"1 0 0 {n} 0 1 0 2 0 0 1 3\n" for n in range(3))


def poses_of(stream: Stream) -> list[Any]:
    codec = Codec(1, 1)
    codec.feed(b"".join(message.frame for message in stream.messages))
    messages = [one.message for one in iter(codec.next_received, None) if isinstance(one, Received)]
    return [message for message in messages if not isinstance(message, HEARTBEAT)]


def written(folder: Path, name: str, text: str) -> Path:
    path = folder / name
    path.write_text(text)
    return path


@pytest.mark.parametrize("options", [[], ["--as", "vision+speed", "--axes", "euroc", "--rate", "25"]])
def test_stream_is_what_play_writes(viso: Viso, options: list[str]) -> None:
    assert viso("play", FLIGHT, "-o", "flight.tlog", *options).code == 0
    by_name = dict(zip(options[::2], options[1::2], strict=True))
    chosen = TrajectoryOptions(
        by_name.get("--as", "odometry"),
        axes=by_name.get("--axes", "enu_flu"),
        rate_hz=float(by_name["--rate"]) if options else None,
    )
    stream = read_stream(FLIGHT, LEAD_US, chosen)
    assert stream.messages == read_stream(Path("flight.tlog"), LEAD_US).messages
    assert len(stream.messages) > 150


@pytest.mark.parametrize(("name", "text"), [("poses.tum", TUM), ("vio.csv", EUROC), ("poses.txt", TUM)])
def test_formats_are_found_out(tmp_path: Path, name: str, text: str) -> None:
    stream = read_stream(written(tmp_path, name, text), LEAD_US, TrajectoryOptions(axes="ned_frd"))
    messages = poses_of(stream)
    assert [type(message) for message in messages] == [ODOMETRY] * 3
    assert [(message.y, message.z) for message in messages] == [(2.0, 3.0)] * 3
    assert stream.messages[0].arrival_us == LEAD_US
    assert stream.messages[-1].arrival_us == LEAD_US + 200_000


def test_hole_in_a_trajectory_is_not_filled_with_heartbeats(tmp_path: Path) -> None:
    late = "".join(f"{80_000 + n} 2 2 3 0 0 0 1\n" for n in (1, 2))
    stream = read_stream(written(tmp_path, "hole.tum", TUM + late), 0)
    assert [message.time_usec for message in poses_of(stream)] == [0, 100_000, 200_000, 80_000_000_000, 80_001_000_000]
    times_us = [message.arrival_us for message in stream.messages]
    assert times_us == [0, 0, 100_000, 200_000, 80_000_000_000, 80_000_000_000, 80_001_000_000, 80_001_000_000]


def test_kitti_has_its_times_in_another_file(tmp_path: Path) -> None:
    times = written(tmp_path, "times.txt", "0.0\n0.5\n1.0\n")
    stream = read_stream(written(tmp_path, "00.txt", KITTI), 0, TrajectoryOptions(times=times, axes="optical"))
    assert [message.time_usec for message in poses_of(stream)] == [0, 500_000, 1_000_000]


def test_bag_is_read(tmp_path: Path) -> None:
    pytest.importorskip("rosbags", reason="rosbags is not installed")
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    types = store.types
    kind = "geometry_msgs/msg/PoseStamped"
    path = tmp_path / "flight.bag"
    with Writer(path) as writer:
        connection = writer.add_connection("/pose", kind, typestore=store)
        for sec in (1, 2, 3):
            head = types["std_msgs/msg/Header"](0, types["builtin_interfaces/msg/Time"](sec, 0), "map")
            point = types["geometry_msgs/msg/Point"](float(sec), 2.0, 3.0)
            level = types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
            pose = types[kind](head, types["geometry_msgs/msg/Pose"](point, level))
            writer.write(connection, sec * 10**9, store.serialize_ros1(pose, kind))
    stream = read_stream(path, LEAD_US, TrajectoryOptions(axes="ned_frd", form="vision", topic="/pose"))
    assert [message.x for message in poses_of(stream)] == [1.0, 2.0, 3.0]


def test_records_that_are_left_out_are_noted(tmp_path: Path) -> None:
    path = written(tmp_path, "poses.tum", TUM + "1.3 nan 0 0 0 0 0 1\n")
    assert read_stream(path, 0).notes == (f"{path}: 1 with a number that is not finite",)


@pytest.mark.parametrize(("options", "error"), [
    (TrajectoryOptions("mavros"), "--as mavros: there are odometry, vision"),
    (TrajectoryOptions(axes="north"), "--axes: 'north' is neither WORLD/BODY"),
    (TrajectoryOptions(rate_hz=0.01), "--rate 0.01: not between 0.1 and 1000"),
    (TrajectoryOptions(format_name="ulog"), "no format 'ulog'; there are tum"),
])  # fmt: skip
def test_option_that_cannot_be_used_is_one_line(options: TrajectoryOptions, error: str) -> None:
    with pytest.raises(InputError) as raised:
        read_stream(FLIGHT, 0, options)
    assert str(raised.value).startswith(error)


def test_bad_line_is_named(tmp_path: Path) -> None:
    path = written(tmp_path, "poses.tum", TUM + "1.3 1 2 3 0 0 0 x\n")
    with pytest.raises(InputError, match=r"poses\.tum:4: not a number: 'x'$"):
        read_stream(path, 0)
