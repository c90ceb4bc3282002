# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The offsets of the records of a DataFlash log, found without a Python step for each record.

A record's type gives its length, and the next record follows it; in a damaged log the next header of a known type
follows. So every place that looks like a header has a successor. In a sound log that is nearly always the next such
place. A step is needed only where it is not, because a header's two bytes occur among values.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from ap_core.dataflash_dtype import Records, dtype_of, record_dtype
from ap_core.log_structure import FMT, HEAD_BYTE1, HEAD_BYTE2

Offsets: TypeAlias = npt.NDArray[np.int64]
Bytes: TypeAlias = npt.NDArray[np.uint8]

HEADER_BYTES: Final = 3
NO_HEADER: Final = "no record begins here"
CUT_SHORT: Final = "the log ends within this record"
_FMT_DTYPE: Final = record_dtype(FMT)
_MOST_PASSES: Final = 8
_AT_ONCE: Final = 1 << 24


class Lost(NamedTuple):
    """Bytes of a log that are in no record: offset of the first, number and reason."""

    offset: int
    size: int
    reason: str


@dataclass(frozen=True, slots=True)
class Layout:
    """The layout of a type in an FMT record; ``format`` has a character a field, ``dtype`` includes the header."""

    msg_type: int
    name: str
    format: str
    labels: tuple[str, ...]
    dtype: np.dtype[np.void]


_FMT_LAYOUT: Final = Layout(FMT.msg_type, FMT.name, FMT.format, FMT.fields, _FMT_DTYPE)


@dataclass(frozen=True, slots=True)
class Formats:
    """The layouts in a log's FMT records, by type; ``ill`` holds why a type with an FMT has no layout."""

    layouts: dict[int, Layout]
    ill: dict[int, str]

    @property
    def lengths(self) -> Offsets:
        """The record length in bytes by type, 0 for an unknown type."""
        lengths = np.zeros(256, np.int64)
        for msg_type, layout in self.layouts.items():
            lengths[msg_type] = layout.dtype.itemsize
        return lengths


class Chain(NamedTuple):
    """The records of a log, in log order.

    Attributes:
        begins, ends: offsets of each record from the start of the log.
        types: type number of each record.
        cut_short: offset of a last record that is cut off; the length of the log if there is none.
    """

    begins: Offsets
    ends: Offsets
    types: Bytes
    cut_short: int


def rows_at(data: Bytes, offsets: Offsets, dtype: np.dtype[np.void]) -> Records:
    """Return the records of a type at the given offsets, all of which must be within the data."""
    size = dtype.itemsize
    if not len(offsets):
        return np.empty(0, dtype)
    windows: Any = np.ndarray((len(data) - size + 1,), f"V{size}", data.data, strides=(1,))
    return np.ascontiguousarray(windows[offsets]).view(dtype)


def scan(data: Bytes) -> tuple[Chain, Formats]:
    """Find all records of a log, and read its FMT records.

    FMT records anywhere in the log count, as in DFReader: a log that lost its start may repeat them later. The last one
    of a type counts.
    """
    headers = _headers(data)
    formats, chain = Formats({FMT.msg_type: _FMT_LAYOUT}, {}), None
    for _ in range(_MOST_PASSES):
        lengths = formats.lengths
        chain = _chain(data, headers, lengths)
        formats = _formats(rows_at(data, chain.begins[chain.types == FMT.msg_type], _FMT_DTYPE))
        if (formats.lengths == lengths).all():
            break
    assert chain is not None, "there is a pass"
    return chain, formats


def _headers(data: Bytes) -> Offsets:
    """Return all places that look like a header, of whatever type."""
    if len(data) < HEADER_BYTES:
        return np.zeros(0, np.int64)
    found = []
    for start in range(0, len(data) - 2, _AT_ONCE):  # otherwise a large log would be in memory twice
        part = data[start : min(start + _AT_ONCE, len(data) - 2)]
        first: Offsets = np.flatnonzero(part == HEAD_BYTE1) + start
        found.append(first.compress(data[first + 1] == HEAD_BYTE2))
    return np.concatenate(found)


def _chain(data: Bytes, headers: Offsets, lengths: Offsets) -> Chain:
    sizes = lengths[data[headers + 2]]
    begins, sizes = headers[sizes > 0], sizes[sizes > 0]
    ends = begins + sizes
    is_record = np.ones(len(begins), np.bool_)
    # A header inside another record is not a header.
    overlapping = np.flatnonzero(ends[:-1] > begins[1:])
    successors = np.searchsorted(begins, ends[overlapping])
    reached = 0
    for number, successor in zip(overlapping.tolist(), successors.tolist(), strict=True):
        if number >= reached:
            is_record[number + 1 : successor] = False
            reached = successor
    begins, ends = begins[is_record], ends[is_record]
    whole = int(np.argmax(ends > len(data))) if (ends[-1:] > len(data)).any() else len(begins)
    cut_short = int(begins[whole]) if whole < len(begins) else len(data)
    begins, ends = begins[:whole], ends[:whole]
    return Chain(begins, ends, data[begins + 2], cut_short)


def _formats(records: Records) -> Formats:
    formats = Formats({FMT.msg_type: _FMT_LAYOUT}, {})
    for record in records:
        msg_type = int(record["Type"])
        try:
            layout = _layout(msg_type, int(record["Length"]), *(_text(record[label]) for label in FMT.fields[2:]))
        except ValueError as error:
            formats.ill[msg_type] = str(error)
            formats.layouts.pop(msg_type, None)
        else:
            formats.layouts[msg_type] = layout
            formats.ill.pop(msg_type, None)
    formats.layouts[FMT.msg_type] = _FMT_LAYOUT
    return formats


def _layout(msg_type: int, length: int, name: str, format: str, columns: str) -> Layout:
    labels = tuple(columns.split(",")) if columns else ()
    dtype = dtype_of(format, labels)
    if length != dtype.itemsize:
        raise ValueError(f"the FMT of {name!r} tells {length} bytes, and a format of {dtype.itemsize}")
    return Layout(msg_type, name, format, labels, dtype)


def _text(value: bytes) -> str:
    return value.decode(errors="backslashreplace").partition("\0")[0]


def lost_bytes(data: Bytes, chain: Chain, formats: Formats) -> tuple[Lost, ...]:
    """Return the bytes that are in no record, in log order, and why."""
    begins, ends = np.append(chain.begins, chain.cut_short), np.insert(chain.ends, 0, 0)
    gaps = np.flatnonzero(begins > ends)
    lost = [Lost(begin, end - begin, _reason(data, begin, formats)) for begin, end in _pairs(ends[gaps], begins[gaps])]
    if chain.cut_short < len(data):
        lost.append(Lost(chain.cut_short, len(data) - chain.cut_short, CUT_SHORT))
    return tuple(lost)


def _pairs(first: Offsets, second: Offsets) -> Iterator[tuple[int, int]]:
    return zip(first.tolist(), second.tolist(), strict=True)


def _reason(data: Bytes, begin: int, formats: Formats) -> str:
    head = data[begin : begin + HEADER_BYTES].tolist()
    if len(head) < HEADER_BYTES or head[:2] != [HEAD_BYTE1, HEAD_BYTE2]:
        return NO_HEADER
    return formats.ill.get(head[2], f"no FMT describes type {head[2]}")
