# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The ring of telemetry files."""

import errno
import io
import logging
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import pytest

from tests.unit.viso.companion.vio.strategy_rig import Ticks, make_frame, make_logger, make_output
from viso.companion.vio.telemetry import NullSink, RingSink, last_output, ring_files, ring_records
from viso.companion.vio.telemetry_records import output_values, pack_record

RECORD_BYTES = len(pack_record({"n": 1000}))


class FullDisk(io.BytesIO):
    """A file that takes some bytes, and not one more."""

    def __init__(self, room: int) -> None:
        super().__init__()
        self._room = room

    def write(self, data: Any) -> int:
        self._room -= len(data)
        if self._room < 0:
            raise OSError(errno.ENOSPC, "No space left on device")
        return super().write(data)


class Rig:
    """A sink on a folder."""

    def __init__(self, folder: Path, **options: Any) -> None:
        self.folder = folder
        self.clock = Ticks()
        self.logger, self.log = make_logger()
        self.sink = RingSink(folder, self.clock, self.logger, **options)

    def numbers(self) -> list[int]:
        return [record["n"] for record in ring_records(self.folder)]

    def write(self, *numbers: int) -> None:
        for number in numbers:
            self.sink.write({"n": number})

    def write_output(self, sequence: int) -> None:
        self.sink.write({"output": output_values(make_output(make_frame(sequence)))})


def sequence_of(folder: Path) -> int | None:
    """Return the number of the frame that the newest output in a folder is of."""
    output = last_output(folder)
    return None if output is None else int(output.frame_id.int >> 64 & 0xFFF)


def test_records_come_back_in_order(tmp_path: Path) -> None:
    rig = Rig(tmp_path / "new" / "folder")
    rig.write(1, 2, 3)
    rig.sink.close()
    assert rig.numbers() == [1, 2, 3]
    assert rig.sink.written == 3


def test_debug_records_never_go_in(tmp_path: Path) -> None:
    rig = Rig(tmp_path)
    rig.sink.write({"level": "DEBUG", "n": 1, "output": output_values(make_output(make_frame(1)))})
    rig.sink.write({"level": "INFO", "n": 2})
    rig.sink.close()
    assert rig.numbers() == [2]
    assert rig.sink.last_output() is None


def test_flushed_once_a_second(tmp_path: Path) -> None:
    rig = Rig(tmp_path)
    seen = []
    for now_ns in (0, 999_999_999, 1_000_000_000):
        rig.clock.now_ns = now_ns
        rig.write(now_ns)
        seen.append(len(rig.numbers()))
    assert seen == [1, 1, 3]
    rig.sink.close()


def test_files_have_a_limited_size(tmp_path: Path) -> None:
    rig = Rig(tmp_path, file_bytes=2 * RECORD_BYTES)
    rig.write(*range(1000, 1005))
    rig.sink.close()
    assert [path.stat().st_size for path in ring_files(tmp_path)] == [2 * RECORD_BYTES, 2 * RECORD_BYTES, RECORD_BYTES]


def test_oldest_files_go(tmp_path: Path) -> None:
    rig = Rig(tmp_path, file_bytes=1, files=3)
    rig.write(*range(1000, 1010))
    rig.sink.close()
    assert rig.numbers() == [1007, 1008, 1009]


def test_next_run_goes_on_with_the_ring(tmp_path: Path) -> None:
    for first in (1000, 1002):
        rig = Rig(tmp_path, file_bytes=1, files=3)
        rig.write(first, first + 1)
        rig.sink.close()
    assert rig.numbers() == [1001, 1002, 1003]


def test_other_files_are_left_alone(tmp_path: Path) -> None:
    other = tmp_path / "notes.vtl"
    other.write_text("mine")
    rig = Rig(tmp_path, file_bytes=1, files=2)
    rig.write(*range(1000, 1005))
    rig.sink.close()
    assert other.read_text() == "mine"


@pytest.mark.parametrize("room", [0, RECORD_BYTES])
def test_full_disk_turns_the_sink_off_with_one_error(tmp_path: Path, room: int) -> None:
    rig = Rig(tmp_path, create=lambda path: FullDisk(room))
    rig.write(*range(1000, 1010))
    assert rig.sink.is_off
    (record,) = rig.log.events("telemetry_off")
    assert (record.levelno, record.getMessage()) == (logging.ERROR, "telemetry is off: No space left on device")


def test_full_disk_that_shows_at_the_flush(tmp_path: Path) -> None:
    def create(path: Path) -> BinaryIO:
        return Path("/dev/full").open("wb")

    rig = Rig(tmp_path, create=create)
    rig.write(*range(1000, 1010))
    rig.sink.close()
    assert len(rig.log.events("telemetry_off")) == 1


def test_folder_that_cannot_be_made_turns_the_sink_off(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    rig = Rig(tmp_path / "file")
    rig.write(1)
    assert rig.sink.is_off


def test_closed_sink_takes_records_in_silence(tmp_path: Path) -> None:
    rig = Rig(tmp_path)
    rig.sink.close()
    rig.write(1)
    rig.sink.close()
    assert (rig.numbers(), rig.log.records) == ([], [])


def test_ring_needs_two_files(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="files: at least 2"):
        Rig(tmp_path, files=1)


def test_nothing_to_start_from_in_an_empty_ring(tmp_path: Path) -> None:
    assert Rig(tmp_path).sink.warm_start_hint() is None


def test_last_output_of_this_run(tmp_path: Path) -> None:
    rig = Rig(tmp_path)
    rig.write_output(1)
    rig.write_output(2)
    rig.sink.write({"output": None})
    output = rig.sink.last_output()
    assert output is not None
    assert output.frame_id == make_frame(2).frame_id
    rig.sink.close()


def test_full_disk_does_not_lose_the_last_output(tmp_path: Path) -> None:
    rig = Rig(tmp_path, create=lambda path: FullDisk(0))
    rig.write_output(1)
    assert rig.sink.last_output() is not None


def test_hint_after_a_reboot_is_the_last_output_before_it(tmp_path: Path) -> None:
    before = Rig(tmp_path, file_bytes=1)
    before.write_output(1)
    before.write_output(2)
    before.write(3)
    before.sink.close()
    hint = Rig(tmp_path).sink.warm_start_hint()
    assert hint is not None
    expected = make_output(make_frame(2)).world_T_body
    assert hint.body_T_world.inverse().t == pytest.approx(expected.t)
    assert sequence_of(tmp_path) == 2


def test_truncated_output_gives_way_to_the_one_before(tmp_path: Path) -> None:
    rig = Rig(tmp_path)
    rig.write_output(1)
    rig.write_output(2)
    rig.sink.close()
    (path,) = ring_files(tmp_path)
    path.write_bytes(path.read_bytes()[:-1])
    assert sequence_of(tmp_path) == 1


def test_damaged_file_gives_way_to_the_one_before(tmp_path: Path) -> None:
    rig = Rig(tmp_path, file_bytes=1)
    rig.write_output(1)
    rig.write_output(2)
    rig.sink.close()
    ring_files(tmp_path)[-1].write_bytes(bytes(np.arange(256, dtype=np.uint8)))
    assert sequence_of(tmp_path) == 1


def test_null_sink_takes_anything() -> None:
    NullSink().write({"output": object()})
