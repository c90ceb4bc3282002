# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Inputs that go on: files that grow, snapshots that are rewritten, links; and that nothing of them is lost."""

import json
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from mav_handlers.links.pair import PairLink, make_pair
from mav_handlers.wire.codec import Codec, Received
from mav_handlers.wire.messages import (
    ATTITUDE,
    COMMAND_LONG,
    GLOBAL_POSITION_INT,
    HEARTBEAT,
    LOCAL_POSITION_NED,
    Message,
)
from viso.errors import InputError
from viso.landmarks import live as landmarks_live
from viso.landmarks.inputs.files import InputOptions
from viso.landmarks.live import Live, standard_lines
from viso.landmarks.types import AircraftReport, Detections, Event, GlobalFix, LandmarkMap, VehiclePose

OPTIONS = InputOptions()
NOW_S = 1_760_000_000.0
SBS = "MSG,3,1,1,{},1,,,,,,4000,,,47.42,8.58,,,0,0,0,0"


def pose_line(t_s: float) -> str:
    return json.dumps({"t_s": t_s, "pose": {"x": 1.0, "y": 2.0, "yaw": 0.1}})


def snapshot(t_s: float, latitude: float = 47.0) -> str:
    aircraft = {"hex": "3c6481", "lat": latitude, "lon": 8.0, "seen_pos": 0.5}
    return json.dumps({"now": t_s, "aircraft": [aircraft]}, indent=1)


@pytest.fixture(autouse=True)
def _in_a_folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(landmarks_live, "LONGEST_WAIT_S", 0.0)


@pytest.fixture
def link(monkeypatch: pytest.MonkeyPatch) -> PairLink:
    """Return the far end of the link that is opened, whatever its name."""
    ours, theirs = make_pair()
    monkeypatch.setattr(landmarks_live, "open_link", lambda _name: ours)
    return theirs


class Script:
    """Does a step each time it is asked whether to stop, and says yes after the last."""

    def __init__(self, *steps: Callable[[], object]) -> None:
        self._steps = list(steps)

    def __call__(self) -> bool:
        if not self._steps:
            return True
        self._steps.pop(0)()
        return False


def no_input() -> int:
    raise AssertionError("standard input is not asked for")


def heard(names: list[str], *steps: Callable[[], object], standard_input: Callable[[], int] = no_input) -> list[Event]:
    """Return the events of inputs while a script runs; whatever its last step leaves is there for the end only."""
    with Live(names, OPTIONS, standard_input, lambda: NOW_S) as live:
        return list(live.events(Script(*steps)))


def append(path: str, text: str) -> Callable[[], object]:
    def write() -> None:
        with Path(path).open("a") as file:
            file.write(text)

    return write


def nothing() -> None:
    """Let a round pass."""


def test_lines_are_read_on_as_they_arrive() -> None:
    Path("a.jsonl").write_text(pose_line(1.0) + "\n")
    events = heard(["a.jsonl"], nothing, append("a.jsonl", pose_line(2.0) + "\n"), nothing)
    assert [event.t_s for event in events] == [1.0, 2.0]


def test_line_that_came_just_before_the_end_counts_though_it_has_no_end() -> None:
    Path("a.jsonl").write_text(pose_line(1.0) + "\n")
    events = heard(["a.jsonl"], nothing, append("a.jsonl", pose_line(2.0) + "\n" + pose_line(3.0)))
    assert [event.t_s for event in events] == [1.0, 2.0, 3.0]


def test_line_that_comes_in_pieces_is_one() -> None:
    Path("a.jsonl").write_text("")
    line = pose_line(5.0)
    events = heard(["a.jsonl"], append("a.jsonl", line[:9]), nothing, append("a.jsonl", line[9:] + "\n"), nothing)
    assert [event.t_s for event in events] == [5.0]


def test_lines_without_a_time_have_that_of_their_arrival() -> None:
    Path("a.jsonl").write_text('{"observations": []}\n')
    assert heard(["a.jsonl"], nothing) == [Detections(NOW_S)]


def test_lines_of_no_known_format_are_counted() -> None:
    Path("a.jsonl").write_text(pose_line(1.0) + "\n")
    Path("b.jsonl").write_text("")
    with Live(["a.jsonl", "b.jsonl"], OPTIONS, no_input, lambda: NOW_S) as live:
        list(live.events(Script(append("b.jsonl", "?\n" + pose_line(1.0) + "\n{\n"), nothing)))
        assert live.refused() == {"b.jsonl": {"a line of no known format": 1, "not JSON": 1}}


def test_record_over_several_lines_is_read_once() -> None:
    record = {"landmarks": [{"id": 0, "x": 1, "y": 2}]}
    Path("map.json").write_text(json.dumps(record, indent=2))
    events = heard(["map.json"], nothing, nothing)
    assert [type(event) for event in events] == [LandmarkMap]


def test_inputs_that_are_all_over_end_it() -> None:
    Path("map.json").write_text(json.dumps({"landmarks": []}, indent=2) + "\n\n{")
    Path("map.json").write_text(json.dumps({"landmarks": []}, indent=2))
    with Live(["map.json"], OPTIONS, no_input, lambda: NOW_S) as live:
        assert len(list(live.events(lambda: False))) == 1


def test_snapshot_is_read_whenever_it_is_new() -> None:
    Path("aircraft.json").write_text(snapshot(10.0))

    def renew() -> None:
        Path("new.json").write_text(snapshot(20.0, 47.5))
        Path("new.json").replace("aircraft.json")

    def vanish() -> None:
        Path("aircraft.json").unlink()

    events = heard(["aircraft.json"], nothing, nothing, renew, nothing, vanish, nothing)
    assert [(event.t_s, event.latitude_deg) for event in events if isinstance(event, AircraftReport)] == [
        (9.5, 47.0),
        (19.5, 47.5),
    ]
    assert len(events) == 2


def test_standard_input_ends_with_its_writer() -> None:
    reading, writing = os.pipe()
    os.write(writing, (pose_line(1.0) + "\n" + pose_line(2.0)).encode())
    os.close(writing)
    with Live(["-"], OPTIONS, lambda: reading, lambda: NOW_S) as live:
        events = list(live.events(lambda: False))
    os.close(reading)
    assert [event.t_s for event in events] == [1.0, 2.0]


def test_lines_of_standard_input_end_when_it_is_enough() -> None:
    reading, writing = os.pipe()
    os.write(writing, b"one\ntwo\nthr")
    assert list(standard_lines(reading, Script(nothing, nothing))) == ["one", "two", "thr"]
    os.close(writing)
    os.close(reading)


def test_time_limit_ends_it() -> None:
    Path("a.jsonl").write_text(pose_line(1.0) + "\n")
    times = iter(range(100))
    with Live(["a.jsonl"], OPTIONS, no_input, lambda: float(next(times))) as live:
        assert len(list(live.events(lambda: False, until_s=20.0))) == 1
    assert next(times) < 40


def messages(end: PairLink) -> Iterator[Message]:
    """Yield what has arrived at an end of a link."""
    codec = Codec(1, 1)
    while data := end.receive():
        codec.feed(data)
    while (received := codec.next_received()) is not None:
        assert isinstance(received, Received)
        assert received.message is not None
        yield received.message


def test_vehicle_on_a_link_is_asked_for_poses_and_heard(link: PairLink) -> None:
    codec = Codec(1, 1)
    position = LOCAL_POSITION_NED(1000, 10.0, 20.0, -3.0, 0.0, 0.0, 0.0)
    attitude = ATTITUDE(1000, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0)
    fix = GLOBAL_POSITION_INT(1000, 470000000, 80000000, 500000, 3000, 0, 0, 0, 0)

    def tell() -> None:
        link.send(b"".join(map(codec.encode, (position, attitude, fix))))

    events = heard(["udpin:14550"], tell, nothing)
    (pose,) = [event for event in events if isinstance(event, VehiclePose)]
    assert (pose.t_s, pose.x_m, pose.y_m, pose.z_m) == (NOW_S, 20.0, 10.0, 3.0)
    assert [type(event) for event in events] == [VehiclePose, GlobalFix]
    sent: list[Any] = list(messages(link))
    assert isinstance(sent[0], HEARTBEAT)
    assert {one.param1 for one in sent if isinstance(one, COMMAND_LONG)} == {30, 32, 33}
    assert len([one for one in sent if isinstance(one, HEARTBEAT)]) == 1


def test_base_station_on_a_link_is_heard_to_its_last_line(link: PairLink) -> None:
    def tell() -> None:
        link.send((SBS.format("3C6481") + "\r\n" + SBS.format("4B1803")).encode())

    events = heard(["sbs:localhost:30003"], tell)
    assert [(event.t_s, event.icao) for event in events if isinstance(event, AircraftReport)] == [
        (NOW_S, "3C6481"),
        (NOW_S, "4B1803"),
    ]


def test_base_station_is_a_tcp_link(monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[str] = []

    def open_link(name: str) -> PairLink:
        opened.append(name)
        return make_pair()[0]

    monkeypatch.setattr(landmarks_live, "open_link", open_link)
    heard(["sbs:10.0.0.2:30003"])
    assert opened == ["tcp:10.0.0.2:30003"]


@pytest.mark.parametrize("name", ["none.jsonl", "none.tlog", "none.json"])
def test_file_that_is_not_there_is_one_line(name: str) -> None:
    with pytest.raises(InputError, match=f"^{name}: "):
        heard([name], nothing)


def test_links_are_closed_when_another_input_is_wrong(link: PairLink) -> None:
    with pytest.raises(InputError, match=r"none\.jsonl"):
        Live(["udpin:1", "none.jsonl"], OPTIONS, no_input)
    link.send(b"x")
    assert link.stats.bytes_dropped == 1
