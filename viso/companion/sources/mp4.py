# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a metadata track of an MP4 file holds (ISO/IEC 14496-12, the ISO base media file format)."""

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, Final

from viso.companion.sources.base import SourceError

LARGEST_INDEX_BYTES: Final = 1 << 28
MOST_SAMPLES: Final = 1_000_000
"""Of a track with a sample a second, as telemetry has."""
_LONG_SIZE, _TO_THE_END = 1, 0


@dataclass(frozen=True, slots=True)
class Payload:
    """A sample of a track, by the time since the track's start."""

    start_s: float
    duration_s: float
    data: bytes


class _DamagedError(Exception):
    """Carries what is wrong."""


def read_payloads(path: Path, entry: bytes) -> list[Payload]:
    """Return the samples of the first track with a kind of sample entry, such as ``gpmd``; none without such a track.

    Raises SourceError if the file cannot be read, or is no MP4, or a damaged one.
    """
    try:
        with path.open("rb") as file:
            return _payloads(file, entry)
    except OSError as error:
        raise SourceError(f"{path}: {error.strerror or error}") from error
    except (_DamagedError, struct.error) as error:
        raise SourceError(f"{path}: no MP4, or a damaged one: {error}") from error


def _payloads(file: BinaryIO, entry: bytes) -> list[Payload]:
    size = file.seek(0, 2)
    for kind, track in _boxes(_index(file, size)):
        media = _find(track, b"mdia") if kind == b"trak" else None
        table = None if media is None else _find(media, b"minf", b"stbl")
        if media is None or table is None or bytes(_required(table, b"stsd")[12:16]) != entry:
            continue
        lengths = _lengths(_required(table, b"stsz"), size)
        offsets = _offsets(table, lengths)
        return [
            Payload(start_s, duration_s, _read(file, offset, length, size))
            for offset, length, (start_s, duration_s) in zip(offsets, lengths, _times(media, table), strict=False)
        ]
    return []


def _index(file: BinaryIO, size: int) -> memoryview:
    """Return what the box moov holds."""
    position = 0
    while position + 8 <= size:
        file.seek(position)
        header = file.read(16)
        kind, start, length = _header(header, size - position)
        if kind == b"moov":
            if length > LARGEST_INDEX_BYTES:
                raise _DamagedError(f"an index of {length} bytes")
            return memoryview(_read(file, position + start, length - start, size))
        position += length
    raise _DamagedError("no index (moov)")


def _header(data: bytes | memoryview, available: int) -> tuple[bytes, int, int]:
    """Return the kind of a box, the length of its header and its own."""
    length, kind = struct.unpack(">I4s", data[:8])
    start = 8
    if length == _LONG_SIZE:
        (length,) = struct.unpack(">Q", data[8:16])
        start = 16
    elif length == _TO_THE_END:
        length = available
    if not start <= length <= available:
        raise _DamagedError(f"a box {kind!r} of {length} bytes where there are {available}")
    return kind, start, length


def _boxes(data: memoryview) -> Iterator[tuple[bytes, memoryview]]:
    while len(data) >= 8:
        kind, start, length = _header(data, len(data))
        yield kind, data[start:length]
        data = data[length:]


def _find(data: memoryview, *kinds: bytes) -> memoryview | None:
    """Return what the first box of a kind holds, or the first one in that, and so on."""
    for wanted in kinds:
        found = next((body for kind, body in _boxes(data) if kind == wanted), None)
        if found is None:
            return None
        data = found
    return data


def _required(data: memoryview, kind: bytes) -> memoryview:
    found = _find(data, kind)
    if found is None:
        raise _DamagedError(f"no {kind.decode()}")
    return found


def _rows(body: memoryview, form: str, skip: int = 4) -> Iterator[tuple[int, ...]]:
    """Yield the rows of a table: its number of rows stands after some bytes, then they follow."""
    (count,) = struct.unpack_from(">I", body, skip)
    length = struct.calcsize(form)
    start = skip + 4
    if count * length > len(body) - start:
        raise _DamagedError(f"a table of {count} rows in {len(body)} bytes")
    return struct.iter_unpack(form, body[start : start + count * length])


def _lengths(body: memoryview, size: int) -> list[int]:
    fixed, count = struct.unpack_from(">II", body, 4)
    if count > MOST_SAMPLES:
        raise _DamagedError(f"{count} samples")
    if not fixed:
        return [row[0] for row in _rows(body, ">I", 8)]
    if fixed * count > size:
        raise _DamagedError(f"{count} samples of {fixed} bytes")
    return [fixed] * count


def _offsets(table: memoryview, lengths: list[int]) -> Iterator[int]:
    """Yield where each sample begins: samples lie in chunks, each right after the one before."""
    short = _find(table, b"stco")
    chunks = list(_rows(short, ">I") if short is not None else _rows(_required(table, b"co64"), ">Q"))
    runs = list(_rows(_required(table, b"stsc"), ">III"))
    left = iter(lengths)
    for number, (offset,) in enumerate(chunks, 1):
        while len(runs) > 1 and runs[1][0] <= number:
            runs.pop(0)
        for _ in range(runs[0][1] if runs else 0):
            yield offset
            length = next(left, None)
            if length is None:
                return
            offset += length


def _times(media: memoryview, table: memoryview) -> Iterator[tuple[float, float]]:
    header = _required(media, b"mdhd")
    (scale,) = struct.unpack_from(">I", header, 20 if header[0] == 1 else 12)
    if scale == 0:
        raise _DamagedError("a time scale of 0")
    time = 0
    for count, duration in _rows(_required(table, b"stts"), ">II"):
        for _ in range(count):
            yield time / scale, duration / scale
            time += duration


def _read(file: BinaryIO, offset: int, length: int, size: int) -> bytes:
    if offset + length > size:
        raise _DamagedError(f"{length} bytes at {offset} of {size}: cut short")
    file.seek(offset)
    return file.read(length)
