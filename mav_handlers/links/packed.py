# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Reading of files that may be compressed, with a limit on the unpacked size.

A file of a few kilobytes can unpack to gigabytes. Recordings shrink to between a half and a tenth.
"""

import gzip
import io
import lzma
import os
import zlib
from pathlib import Path
from typing import Final

MOST_TIMES: Final = 50
"""The largest growth factor of a packed file."""
ALWAYS_BYTES: Final = 1 << 24
"""The unpacked size that is always allowed."""
_GZIP_MAGIC: Final = b"\x1f\x8b"


class PackedError(OSError):
    """A packed file that is damaged or unpacks to too much; the text is one line, without the file's name."""


class CutShortError(PackedError):
    """A packed file whose end is missing; the bytes before it have been read."""


def open_packed(path: Path) -> io.BufferedReader:
    """Open a file; it is unpacked as xz if its name ends in .xz, as gzip if it begins with gzip's magic bytes.

    Raises OSError; reading from the file also raises PackedError.
    """
    file = path.open("rb")
    if path.suffix == ".xz":
        return io.BufferedReader(_Unpacked(lzma.LZMAFile(file), file, "xz"))
    if file.peek(len(_GZIP_MAGIC)).startswith(_GZIP_MAGIC):
        return io.BufferedReader(_Unpacked(gzip.GzipFile(fileobj=file), file, "gzip"))
    return file


class _Unpacked(io.RawIOBase):
    """The content of a packed file, up to the limit."""

    def __init__(self, unpacker: lzma.LZMAFile | gzip.GzipFile, file: io.BufferedReader, kind: str) -> None:
        self._unpacker = unpacker
        self._file = file
        self._kind = kind
        self._most = max(MOST_TIMES * os.fstat(file.fileno()).st_size, ALWAYS_BYTES)
        self._read = 0

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: memoryview) -> int:  # type: ignore[override]  # any buffer, by the documentation
        try:
            data = self._unpacker.read1(len(buffer))
        except EOFError as error:
            raise CutShortError(f"damaged {self._kind} file: {error}") from error
        except (gzip.BadGzipFile, lzma.LZMAError, zlib.error) as error:
            raise PackedError(f"damaged {self._kind} file: {error}") from error
        self._read += len(data)
        if self._read > self._most:
            most = f"{self._most >> 20} MiB"
            raise PackedError(f"holds more than {most}, as no recording of its size does; it is taken once unpacked")
        buffer[: len(data)] = data
        return len(data)

    def close(self) -> None:
        self._file.close()
        super().close()
