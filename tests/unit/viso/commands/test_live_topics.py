# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""``viso play`` and ``viso doctor`` of a live topic that a test fills; no DDS is needed."""

import json
import math
import sys
import time
from types import SimpleNamespace as Content
from typing import Any

import pytest

from mav_handlers.links.pair import make_pair
from mav_handlers.wire.codec import Codec, Received
from mav_handlers.wire.messages import ODOMETRY
from tests.places import DATA
from tests.unit.viso.command_line import Viso, failed_with
from viso.commands import doctor as doctor_command
from viso.commands import play as play_command
from viso.dds.poses import Heard


def pose(number: int, x: float = 4e6) -> Heard:
    """Return Odometry that stands still, with the stamp of now and some periods."""
    sec, nanosec = divmod(time.time_ns() + number * 50_000_000, 10**9)
    content = Content(
        header=Content(stamp=Content(sec=sec, nanosec=nanosec), frame_id="odom"),
        child_frame_id="base_link",
        pose=Content(
            pose=Content(position=Content(x=x, y=2.0, z=1.0), orientation=Content(w=1.0, x=0.0, y=0.0, z=0.0)),
            covariance=[0.0] * 36,
        ),
        twist=Content(twist=Content(linear=Content(x=0.1, y=0.0, z=0.0))),
    )
    return Heard(1, time.time_ns(), (time.time_ns() + number * 50_000_000, "nav_msgs/msg/Odometry", content))


class FilledTopic:
    """A topic on which three poses wait, one of them with NaN."""

    kind, damaged = "nav_msgs/msg/Odometry", 2

    def __init__(self, name: str, _domain: int) -> None:
        self.name = name
        self._poses = [pose(0), pose(1, math.nan), pose(2)]

    def find(self) -> bool:
        return True

    def fileno(self) -> int:
        return -1

    def take(self, _now_ns: int) -> list[Heard]:
        taken, self._poses = self._poses, []
        return taken

    def silence(self) -> str:
        return "nobody writes it"

    def close(self) -> None:
        pass


@pytest.fixture
def filled(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Have a filled topic stand for every live one; return the vehicle's end of the wire."""
    vehicle, ours = make_pair(("vehicle", "pair"))
    monkeypatch.setattr(play_command, "open_link", lambda _name: ours)
    for command in (play_command, doctor_command):
        monkeypatch.setattr(command, "PoseTopic", FilledTopic)
    return vehicle


PLAY = ("play", "--ros2", "/odom", "--wait", "0", "--until", "0.01")


def test_poses_are_sent_and_what_became_of_them_is_told(viso: Viso, filled: Any) -> None:
    outcome = viso(*PLAY, "--from-zero", "--quality", "70", "--sigma", "0.1,1")
    assert outcome.code == 0
    assert "note: /odom: 1 with a number that is not finite" in outcome.err
    assert "note: /odom: 2 with bytes that cannot be read" in outcome.err
    assert "/odom: 3 poses heard, 0 resets" in outcome.out
    codec, sent = Codec(1, 1), []
    codec.feed(filled.receive())
    while isinstance(received := codec.next_received(), Received):
        if isinstance(received.message, ODOMETRY):
            sent.append(received.message)
    assert [(message.x, message.y, message.quality) for message in sent] == [(0, 0, 70)] * 2
    assert sent[0].pose_covariance[0] == pytest.approx(0.01)


@pytest.mark.usefixtures("filled")
def test_the_same_for_machines(viso: Viso) -> None:
    told = json.loads(viso("play", "ros2:/odom", *PLAY[3:], "--json", "--from-zero").out)
    assert (told["topic"], told["heard"], told["resets"], told["texts"]) == ("/odom", 3, 0, [])
    assert told["sent"]["ODOMETRY"] == 2
    assert told["left_out"] == {"a number that is not finite": 1, "bytes that cannot be read": 2}


@pytest.mark.parametrize(
    ("args", "line"),
    [
        (("--ros2", "/odom", "--rate", "4"), "--rate: not of a live topic, which is sent as it comes"),
        (("ros2:/odom", "-o", "out.tlog"), "--output: not of a live topic, which is sent as it comes"),
        ((), "TRAJECTORY: a file is needed, or a live topic"),
        ((DATA / "trajectories" / "flight.tum", "--ros2", "/odom"), "TRAJECTORY: a file is needed, or a live topic"),
    ],
)
def test_what_does_not_go_with_a_live_topic_is_one_line(viso: Viso, args: tuple[str, ...], line: str) -> None:
    assert failed_with(viso("play", *args), line)


@pytest.mark.usefixtures("filled")
def test_the_doctor_takes_all_that_comes_as_it_is(viso: Viso) -> None:
    outcome = viso("doctor", "ros2:/odom", "--seconds", "0.01", "--filter-seconds", "0", "--lead", "1", "--json")
    told = json.loads(outcome.out)
    assert {"XN5-01", "XN5-19"} <= {finding["code"] for finding in told["findings"]}
    assert "ros2:/odom: 2 messages that could not be read" in told["notes"]


@pytest.mark.usefixtures("filled")
@pytest.mark.parametrize(
    ("args", "line"),
    [
        (("--axes", "sideways"), "--axes: 'sideways' is neither WORLD/BODY, such as ENU/FLU, nor one of"),
        (("--as", "delta"), "--as delta: as recorded, there are odometry, vision, vision+speed, mocap"),
    ],
)
def test_the_doctor_does_not_listen_in_vain(viso: Viso, args: tuple[str, ...], line: str) -> None:
    outcome = viso("doctor", "ros2:/odom", *args)
    assert outcome.code == 2
    assert line in " ".join(outcome.err.split())


@pytest.mark.usefixtures("filled")
def test_the_doctor_tells_why_nothing_came(viso: Viso, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(FilledTopic, "take", lambda _self, _now_ns: [])
    line = "ros2:/odom: nothing heard within 0.01 s: nobody writes it"
    assert failed_with(viso("doctor", "ros2:/odom", "--seconds", "0.01"), line)


@pytest.mark.parametrize("command", [("play", "--ros2", "/odom"), ("doctor", "ros2:/odom")])
def test_without_the_extra_one_line_says_what_to_install(
    viso: Viso, monkeypatch: pytest.MonkeyPatch, command: tuple[str, ...]
) -> None:
    monkeypatch.setitem(sys.modules, "cyclonedds", None)
    line = "ros2:/odom: ROS 2 topics are read and written with cyclonedds; install it with: "
    assert failed_with(viso(*command), line + "pip install 'ardupilot-viso[ros2]'")
