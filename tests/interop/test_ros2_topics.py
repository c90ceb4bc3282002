# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Live topics over real DDS: what writes them, ``viso play`` and ``viso serve`` are processes of their own."""

import dataclasses
import json
import os
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("cyclonedds", reason="cyclonedds is not installed")
pytest.importorskip("rosbags", reason="rosbags is not installed")

from rosbags.highlevel import AnyReader

from tests.interop.programs import LOOPBACK
from tests.places import ROOT
from viso.dds import messages
from viso.dds.graph import DEFAULT, SENSOR_DATA, Participant, Qos
from viso.dds.messages import Header, Odometry, PoseStamped, TFMessage, Time, TransformStamped
from viso.dds.poses import Heard, PoseTopic
from viso.errors import InputError

pytestmark = pytest.mark.interop

VISO = (sys.executable, "-c", "from viso.cli import main; main()")
BAG = ROOT / "tests" / "data" / "real" / "evo_nav2_turtlebot.mcap"
EXAMPLE = ROOT / "docs" / "examples" / "ros2_bridge" / "circling_rigid_body.py"
DOMAIN = 1 + os.getpid() % 100
LIMIT_S = 60.0
BAG_S = 4.0


@pytest.fixture(autouse=True, scope="module")
def on_loopback() -> Iterator[None]:
    """Keep DDS, of this process and of those that it starts, on this machine."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("CYCLONEDDS_URI", LOOPBACK)
        patch.setenv("ROS_DOMAIN_ID", str(DOMAIN))
        yield


def until(true: Callable[[], object]) -> None:
    """Wait until something is so."""
    end_s = time.monotonic() + LIMIT_S
    while not true():
        assert time.monotonic() < end_s, "it did not come to that"
        time.sleep(0.01)


def as_sent(kind: type, content: Any) -> Any:
    """Return a message of a bag as the class that carries it over DDS."""
    values = {}
    for field in dataclasses.fields(kind):
        value = getattr(content, field.name)
        inner = getattr(messages, type(value).__name__.rpartition("__")[2], None)
        values[field.name] = as_sent(inner, value) if inner else value.tolist() if hasattr(value, "tolist") else value
    return kind(**values)


def play_bag(qos: Qos) -> int:
    """Play the beginning of the bag's /odom at its own pace; return how many messages that were."""
    with AnyReader([BAG]) as reader, Participant(DOMAIN) as graph:
        connections = [one for one in reader.connections if one.topic == "/odom"]
        writer = graph.writer("/odom", Odometry, qos)
        until(lambda: writer.readers)
        start_s, first_ns, count = time.monotonic(), 0, 0
        for connection, time_ns, data in reader.messages(connections):
            first_ns = first_ns or time_ns
            bag_s = (time_ns - first_ns) * 1e-9
            if bag_s > BAG_S:
                break
            time.sleep(max(0.0, start_s + bag_s - time.monotonic()))
            writer.write(as_sent(Odometry, reader.deserialize(data, connection.msgtype)))
            count += 1
        time.sleep(0.5)  # a best effort reader gets nothing of a writer that has gone
    return count


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def bridged(folder: Path, topic: str, *options: str, publish: Callable[[], int]) -> tuple[int, Any, dict[str, Any]]:
    """Return how many poses were published, what the bridge said, and how many messages met which outcome."""
    port = free_port()
    serve = [*VISO, "serve", "--master", f"tcpin:127.0.0.1:{port}", "--log-dir", str(folder), "--json"]
    serve += ["--param", "VISO_TYPE=1"]
    play = [*VISO, "play", "--ros2", topic, "--master", f"tcp:127.0.0.1:{port}", "--wait", str(LIMIT_S), "--json"]
    quiet = subprocess.DEVNULL
    with (
        subprocess.Popen(serve, stdout=subprocess.PIPE, stderr=quiet) as autopilot,
        subprocess.Popen([*play, *options], stdout=subprocess.PIPE) as bridge,
    ):
        try:
            published = publish()
        finally:
            bridge.terminate()
            said, _ = bridge.communicate(timeout=LIMIT_S)
            autopilot.terminate()
            told, _ = autopilot.communicate(timeout=LIMIT_S)
    outcomes = {f"{row['message']} {row['outcome']}": row["count"] for row in json.loads(told)["verdicts"]}
    return published, json.loads(said), outcomes


@pytest.mark.parametrize("qos", [DEFAULT, SENSOR_DATA], ids=["reliable", "best_effort"])
def test_every_pose_of_a_bag_that_is_played_reaches_the_autopilot(tmp_path: Path, qos: Qos) -> None:
    published, bridge, outcomes = bridged(tmp_path, "/odom", publish=lambda: play_bag(qos))
    assert published > 100
    assert bridge["heard"] == bridge["sent"]["ODOMETRY"] == outcomes["ODOMETRY accepted"] == published
    assert (bridge["type"], bridge["resets"], bridge["left_out"]) == ("nav_msgs/msg/Odometry", 0, {})


def test_the_example_reaches_the_autopilot(tmp_path: Path) -> None:
    def circle() -> int:
        with (
            subprocess.Popen([sys.executable, EXAMPLE, "/drone/pose"]) as example,
            Participant(DOMAIN) as graph,
        ):
            beside = graph.writer("/drone/pose", PoseStamped, DEFAULT)
            until(lambda: beside.readers)
            time.sleep(3.0)
            example.terminate()
        return 3 * 50

    published, bridge, outcomes = bridged(tmp_path, "/drone/pose", "--as", "mocap", publish=circle)
    assert bridge["heard"] == bridge["sent"]["ATT_POS_MOCAP"] == outcomes["ATT_POS_MOCAP accepted"] > published / 3
    assert bridge["resets"] == 0


def test_the_doctor_listens_to_a_topic() -> None:
    command = [*VISO, "doctor", "ros2:/odom", "--seconds", "6", "--filter-seconds", "0", "--json"]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as doctor:
        play_bag(DEFAULT)
        said, _ = doctor.communicate(timeout=LIMIT_S)
    told = json.loads(said)
    assert {"XN5-08", "XN7-16"} <= {finding["code"] for finding in told["findings"]}, told


@pytest.fixture
def graph() -> Iterator[Participant]:
    with Participant(DOMAIN) as one:
        yield one


@pytest.fixture
def listened() -> Iterator[Callable[[str], PoseTopic]]:
    """Return a function that listens to a topic."""
    topics: list[PoseTopic] = []

    def listen(name: str) -> PoseTopic:
        topics.append(PoseTopic(name, DOMAIN))
        return topics[-1]

    yield listen
    for topic in topics:
        topic.close()


def taken(topic: PoseTopic) -> list[Heard]:
    """Return what comes next on a topic."""
    found: list[Heard] = []

    def come() -> bool:
        found.extend(topic.take(5))
        return bool(found)

    until(come)
    return found


def stamped(sec: int) -> Header:
    return Header(Time(sec, 0), "odom")


def test_a_writer_that_comes_again_is_another(graph: Participant, listened: Callable[[str], PoseTopic]) -> None:
    topic = listened("odom")
    writers = set()
    for sec in (1, 2):
        with Participant(DOMAIN) as sender:
            writer = sender.writer("/odom", PoseStamped, SENSOR_DATA)
            until(lambda: topic.find() and writer.readers)  # noqa: B023
            writer.write(PoseStamped(stamped(sec)))
            (heard,) = taken(topic)
            assert (heard.message[0], heard.message[2].header.stamp.sec) == (5, sec)
            writers.add(heard.writer)
    assert len(writers) == 2
    until(lambda: "nobody writes it" in topic.silence())


def test_transforms_are_told_apart_by_their_frames(graph: Participant, listened: Callable[[str], PoseTopic]) -> None:
    topic, unnamed = listened("/tf:odom.base_link"), listened("/tf")
    writer = graph.writer("/tf", TFMessage, DEFAULT)
    until(lambda: topic.find() and unnamed.find() and writer.readers == 2)
    pairs = [TransformStamped(stamped(1), "base_link"), TransformStamped(stamped(1), "wheel")]
    writer.write(TFMessage(pairs))
    (heard,) = taken(topic)
    assert (heard.message[1], heard.message[2].child_frame_id) == ("geometry_msgs/msg/TransformStamped", "base_link")
    assert unnamed.take(5) == []
    assert unnamed.silence().endswith("there are: /tf:odom.base_link, /tf:odom.wheel")


def test_it_is_told_why_nothing_comes(graph: Participant, listened: Callable[[str], PoseTopic]) -> None:
    topic = listened("/odom")
    graph.writer("/pose", PoseStamped, DEFAULT)
    until(lambda: topic.silence().endswith("topics with poses are: /pose"))
    graph.writer("/odom", Header, DEFAULT)
    until(lambda: "it carries std_msgs/msg/Header, and poses are of nav_msgs" in topic.silence())
    assert not topic.find()
    writer = graph.writer("/odom", Odometry, DEFAULT)
    until(topic.find)
    assert topic.silence() == f"it is written in the domain {DOMAIN}, but nothing comes"
    until(lambda: writer.readers)
    writer.write(Odometry(stamped(3)))
    assert len(taken(topic)) == 1


def test_what_cannot_be_read_is_counted(graph: Participant, listened: Callable[[str], PoseTopic]) -> None:
    topic = listened("/odom")
    writer = graph.writer("/odom", PoseStamped, DEFAULT)
    until(lambda: topic.find() and writer.readers)
    bad = PoseStamped(stamped(1))
    bad.serialize = lambda *_args, **_options: b"\x00\x01\x00\x00" + b"\xff" * 90
    writer.write(bad)
    writer.write(PoseStamped(stamped(2)))
    assert [heard.message[2].header.stamp.sec for heard in taken(topic)] == [2]


def test_a_domain_that_there_is_not_is_refused() -> None:
    with pytest.raises(InputError, match=r"^--domain 233: not a domain between 0 and 232$"):
        PoseTopic("/odom", 233)
