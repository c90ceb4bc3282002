# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Reading of files that may be packed, by their first bytes, with a limit on the unpacked size.

A file of a few kilobytes can unpack to gigabytes. Recordings shrink to between a half and a tenth.
"""

import gzip
import io
import lzma
import os
import sys
import zipfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final, NamedTuple

MOST_TIMES: Final = 50
"""The largest growth factor of a packed file."""
ALWAYS_BYTES: Final = 1 << 24
"""The unpacked size that is always allowed."""
PACKED_ENDINGS: Final = (".gz", ".xz", ".zst", ".zip")
"""The endings of the names of packed files."""
_LFS_POINTER: Final = b"version https://git-lfs.github.com/spec/"
_OF_ARCHIVERS: Final = ("__MACOSX/", ".DS_Store")
_RECORDINGS: Final = (".bin", ".log", ".tlog", ".rlog", ".tlog.raw", ".jsonl")
_MOST_NAMES: Final = 3


class PackedError(OSError):
    """A packed file that is damaged or unpacks to too much; the text is one line, without the file's name."""


class CutShortError(PackedError):
    """A packed file whose end is missing; the bytes before it have been read."""


def _zstd(file: io.BufferedReader) -> Any:
    try:
        if sys.version_info >= (3, 14):
            from compression.zstd import ZstdFile
        else:
            from backports.zstd import ZstdFile
    except ModuleNotFoundError as error:
        reason = "packed with zstd, which this Python reads only with backports.zstd: unpack it with zstd -d"
        raise PackedError(reason) from error
    return ZstdFile(file)


def _zip(file: io.BufferedReader) -> Any:
    archive = zipfile.ZipFile(file)
    return archive.open(_only_name(archive))


def _only_name(archive: zipfile.ZipFile) -> str:
    names = [one.filename for one in archive.infolist() if not one.is_dir()]
    names = [name for name in names if not name.startswith(_OF_ARCHIVERS) and not name.endswith(_OF_ARCHIVERS)]
    recordings = [name for name in names if name.lower().endswith(_RECORDINGS)]
    chosen = recordings if len(names) > 1 else names
    if len(chosen) != 1:
        shown = ", ".join(chosen[:_MOST_NAMES]) + (", ..." if len(chosen) > _MOST_NAMES else "")
        what = f"{len(chosen)} of them recordings ({shown}): unpack it, and name one" if chosen else "none a recording"
        raise PackedError(f"a zip of {len(names)} files, {what}")
    return chosen[0]


class _Packing(NamedTuple):
    """A way of packing: its name, the first bytes of its files, and what opens one for unpacking."""

    name: str
    magic: bytes
    unpacker: Callable[[io.BufferedReader], Any]


_PACKINGS: Final = (
    _Packing("gzip", b"\x1f\x8b", lambda file: gzip.GzipFile(fileobj=file)),
    _Packing("xz", b"\xfd7zXZ\x00", lzma.LZMAFile),
    _Packing("zstd", b"\x28\xb5\x2f\xfd", _zstd),
    _Packing("zip", b"PK\x03\x04", _zip),
)
_LONGEST_MAGIC: Final = len(_LFS_POINTER)


def open_packed(path: Path) -> io.BufferedReader:
    """Open a file; it is unpacked if its first bytes are those of gzip, xz, zstd, or a zip with one recording in it.

    Raises OSError, and PackedError for a pointer of Git LFS; reading from the file also raises PackedError.
    """
    file = path.open("rb")
    try:
        head = file.peek(_LONGEST_MAGIC)
        if head.startswith(_LFS_POINTER):
            raise PackedError("a pointer of Git LFS, not the file itself: git lfs pull fetches that")
        packing = next((one for one in _PACKINGS if head.startswith(one.magic)), None)
        if packing is None:
            return file
        with _packed_errors(packing.name):
            return io.BufferedReader(_Unpacked(packing.unpacker(file), file, packing.name))
    except BaseException:
        file.close()
        raise


def name_unpacked(path: Path) -> str:
    """Return the name of what a file holds: of the recording in a zip, else without the ending of a packed file."""
    name = path.name
    if name.lower().endswith(".zip"):
        try:
            with zipfile.ZipFile(path) as archive:
                return Path(_only_name(archive)).name
        except (OSError, zipfile.BadZipFile):
            return name[: -len(".zip")]
    ending = next((one for one in PACKED_ENDINGS if name.lower().endswith(one)), "")
    return name[: len(name) - len(ending)]


def first_bytes(path: Path, count: int) -> bytes:
    """Return the first bytes of what a file holds, fewer if it is shorter. Raises OSError, also PackedError."""
    with open_packed(path) as file:
        try:
            return file.read(count)
        except CutShortError:
            return b""


@contextmanager
def _packed_errors(kind: str) -> Iterator[None]:
    try:
        yield
    except EOFError as error:
        raise CutShortError(f"damaged {kind} file: {error}") from error
    except OSError as error:
        if isinstance(error, PackedError) or error.errno is not None:
            raise
        raise PackedError(f"damaged {kind} file: {error}") from error
    except Exception as error:  # each way of packing has errors of its own
        raise PackedError(f"damaged {kind} file: {error}") from error


class _Unpacked(io.RawIOBase):
    """The content of a packed file, up to the limit."""

    def __init__(self, unpacker: Any, file: io.BufferedReader, kind: str) -> None:
        self._unpacker = unpacker
        self._file = file
        self._kind = kind
        self._most = max(MOST_TIMES * os.fstat(file.fileno()).st_size, ALWAYS_BYTES)
        self._read = 0

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: memoryview) -> int:  # type: ignore[override]  # any buffer, by the documentation
        with _packed_errors(self._kind):
            data: bytes = self._unpacker.read1(len(buffer))
        self._read += len(data)
        if self._read > self._most:
            most = f"{self._most >> 20} MiB"
            raise PackedError(f"holds more than {most}, as no recording of its size does; it is taken once unpacked")
        buffer[: len(data)] = data
        return len(data)

    def close(self) -> None:
        self._file.close()
        super().close()
