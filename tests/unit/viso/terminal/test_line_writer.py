# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Lines for readers that are slow, stalled or gone; pipes and files stand in for them."""

import os
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

import pytest

from viso.terminal.verdict_stream import LineWriter


class Pipe(NamedTuple):
    """Both ends of a pipe."""

    reader: int
    writer: int

    def fill(self) -> None:
        """Fill the pipe to the brim, so that the next write has to wait."""
        os.set_blocking(self.writer, False)
        with suppress(BlockingIOError):
            while True:
                os.write(self.writer, b"\0" * 4096)
        os.set_blocking(self.writer, True)

    def read_to_the_end(self) -> bytes:
        """Close the writing end and return all that was written."""
        os.close(self.writer)
        data = b""
        while part := os.read(self.reader, 65536):
            data += part
        return data


@pytest.fixture
def pipe() -> Iterator[Pipe]:
    ends = Pipe(*os.pipe())
    yield ends
    for end in ends:
        with suppress(OSError):
            os.close(end)


def test_lines_come_in_order_and_none_is_lost(pipe: Pipe) -> None:
    writer = LineWriter(pipe.writer)
    for number in range(500):
        writer.put(f"line {number}")
    writer.close()
    assert pipe.read_to_the_end().decode().splitlines() == [f"line {number}" for number in range(500)]
    assert (writer.lost, writer.error) == (0, None)


def test_line_is_written_without_waiting_for_another(pipe: Pipe) -> None:
    writer = LineWriter(pipe.writer)
    writer.put("at once")
    assert os.read(pipe.reader, 100) == b"at once\n"
    writer.close()


def test_stalled_reader_costs_lines_but_no_time(pipe: Pipe) -> None:
    pipe.fill()
    writer = LineWriter(pipe.writer, limit=3)
    for number in range(10):
        writer.put(str(number))
    assert writer.lost == 7
    writer.close(patience_s=0.01)
    assert writer.lost == 10
    os.read(pipe.reader, 1 << 20)  # lets the thread end


def test_reader_that_wakes_up_gets_what_has_waited(pipe: Pipe) -> None:
    pipe.fill()
    writer = LineWriter(pipe.writer, limit=3)
    for number in range(10):
        writer.put(str(number))
    data = os.read(pipe.reader, 1 << 20)
    writer.close()
    data += pipe.read_to_the_end()
    assert data.lstrip(b"\0") == b"0\n1\n2\n"
    assert writer.lost == 7


def test_reader_that_left_is_noticed_and_everything_after_is_lost(pipe: Pipe) -> None:
    os.close(pipe.reader)
    writer = LineWriter(pipe.writer)
    writer.put("nobody")
    writer.close()
    assert writer.reader_left
    writer.put("nobody")
    assert writer.lost == 2


def test_error_of_the_file_system_ends_the_writing() -> None:
    descriptor = os.open("/dev/full", os.O_WRONLY)
    writer = LineWriter(descriptor)
    writer.put("too much")
    writer.close()
    os.close(descriptor)
    assert writer.error is not None
    assert writer.error.strerror == "No space left on device"
    assert not writer.reader_left
    assert writer.lost == 1


def test_short_writes_are_continued(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write = os.write
    monkeypatch.setattr(os, "write", lambda descriptor, data: write(descriptor, data[:3]))
    descriptor = os.open(tmp_path / "file", os.O_WRONLY | os.O_CREAT)
    writer = LineWriter(descriptor)
    writer.put("longer than three bytes")
    writer.close()
    os.close(descriptor)
    assert (tmp_path / "file").read_text() == "longer than three bytes\n"


def test_descriptor_that_does_not_block_is_waited_for(pipe: Pipe) -> None:
    pipe.fill()
    os.set_blocking(pipe.writer, False)
    writer = LineWriter(pipe.writer)
    writer.put("patience")
    data = os.read(pipe.reader, 1 << 20)
    writer.close()
    assert writer.error is None
    assert (data + pipe.read_to_the_end()).lstrip(b"\0") == b"patience\n"


def test_line_after_the_end_is_lost(pipe: Pipe) -> None:
    writer = LineWriter(pipe.writer)
    writer.close()
    writer.put("late")
    assert writer.lost == 1
    assert pipe.read_to_the_end() == b""


def test_text_is_utf_8(pipe: Pipe) -> None:
    writer = LineWriter(pipe.writer)
    writer.put("5 µs")
    writer.close()
    assert pipe.read_to_the_end() == b"5 \xc2\xb5s\n"
