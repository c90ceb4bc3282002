# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""``viso play``: into a log, over a link to a vehicle, and what it refuses."""

import json
import math
import re
import shlex
from io import StringIO
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from mav_handlers.links import read_tlog
from mav_handlers.links.pair import PairLink, make_pair
from mav_handlers.wire.codec import Codec, Received
from mav_handlers.wire.messages import HEARTBEAT, ODOMETRY, STATUSTEXT, Message
from tests.places import ROOT
from tests.unit.viso.command_line import Outcome, Viso, failed_with
from viso.commands import play as play_command
from viso.geometry.frame_change import PRESETS
from viso.streams.messages import FORMS
from viso.streams.readers import FORMATS, Source, load_trajectory

FLIGHT = ROOT / "tests" / "data" / "trajectories" / "flight.tum"
CLIP = ROOT.parent / "shared" / "data" / "euroc_mh01_clip" / "groundtruth.tum"
PAGE = ROOT / "docs" / "recorded.md"
ALIVE = HEARTBEAT(2, 3, 0, 0, 4, 3)


def logged(viso: Viso, *args: object) -> list[Any]:
    """Play into a log and return the messages in it, but for the heartbeats."""
    assert viso("play", FLIGHT, "-o", "flight.tlog", *args).code == 0
    codec = Codec(1, 1)
    found: list[Any] = []
    for entry in read_tlog("flight.tlog"):
        codec.feed(entry.data)
        received = codec.next_received()
        assert isinstance(received, Received)
        if not isinstance(received.message, HEARTBEAT):
            found.append(received.message)
    return found


def replayed(viso: Viso, *params: str) -> dict[tuple[str, str], int]:
    """Replay the log and return how many messages of each type met each outcome."""
    outcome = viso("replay", "flight.tlog", "--json", "--lead", "3", *(f"--param={param}" for param in params))
    rows = json.loads(outcome.out)["verdicts"]
    return {(row["message"], row["outcome"]): row["count"] for row in rows}


@pytest.fixture
def played(viso: Viso, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Return a function that plays over a wire on which a vehicle has said something; and the vehicle's end of it."""
    vehicle, ours = make_pair(("vehicle", "pair"))

    def run(*args: object, said: tuple[Message, ...] = (ALIVE,)) -> tuple[Outcome, PairLink]:
        vehicle.send(b"".join(map(Codec(1, 1).encode, said)))
        monkeypatch.setattr(play_command, "open_link", lambda _name: ours)
        return viso("play", FLIGHT, "--master", "pair", "--speedup", "1000", *args), vehicle

    return run


@pytest.mark.parametrize(
    ("form", "types"),
    [
        ("odometry", ["ODOMETRY"]),
        ("vision", ["VISION_POSITION_ESTIMATE"]),
        ("vision+speed", ["VISION_POSITION_ESTIMATE", "VISION_SPEED_ESTIMATE"]),
        ("delta", ["VISION_POSITION_DELTA"]),
        ("mocap", ["ATT_POS_MOCAP"]),
    ],
)
def test_replay_accepts_every_message_of_every_form(viso: Viso, form: str, types: list[str]) -> None:
    sent = logged(viso, "--as", form, "--until", "1")
    count = 10 if form == "delta" else 11
    assert {type(message).__name__ for message in sent} == set(types)
    assert replayed(viso, "VISO_TYPE=1") == {(name, "accepted"): count for name in types} | {
        ("HEARTBEAT", "handled"): 2
    }


def test_options_reach_the_messages(viso: Viso) -> None:
    changed = ["--yaw", "90", "--scale", "2", "--quality", "55", "--sigma", "0.5,1", "--stamp-offset", "9"]
    plain, other = logged(viso)[80], logged(viso, *changed)[80]
    assert (other.x, other.y, other.z) == pytest.approx((-2 * plain.y, 2 * plain.x, 2 * plain.z), abs=1e-5)
    assert (other.quality, other.time_usec - plain.time_usec) == (55, 9_000_000)
    assert other.pose_covariance[0] == pytest.approx(0.25)


def test_covariance_may_be_withheld(viso: Viso) -> None:
    assert all(math.isnan(message.pose_covariance[0]) for message in logged(viso, "--sigma", "none", "--until", "1"))


def test_rate_speed_and_delay_reach_the_messages(viso: Viso) -> None:
    sent = logged(viso, "--rate", "50", "--speed", "2", "--delay", "3", "--until", "4")
    assert [message.time_usec for message in sent[:3]] == [3_000_000, 3_010_000, 3_020_000]
    assert len(sent) == 101


def test_flight_is_north_east_down(viso: Viso) -> None:
    sent = logged(viso, "--as", "vision+speed")
    poses, speeds = sent[0::2], sent[1::2]
    assert min(pose.z for pose in poses) == -2.0
    assert max(abs(pose.yaw) for pose in poses) < 1e-3  # it heads north all the time
    assert speeds[55].x > 0.5  # and flies north at first


def test_jump_counts_up_the_reset_counter(viso: Viso) -> None:
    Path("jump.tum").write_text("".join(f"{t / 10} {5 * (t > 3)} 0 0 0 0 0 1\n" for t in range(8)))
    assert viso("play", "jump.tum", "-o", "jump.tlog", "--reset-jump", "1").code == 0
    codec = Codec(1, 1)
    for entry in read_tlog("jump.tlog"):
        codec.feed(entry.data)
    counters = []
    while isinstance(received := codec.next_received(), Received):
        counters += [received.message.reset_counter] if isinstance(received.message, ODOMETRY) else []
    assert counters == [0, 0, 0, 0, 1, 1, 1, 1]


def test_what_was_left_out_is_noted(viso: Viso) -> None:
    Path("bad.tum").write_text("0 0 0 0 0 0 0 1\n0 0 0 0 0 0 0 1\n1 nan 0 0 0 0 0 1\n2 0 0 0 0 0 0 1\n")
    outcome = viso("play", "bad.tum", "-o", "bad.tlog")
    assert outcome.code == 0
    assert outcome.err.splitlines() == [
        "note: bad.tum: 1 with a number that is not finite",
        "note: bad.tum: 1 with a time not after the one before",
    ]


def test_counts_for_machines(viso: Viso) -> None:
    told = json.loads(viso("play", FLIGHT, "-o", "flight.tlog", "--json").out)
    assert told == {"records": 161, "left_out": {}, "sent": {"HEARTBEAT": 17, "ODOMETRY": 161}, "texts": []}


def test_same_command_twice_writes_the_same_bytes(viso: Viso) -> None:
    logged(viso, "--until", "2")
    first = Path("flight.tlog").read_bytes()
    logged(viso, "--until", "2")
    assert Path("flight.tlog").read_bytes() == first


def test_texts_and_counts_are_shown_when_played_over_a_link(played: Any) -> None:
    outcome, vehicle = played(said=(ALIVE, STATUSTEXT(6, "ArduPilot Ready")))
    assert (outcome.code, outcome.err) == (0, "")
    assert "(6) ArduPilot Ready" in outcome.out
    assert "ODOMETRY" in outcome.out
    codec = Codec(1, 1)
    codec.feed(vehicle.receive())
    assert isinstance(received := codec.next_received(), Received)
    assert (received.header.name, received.header.component_id) == ("HEARTBEAT", 197)


def test_counts_grow_on_a_terminal(played: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = StringIO()
    monkeypatch.setattr(play_command, "out", Console(file=terminal, force_terminal=True, width=80))
    outcome, _ = played()
    assert outcome.code == 0
    assert terminal.getvalue().count("What was sent") >= 2  # drawn at the start, and left standing at the end


def test_link_for_machines(played: Any) -> None:
    outcome, _ = played("--json", said=(STATUSTEXT(4, "PreArm: no"),))
    told = json.loads(outcome.out)
    assert told["texts"] == [{"severity": 4, "text": "PreArm: no"}]
    assert told["sent"]["ODOMETRY"] == 161


def test_vehicle_that_is_not_heard_is_one_line(played: Any) -> None:
    outcome, _ = played("--wait", "0.01", "--json", said=())
    assert outcome.code == 2
    assert outcome.err.endswith("viso: --master pair: no vehicle heard within 0.01 s (--wait 0 plays unheard)\n")


def test_server_that_refuses_is_named_as_that(viso: Viso) -> None:
    outcome = viso("play", FLIGHT, "--master", "tcp:127.0.0.1:1", "--wait", "0.05", "--json")
    line = "no vehicle heard within 0.05 s: connection refused (--wait 0 plays unheard)"
    assert outcome.err.endswith(f"viso: --master tcp:127.0.0.1:1: {line}\n")


def test_unheard_playing_is_possible(played: Any) -> None:
    outcome, _ = played("--wait", "0", said=())
    assert outcome.code == 0


def test_losses_are_noted(viso: Viso, monkeypatch: pytest.MonkeyPatch) -> None:
    vehicle, ours = make_pair()
    vehicle.close()
    monkeypatch.setattr(play_command, "open_link", lambda _name: ours)
    outcome = viso("play", FLIGHT, "--master", "pair", "--speedup", "1000", "--wait", "0")
    assert outcome.code == 0
    assert outcome.err.startswith("note: pair: ")
    assert outcome.err.endswith(" bytes did not reach the vehicle: no peer\n")


def test_link_that_cannot_be_opened_is_one_line(viso: Viso) -> None:
    outcome = viso("play", FLIGHT, "--master", "nosuch")
    assert outcome.code == 2
    assert outcome.err.startswith("viso: bad connection string 'nosuch': ")


@pytest.mark.parametrize(
    ("args", "line"),
    [
        (["--as", "x"], f"--as x: there are {', '.join(FORMS)}"),
        (["--format", "x"], f"no format 'x'; there are {', '.join(FORMATS)}"),
        (["--axes", "x"], f"--axes: 'x' is neither WORLD/BODY, such as ENU/FLU, nor one of {', '.join(PRESETS)}"),
        (["--mounting", "1,2"], "--mounting: '1,2': 3, 4 or 9 numbers make a rotation, not 2"),
        (["--sigma", "1"], "--sigma 1: neither METRES,DEGREES nor none"),
        (["--sigma=-1,1"], "--sigma -1: not between 0 and 1000"),
        (["--rate", "0"], "--rate 0: not between 0.1 and 1000"),
        (["--rate", "nan"], "--rate nan: not between 0.1 and 1000"),
        (["--scale", "0"], "--scale 0: not between 1e-06 and 1e+06"),
        (["--speed", "0"], "--speed 0: not between 0.01 and 100"),
        (["--speedup", "inf"], "--speedup inf: not between 0.01 and 1000"),
        (["--quality", "101"], "--quality 101: not between -1 and 100"),
        (["--until", "-1"], "--until -1: not between 0 and 4e+09"),
        (["--master", "tcp:127.0.0.1:1"], "--master and --output: use one of the two"),
        (["--loop"], "--loop: a log without an end needs --until"),
    ],
)
def test_option_that_cannot_be_used_is_one_line(viso: Viso, args: list[str], line: str) -> None:
    assert failed_with(viso("play", FLIGHT, "-o", "flight.tlog", *args), line)
    assert not Path("flight.tlog").exists()


@pytest.mark.parametrize("name", ["none.tum", "none.bag"])
def test_file_that_is_not_there_is_one_line(viso: Viso, name: str) -> None:
    outcome = viso("play", name, "-o", "flight.tlog")
    assert (outcome.code, outcome.out) == (2, "")
    assert outcome.err.startswith(f"viso: {name}: ")
    assert outcome.err.count("\n") == 1


@pytest.mark.parametrize("command", re.findall(r"viso play (?!--ros2)[^`\n]+", PAGE.read_text(encoding="utf-8")))
def test_command_of_the_page_works(viso: Viso, monkeypatch: pytest.MonkeyPatch, command: str) -> None:
    recorded = load_trajectory(Source(FLIGHT))  # in the place of files that only their owners have
    _, ours = make_pair()
    monkeypatch.setattr(play_command, "load", lambda _source, _format, **_options: recorded)
    monkeypatch.setattr(play_command, "open_link", lambda _name: ours)
    program, *args = shlex.split(command)
    outcome = viso(*args, "--until", "0.5", "--wait", "0", "--speedup", "1000")
    assert (program, outcome.code, outcome.err) == ("viso", 0, "")


@pytest.mark.slow
@pytest.mark.skipif(not CLIP.exists(), reason=f"{CLIP.parent.name} is not there")
def test_ground_truth_of_euroc_is_accepted_and_fused(viso: Viso) -> None:
    args = ["--axes", "euroc", "--mounting", "0,-25,0", "--rate", "30", "--until", "5"]
    assert viso("play", CLIP, "-o", "flight.tlog", *args).code == 0
    outcome = viso("replay", "flight.tlog", "--preset", "voxl", "--ekf", "--json")
    told = json.loads(outcome.out)
    assert {row["message"]: row["outcome"] for row in told["verdicts"]}["ODOMETRY"] == "accepted"
    assert all(row["rejected"] == 0 for row in told["innovations"])
