# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Replacing files as a whole; what crashes leave is in the tests of the stores."""

import os
import stat
from pathlib import Path

import pytest

from viso.files.atomic_file import remove_stale_drafts, replace_file


def test_file_and_folder_are_made(tmp_path: Path) -> None:
    replace_file(tmp_path / "new" / "file", b"data")
    assert (tmp_path / "new" / "file").read_bytes() == b"data"


@pytest.mark.parametrize("mode", [0o600, 0o640, 0o644])
def test_file_has_the_mode_from_its_first_byte_on(tmp_path: Path, mode: int, monkeypatch: pytest.MonkeyPatch) -> None:
    modes = []
    write = os.write

    def noted(descriptor: int, data: bytes) -> int:
        modes.append(stat.S_IMODE(os.fstat(descriptor).st_mode))
        return write(descriptor, data)

    monkeypatch.setattr(os, "write", noted)
    before = os.umask(0)
    try:
        replace_file(tmp_path / "file", b"data", mode=mode)
    finally:
        os.umask(before)
    assert modes == [mode]


def test_link_stays_a_link(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"old")
    (tmp_path / "link").symlink_to("file")
    replace_file(tmp_path / "link", b"new")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "file").read_bytes() == b"new"


def test_nothing_to_clear_away_is_fine(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"data")
    remove_stale_drafts(tmp_path / "file")
    remove_stale_drafts(tmp_path / "none" / "file")
    assert [entry.name for entry in tmp_path.iterdir()] == ["file"]
