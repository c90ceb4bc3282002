# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Layouts of DataFlash records as numpy types, and conversion of columns to the values that log readers show.

Source: AP_Logger/LogStructure.h; values as those of pymavlink's DFReader.
"""

from collections.abc import Sequence
from typing import Any, Final, TypeAlias

import numpy as np
import numpy.typing as npt

from ap_core.log_structure import LogStructure

Records: TypeAlias = npt.NDArray[np.void]
Column: TypeAlias = npt.NDArray[Any]

HEADER: Final = "(header)"
"""The name of the field of the three header bytes."""

CODES: Final[dict[str, str]] = {
    **dict.fromkeys("bM", "i1"),
    "B": "u1",
    **dict.fromkeys("hc", "<i2"),
    **dict.fromkeys("HC", "<u2"),
    **dict.fromkeys("ieL", "<i4"),
    **dict.fromkeys("IE", "<u4"),
    "q": "<i8",
    "Q": "<u8",
    "g": "<f2",
    "f": "<f4",
    "d": "<f8",
    "a": "(32,)<i2",
    "n": "S4",
    "N": "S16",
    "Z": "S64",
}
"""Format character: the numpy type of its field."""

TEXTS: Final = frozenset("nNZ")
_FLOATS: Final = frozenset("gfd")
# Division by the inverse of the factor is what DFReader does; it gives 0.07 where a product gives 0.07000000000000001.
_DIVISORS: Final = {**dict.fromkeys("cCeE", 1 / 0.01), "L": 1 / 1.0e-7}


def dtype_of(format: str, labels: Sequence[str]) -> np.dtype[np.void]:
    """Return the type of a whole record, header included.

    Args:
        format: a character a field.
        labels: a name a field. If a name occurs twice, the last field has it, as in DFReader. The other field, or one
            without a name, is named after its number: ``(2)`` is the third.

    Raises:
        ValueError: if a character is unknown.
    """
    if unknown := set(format) - CODES.keys():
        raise ValueError(f"unknown character {min(unknown)!r} in format {format!r}")
    last = {label: number for number, label in enumerate(labels)}
    names = [
        labels[number] if number < len(labels) and last[labels[number]] == number else f"({number})"
        for number in range(len(format))
    ]
    return np.dtype([(HEADER, "V3"), *((name, CODES[char]) for name, char in zip(names, format, strict=True))])


def record_dtype(structure: LogStructure) -> np.dtype[np.void]:
    """Return the numpy type of a structure's records, header included: an array of it has the log's bytes."""
    return dtype_of(structure.format, structure.fields)


def shown(column: Column, char: str) -> Column:
    """Return the values that a log reader shows for a stored column.

    Integers stay unchanged; floats become float64, and so do fields in hundredths or 1e-7 of a unit; texts become str.
    ``char`` is the format character of the field.
    """
    if char in _FLOATS:
        with np.errstate(invalid="ignore"):  # a signalling NaN, which damage can cause, warns
            return column.astype(np.float64)
    if char in _DIVISORS:
        return column / _DIVISORS[char]
    if char in TEXTS:
        return texts_of(column)
    return np.ascontiguousarray(column)


def texts_of(column: Column) -> Column:
    """Return texts up to their first NUL, UTF-8 or else Latin-1; each different one is decoded once."""
    different, of_rows = np.unique(column, return_inverse=True)
    texts = [_decoded(value) for value in different.tolist()]
    return np.array(texts, dtype=np.str_)[of_rows] if texts else np.zeros(0, np.str_)


def _decoded(value: bytes) -> str:
    try:
        text = value.decode("utf-8")
    except UnicodeDecodeError:
        text = value.decode("iso-8859-1")
    return text.partition("\0")[0]
