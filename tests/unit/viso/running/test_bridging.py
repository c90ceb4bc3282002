# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Poses of a topic to an autopilot, by a clock that moves only when there is nothing to do; the topic is a list."""

from collections.abc import Callable, Iterable
from types import SimpleNamespace as Content
from typing import Any, cast

import numpy as np
import pytest

from mav_handlers.links.base import Readable
from mav_handlers.links.pair import make_pair
from mav_handlers.wire.codec import Codec, Received
from mav_handlers.wire.messages import HEARTBEAT, ODOMETRY, STATUSTEXT, TIMESYNC, Message
from viso.dds.poses import Heard, PoseTopic
from viso.geometry.frame_change import FrameChange, parse_axes
from viso.running import bridging
from viso.running.bridging import SECOND_WRITER, Bridge, delay_lines
from viso.streams.live import LiveOptions, LivePoses
from viso.streams.player import Text

START_NS = 1_700_000_000 * 10**9
MS = 1_000_000


class ListedTopic:
    """A topic on which poses come at times that a test has said."""

    name, damaged = "/odom", 0
    kind = "nav_msgs/msg/Odometry"

    def __init__(self, now_ns: Callable[[], int]) -> None:
        self._now_ns = now_ns
        self.coming: list[tuple[int, Heard]] = []

    def find(self) -> bool:
        return True

    def fileno(self) -> int:
        return -1

    def silence(self) -> str:
        return "nobody writes it"

    def take(self, _now_ns: int) -> list[Heard]:
        now_ns = self._now_ns()
        come = [heard for due_ns, heard in self.coming if due_ns <= now_ns]
        self.coming = [(due_ns, heard) for due_ns, heard in self.coming if due_ns > now_ns]
        return come

    def say(self, time_ms: int, *, writer: int = 1, x: float = 0.0, age_ms: int = 5, late_ms: int = 2) -> None:
        """Have a pose come at a time since the start, of an age, and so long after it was written."""
        due_ns = START_NS + time_ms * MS
        sec, nanosec = divmod(due_ns - age_ms * MS, 10**9)
        ahead, level = Content(x=1.0, y=0.0, z=0.0), Content(w=1.0, x=0.0, y=0.0, z=0.0)
        content = Content(
            header=Content(stamp=Content(sec=sec, nanosec=nanosec), frame_id="odom"),
            child_frame_id="base_link",
            pose=Content(pose=Content(position=Content(x=x, y=0.0, z=1.0), orientation=level), covariance=[0.0] * 36),
            twist=Content(twist=Content(linear=ahead)),
        )
        self.coming.append((due_ns, Heard(writer, due_ns - late_ms * MS, (due_ns, self.kind, content))))


class Rig:
    """A bridge between a listed topic and a wire; time moves while it waits."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now_ns = START_NS
        self.set_ns = 0
        self.topic = ListedTopic(lambda: self.now_ns)
        self.news: list[str] = []
        self.texts: list[Text] = []
        ours, self._vehicle = make_pair()
        self._codec = Codec(1, 1)
        monkeypatch.setattr(bridging, "wait_readable", self._wait)
        change = FrameChange(*parse_axes("enu_flu"), np.eye(3))
        self.bridge = Bridge(
            ours,
            cast(PoseTopic, self.topic),
            LivePoses(LiveOptions(change.apply)),
            on_text=self.texts.append,
            on_news=self.news.append,
            stop=lambda: False,
            wall_ns=lambda: self.now_ns + self.set_ns,
            now_ns=lambda: self.now_ns - START_NS,
        )

    def _wait(self, _links: Iterable[Readable], timeout_s: float) -> list[Readable]:
        due_ns = min((due_ns for due_ns, _ in self.topic.coming), default=self.now_ns + 10**12)
        self.now_ns = max(self.now_ns + 1000, min(due_ns, self.now_ns + round(timeout_s * 1e9)))
        return []

    def say(self, message: Message) -> None:
        self._vehicle.send(self._codec.encode(message))

    def run(self, seconds: float) -> list[Any]:
        """Run, and return what arrived at the autopilot."""
        self.bridge.run(round(seconds * 1e6))
        while data := self._vehicle.receive():
            self._codec.feed(data)
        arrived = []
        while (received := self._codec.next_received()) is not None:
            assert isinstance(received, Received)
            arrived.append(received.message)
        return arrived


@pytest.fixture
def rig(monkeypatch: pytest.MonkeyPatch) -> Rig:
    return Rig(monkeypatch)


def counters(arrived: list[Any]) -> list[int]:
    return [message.reset_counter for message in arrived if isinstance(message, ODOMETRY)]


def test_each_pose_goes_out_as_it_comes_beside_a_heartbeat_a_second(rig: Rig) -> None:
    for time_ms in range(0, 2000, 33):
        rig.topic.say(time_ms)
    arrived = rig.run(2.5)
    assert len(counters(arrived)) == 61
    assert sum(isinstance(message, HEARTBEAT) for message in arrived) == 3
    assert rig.news == ["/odom: waiting for poses", "/odom: poses come, nav_msgs/msg/Odometry"]


def test_it_tells_how_late_poses_are_and_what_delay_fits(rig: Rig) -> None:
    for time_ms in range(0, 1000, 50):
        rig.topic.say(time_ms)
    rig.run(1.0)
    assert list(delay_lines(rig.bridge.summary())) == [
        "From publishing to sending: 2.0 ms, 99 % within 2.0 ms.",
        "From the stamp to sending: 5.0 ms, 99 % within 5.0 ms.",
        "VISO_DELAY_MS 5 fits.",
    ]


def test_stamps_of_another_clock_tell_no_delay(rig: Rig) -> None:
    rig.topic.say(0, age_ms=86_400_000)
    rig.run(0.5)
    assert list(delay_lines(rig.bridge.summary()))[1:] == [
        "From the stamp to sending: not known, as that is told by another clock than this machine's."
    ]


def test_a_wall_clock_that_is_set_back_stops_nothing(rig: Rig) -> None:
    rig.set_ns = -3_600_000 * MS
    rig.topic.say(1500)
    arrived = rig.run(2.5)
    assert sum(isinstance(message, HEARTBEAT) for message in arrived) == 3
    assert len(counters(arrived)) == 1


def test_another_sender_counts_once_the_first_is_silent(rig: Rig) -> None:
    for time_ms, writer in ((0, 1), (100, 2), (200, 1), (1300, 2), (1400, 2)):
        rig.topic.say(time_ms, writer=writer)
    assert counters(rig.run(2.0)) == [0, 0, 1, 1]
    assert rig.bridge.summary()["left_out"] == {SECOND_WRITER: 1}


def test_silence_is_told_once_and_that_it_ends(rig: Rig) -> None:
    rig.topic.say(10_000)
    rig.run(20.0)
    silent = "/odom: nothing heard for 3 s: nobody writes it"
    assert rig.news[1:] == [silent, "/odom: poses come, nav_msgs/msg/Odometry", silent]


def test_it_keeps_time_with_the_autopilot_and_hears_it(rig: Rig) -> None:
    rig.say(TIMESYNC(0, 123))
    rig.say(STATUSTEXT(6, "EKF3 IMU0 is using external nav data"))
    arrived = [message for message in rig.run(0.1) if isinstance(message, TIMESYNC)]
    assert [message.ts1 for message in arrived if message.tc1] == [123]
    (asked,) = (message for message in arrived if not message.tc1)
    rig.say(TIMESYNC(456, asked.ts1))
    rig.run(0.01)
    assert rig.bridge.summary()["round_trip_ms"] is None  # 100 ms there and back are too long to tell anything
    assert [text.text for text in rig.texts] == ["EKF3 IMU0 is using external nav data"]


def test_it_waits_for_a_vehicle_no_longer_than_it_is_told(rig: Rig) -> None:
    assert not rig.bridge.wait_for_vehicle(0.5)
    assert rig.now_ns - START_NS == pytest.approx(0.5e9, rel=0.3)
    rig.say(HEARTBEAT(2, 3, 0, 0, 4, 3))
    assert rig.bridge.wait_for_vehicle(5.0)
