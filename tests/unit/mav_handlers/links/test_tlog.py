# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Telemetry logs: whole, cut, damaged, compressed, and files that are none."""

import gzip
import os
import struct
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink import mavutil

from mav_handlers.links import TlogEntry, TlogError, TlogWriter, read_tlog

START_US = 1_760_000_000_000_000  # July 2025


def frame_v1(length: int = 9, fill: int = 0x11) -> bytes:
    # STX, length, sequence, system, component, message id; then payload and two bytes of checksum
    return bytes([0xFE, length, 0, 1, 1, 0]) + bytes([fill]) * (length + 2)


def frame_v2(length: int = 9, flags: int = 0, fill: int = 0x22) -> bytes:
    # STX, length, incompatible and compatible flags, sequence, system, component, three bytes of message id
    signature = 13 if flags & 1 else 0
    return bytes([0xFD, length, flags, 0, 0, 1, 1, 0, 0, 0]) + bytes([fill]) * (length + 2 + signature)


FRAMES = [frame_v1(), frame_v2(), frame_v2(40, flags=1), frame_v1(0), frame_v2(255, flags=1), frame_v2(0)] * 3


def entries(frames: list[bytes], start_us: int = START_US) -> list[TlogEntry]:
    return [TlogEntry(start_us + 10_000 * index, frame) for index, frame in enumerate(frames)]


def packed(items: list[TlogEntry]) -> list[bytes]:
    return [struct.pack(">Q", item.time_us) + item.data for item in items]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "flight.tlog"


WHOLE = entries(FRAMES)
PIECES = packed(WHOLE)


class TestWholeFile:
    def test_each_entry_has_its_time_and_frame(self, path: Path) -> None:
        path.write_bytes(b"".join(PIECES))
        reader = read_tlog(path)
        assert list(reader) == WHOLE
        assert (reader.skipped_bytes, reader.truncated_bytes, reader.truncated) == (0, 0, False)

    def test_gzip_is_known_by_its_content(self, path: Path) -> None:
        path.write_bytes(gzip.compress(b"".join(PIECES)))
        assert list(read_tlog(str(path))) == WHOLE

    def test_time_since_boot_is_accepted(self, path: Path) -> None:
        small = entries(FRAMES, start_us=0)
        path.write_bytes(b"".join(packed(small)))
        assert list(read_tlog(path)) == small

    def test_clock_that_was_set_during_the_recording_is_no_damage(self, path: Path) -> None:
        items = entries(FRAMES[:3], start_us=5_000_000) + entries(FRAMES[3:6])
        path.write_bytes(b"".join(packed(items)))
        reader = read_tlog(path)
        assert list(reader) == items
        assert reader.skipped_bytes == 0

    def test_pymavlink_reads_the_same_frames(self, path: Path) -> None:
        link = mavutil.mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
        frames = [link.heartbeat_encode(2, 3, 81, 0, 3).pack(link) for _ in range(5)]
        path.write_bytes(b"".join(packed(entries(frames))))
        log = mavutil.mavlink_connection(str(path))
        theirs = []
        while (message := log.recv_msg()) is not None:
            theirs.append(TlogEntry(round(message._timestamp * 1e6), bytes(message.get_msgbuf())))
        log.close()
        assert list(read_tlog(path)) == theirs


class TestCutFile:
    @pytest.mark.parametrize("kept", [1, 7, 8, 9, 10, 11, 12, 27])
    def test_cut_last_entry_is_left_out_and_counted(self, path: Path, kept: int) -> None:
        last = packed([TlogEntry(START_US, frame_v2())])[0]
        path.write_bytes(b"".join(PIECES) + last[:kept])
        reader = read_tlog(path)
        assert list(reader) == WHOLE
        assert (reader.truncated, reader.truncated_bytes, reader.skipped_bytes) == (True, kept, 0)

    def test_cut_compressed_file_gives_what_it_has(self, path: Path) -> None:
        noisy = entries([frame_v1()[:-2] + os.urandom(2) for _ in range(5000)])
        data = gzip.compress(b"".join(packed(noisy)))
        path.write_bytes(data[: len(data) // 2])
        reader = read_tlog(path)
        got = list(reader)
        assert reader.truncated
        assert got == noisy[: len(got)]
        assert len(got) > 1000


class TestDamage:
    @given(
        at=st.integers(1, len(PIECES) - 1),
        junk=st.binary(min_size=1, max_size=400).filter(lambda junk: not {0xFD, 0xFE} & set(junk)),
    )
    def test_inserted_bytes_cost_no_entry(self, tmp_path_factory: pytest.TempPathFactory, at: int, junk: bytes) -> None:
        path = tmp_path_factory.mktemp("tlog") / "x"
        path.write_bytes(b"".join(PIECES[:at]) + junk + b"".join(PIECES[at:]))
        reader = read_tlog(path)
        assert list(reader) == WHOLE
        assert reader.skipped_bytes == len(junk)

    @given(data=st.data())
    def test_removed_bytes_cost_only_the_entries_they_touch(
        self, tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
    ) -> None:
        content = b"".join(PIECES)
        first = data.draw(st.integers(0, len(content) - 100))
        count = data.draw(st.integers(1, 15))  # less than the shortest entry: none can take another's place
        path = tmp_path_factory.mktemp("tlog") / "x"
        path.write_bytes(content[:first] + content[first + count :])
        got = list(read_tlog(path))
        ends = [sum(map(len, PIECES[: index + 1])) for index in range(len(PIECES))]
        starts = [0, *ends[:-1]]
        untouched = [
            item for item, start, end in zip(WHOLE, starts, ends, strict=True) if end <= first or start >= first + count
        ]
        assert [item for item in got if item in untouched] == untouched

    def test_wrong_length_does_not_swallow_the_next_entries(self, path: Path) -> None:
        broken = bytearray(PIECES[1])
        broken[9] = 200
        path.write_bytes(PIECES[0] + broken + b"".join(PIECES[2:]))
        reader = read_tlog(path)
        assert list(reader) == WHOLE[:1] + WHOLE[2:]
        assert reader.skipped_bytes == len(broken)

    def test_recording_continued_on_another_day_is_found(self, path: Path) -> None:
        later = entries(FRAMES, start_us=START_US + 30 * 86_400_000_000)
        path.write_bytes(b"".join(PIECES) + PIECES[0][:15] + b"".join(packed(later)))
        reader = read_tlog(path)
        assert list(reader) == WHOLE + later
        assert reader.skipped_bytes == 15

    def test_time_in_a_far_future_is_damage(self, path: Path) -> None:
        broken = packed([TlogEntry(1 << 63, frame_v1())])[0]
        path.write_bytes(b"".join(PIECES[:3]) + broken + b"".join(PIECES[3:]))
        reader = read_tlog(path)
        assert list(reader) == WHOLE
        assert reader.skipped_bytes == len(broken)

    def test_cut_entry_behind_damage_is_skipped_with_it(self, path: Path) -> None:
        path.write_bytes(b"".join(PIECES) + b"garbage" * 9 + PIECES[0][:-1])
        reader = read_tlog(path)
        assert list(reader) == WHOLE
        assert reader.skipped_bytes == 63 + len(PIECES[0]) - 1

    def test_damage_at_the_beginning_is_skipped(self, path: Path) -> None:
        path.write_bytes(b"garbage" * 9 + b"".join(PIECES))
        reader = read_tlog(path)
        assert list(reader) == WHOLE
        assert reader.skipped_bytes == 63

    def test_garbage_at_the_end_is_skipped(self, path: Path) -> None:
        path.write_bytes(b"".join(PIECES) + b"garbage" * 9)
        reader = read_tlog(path)
        assert list(reader) == WHOLE
        assert (reader.skipped_bytes, reader.truncated) == (63, False)

    def test_time_since_boot_finds_its_way_after_damage(self, path: Path) -> None:
        small = entries(FRAMES, start_us=7_000_000)
        pieces = packed(small)
        path.write_bytes(b"".join(pieces[:4]) + b"\x55" * 30 + b"".join(pieces[4:]))
        assert list(read_tlog(path)) == small

    @given(content=st.binary(max_size=2000))
    def test_no_bytes_make_it_raise_anything_else(
        self, tmp_path_factory: pytest.TempPathFactory, content: bytes
    ) -> None:
        path = tmp_path_factory.mktemp("tlog") / "x"
        path.write_bytes(PIECES[0] + content)
        reader = read_tlog(path)
        size = sum(8 + len(item.data) for item in reader)
        assert size + reader.skipped_bytes + reader.truncated_bytes == len(PIECES[0]) + len(content)


class TestNoTlog:
    @pytest.mark.parametrize(
        "content",
        [b"text, and nothing else\n" * 20, bytes(5000), b"\xa3\x95\x80\x80" * 300, frame_v2() * 50, b"\xfd"],
        ids=["text", "zeros", "dataflash", "frames without time", "one byte"],
    )
    def test_other_file_is_an_error_naming_file_and_byte(self, path: Path, content: bytes) -> None:
        path.write_bytes(content)
        with pytest.raises(TlogError) as caught:
            read_tlog(path)
        assert str(caught.value) == f"{path}: byte 0: no telemetry log entry in this file"

    def test_empty_file_is_an_error(self, path: Path) -> None:
        path.write_bytes(b"")
        with pytest.raises(TlogError, match="byte 0: the file is empty"):
            read_tlog(path)

    def test_absent_file_is_an_error_in_one_line(self, path: Path) -> None:
        with pytest.raises(TlogError) as caught:
            read_tlog(path)
        assert str(caught.value) == f"{path}: no such file or directory"

    def test_broken_compression_is_an_error_naming_the_byte(self, path: Path) -> None:
        data = bytearray(gzip.compress(os.urandom(500_000), compresslevel=0))
        data[100_000:300_000] = b"\xff" * 200_000
        path.write_bytes(data)
        with pytest.raises(TlogError, match=r"\A[^\n]+: byte \d+: [^\n]+\Z"):
            read_tlog(path)


class TestWriter:
    @pytest.mark.parametrize("name", ["a.tlog", "a.tlog.gz"])
    def test_what_is_written_is_read(self, tmp_path: Path, name: str) -> None:
        with TlogWriter(tmp_path / name) as writer:
            for item in WHOLE:
                writer.write(item.time_us, item.data)
        assert list(read_tlog(tmp_path / name)) == WHOLE

    def test_same_entries_give_the_same_compressed_bytes(self, tmp_path: Path) -> None:
        for name in ("a.gz", "b.gz"):
            with TlogWriter(tmp_path / name) as writer:
                writer.write(START_US, frame_v1())
        assert (tmp_path / "a.gz").read_bytes() == (tmp_path / "b.gz").read_bytes()

    @pytest.mark.parametrize(("time_us", "data"), [(-1, frame_v1()), (0, b""), (0, b"abc")])
    def test_what_is_no_entry_is_refused(self, path: Path, time_us: int, data: bytes) -> None:
        with TlogWriter(path) as writer, pytest.raises(ValueError, match="one MAVLink frame"):
            writer.write(time_us, data)

    def test_file_that_cannot_be_made_is_an_error_in_one_line(self, tmp_path: Path) -> None:
        with pytest.raises(TlogError, match=r"\A[^\n]+: is a directory\Z"):
            TlogWriter(tmp_path)

    def test_full_disk_is_an_error_in_one_line(self) -> None:
        if not Path("/dev/full").exists():
            pytest.skip("needs a device that is always full")
        writer = TlogWriter("/dev/full")
        writer.write(START_US, frame_v1())
        with pytest.raises(TlogError, match=r"\A/dev/full: no space left on device\Z"):
            writer.close()

    def test_full_disk_shows_while_writing_too(self) -> None:
        if not Path("/dev/full").exists():
            pytest.skip("needs a device that is always full")
        writer = TlogWriter("/dev/full")
        big = frame_v2() + bytes(1 << 20)  # more than the buffer holds
        with pytest.raises(TlogError, match="no space left"):
            writer.write(START_US, big)
        writer.close()
