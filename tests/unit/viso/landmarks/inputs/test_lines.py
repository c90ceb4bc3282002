# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Files of lines, and the bytes of a stream cut into lines."""

import gzip
import re
import socket
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from viso.landmarks.inputs.base import InputFileError
from viso.landmarks.inputs.json_lines import JsonReader
from viso.landmarks.inputs.lines import LONGEST_LINE_BYTES, LineSplitter, TextFile, file_lines
from viso.landmarks.types import Detections


@pytest.mark.parametrize("packed", [False, True])
def test_file_may_be_packed(tmp_path: Path, packed: bool) -> None:
    path = tmp_path / "records"
    data = '\ufeff{"t_s": 1, "observations": []}\r\n\r\n{"t_s": 2, "observations": []}'.encode()
    path.write_bytes(gzip.compress(data) if packed else data)
    file = TextFile(path, JsonReader())
    assert list(file.events()) == [Detections(1.0), Detections(2.0)]
    assert not file.refused


def test_line_that_is_not_utf_8_is_refused_and_the_others_stay(tmp_path: Path) -> None:
    path = tmp_path / "records"
    path.write_bytes(b'{"t_s": 1, "observations": []}\n\xff\xfe\x80\n{"t_s": 2, "observations": []}\n')
    file = TextFile(path, JsonReader())
    assert len(list(file.events())) == 2
    assert file.refused == {"not JSON": 1}


def complaint(path: Path) -> str:
    with pytest.raises(InputFileError) as raised:
        list(file_lines(path))
    assert len(str(raised.value).splitlines()) == 1
    return str(raised.value)


def test_file_that_is_not_there_is_one_line(tmp_path: Path) -> None:
    assert complaint(tmp_path / "none") == f"{tmp_path / 'none'}: No such file or directory"
    assert complaint(tmp_path) == f"{tmp_path}: Is a directory"


def test_file_that_is_no_text_names_the_line(tmp_path: Path) -> None:
    path = tmp_path / "records"
    path.write_bytes(b"hello\n\0\1\2")
    assert complaint(path) == f"{path}:2: not a text file"


def test_packed_file_that_is_cut_short_names_the_line(tmp_path: Path) -> None:
    path = tmp_path / "records.gz"
    path.write_bytes(gzip.compress(b"hello\n" * 3)[:-9])
    assert re.match(rf"{re.escape(str(path))}:\d: damaged gzip file: ", complaint(path))


@pytest.mark.slow
@given(st.lists(st.text(st.characters(exclude_characters="\r\n", exclude_categories=["Cs"]))), st.data())
def test_lines_come_out_however_the_bytes_arrive(lines: list[str], data: st.DataObject) -> None:
    stream = "".join(f"{line}\r\n" for line in lines).encode()
    splitter, found = LineSplitter(), []
    while stream:
        size = data.draw(st.integers(1, len(stream)))
        found += splitter.feed(stream[:size])
        stream = stream[size:]
    assert found == lines


def test_line_that_never_ends_is_thrown_away() -> None:
    splitter = LineSplitter()
    assert splitter.feed(b"x" * (LONGEST_LINE_BYTES + 1)) == []
    assert splitter.feed(b"hello\n") == ["hello"]


def test_lines_come_out_of_a_socket() -> None:
    near, far = socket.socketpair()
    with near, far:
        far.sendall(b'{"observations": []}\n{"obs')
        far.shutdown(socket.SHUT_WR)
        splitter = LineSplitter()
        lines = [line for data in iter(lambda: near.recv(7), b"") for line in splitter.feed(data)]
    reader = JsonReader()
    assert [event for line in lines for event in reader.take(line, 5.0)] == [Detections(5.0)]
