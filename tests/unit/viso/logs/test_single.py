# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A log with a name of the user's."""

import os
from pathlib import Path

import pytest

from viso.errors import InputError
from viso.logs.files import single_log


def test_log_takes_the_place_of_a_file_at_the_end(tmp_path: Path) -> None:
    path = tmp_path / "out.BIN"
    path.write_bytes(b"before")
    with single_log(path) as open_log:
        open_log().write(b"after")
        assert path.read_bytes() == b"before"
    assert path.read_bytes() == b"after"


def test_log_that_is_never_opened_is_empty(tmp_path: Path) -> None:
    with single_log(tmp_path / "out.BIN"):
        pass
    assert (tmp_path / "out.BIN").read_bytes() == b""


def test_log_that_is_opened_again_is_continued(tmp_path: Path) -> None:
    with single_log(tmp_path / "out.BIN") as open_log:
        for data in (b"one", b"two"):
            with open_log() as file:
                file.write(data)
    assert (tmp_path / "out.BIN").read_bytes() == b"onetwo"


@pytest.mark.parametrize("name", ["none/out.BIN", "."])
def test_place_that_cannot_be_written_to_is_an_error(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    with pytest.raises(InputError) as raised, single_log(path):
        pass
    assert str(raised.value).startswith(f"{path}: ")


def test_no_descriptor_is_kept(tmp_path: Path) -> None:
    before = len(os.listdir("/proc/self/fd"))
    with single_log(tmp_path / "out.BIN") as open_log:
        open_log().write(b"data")
    assert len(os.listdir("/proc/self/fd")) == before


def test_failure_to_write_is_told() -> None:
    with pytest.raises(InputError) as raised, single_log(Path("/dev/full")) as open_log:
        open_log().write(b"data")
    assert str(raised.value) == "/dev/full: No space left on device"
