# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The file interface that MAVLink FTP needs.

Paths are as the client sent them, up to the first NUL. Nothing here raises: a failed operation returns a Failure.
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
        """The size in bytes that is reported to the client; it may be an estimate."""

    def read(self, offset: int, count: int) -> bytes | Failure:
        """Return up to ``count`` bytes at ``offset``; none at or after the end of the file."""

    def close(self) -> None:
        """Close the file."""


class WritableFile(Protocol):
    """A file opened for writing."""

    def write(self, offset: int, data: bytes) -> Failure | None:
        """Write ``data`` at ``offset``."""

    def close(self) -> None:
        """Complete and close the file."""


class FtpFiles(Protocol):
    """A tree of files."""

    def list_directory(self, path: str) -> Sequence[Entry] | Failure:
        """Return a directory's entries in a fixed order."""

    def open_read(self, path: str) -> ReadableFile | Failure:
        """Open a file for reading."""

    def open_write(self, path: str, *, create: bool) -> WritableFile | Failure:
        """Open a file for writing; ``create`` makes or empties it."""

    def remove(self, path: str) -> Failure | None:
        """Remove a file or an empty directory."""

    def make_directory(self, path: str) -> Failure | None:
        """Make a directory."""

    def rename(self, old_path: str, new_path: str) -> Failure | None:
        """Rename a file or directory."""
