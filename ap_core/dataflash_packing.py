# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Columns turned into the bytes of DataFlash records: those that LogStructure.pack makes of the values of each row.

Source: AP_Logger/AP_Logger_Backend.cpp (Write).
"""

from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np

from ap_core.dataflash import DataFlashWriter
from ap_core.dataflash_dtype import CODES, HEADER, TEXTS, Column, Records, record_dtype
from ap_core.log_field import FORMATS
from ap_core.log_structure import HEAD_BYTE1, HEAD_BYTE2, TIME_LABEL, LogStructure

_SCALES: Final = {**dict.fromkeys("cCeE", 100.0), "L": 1e7}
# What floats go through on x86-64 on their way to an integer field: a 64-bit register for these, else a 32-bit one.
_WIDE: Final = frozenset("IEqQ")
_LIMITS: Final = {True: 2.0**63, False: 2.0**31}
_WIDE_LIMIT: Final = 2.0**63
_HALF_NAN: Final = np.uint16(0x7E00)
_HALF_SIGN: Final = np.uint16(0x8000)


class Part(NamedTuple):
    """Records of one type in a log that is being made.

    Attributes:
        structure: their type.
        places: where each comes among all records of the log, ascending; int64.
        records: as :func:`pack_columns` makes them.
    """

    structure: LogStructure
    places: Column
    records: Records


def pack_columns(structure: LogStructure, columns: Sequence[Column]) -> Records:
    """Return records of a type, headers included, from a column a field.

    Integers are raw, floats in integer fields are physical values, as for :meth:`LogStructure.pack`. Texts are bytes or
    str; ``a`` fields take rows of 32 numbers.

    Raises:
        ValueError: if the number of columns is wrong, they differ in length, or text and numbers are mixed up.
    """
    if len(columns) != len(structure.fields) or len({len(column) for column in columns}) != 1:
        raise ValueError(f"{structure.name}: {len(structure.fields)} columns of one length are needed")
    records = np.zeros(len(columns[0]), record_dtype(structure))
    records[HEADER] = np.frombuffer(bytes((HEAD_BYTE1, HEAD_BYTE2, structure.msg_type)), "V3")
    with np.errstate(all="ignore"):
        for label, char, column in zip(structure.fields, structure.format, columns, strict=True):
            try:
                records[label] = _stored(char, np.asarray(column), records.dtype[label])
            except TypeError as error:
                raise ValueError(f"{structure.name}.{label}: {error}") from None
    return records


def _stored(char: str, column: Column, dtype: np.dtype[Any]) -> Column:
    is_text = column.dtype.kind in "SU"
    if is_text != (char in TEXTS):
        raise TypeError("text in a numeric field" if is_text else "numbers in a text field")
    if is_text:
        return _texts(column, dtype.itemsize)
    if char == "g":
        return _halves(column)
    if char in "fd":
        return _floats(column, dtype)
    if column.dtype.kind == "f":
        column = _truncated(column, _SCALES.get(char, 1.0), is_wide=char in _WIDE)
    return column.astype(CODES[char].partition(")")[2] or CODES[char])


def _texts(column: Column, size: int) -> Column:
    if column.dtype.kind == "S":
        return column.astype(f"S{size}")
    different, of_rows = np.unique(column, return_inverse=True)
    encode = FORMATS["Z"][1]
    return np.array([encode(text) for text in different.tolist()], f"S{size}")[of_rows]


def _floats(column: Column, dtype: np.dtype[Any]) -> Column:
    # Integers become a double first, as any number that is packed.
    return column if column.dtype.kind == "f" else column.astype(np.float64)


def _halves(column: Column) -> Column:
    wide = column.astype(np.float64)
    bits = wide.astype(np.float16).view(np.uint16)
    return np.where(np.isnan(wide), _HALF_NAN | (bits & _HALF_SIGN), bits).view(np.float16)


def _truncated(column: Column, scale: float, *, is_wide: bool) -> Column:
    """Return floats times ``scale`` as 64-bit integers; what does not fit the register becomes its least value."""
    product = column.astype(np.float64) * scale
    if column.dtype == np.float32:
        product = np.where(np.abs(product) < _WIDE_LIMIT, product.astype(np.float32).astype(np.float64), product)
    limit, whole = _LIMITS[is_wide], np.trunc(product)
    fits = (whole >= -limit) & (whole < limit)
    return np.where(fits, whole, -limit).astype(np.int64)


def write_log(writer: DataFlashWriter, parts: Sequence[Part]) -> bytes:
    """Return the bytes of records of several types, in the order of their places.

    They are those that ``writer.record`` would return for one after the other: a type that the log does not describe
    yet is described before its first record.

    Raises:
        ValueError: if a type is not registered with the writer.
    """
    parts = sorted((part for part in parts if len(part.records)), key=lambda part: int(part.places[0]))
    if not parts:
        return b""
    merged, end = _Merged(parts), 0
    pieces: list[bytes] = []
    for part in parts:
        begin = int(np.searchsorted(merged.places, part.places[0]))
        pieces += merged.bytes_of(end, begin), _description(writer, part, _time_up_to(parts, part.places[0]))
        end = begin
    pieces.append(merged.bytes_of(end, len(merged.places)))
    _description(writer, parts[0], _time_up_to(parts, merged.places[-1]))  # the writer goes on from the latest time
    return b"".join(pieces)


def _time_up_to(parts: Sequence[Part], place: int) -> int | None:
    """Return TimeUS of the latest record that has one, up to a place; None if there is none."""
    latest: tuple[int, int] | None = None
    for part in parts:
        row = int(np.searchsorted(part.places, place, side="right")) - 1
        if part.structure.fields[0] == TIME_LABEL and row >= 0:
            found = int(part.places[row]), int(part.records[TIME_LABEL][row])
            latest = found if latest is None else max(latest, found)
    return None if latest is None else latest[1]


def _description(writer: DataFlashWriter, part: Part, time_us: int | None) -> bytes:
    """Return what the writer puts before a record of a type if it is new to the log."""
    first = part.records[0]
    values = [value.tobytes() if isinstance(value, np.ndarray) else value for value in first.tolist()[1:]]
    written = writer.record(part.structure, values, time_us=time_us)
    return written[: len(written) - part.structure.length]


class _Merged:
    """Records of several types in their common order, as bytes."""

    def __init__(self, parts: Sequence[Part]) -> None:
        places = np.concatenate([part.places for part in parts])
        sizes = np.repeat([part.structure.length for part in parts], [len(part.records) for part in parts])
        order = np.argsort(places, kind="stable")
        self.places = places[order]
        self._offsets = np.concatenate(([0], np.cumsum(sizes[order])))
        self._data = np.empty(int(self._offsets[-1]), np.uint8)
        begins = np.empty(len(places), np.int64)
        begins[order] = self._offsets[:-1]
        first = 0
        for part in parts:
            size, last = part.structure.length, first + len(part.records)
            windows: Any = np.ndarray((len(self._data) - size + 1,), f"V{size}", self._data.data, strides=(1,))
            windows[begins[first:last]] = part.records.view(f"V{size}")
            first = last

    def bytes_of(self, begin: int, end: int) -> bytes:
        """Return the records from one to another."""
        return self._data[self._offsets[begin] : self._offsets[end]].tobytes()
