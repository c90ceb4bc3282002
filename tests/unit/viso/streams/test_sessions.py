# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A reboot of the autopilot parts a recording into sessions, and one of them is looked at."""

import json
import struct
from pathlib import Path

import pytest

from mav_handlers.wire.codec import Codec
from mav_handlers.wire.messages import ATTITUDE, HEARTBEAT, PARAM_VALUE, SYSTEM_TIME, Message
from tests.unit.viso.command_line import Viso, failed_with
from tests.unit.viso.conftest import odometry
from viso.doctor.evidence.vehicle_data import listen
from viso.streams.sessions import one_session, sessions_of
from viso.streams.stream_kinds import Stream, StreamMessage

BEAT = HEARTBEAT(2, 3, 81, 0, 3, 3)
LEAD_US = 30_000_000
EPOCH_US = 1_700_000_000_000_000
Said = list[tuple[int, int, int, Message]]


def autopilot(start_us: int, boot_ms: int, seconds: float, viso_type: float = 1.0, system: int = 1) -> Said:
    """Return what an autopilot says from a time on, with its time since boot."""
    said: Said = [(start_us, system, 1, BEAT), (start_us, system, 1, PARAM_VALUE("VISO_TYPE", viso_type, 9, 1, 0))]
    for step_us in range(0, int(seconds * 1e6), 50_000):
        now_ms = boot_ms + step_us // 1000
        said.append((start_us + step_us, system, 1, ATTITUDE(now_ms, 0.0, 0.0, 0.3, 0.0, 0.0, 0.0)))
        if step_us % 1_000_000 == 0:
            said.append((start_us + step_us, system, 1, SYSTEM_TIME(0, now_ms)))
    return said


def camera(start_us: int, seconds: float) -> Said:
    return [(at, 1, 197, odometry(at)) for at in range(start_us, start_us + int(seconds * 1e6), 40_000)]


def stream_of(said: Said) -> Stream:
    codecs: dict[tuple[int, int], Codec] = {}
    frames = []
    for at, system, component, message in sorted(said, key=lambda row: row[0]):
        codec = codecs.setdefault((system, component), Codec(system, component))
        frames.append(StreamMessage(LEAD_US + at, codec.encode(message)))
    return Stream("flight", tuple(frames))


def rebooted() -> Stream:
    """Return a stream of 4 s, a reboot that takes 5 s, and 6 s more with VISO_TYPE changed; the camera never stops."""
    before, after = autopilot(0, 100_000, 4.0), autopilot(9_000_000, 2_500, 6.0, viso_type=2.0)
    return stream_of([*before, *after, *camera(100_000, 14.9)])


def test_recording_without_a_reboot_is_one_session() -> None:
    stream = stream_of([*autopilot(0, 100_000, 4.0), *camera(0, 4.0)])
    assert sessions_of(stream) == (stream,)
    assert one_session(stream) is stream


def test_reboot_parts_the_stream_behind_the_last_old_time() -> None:
    stream = rebooted()
    first, second = sessions_of(stream)
    assert len(first.messages) + len(second.messages) == len(stream.messages)
    # Times are those of the autopilot's clock, which begins again; what came before it ran counts as of its boot.
    assert first.messages[-1].arrival_us == 100_000_000 + 3_950_000
    assert second.messages[0].arrival_us == 0
    told = [listen(session) for session in (first, second)]
    assert [one.params["VISO_TYPE"] for one in told] == [1.0, 2.0]
    assert all(one.changes == () for one in told)
    starts_us = [one.attitude.time_us.min() for one in told if one.attitude is not None]
    assert starts_us == [100_000_000, 2_500_000]


def test_session_with_most_external_navigation_is_taken_unless_told_otherwise() -> None:
    stream = rebooted()
    first, second = sessions_of(stream)
    assert one_session(stream).messages == second.messages
    assert one_session(stream, 1).messages == first.messages
    (note,) = one_session(stream).notes
    assert "its time falls back once; session 2 of 2 is looked at" in note
    assert f"from message {len(first.messages) + 1} of the file on" in note
    assert note.endswith("in each: 97, 276")


def test_parameters_of_a_whole_list_hold_beyond_a_reboot() -> None:
    said = [row for row in autopilot(9_000_000, 2_500, 2.0) if not isinstance(row[3], PARAM_VALUE)]
    _, second = sessions_of(stream_of([*autopilot(0, 100_000, 4.0, viso_type=3.0), *said]))
    assert second.params == {"VISO_TYPE": 3.0}


@pytest.mark.parametrize("others", [
    autopilot(2_000_000, 1_000, 1.0, system=7),  # another vehicle
    [(2_000_000, 1, 197, ATTITUDE(1_000, 0, 0, 0, 0, 0, 0))],  # a companion that counts from its own start
    [(2_000_000, 1, 1, ATTITUDE(100_900, 0, 0, 0, 0, 0, 0))],  # overtaken on the way
])  # fmt: skip
def test_other_clocks_are_no_reboot(others: Said) -> None:
    assert len(sessions_of(stream_of([*autopilot(0, 100_000, 4.0), *others]))) == 1


def test_wrap_of_the_clock_after_seven_weeks_is_no_reboot() -> None:
    said = [*autopilot(0, 2**32 - 2_000, 1.9), *autopilot(2_000_000, 0, 2.0)]
    assert len(sessions_of(stream_of(said))) == 1


def test_every_reboot_counts() -> None:
    said = [row for number in range(3) for row in autopilot(number * 5_000_000, 3_000, 4.0)]
    assert len(sessions_of(stream_of(said))) == 3


def written(stream: Stream) -> Path:
    path = Path("flight.tlog")
    path.write_bytes(
        b"".join(struct.pack(">Q", EPOCH_US + (one.arrival_us or 0)) + one.frame for one in stream.messages)
    )
    return path


@pytest.mark.slow
def test_doctor_says_which_session_it_looks_at(viso: Viso) -> None:
    path = written(rebooted())
    outcome = viso("doctor", path, "--json", "--lead", "3")
    data = json.loads(outcome.out)
    assert any("session 2 of 2" in note for note in data["notes"])
    assert "XN7-13" not in {finding["code"] for finding in data["findings"]}
    assert sum(row["count"] for row in data["summary"]["messages"]) == 276
    first = json.loads(viso("doctor", path, "--json", "--lead", "3", "--session", "1").out)
    assert sum(row["count"] for row in first["summary"]["messages"]) == 97


def test_session_that_is_not_there_is_one_line(viso: Viso) -> None:
    path = written(rebooted())
    assert failed_with(viso("doctor", path, "--session", "3"), "--session 3: there are 2")
    path = written(stream_of(camera(0, 1.0)))
    assert failed_with(viso("doctor", path, "--session", "2"), "--session 2: the autopilot was not rebooted")
