# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Packed files: what they hold, and that no more of it is unpacked than a recording of their size can hold."""

import gzip
import lzma
from collections.abc import Callable
from pathlib import Path

import pytest

from mav_handlers.links import packed
from mav_handlers.links.packed import MOST_TIMES, CutShortError, PackedError, open_packed

PACKERS = pytest.mark.parametrize(("name", "pack"), [("a.tlog", gzip.compress), ("a.BIN.xz", lzma.compress)])
Pack = Callable[[bytes], bytes]
CONTENT = bytes(range(256)) * 40


def written(folder: Path, name: str, data: bytes) -> Path:
    path = folder / name
    path.write_bytes(data)
    return path


def read_into(content: bytearray, path: Path) -> None:
    with open_packed(path) as file:
        while part := file.read1():
            content += part


@PACKERS
def test_packed_file_reads_as_what_is_in_it(tmp_path: Path, name: str, pack: Pack) -> None:
    with open_packed(written(tmp_path, name, pack(CONTENT) + pack(b"more"))) as file:
        assert file.read() == CONTENT + b"more"


@pytest.mark.parametrize("content", [b"", b"\x1f", CONTENT])
def test_plain_file_reads_as_it_is(tmp_path: Path, content: bytes) -> None:
    with open_packed(written(tmp_path, "a.gz", content)) as file:
        assert file.read() == content


@PACKERS
def test_no_more_is_unpacked_than_a_file_of_its_size_can_hold(
    tmp_path: Path, name: str, pack: Pack, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(packed, "ALWAYS_BYTES", 0)
    path = written(tmp_path, name, pack(bytes(1_000_000)))
    unpacked = bytearray()
    with pytest.raises(PackedError, match=r"\Aholds more than [^\n]*\Z"):
        read_into(unpacked, path)
    assert 0 < len(unpacked) <= MOST_TIMES * path.stat().st_size < 1_000_000


def test_small_file_may_hold_much_more_than_its_size(tmp_path: Path) -> None:
    with open_packed(written(tmp_path, "a.gz", gzip.compress(bytes(200_000)))) as file:
        assert len(file.read()) == 200_000


@PACKERS
def test_file_that_is_cut_short_tells_it_after_what_there_is(tmp_path: Path, name: str, pack: Pack) -> None:
    read = bytearray()
    with pytest.raises(CutShortError, match="damaged"):
        read_into(read, written(tmp_path, name, pack(CONTENT)[:-9]))
    assert CONTENT.startswith(read)


@PACKERS
def test_damage_is_told(tmp_path: Path, name: str, pack: Pack) -> None:
    data = bytearray(pack(CONTENT))
    data[60:90] = b"\xff" * 30
    with (
        open_packed(written(tmp_path, name, bytes(data))) as file,
        pytest.raises(PackedError, match=r"damaged (gzip|xz) file: "),
    ):
        file.read()
