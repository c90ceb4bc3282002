# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Telemetry logs (.tlog): the time and the bytes of each frame.

An entry is a big-endian count of microseconds in eight bytes, then one MAVLink 1 or 2 frame. Ground
stations write time since 1970, some with the number of the link in the lowest two bits. Nothing marks the
start of an entry, so after damage the next one is found by plausibility.
"""

import gzip
import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import BinaryIO

from mav_handlers.links.base import reason_of
from mav_handlers.links.packed import CutShortError, PackedError, open_packed

STAMP_BYTES = 8
STX_V1 = 0xFE
STX_V2 = 0xFD
V1_OVERHEAD_BYTES = 8
V2_OVERHEAD_BYTES = 12
SIGNATURE_BYTES = 13
IFLAG_SIGNED = 0x01
HEAD_BYTES = STAMP_BYTES + 3

DAY_US = 86_400_000_000
YEAR_2000_US = 946_684_800_000_000
YEAR_2100_US = 4_102_444_800_000_000

_STX = re.compile(rb"[\xfd\xfe]")


class TlogError(Exception):
    """A file that cannot be read or written as a tlog; the text is one line with file, position and reason."""


@dataclass(frozen=True, slots=True)
class TlogEntry:
    """One recorded frame; ``time_us`` is as in the file, including the link number."""

    time_us: int
    data: bytes


class TlogReader(Iterator[TlogEntry]):
    """Iterates over the entries of a tlog, plain or gzip, and skips damaged places.

    Frames are returned as recorded, without a check of the checksum. The file is held in memory. After the iteration
    the attributes hold what was not read: ``skipped_bytes`` in damaged places, ``truncated_bytes`` of a last entry that
    was
    cut off, ``truncated`` if that happened or the compressed data end too early. Raises TlogError, at once, if the file
    is not readable or has no entry.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self.skipped_bytes = 0
        self.truncated_bytes = 0
        self._data, self.truncated = _load(self.path)
        self._offset = 0
        self._last_us: int | None = None
        self._ahead = self._next_entry()
        if self._ahead is None:
            what = "no telemetry log entry in this file" if self._data else "the file is empty"
            raise TlogError(f"{self.path}: byte 0: {what}")

    def __next__(self) -> TlogEntry:
        """Return the next entry."""
        entry = self._ahead
        if entry is None:
            raise StopIteration
        self._ahead = self._next_entry()
        return entry

    def _next_entry(self) -> TlogEntry | None:
        while self._offset < len(self._data):
            size = self._size_at(self._offset)
            end = self._offset + size
            if size and end <= len(self._data) and self._trusted(self._offset, end):
                return self._take(end)
            if not self._resynchronise(size):
                return None
        return None

    def _take(self, end: int) -> TlogEntry:
        entry = TlogEntry(self._stamp_at(self._offset), bytes(self._data[self._offset + STAMP_BYTES : end]))
        self._last_us = entry.time_us
        self._offset = end
        return entry

    def _resynchronise(self, size: int) -> bool:
        """Move to the next plausible entry or to the end; ``size`` is the present entry's stated size, 0 if none."""
        found = self._find(self._offset + 1, len(self._data))
        rest = len(self._data) - self._offset
        if found is not None:
            self.skipped_bytes += found - self._offset
            self._offset = found
            return True
        self._offset = len(self._data)
        if size > rest or rest < HEAD_BYTES:
            self.truncated_bytes = rest
            self.truncated = True
        else:
            self.skipped_bytes += rest
        return False

    def _trusted(self, start: int, end: int) -> bool:
        """Return whether an entry is genuine.

        Either another entry follows, or its time fits and no other entry begins inside it.
        """
        if self._leads_on(start, end):
            return True
        return self._time_fits(start) and self._find(start + 1, end) is None

    def _find(self, start: int, stop: int) -> int | None:
        """Return the offset in [start, stop) of the first plausible entry."""
        for stx in _STX.finditer(self._data, start + STAMP_BYTES, stop + STAMP_BYTES):
            at = stx.start() - STAMP_BYTES
            size = self._size_at(at)
            if size and self._time_fits(at) and self._leads_on(at, at + size):
                return at
        return None

    def _leads_on(self, start: int, end: int) -> bool:
        """Return whether an entry with a possible time is followed by another or by the end of the file."""
        if self._stamp_at(start) >= YEAR_2100_US or end > len(self._data):
            return False
        return end == len(self._data) or self._size_at(end) > 0

    def _time_fits(self, at: int) -> bool:
        """Return whether the time at an offset is in this century, or within a day of the last one."""
        time_us = self._stamp_at(at)
        if YEAR_2000_US <= time_us < YEAR_2100_US:
            return True
        return self._last_us is not None and abs(time_us - self._last_us) <= DAY_US

    def _stamp_at(self, at: int) -> int:
        return int.from_bytes(self._data[at : at + STAMP_BYTES], "big")

    def _size_at(self, at: int) -> int:
        return _size_of(self._data, at)


class TlogWriter:
    """Writes a tlog, plain or, if the name ends in ``.gz``, compressed.

    Args:
        path: the file, rewritten.
        file: the open file to write to, if any.

    Raises:
        TlogError: if the file cannot be written.
    """

    def __init__(self, path: str | Path, file: BinaryIO | None = None) -> None:
        self.path = Path(path)
        try:
            raw = self.path.open("wb") if file is None else file
        except OSError as error:
            raise TlogError(f"{self.path}: {reason_of(error)}") from None
        self._raw = raw
        self._file = gzip.GzipFile("", "wb", fileobj=raw, mtime=0) if self.path.suffix == ".gz" else raw

    def write(self, time_us: int, data: bytes) -> None:
        """Add one frame. Raises ValueError if it is not a whole frame or the time is negative."""
        if time_us < 0 or data[:1] not in (bytes([STX_V1]), bytes([STX_V2])):
            raise ValueError("an entry is a time not before 0 and one MAVLink frame")
        try:
            self._file.write(struct.pack(">Q", time_us) + data)
        except OSError as error:
            raise TlogError(f"{self.path}: {reason_of(error)}") from None

    def close(self) -> None:
        """Flush and close the file."""
        try:
            self._file.close()
            self._raw.close()
        except OSError as error:
            raise TlogError(f"{self.path}: {reason_of(error)}") from None

    def __enter__(self) -> "TlogWriter":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def begins_with_entry(data: bytes) -> bool:
    """Return whether bytes begin with an entry of a tlog, as far as it and the entry behind it are there."""
    if len(data) < HEAD_BYTES or int.from_bytes(data[:STAMP_BYTES], "big") >= YEAR_2100_US:
        return False
    size = _size_of(data, 0)
    return size > 0 and (len(data) < size + HEAD_BYTES or _size_of(data, size) > 0)


def _size_of(data: bytes | bytearray, at: int) -> int:
    """Return the size of the entry at an offset, from its first bytes, or 0 if there is none."""
    if at + HEAD_BYTES > len(data):
        return 0
    stx, length, incompat_flags = data[at + STAMP_BYTES : at + HEAD_BYTES]
    if stx == STX_V1:
        return STAMP_BYTES + length + V1_OVERHEAD_BYTES
    if stx == STX_V2:
        signature = SIGNATURE_BYTES if incompat_flags & IFLAG_SIGNED else 0
        return STAMP_BYTES + length + V2_OVERHEAD_BYTES + signature
    return 0


def read_tlog(path: str | Path) -> TlogReader:
    """Read a tlog; iterate over the result for its entries. Raises TlogError."""
    return TlogReader(path)


def _load(path: Path) -> tuple[bytearray, bool]:
    """Return the file's content, uncompressed, and whether the compressed data were cut off."""
    data = bytearray()
    try:
        with open_packed(path) as file:
            while part := file.read1(65536):
                data += part
    except CutShortError:
        return data, True
    except PackedError as error:
        raise TlogError(f"{path}: byte {len(data)}: {reason_of(error)}") from None
    except OSError as error:
        raise TlogError(f"{path}: {reason_of(error)}") from None
    return data, False
