# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What MAVLink FTP asks of the files behind it.

Paths are as the client sent them, up to the first NUL. Nothing here raises: what fails is answered by a Failure.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol


@dataclass(frozen=True, slots=True)
class Failure:
    """Why an operation failed: a number of the ``errno`` module."""

    errno: int


@dataclass(frozen=True, slots=True)
class Entry:
    """One line of a directory: a file with its size in bytes, or a directory with None."""

    name: str
    size: int | None = None


class ReadableFile(Protocol):
    """A file opened for reading."""

    @property
    def size(self) -> int:
        """The size in bytes that is told to the client; it may be an estimate."""

    def read(self, offset: int, count: int) -> bytes | Failure:
        """Return up to ``count`` bytes at ``offset``; none at the end of the file and beyond."""

    def close(self) -> None:
        """Let go of the file."""


class WritableFile(Protocol):
    """A file opened for writing."""

    def write(self, offset: int, data: bytes) -> Failure | None:
        """Put ``data`` at ``offset``."""

    def close(self) -> None:
        """Complete the file and let go of it."""


class FtpFiles(Protocol):
    """A tree of files."""

    def list_directory(self, path: str) -> Sequence[Entry] | Failure:
        """Return a directory's entries, always in the same order."""

    def open_read(self, path: str) -> ReadableFile | Failure:
        """Open a file for reading."""

    def open_write(self, path: str, *, create: bool) -> WritableFile | Failure:
        """Open a file for writing; ``create`` makes it, or empties the one that is there."""

    def remove(self, path: str) -> Failure | None:
        """Remove a file or an empty directory."""

    def make_directory(self, path: str) -> Failure | None:
        """Make a directory."""

    def rename(self, old_path: str, new_path: str) -> Failure | None:
        """Give a file or directory another path."""
