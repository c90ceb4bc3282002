# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the filter's log may go, and how it gets there."""

import os
import stat
from pathlib import Path

import pytest

from viso.errors import InputError
from viso.replay.ekf.output import EkfOutput


@pytest.fixture
def output() -> EkfOutput:
    """Return a log that has begun."""
    output = EkfOutput(lambda: 0)
    output.begin([("EK3_ENABLE", 1.0, 1.0)], 3_000_000)
    return output


def test_log_is_empty_until_it_begins(output: EkfOutput) -> None:
    assert EkfOutput(lambda: 0).is_empty
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
