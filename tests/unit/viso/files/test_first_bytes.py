# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Recordings are known by their first bytes, however they are named or packed."""

import gzip
import io
import lzma
import struct
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest
from backports import zstd

from mav_handlers.links.packed import name_unpacked
from mav_handlers.wire.codec import Codec
from mav_handlers.wire.messages import ATTITUDE, HEARTBEAT
from tests.places import RECORDED
from viso.errors import InputError
from viso.files.first_bytes import Content, content_of
from viso.logs.recorded import read_columns
from viso.streams.stream import Aspect
from viso.streams.stream_kinds import kind_of, read_stream

LOG = lzma.decompress((RECORDED / "logs" / "voxl.BIN.xz").read_bytes())[
    :100_000
]  # packing all takes a tenth of a second
_CODEC = Codec(1, 1)
FRAMES = [
    _CODEC.encode(one)
    for second in range(4)
    for one in (HEARTBEAT(2, 3, 0, 0, 4, 3), ATTITUDE(9000 + 1000 * second, 0.0, 0.0, 0.1, 0.0, 0.0, 0.0))
]
TLOG = b"".join(struct.pack(">Q", 1_700_000_000_000_000 + 1000 * i) + frame for i, frame in enumerate(FRAMES))
RAW = b"".join(FRAMES)


def zipped(**files: bytes) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in files.items():
            archive.writestr(name.replace("_", "."), data)
    return file.getvalue()


PACKERS: dict[str, Callable[[bytes], bytes]] = {
    "": lambda data: data,
    ".gz": gzip.compress,
    ".xz": lzma.compress,
    ".zst": zstd.compress,
    ".zip": lambda data: zipped(flight_BIN=data, notes_txt=b"windy"),
}


@pytest.mark.parametrize("ending", PACKERS)
@pytest.mark.parametrize("name", ["flight.BIN", "flight.log", "flight.tlog", "flight"])
def test_log_is_read_whatever_its_name_and_however_it_is_packed(tmp_path: Path, name: str, ending: str) -> None:
    path = tmp_path / (name + ending)
    path.write_bytes(PACKERS[ending](LOG))
    assert kind_of(path) == "DataFlash log"
    assert read_columns(path).counts["PARM"] > 0


@pytest.mark.parametrize("ending", PACKERS)
def test_packed_telemetry_log_is_read(tmp_path: Path, ending: str) -> None:
    path = tmp_path / f"flight.tlog{ending}"
    path.write_bytes(PACKERS[ending](TLOG))
    assert [one.frame for one in read_stream(path, 0).messages] == FRAMES


@pytest.mark.parametrize("name", ["mav.tlog.raw", "flight.rlog", "flight.tlog", "flight.bin"])
def test_bytes_of_a_link_have_the_times_of_the_autopilots_messages(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    path.write_bytes(RAW)
    stream = read_stream(path, 0)
    assert [one.frame for one in stream.messages] == FRAMES
    assert [one.arrival_us for one in stream.messages] == [1e6 * s for s in (9, 9, 9, 10, 10, 11, 11, 12)]
    assert Aspect.ARRIVAL in stream.lacks
    assert any("without times of arrival" in note for note in stream.notes)


def test_bytes_of_a_link_that_begin_within_a_frame_are_known_by_the_ending(tmp_path: Path) -> None:
    path = tmp_path / "flight.rlog"
    path.write_bytes(RAW[5:])
    assert [one.frame for one in read_stream(path, 0).messages] == FRAMES[1:]


def test_bytes_of_a_link_without_an_autopilots_time_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "flight.rlog"
    path.write_bytes(Codec(1, 197).encode(HEARTBEAT(18, 8, 0, 0, 4, 3)))
    with pytest.raises(InputError, match=r"without times, .*the \.tlog"):
        read_stream(path, 0)


@pytest.mark.parametrize(
    ("frames", "what"),
    [
        (FRAMES, ""),
        (FRAMES[::2], "of the autopilot only heartbeats are in this recording"),
        ([Codec(1, 197).encode(HEARTBEAT(18, 8, 0, 0, 4, 3))], "no autopilot is in this recording"),
    ],
)
def test_recording_without_an_autopilot_or_its_answers_says_so(tmp_path: Path, frames: list[bytes], what: str) -> None:
    path = tmp_path / "flight.tlog"
    path.write_bytes(b"".join(struct.pack(">Q", 1000 * i) + frame for i, frame in enumerate(frames)))
    notes = read_stream(path, 0).notes
    assert any(what in note for note in notes) if what else not notes


@pytest.mark.parametrize(
    ("name", "data", "reason"),
    [
        ("a.tlog", b"version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 9\n", "a pointer of Git LFS"),
        ("a.BIN", b"version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 9\n", "a pointer of Git LFS"),
        ("a.ulg", b"ULog\x01\x12\x35\x01" + bytes(90), r"a log of PX4 \(ULog\), which viso does not read"),
        ("a.log", b"ULog\x01\x12\x35\x01" + bytes(90), "a log of PX4"),
        (
            "a.log",
            b"FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\n",
            "a DataFlash log that was turned into text: give the .BIN",
        ),
        ("a.BIN", b"<!DOCTYPE html>\n<html>", "a page of the web"),
        ("a.zip", zipped(a_BIN=LOG, b_BIN=LOG), r"a zip of 2 files, 2 of them recordings \(a\.BIN, b\.BIN\)"),
        ("a.zip", zipped(a_txt=b"", b_jpg=b""), "a zip of 2 files, none a recording"),
        ("a.zip", b"PK\x03\x04" + bytes(40), "damaged zip file"),
        ("a.gz", b"\x1f\x8b" + b"\xff" * 40, "damaged gzip file"),
    ],
)
def test_what_is_never_read_is_named(tmp_path: Path, name: str, data: bytes, reason: str) -> None:
    path = tmp_path / name
    path.write_bytes(data)
    for read in (content_of, read_columns, lambda path: read_stream(path, 0)):
        with pytest.raises(InputError, match=rf"^{path}: {reason}"):
            read(path)


def test_log_that_is_another_recording_says_which(tmp_path: Path) -> None:
    path = tmp_path / "flight.BIN"
    path.write_bytes(TLOG)
    with pytest.raises(InputError, match="not a DataFlash log, but a telemetry log"):
        read_columns(path)


def test_content_of_what_is_not_there_is_unknown(tmp_path: Path) -> None:
    assert content_of(tmp_path / "none") is None
    assert content_of(tmp_path) is None


@pytest.mark.parametrize(("data", "content"), [
    (LOG, Content.DATAFLASH_LOG), (TLOG, Content.TELEMETRY_LOG), (RAW, Content.LINK_BYTES),
    (TLOG[:30], Content.TELEMETRY_LOG), (b"", None), (b"1 2 3 4 5 6 7 8\n" * 9, None), (bytes(99), None),
])  # fmt: skip
def test_first_bytes_tell_what_a_file_is(tmp_path: Path, data: bytes, content: Content | None) -> None:
    path = tmp_path / "any"
    path.write_bytes(data)
    assert content_of(path) is content


def test_name_in_a_zip_counts(tmp_path: Path) -> None:
    path = tmp_path / "flight.zip"
    unpacked = tmp_path / "poses.tum"
    unpacked.write_bytes(b"0 0 0 0 0 0 0 1\n0.1 0 0 0 0 0 0 1\n")
    path.write_bytes(zipped(poses_tum=unpacked.read_bytes()))
    assert (name_unpacked(path), kind_of(path)) == ("poses.tum", "trajectory")
    assert len(read_stream(path, 0).messages) == len(read_stream(unpacked, 0).messages) > 0
