# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Makes small MP4 files with telemetry, byte by byte."""

import struct
from collections.abc import Sequence

ACCEL_HZ, GYRO_HZ = 200, 400


def box(kind: bytes, *bodies: bytes) -> bytes:
    """Return a box of ISO/IEC 14496-12."""
    body = b"".join(bodies)
    return struct.pack(">I4s", 8 + len(body), kind) + body


def table(kind: bytes, form: str, rows: Sequence[tuple[int, ...]], between: bytes = b"") -> bytes:
    """Return a box with version and flags 0, something between, a number of rows, and the rows."""
    packed = b"".join(struct.pack(form, *row) for row in rows)
    return box(kind, bytes(4), between, struct.pack(">I", len(rows)), packed)


def movie(payloads: Sequence[bytes], entry: bytes = b"gpmd", *, in_chunks_of: int = 1, wide: bool = False) -> bytes:
    """Return an MP4 with one track, whose samples last 1.001 s each.

    Args:
        payloads: the samples.
        entry: kind of the sample entry.
        in_chunks_of: how many samples lie in a chunk.
        wide: whether offsets have 64 bits.
    """
    head = box(b"ftyp", b"mp41", bytes(4))
    offsets, position = [], len(head) + 8
    for number, payload in enumerate(payloads):
        if number % in_chunks_of == 0:
            offsets.append((position,))
        position += len(payload)
    samples = box(
        b"stbl",
        box(b"stsd", bytes(4), struct.pack(">I", 1), box(entry, bytes(8))),
        table(b"stts", ">II", [(len(payloads), 1001)]),
        table(b"stsc", ">III", [(1, in_chunks_of, 1)]),
        table(b"stsz", ">I", [(len(payload),) for payload in payloads], between=bytes(4)),
        table(b"co64", ">Q", offsets) if wide else table(b"stco", ">I", offsets),
    )
    header = box(b"mdhd", bytes(12), struct.pack(">II", 1000, 1001 * len(payloads)), bytes(4))
    track = box(b"trak", box(b"mdia", header, box(b"minf", samples)))
    return head + box(b"mdat", *payloads) + box(b"moov", box(b"mvhd", bytes(100)), track)


def item(key: str, kind: str, width: int, data: bytes) -> bytes:
    """Return an item of GPMF: rows of a width, filled up to whole words; a kind of "" is for items within."""
    count = len(data) // width if width else 0
    return struct.pack(">4scBH", key.encode(), (kind or "\0").encode(), width, count) + data + bytes(-len(data) % 4)


def nested(key: str, *items: bytes) -> bytes:
    """Return an item that holds items."""
    return item(key, "", 1, b"".join(items))


def numbers(key: str, kind: str, form: str, *rows: Sequence[float]) -> bytes:
    """Return an item with rows of numbers."""
    data = b"".join(struct.pack(">" + form, *row) for row in rows)
    return item(key, kind, struct.calcsize(">" + form), data)


def stream(values: bytes, **about: bytes) -> bytes:
    """Return a stream: what is told about it, then its values."""
    return nested("STRM", *about.values(), values)


def sensor(
    key: str, rows: Sequence[Sequence[int]], scale: int, *, total: int | None = None, tick_ms: int | None = None,
    axes: str = "",
) -> bytes:  # fmt: skip
    """Return a stream of a camera's sensor."""
    about = {"scal": numbers("SCAL", "s", "h", [scale])}
    if total is not None:
        about["tsmp"] = numbers("TSMP", "L", "I", [total])
    if tick_ms is not None:
        about["tick"] = numbers("TICK", "L", "I", [tick_ms])
    if axes:
        about["orin"] = item("ORIN", "c", 1, axes.encode())
    return stream(numbers(key, "s", "hhh", *rows), **about)


def camera(*streams: bytes) -> bytes:
    """Return what a device tells."""
    return nested("DEVC", numbers("DVID", "L", "I", [1]), item("DVNM", "c", 1, b"Camera"), *streams)


def seconds_of_flight(count: int, accel: Sequence[int], gyro: Sequence[int], axes: str = "") -> list[bytes]:
    """Return telemetry of so many seconds at constant readings, which are whole multiples of 0.01."""
    payloads = []
    for number in range(count):
        streams = [
            sensor(key, [row] * rate, 100, total=rate * (number + 1), tick_ms=5000 + 1000 * number, axes=axes)
            for key, row, rate in (("ACCL", accel, ACCEL_HZ), ("GYRO", gyro, GYRO_HZ))
        ]
        payloads.append(camera(*streams))
    return payloads
