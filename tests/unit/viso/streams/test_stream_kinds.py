# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Recorded streams are read, or refused with the place and the reason."""

import gzip
import json
import struct
from pathlib import Path

import pytest

from mav_handlers.wire.codec import Codec
from mav_handlers.wire.messages import HEARTBEAT
from viso.errors import InputError
from viso.streams.heard import firmware_of_recording
from viso.streams.stream_kinds import CAPTURE_BAUD, STREAM_KINDS, StreamMessage, TrajectoryOptions, kind_of, read_stream

HEADER = {"name": "short", "params": {"VISO_TYPE": 1, "VISO_SCALE": 1.5}}
NO_AUTOPILOT = "flight: no autopilot is in this recording: what it answered, and what its filter did, is not known"
FRAME = Codec(1, 197).encode(HEARTBEAT(18, 8, 0, 0, 4, 3))


def message(arrival_us: object, frame: bytes = FRAME) -> dict[str, object]:
    return {"arrival_us": arrival_us, "type": "HEARTBEAT", "msg": frame.hex(), "out": []}


def capture(path: Path, *lines: object) -> Path:
    file = path / "capture.jsonl"
    file.write_text("".join((line if isinstance(line, str) else json.dumps(line)) + "\n" for line in lines))
    return file


def tlog(path: Path, *stamps_us: int, tail: bytes = b"") -> Path:
    file = path / "flight.tlog"
    file.write_bytes(b"".join(struct.pack(">Q", stamp) + FRAME for stamp in stamps_us) + tail)
    return file


# Captures


def test_capture_is_read(tmp_path: Path) -> None:
    stream = read_stream(capture(tmp_path, HEADER, message(None), message(5), message(5)), 0)
    assert stream.name == "short"
    assert stream.params == {"VISO_TYPE": 1.0, "VISO_SCALE": 1.5}
    assert stream.messages == (StreamMessage(None, FRAME), StreamMessage(5, FRAME), StreamMessage(5, FRAME))
    assert (stream.baud, stream.shared_arrival) == (CAPTURE_BAUD, True)


@pytest.mark.parametrize(
    ("told", "name"),
    [
        ("ArduCopter 4.7.0-dev SITL x86-64", "2025-07"),
        ("ArduCopter 4.7.0-dev of February 2026, SITL x86-64", "2026-02"),
        ("ArduCopter V4.7.0 (12345678)", "4.7"),
        ("unknown", "4.7"),
    ],
)
def test_capture_names_the_release_that_flew(tmp_path: Path, told: str, name: str) -> None:
    stream = read_stream(capture(tmp_path, {**HEADER, "firmware": told}), 0)
    judged_by = firmware_of_recording(stream)
    assert judged_by.firmware.name == name
    assert ("the recording says" in judged_by.reason) == (told != "unknown")


def test_packed_capture_is_read(tmp_path: Path) -> None:
    packed = tmp_path / "capture.jsonl.gz"
    packed.write_bytes(gzip.compress(capture(tmp_path, HEADER, message(5)).read_bytes()))
    assert read_stream(packed, 0).messages == (StreamMessage(5, FRAME),)


def test_capture_without_messages_is_a_stream(tmp_path: Path) -> None:
    assert read_stream(capture(tmp_path, HEADER), 0).messages == ()


@pytest.mark.parametrize(("lines", "error"), [
    ([HEADER, "{"], ":2: not JSON: "),
    ([HEADER, message(5), "", "no"], ":4: not JSON: Expecting value in column 1"),
    (["[]"], ":1: the first line of a capture is an object with 'name' and 'params'"),
    (['{"name": "x"}'], ":1: the first line of a capture"),
    ([{"params": {"VISO_TYPE": "1"}}], ":1: not a finite number: '1'"),
    ([{"params": {"VISO_TYPE": True}}], ":1: not a finite number: True"),
    (['{"params": {"VISO_TYPE": NaN}}'], ":1: not a finite number: nan"),
    (['{"params": {"VISO_TYPE": 1e39}}'], ":1: not a finite number: 1e+39"),
    ([{"params": {"VISO_TYPE": 10**400}}], ":1: not a finite number: 1000"),
    ([HEADER, "[]"], ":2: a message is an object with 'arrival_us' and 'msg'"),
    ([HEADER, '{"arrival_us": 5}'], ":2: a message is an object"),
    ([HEADER, message("5")], ":2: 'arrival_us' is not a time: '5'"),
    ([HEADER, message(1.5)], ":2: 'arrival_us' is not a time: 1.5"),
    ([HEADER, message(-1)], ":2: 'arrival_us' is not a time: -1"),
    ([HEADER, message(True)], ":2: 'arrival_us' is not a time: True"),
    ([HEADER, {"msg": 7}], ":2: 'msg' is not text in hex"),
    ([HEADER, {"msg": "0g"}], ":2: non-hexadecimal number"),
    ([HEADER, message(5), message(4)], ":3: 'arrival_us' runs backwards: 4 after 5"),
    ([HEADER, message(5), message(10**15)], ":3: 'arrival_us' leaps over more than a day: 1000000000000000 after 5"),
    ([HEADER, message(5), message(None), message(4)], ":4: 'arrival_us' runs backwards: 4 after 5"),
    ([], ": an empty capture"),
])  # fmt: skip
def test_capture_error_names_file_and_line(tmp_path: Path, lines: list[object], error: str) -> None:
    path = capture(tmp_path, *lines)
    with pytest.raises(InputError) as raised:
        read_stream(path, 0)
    assert str(raised.value).startswith(f"{path}{error}")
    assert "\n" not in str(raised.value)


# Telemetry logs


def test_telemetry_log_begins_at_the_lead(tmp_path: Path) -> None:
    stream = read_stream(tlog(tmp_path, 1_000_000, 1_033_333), 30_000_000)
    assert [message.arrival_us for message in stream.messages] == [30_000_000, 30_033_333]
    assert [message.frame for message in stream.messages] == [FRAME, FRAME]


def test_telemetry_log_has_no_transport_time_and_no_parameters(tmp_path: Path) -> None:
    stream = read_stream(tlog(tmp_path, 1_000_000), 0)
    assert (stream.name, stream.baud, stream.shared_arrival, stream.params) == ("flight", None, False, {})


def test_stamp_that_runs_backwards_counts_as_its_predecessors(tmp_path: Path) -> None:
    stream = read_stream(tlog(tmp_path, 1_000_000, 2_000_000, 1_500_000, 2_500_000), 0)
    assert [message.arrival_us for message in stream.messages] == [0, 1_000_000, 1_000_000, 1_500_000]


def test_telemetry_log_that_is_cut_short_is_noted(tmp_path: Path) -> None:
    path = tlog(tmp_path, 1_000_000, tail=struct.pack(">Q", 2_000_000) + FRAME[:5])
    stream = read_stream(path, 0)
    assert len(stream.messages) == 1
    assert stream.notes == (f"{path}: the last entry is cut short", NO_AUTOPILOT)


def test_damage_in_a_telemetry_log_is_noted(tmp_path: Path) -> None:
    path = tlog(tmp_path, *range(1_000_000, 9_000_000, 1_000_000))
    data = path.read_bytes()
    half = len(data) // 2
    path.write_bytes(data[:half] + b"\xff" * 7 + data[half:])
    stream = read_stream(path, 0)
    assert len(stream.messages) == 8
    assert stream.notes == (f"{path}: 7 damaged bytes passed over", NO_AUTOPILOT)


def test_missing_telemetry_log_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none\.tlog"):
        read_stream(tmp_path / "none.tlog", 0)


# Kinds


def test_ending_is_recognised_in_capitals(tmp_path: Path) -> None:
    path = tlog(tmp_path, 1_000_000).rename(tmp_path / "FLIGHT.TLOG")
    assert len(read_stream(path, 0).messages) == 1


@pytest.mark.parametrize(("name", "kind"), [
    ("flight.jsonl", "capture"),
    ("flight.jsonl.gz", "capture"),
    ("flight.tlog.gz", "telemetry log"),
    ("00000001.BIN", "DataFlash log"),
    ("flight.bin.xz", "DataFlash log"),
    ("poses.tum", "trajectory"),
    ("00.txt", "trajectory"),
    ("vio.csv", "trajectory"),
    ("flight.bag", "trajectory"),
    ("flight.mcap", "trajectory"),
    ("flight.db3", "trajectory"),
])  # fmt: skip
def test_kind_is_known_by_the_ending(name: str, kind: str) -> None:
    assert kind_of(Path(name)) == kind


def test_folder_is_a_bag(tmp_path: Path) -> None:
    assert kind_of(tmp_path) == "trajectory"


def test_file_with_a_format_of_trajectories_is_one() -> None:
    assert kind_of(Path("poses"), TrajectoryOptions(format_name="tum")) == "trajectory"


@pytest.mark.parametrize("name", ["flight", "flight.json", "jsonl", "flight.xz"])
def test_other_kind_is_refused(name: str) -> None:
    with pytest.raises(InputError, match=rf"^{name}: by its ending no recorded stream; there are: capture \(\.jsonl"):
        read_stream(Path(name), 0)


@pytest.mark.parametrize("name", ["flight.tlog", "flight.jsonl", "flight.BIN"])
def test_options_of_trajectories_are_refused_for_others(name: str) -> None:
    with pytest.raises(InputError, match=rf"^{name}: --as, .*--rate are for trajectories"):
        read_stream(Path(name), 0, TrajectoryOptions(axes="ned_frd"))


def test_every_kind_says_what_it_is() -> None:
    endings = [ending for row in STREAM_KINDS.values() for ending in row.endings]
    assert len(endings) == len(set(endings))
    assert all(row.content for row in STREAM_KINDS.values())
