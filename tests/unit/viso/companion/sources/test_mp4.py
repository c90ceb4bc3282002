# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The samples of a metadata track, and files that are damaged."""

from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.unit.viso.companion.sources.gopro_maker import box, movie
from viso.companion.sources.base import SourceError
from viso.companion.sources.mp4 import Payload, read_payloads

PAYLOADS = [b"first", b"second one", b"3"]

STSZ = b"stsz" + bytes(8) + (3).to_bytes(4, "big")


def written(tmp_path: Path, data: bytes) -> Path:
    path = tmp_path / "film.mp4"
    path.write_bytes(data)
    return path


@pytest.mark.parametrize("in_chunks_of", [1, 2, 3])
@pytest.mark.parametrize("wide", [False, True])
def test_samples_come_in_order_with_their_times(tmp_path: Path, in_chunks_of: int, wide: bool) -> None:
    path = written(tmp_path, movie(PAYLOADS, in_chunks_of=in_chunks_of, wide=wide))
    expected = [Payload(1.001 * number, 1.001, data) for number, data in enumerate(PAYLOADS)]
    assert read_payloads(path, b"gpmd") == expected


def test_track_of_another_kind_is_not_taken(tmp_path: Path) -> None:
    assert read_payloads(written(tmp_path, movie(PAYLOADS, b"avc1")), b"gpmd") == []


def test_box_may_have_a_long_size(tmp_path: Path) -> None:
    long = (1).to_bytes(4, "big") + b"free" + (24).to_bytes(8, "big") + bytes(8)
    moved = movie(PAYLOADS) + long
    assert len(read_payloads(written(tmp_path, moved), b"gpmd")) == 3


def test_last_box_may_go_on_to_the_end(tmp_path: Path) -> None:
    data = movie(PAYLOADS)
    start = data.index(b"moov") - 4
    open_ended = data[:start] + bytes(4) + data[start + 4 :]
    assert len(read_payloads(written(tmp_path, open_ended), b"gpmd")) == 3


@pytest.mark.parametrize(
    ("data", "complaint"),
    [
        (b"", "no MP4, or a damaged one: no index (moov)"),
        (b"hello, this is no film", "no MP4, or a damaged one: a box"),
        (movie(PAYLOADS)[:-9], "no MP4, or a damaged one: a box b'moov'"),
        (movie(PAYLOADS).replace(b"stsz", b"none"), "no MP4, or a damaged one: no stsz"),
        (movie(PAYLOADS).replace(b"stco", b"none"), "no MP4, or a damaged one: no co64"),
        (box(b"moov", bytes(3)), None),
        (movie(PAYLOADS).replace(STSZ, b"stsz" + bytes(7) + b"\x01" + b"\xff" * 4), "no MP4, or a damaged one: 42949"),
    ],
)
def test_damage_is_told_in_one_line(tmp_path: Path, data: bytes, complaint: str | None) -> None:
    path = written(tmp_path, data)
    if complaint is None:
        assert read_payloads(path, b"gpmd") == []
        return
    with pytest.raises(SourceError) as caught:
        read_payloads(path, b"gpmd")
    assert str(caught.value).startswith(f"{path}: {complaint}")


def test_file_that_is_not_there_is_told(tmp_path: Path) -> None:
    with pytest.raises(SourceError, match=r"none\.mp4: No such file or directory"):
        read_payloads(tmp_path / "none.mp4", b"gpmd")


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_whatever_a_file_holds_nothing_else_is_raised(tmp_path: Path, data: st.DataObject) -> None:
    film = bytearray(movie(PAYLOADS, in_chunks_of=2))
    for _ in range(data.draw(st.integers(1, 4))):
        film[data.draw(st.integers(0, len(film) - 1))] = data.draw(st.integers(0, 255))
    path = written(tmp_path, bytes(film[: data.draw(st.integers(0, len(film)))]))
    try:
        read = read_payloads(path, b"gpmd")
    except SourceError:
        return
    assert sum(len(payload.data) for payload in read) <= 10 * len(film)
