# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Files that replace others as a whole, or grow in their place; what crashes leave is in the tests of the stores."""

import errno
import fcntl
import os
import re
import stat
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import BinaryIO

import pytest

from tests.little_space import space_for
from tests.places import ROOT
from viso.errors import InputError
from viso.files.outputs import (
    check_place,
    growing_file,
    output_file,
    reading,
    refuse_input,
    remove_stale_drafts,
    replace_file,
)

Door = Callable[[Path], AbstractContextManager[BinaryIO]]
OLD, NEW = b"old", b"new"
DRAFT = ".file.0123456789abcdef.draft"


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Return a file that is there."""
    path = tmp_path / "file"
    path.write_bytes(OLD)
    return path


def names_beside(path: Path) -> list[str]:
    return sorted(entry.name for entry in path.parent.iterdir())


def write(door: Door, path: Path, data: bytes = NEW) -> None:
    with door(path) as file:
        file.write(data)


def write_half(door: Door, path: Path, error: type[BaseException]) -> None:
    with door(path) as file:
        file.write(NEW)
        raise error


def replace(path: Path) -> None:
    replace_file(path, NEW)


# Files that replace others


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


@pytest.mark.parametrize("door", [output_file, growing_file])
def test_file_keeps_its_mode(path: Path, door: Door) -> None:
    path.chmod(0o600)
    write(door, path)
    assert (path.read_bytes(), stat.S_IMODE(path.stat().st_mode)) == (NEW, 0o600)


def test_new_file_has_the_mode_of_any_new_file(tmp_path: Path) -> None:
    (tmp_path / "other").touch()
    write(output_file, tmp_path / "file")
    assert (tmp_path / "file").stat().st_mode == (tmp_path / "other").stat().st_mode


def test_link_stays_a_link(path: Path) -> None:
    link = path.with_name("link")
    link.symlink_to("file")
    replace_file(link, NEW)
    assert link.is_symlink()
    assert path.read_bytes() == NEW


def test_other_name_of_a_file_keeps_what_it_holds(path: Path) -> None:
    other = path.with_name("other")
    other.hardlink_to(path)
    write(output_file, path)
    assert (path.read_bytes(), other.read_bytes()) == (NEW, OLD)


def test_file_takes_its_place_at_the_end(path: Path) -> None:
    with output_file(path) as file:
        file.write(NEW)
        file.flush()
        assert path.read_bytes() == OLD
    assert path.read_bytes() == NEW
    assert names_beside(path) == ["file"]


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt, SystemExit])
@pytest.mark.parametrize("before", [None, OLD])
def test_what_ends_early_leaves_what_was_there(
    tmp_path: Path, error: type[BaseException], before: bytes | None
) -> None:
    path = tmp_path / "file"
    if before is not None:
        path.write_bytes(before)
    with pytest.raises(error):
        write_half(output_file, path, error)
    assert [entry.read_bytes() for entry in tmp_path.iterdir()] == ([] if before is None else [before])


@pytest.mark.parametrize("name", ["write", "fsync", "replace"])
def test_place_without_space_leaves_what_was_there(path: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    def no_space(*_: object) -> int:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, name, no_space)
    with pytest.raises(OSError, match="No space left on device"):
        replace_file(path, NEW)
    assert (path.read_bytes(), names_beside(path)) == (OLD, ["file"])


@pytest.mark.parametrize("door", [output_file, growing_file])
@pytest.mark.parametrize("size", [10, 100_000])  # what waits for the end, and what does not
def test_error_of_a_file_names_it(door: Door, size: int) -> None:
    with pytest.raises(InputError) as raised:
        write(door, Path("/dev/full"), bytes(size))
    assert str(raised.value) == "/dev/full: No space left on device"


def test_error_of_something_else_does_not_name_the_file(path: Path) -> None:
    with pytest.raises(BrokenPipeError), output_file(path):
        raise BrokenPipeError


@pytest.mark.parametrize("door", [output_file, growing_file])
def test_device_stays_a_device(door: Door) -> None:
    write(door, Path(os.devnull))
    assert stat.S_ISCHR(Path(os.devnull).stat().st_mode)


@pytest.mark.parametrize("door", [output_file, growing_file])
def test_file_that_must_not_be_written_is_kept(path: Path, door: Door, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "access", lambda *_: False)  # whoever runs the tests may write anywhere
    with pytest.raises(InputError, match="file: Permission denied"):
        write(door, path)
    assert (path.read_bytes(), names_beside(path)) == (OLD, ["file"])


@pytest.mark.parametrize(("name", "reason"), [("none/file", "No such file or directory"), ("", "Is a directory")])
def test_place_that_cannot_be_is_told_ahead(tmp_path: Path, name: str, reason: str) -> None:
    place = tmp_path / name
    for look in (check_place, lambda path: write(output_file, path), lambda path: write(growing_file, path)):
        with pytest.raises(InputError) as raised:
            look(place)
        assert str(raised.value) == f"{place}: {reason}"


def test_to_look_at_a_place_changes_nothing(path: Path, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")  # to open one would wait for its reader
    for name in ("file", "new", "pipe"):
        check_place(tmp_path / name)
    check_place(Path("/dev/full"))
    assert (path.read_bytes(), names_beside(path)) == (OLD, ["file", "pipe"])


def test_name_as_long_as_can_be(tmp_path: Path) -> None:
    path = tmp_path / ("µ" * 127)
    write(output_file, path)
    assert path.read_bytes() == NEW


# Drafts


def test_nothing_to_clear_away_is_fine(path: Path) -> None:
    remove_stale_drafts(path)
    remove_stale_drafts(path.parent / "none" / "file")
    assert names_beside(path) == ["file"]


def test_draft_of_a_killed_command_is_removed_by_the_next(path: Path) -> None:
    path.with_name(DRAFT).touch()
    write(output_file, path)
    assert names_beside(path) == ["file"]


def test_draft_in_use_is_left_alone(path: Path) -> None:
    with path.with_name(DRAFT).open("w") as draft:
        fcntl.flock(draft.fileno(), fcntl.LOCK_EX)
        write(output_file, path)
    assert names_beside(path) == [DRAFT, "file"]


# Files that grow in their place


def test_growing_file_can_be_followed(path: Path) -> None:
    with growing_file(path) as file:
        for count in (1, 2):
            file.write(NEW)
            file.flush()
            assert path.read_bytes() == count * NEW


def test_growing_file_stays_whatever_ends_it(tmp_path: Path) -> None:
    path = tmp_path / "file"
    with pytest.raises(KeyboardInterrupt):
        write_half(growing_file, path, KeyboardInterrupt)
    assert (path.read_bytes(), names_beside(path)) == (NEW, ["file"])


def test_what_was_there_is_kept_beside_a_growing_file(path: Path) -> None:
    write(growing_file, path)
    assert (path.read_bytes(), path.with_name("file~").read_bytes()) == (NEW, OLD)
    assert names_beside(path) == ["file", "file~"]


def test_growing_file_without_space_keeps_both(path: Path) -> None:
    with space_for(20_000), pytest.raises(InputError, match="file: File too large"):
        write(growing_file, path, bytes(30_000))
    assert (path.read_bytes(), path.with_name("file~").read_bytes()) == (bytes(20_000), OLD)


def test_empty_file_is_not_kept_in_place_of_one_that_holds_something(path: Path) -> None:
    write(growing_file, path, b"")  # as when there is no space
    write(growing_file, path)
    assert (path.read_bytes(), path.with_name("file~").read_bytes()) == (NEW, OLD)


# What is being read


def other_names(path: Path) -> list[Path]:
    """Return a file under all the names that one can have."""
    symbolic, hard = path.with_name("symbolic"), path.with_name("hard")
    symbolic.symlink_to(path)
    hard.hardlink_to(path)
    return [path, path.parent / "." / path.name, symbolic, hard]


def test_file_that_is_read_is_refused_by_every_door(path: Path) -> None:
    names = other_names(path)
    there = names_beside(path)
    with reading([("--defaults x", path)]):
        for name in names:
            for door in (replace, check_place, lambda path: write(output_file, path)):
                with pytest.raises(InputError) as raised:
                    door(name)
                assert str(raised.value) == f"{name}: the same file as --defaults x, which is read"
    assert (path.read_bytes(), names_beside(path)) == (OLD, there)


@pytest.mark.parametrize("read", ["file", "file~"])
def test_growing_file_leaves_what_is_read(path: Path, read: str) -> None:
    path.with_name("file~").write_bytes(b"older")
    with (
        reading([("it", path.with_name(read))]),
        pytest.raises(InputError, match="the same file as it, which is read"),
    ):
        write(growing_file, path)
    assert [path.with_name(name).read_bytes() for name in names_beside(path)] == [OLD, b"older"]


def test_files_are_read_for_a_while(path: Path) -> None:
    other = path.with_name("other")
    other.touch()
    with reading([("one", path)]):
        with reading([("two", other)]):
            for name in (path, other):
                with pytest.raises(InputError, match="the same file as"):
                    refuse_input(name)
        refuse_input(other)
    refuse_input(path)


def test_what_is_no_file_is_not_kept(tmp_path: Path) -> None:
    values = ("none", "a\0b", "x" * 5000, str(tmp_path), os.devnull, -1)
    with reading([("it", value) for value in values]):
        for name in ("none", os.devnull):
            refuse_input(Path(name))


def test_standard_input_is_kept_by_its_descriptor(path: Path) -> None:
    with path.open() as file, reading([("standard input", file.fileno())]), pytest.raises(InputError):
        refuse_input(path)


# That there is no other door

OWN_DOORS = {
    "files/outputs.py",
    "cli.py",  # puts standard output out of use
    "logs/files.py",  # takes numbers that no file has
    "sweep/store.py",  # adds to its journal
}
WRITES = (
    r"\.write_(?:bytes|text)",
    r"""\bopen\([^)\n]*["'][rb]*[wax+]""",
    r"O_(?:CREAT|TRUNC|WRONLY)",
    r"(?<!pages\.)savefig\((?!file|data)",
    r"\.to(?:_csv|_parquet|file)\(",
    r"\bos\.re(?:place|name)",
    r"TlogWriter\([^,\n]*\)",
)


def test_nothing_is_written_past_the_door() -> None:
    package = ROOT / "viso"
    texts = {str(path.relative_to(package)): path.read_text(encoding="utf-8") for path in package.rglob("*.py")}
    assert {name for name, text in texts.items() if any(re.search(one, text) for one in WRITES)} == OWN_DOORS
