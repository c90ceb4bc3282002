# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A log with a name of the user's."""

import os
from pathlib import Path

import pytest

from viso.errors import InputError
from viso.logs.files import LogStoreError
from viso.logs.single import SingleLog


def write(log: SingleLog, data: bytes) -> None:
    with log.open() as file:
        file.write(data)


def test_file_is_made_at_once(tmp_path: Path) -> None:
    SingleLog(tmp_path / "out.BIN")
    assert (tmp_path / "out.BIN").read_bytes() == b""


def test_file_that_is_there_is_replaced(tmp_path: Path) -> None:
    path = tmp_path / "out.BIN"
    path.write_bytes(b"before")
    write(SingleLog(path), b"after")
    assert path.read_bytes() == b"after"


def test_log_that_is_opened_again_is_continued(tmp_path: Path) -> None:
    log = SingleLog(tmp_path / "out.BIN")
    write(log, b"one")
    write(log, b"two")
    assert (tmp_path / "out.BIN").read_bytes() == b"onetwo"


@pytest.mark.parametrize("name", ["none/out.BIN", "."])
def test_place_that_cannot_be_written_to_is_an_error(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    with pytest.raises(InputError) as raised:
        SingleLog(path)
    assert str(raised.value).startswith(f"{path}: ")


def test_no_descriptor_is_kept(tmp_path: Path) -> None:
    before = len(os.listdir("/proc/self/fd"))
    write(SingleLog(tmp_path / "out.BIN"), b"data")
    assert len(os.listdir("/proc/self/fd")) == before


def test_file_that_cannot_be_opened_again_is_an_error_of_the_log(tmp_path: Path) -> None:
    path = tmp_path / "out.BIN"
    log = SingleLog(path)
    path.unlink()
    path.mkdir()
    with pytest.raises(LogStoreError, match=r"out\.BIN: Is a directory"):
        log.open()


def test_failure_to_write_is_told(tmp_path: Path) -> None:
    log = SingleLog(Path("/dev/full"))
    write(log, b"data")
    assert log.failure == "/dev/full: No space left on device"


def test_there_is_no_failure_when_all_is_well(tmp_path: Path) -> None:
    log = SingleLog(tmp_path / "out.BIN")
    assert log.failure is None
    write(log, b"data")
    assert log.failure is None
