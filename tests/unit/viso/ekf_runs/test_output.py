# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the filter's log may go, and how it gets there."""

import os
import stat
from pathlib import Path

import pytest

from viso.ekf_runs.output import EkfOutput, check_place
from viso.errors import InputError


@pytest.fixture
def output() -> EkfOutput:
    """Return a log that has begun."""
    output = EkfOutput({"EK3_PRIMARY": 0}.__getitem__, lambda: (0,))
    output.begin([("EK3_ENABLE", 1.0, 1.0)], 3_000_000)
    return output


def test_log_is_empty_until_it_begins(output: EkfOutput) -> None:
    assert EkfOutput(lambda _name: 0, lambda: (0,)).is_empty
    assert not output.is_empty


def test_log_replaces_a_file_as_a_whole(output: EkfOutput, tmp_path: Path) -> None:
    path = tmp_path / "out.BIN"
    path.write_bytes(b"before")
    output.save(path)
    assert path.read_bytes().startswith(bytes.fromhex("a3 95 80 80 59 46 4d 54 00"))
    assert [entry.name for entry in tmp_path.iterdir()] == ["out.BIN"]


def test_device_is_written_to_and_stays_a_device(output: EkfOutput) -> None:
    output.save(Path(os.devnull))
    assert stat.S_ISCHR(Path(os.devnull).stat().st_mode)


def test_place_that_is_no_more_is_one_line(output: EkfOutput, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match=r"\A[^\n]*/file/out\.BIN: [^\n]+\Z"):
        output.save(tmp_path / "file" / "out.BIN")


def refusal(path: Path, source: Path) -> str:
    with pytest.raises(InputError) as refused:
        check_place(path, source)
    return str(refused.value)


def test_folder_of_the_place_is_made(tmp_path: Path) -> None:
    check_place(tmp_path / "new" / "folder" / "out.BIN", tmp_path / "log.BIN")
    assert [entry.name for entry in (tmp_path / "new").iterdir()] == ["folder"]


def test_place_that_is_a_folder_is_refused(tmp_path: Path) -> None:
    assert refusal(tmp_path, tmp_path / "log.BIN") == f"{tmp_path}: Is a directory"


def test_place_in_a_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    assert refusal(tmp_path / "file" / "out.BIN", tmp_path / "log.BIN").startswith(f"{tmp_path}/file/out.BIN: ")


def test_log_that_is_read_is_not_overwritten(tmp_path: Path) -> None:
    log, other_name = tmp_path / "log.BIN", tmp_path / "same.BIN"
    log.write_bytes(b"log")
    other_name.symlink_to(log)
    assert refusal(other_name, log) == f"{other_name}: is the log to be read"
    assert log.read_bytes() == b"log"


def test_folder_that_takes_no_files_is_told_ahead(tmp_path: Path) -> None:
    assert refusal(Path("/proc/out.BIN"), tmp_path / "log.BIN").startswith("/proc/out.BIN: ")  # not even root's
