# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Text files, packed or not, and what is wrong with those that cannot be used."""

import gzip
from pathlib import Path

import pytest

from viso.errors import InputError
from viso.files.text_files import read_lines, read_text, write_text

LINES = [(1, "a\n"), (3, "b\n"), (4, "c")]


@pytest.fixture
def plain(tmp_path: Path) -> Path:
    path = tmp_path / "plain.jsonl"
    path.write_text("a\n \nb\nc")
    return path


def test_lines_have_their_numbers_and_blank_ones_are_passed_over(plain: Path) -> None:
    assert list(read_lines(plain)) == LINES


@pytest.mark.parametrize("name", ["packed.jsonl.gz", "named_like_a_plain_one.jsonl"])
def test_packed_file_is_known_by_its_content(plain: Path, name: str) -> None:
    packed = plain.with_name(name)
    packed.write_bytes(gzip.compress(plain.read_bytes()))
    assert list(read_lines(packed)) == LINES


def test_plain_file_may_be_named_like_a_packed_one(plain: Path) -> None:
    assert list(read_lines(plain.rename(plain.with_suffix(".gz")))) == LINES


def test_empty_file_has_no_lines(tmp_path: Path) -> None:
    path = tmp_path / "empty"
    path.touch()
    assert list(read_lines(path)) == []


def error_of(path: Path) -> str:
    with pytest.raises(InputError) as raised:
        list(read_lines(path))
    return str(raised.value)


def test_bytes_that_are_no_text_are_an_error_with_their_line(tmp_path: Path) -> None:
    path = tmp_path / "binary.jsonl"
    path.write_bytes(b"\xff\xfe\n")
    assert error_of(path) == f"{path}:1: not UTF-8 text"


def test_truncated_gzip_file_is_an_error(plain: Path) -> None:
    packed = plain.with_suffix(".gz")
    packed.write_bytes(gzip.compress(plain.read_bytes())[:-6])
    assert "damaged gzip file" in error_of(packed)


@pytest.mark.parametrize("index", [2, 10, -1, -8])  # the method, the data, the length, the checksum
def test_damaged_gzip_file_is_an_error(plain: Path, index: int) -> None:
    packed = plain.with_suffix(".gz")
    data = bytearray(gzip.compress(plain.read_bytes()))
    data[index] ^= 0xFF
    packed.write_bytes(data)
    assert "damaged gzip file" in error_of(packed)


def test_missing_file_is_an_error(tmp_path: Path) -> None:
    assert error_of(tmp_path / "none") == f"{tmp_path / 'none'}: No such file or directory"


def test_folder_is_an_error(tmp_path: Path) -> None:
    assert error_of(tmp_path) == f"{tmp_path}: Is a directory"


def test_text_is_read_without_a_byte_order_mark(tmp_path: Path) -> None:
    path = tmp_path / "windows.parm"
    path.write_bytes(b"\xef\xbb\xbfVISO_TYPE 1")
    assert read_text(path) == "VISO_TYPE 1"


def test_text_that_is_none_is_an_error(tmp_path: Path) -> None:
    path = tmp_path / "binary.parm"
    path.write_bytes(b"\xff\xfe")
    with pytest.raises(InputError, match=r"binary\.parm: not UTF-8 text"):
        read_text(path)


def test_missing_text_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none\.parm: No such file or directory"):
        read_text(tmp_path / "none.parm")


def test_written_text_is_what_was_written(tmp_path: Path) -> None:
    path = tmp_path / "out.jsonl"
    with write_text(path) as out:
        out.write("µ\n")
    assert path.read_bytes() == "µ\n".encode()


def test_text_is_packed_when_the_name_asks_for_it(tmp_path: Path) -> None:
    path = tmp_path / "out.jsonl.gz"
    with write_text(path) as out:
        out.write("µ\n")
    assert gzip.decompress(path.read_bytes()) == "µ\n".encode()


@pytest.mark.parametrize("name", ["out.jsonl", "out.jsonl.gz"])
def test_place_that_cannot_be_written_to_is_an_error(tmp_path: Path, name: str) -> None:
    path = tmp_path / "none" / name
    with pytest.raises(InputError) as raised, write_text(path):
        pass
    assert str(raised.value) == f"{path}: No such file or directory"
