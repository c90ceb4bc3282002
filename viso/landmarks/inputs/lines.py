# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Text, a record a line: from files, and out of the bytes of a stream."""

import io
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from mav_handlers.links.packed import PackedError, open_packed
from viso.landmarks.inputs.base import InputFileError, LineReader
from viso.landmarks.types import Event

LONGEST_LINE_BYTES: Final = 1 << 20


class TextFile:
    """A file, plain or gzip, whose lines a reader understands; a ``whole`` one is a record with line ends inside."""

    def __init__(self, path: Path, reader: LineReader, *, whole: bool = False) -> None:
        self._path = path
        self._reader = reader
        self._whole = whole
        self.refused = reader.refused

    def events(self) -> Iterator[Event]:
        """Yield what the file tells. Raises InputFileError if it cannot be read or is not text."""
        lines = file_lines(self._path)
        for line in ["".join(lines)] if self._whole else lines:
            yield from self._reader.take(line)


def file_lines(path: Path) -> Iterator[str]:
    """Yield the lines of a text file, plain or gzip; bytes that are no UTF-8 become replacement characters.

    Raises InputFileError if it cannot be read, or is not text at all.
    """
    number = 0
    try:
        with io.TextIOWrapper(open_packed(path), encoding="utf-8-sig", errors="replace") as file:
            for number, line in enumerate(file, 1):
                if "\0" in line:
                    raise InputFileError(f"{path}:{number}: not a text file")
                yield line
    except PackedError as error:
        raise InputFileError(f"{path}:{number + 1}: {error}") from error
    except OSError as error:
        raise InputFileError(f"{path}: {error.strerror or error}") from error


class LineSplitter:
    """Cuts the bytes of a stream into lines; a line without an end is discarded after a mebibyte."""

    def __init__(self) -> None:
        self._rest = b""

    def feed(self, data: bytes) -> list[str]:
        """Return the lines that these bytes complete, without their ends."""
        *lines, self._rest = (self._rest + data).split(b"\n")
        if len(self._rest) > LONGEST_LINE_BYTES:
            self._rest = b""
        return [line.decode("utf-8", "replace").rstrip("\r") for line in lines]
