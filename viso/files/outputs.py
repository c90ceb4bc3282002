# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes files: nothing that was there is lost before what replaces it is complete.

A file is written as a draft beside its place, and takes the place when it is complete; a crash at any instant leaves
the old file or the new one, whole. What a command reads can never be replaced.
"""

import contextlib
import errno
import fcntl
import io
import os
import re
import stat
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import Any, BinaryIO, Final

from viso.errors import InputError, file_errors

BACKUP: Final = "~"
"""What a file is called, behind its own name, when one that grows takes its place."""

_NAME_IN_DRAFT: Final = 40  # characters: with them and more a draft of a long name would have one that is too long

_Identity = tuple[int, int]
_read_now: ContextVar[dict[_Identity, str]] = ContextVar("_read_now")


@contextmanager
def reading(files: Iterable[tuple[str, str | Path | int]]) -> Iterator[None]:
    """Refuse to write over some files for a while, under whatever name.

    Each is what it is called in an error, and its path or descriptor; what is no file there is passed over.
    """
    named = {identity: name for name, file in files if (identity := _identity(file)) is not None}
    before = _read_now.set(_read_now.get({}) | named)
    try:
        yield
    finally:
        _read_now.reset(before)


def refuse_input(path: Path, option: str = "") -> None:
    """Raise InputError if a path is a file that is being read; ``option`` is by which the path was given."""
    identity = _identity(path)
    if identity is not None and (name := _read_now.get({}).get(identity)) is not None:
        raise InputError(f"{option} {path}: the same file as {name}, which is read".lstrip())


def check_place(path: Path) -> None:
    """Raise InputError if a file cannot be written, as far as this is known before there is something to write."""
    with file_errors(path):
        status = _status(path)
        if status is None or stat.S_ISREG(status.st_mode) or stat.S_ISDIR(status.st_mode):
            _Draft(path).discard()


@contextmanager
def output_file(path: Path) -> Iterator[BinaryIO]:
    """Open a file that takes its place at the end, unless what is done meanwhile raises; then all is as it was.

    Raises InputError if it cannot be written.
    """
    remove_stale_drafts(path)
    with file_errors(path):
        draft = _Draft(path)
    try:
        with io.BufferedWriter(_NamedFile(draft.descriptor, path)) as file:
            yield file
        with file_errors(path):
            draft.take_place()
    finally:
        draft.discard()


@contextmanager
def growing_file(path: Path) -> Iterator[BinaryIO]:
    """Open a file that is in its place at once, for what happens only once: it can be followed, and whatever ends it.

    One that was there before is kept under its name and ``BACKUP``. Raises InputError if it cannot be written.
    """
    with file_errors(path):
        draft = _Draft(path)
    try:
        with file_errors(path):
            draft.take_place(keep_old=True)
        with io.BufferedWriter(_NamedFile(draft.descriptor, path)) as file:
            yield file
    finally:
        draft.discard()


def replace_file(path: Path, data: bytes, *, mode: int | None = None, synced: bool = True) -> None:
    """Put a file in place as a whole, for who keeps something in it; its folder is made when it is missing.

    ``mode`` is its permissions, less the process's umask, from the first byte on; by default those that it has. Unless
    ``synced`` waits for the disk, it holds for a crash of the process, not of the computer. Raises OSError as the file
    system says, and the file is then as it was; InputError if the file is being read.
    """
    Path(os.path.realpath(path)).parent.mkdir(parents=True, exist_ok=True)
    draft = _Draft(path, mode)
    try:
        waiting = memoryview(data)
        while waiting:
            waiting = waiting[os.write(draft.descriptor, waiting) :]
        draft.take_place(synced=synced)
    finally:
        draft.discard()


def remove_stale_drafts(path: Path) -> None:
    """Delete what killed processes left; a draft in use is locked (one not yet locked costs its writer a retry)."""
    target = Path(os.path.realpath(path))
    pattern = re.compile(re.escape(_draft_name(target, "")) + r"[0-9a-f]{16}\.draft")
    drafts: list[str] = []
    with contextlib.suppress(OSError):
        drafts += filter(pattern.fullmatch, os.listdir(target.parent))
    for name in drafts:
        draft = target.with_name(name)
        with contextlib.suppress(OSError), draft.open("rb") as stale:
            fcntl.flock(stale.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)
            draft.unlink()


class _Draft:
    """A file that is to take the place of another; in the place of a device or a pipe it is that itself.

    A link to the file stays a link: what it points to is replaced. ``descriptor`` is open until ``discard``.
    """

    def __init__(self, path: Path, mode: int | None = None) -> None:
        refuse_input(path)
        self._target = Path(os.path.realpath(path))
        self._place: Path | None = None
        self._old = _status(path)
        if self._old is not None and not stat.S_ISREG(self._old.st_mode):
            self.descriptor = os.open(path, os.O_WRONLY)
            return
        if self._old is not None and not os.access(path, os.W_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
        place = self._target.with_name(_draft_name(self._target, f"{os.urandom(8).hex()}.draft"))
        self.descriptor = os.open(place, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666 if mode is None else mode)
        self._place = place
        with contextlib.suppress(OSError):  # some file systems have no locks, some no permissions
            fcntl.flock(self.descriptor, fcntl.LOCK_EX)
        if self._old is not None and mode is None:
            with contextlib.suppress(OSError):
                os.fchmod(self.descriptor, stat.S_IMODE(self._old.st_mode))

    def take_place(self, *, keep_old: bool = False, synced: bool = True) -> None:
        """Be the file from now on. Raises OSError."""
        if self._place is None:
            return
        if synced:
            _sync(self.descriptor)
        if keep_old and self._old is not None and self._old.st_size:
            backup = self._target.with_name(self._target.name + BACKUP)
            refuse_input(backup)
            os.replace(self._target, backup)
        os.replace(self._place, self._target)
        self._place = None
        if synced:
            _sync_folder(self._target.parent)

    def discard(self) -> None:
        """Close the file, and delete what has not taken its place."""
        with contextlib.suppress(OSError):
            os.close(self.descriptor)
        if self._place is not None:
            with contextlib.suppress(OSError):
                self._place.unlink()


class _NamedFile(io.FileIO):
    """An open file whose errors name it; the descriptor stays open."""

    def __init__(self, descriptor: int, path: Path) -> None:
        super().__init__(descriptor, "wb", closefd=False)
        self._path = path

    def write(self, data: Any, /) -> int:
        """Write some bytes. Raises InputError if that cannot be done."""
        with file_errors(self._path):
            return super().write(data)


def _identity(file: str | Path | int) -> _Identity | None:
    try:
        status = os.stat(file)
    except (OSError, ValueError):
        return None
    return (status.st_dev, status.st_ino) if stat.S_ISREG(status.st_mode) else None


def _status(path: Path) -> os.stat_result | None:
    try:
        return path.stat()
    except FileNotFoundError:
        return None


def _draft_name(target: Path, rest: str) -> str:
    return f".{target.name[:_NAME_IN_DRAFT]}.{rest}"


def _sync_folder(folder: Path) -> None:
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        _sync(descriptor)
    finally:
        os.close(descriptor)


def _sync(descriptor: int) -> None:
    try:
        os.fsync(descriptor)
    except OSError as error:
        if error.errno != errno.EINVAL:  # some file systems cannot do that, above all to a folder
            raise
