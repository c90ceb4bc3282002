# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Fields of DataFlash records: what each format character stores, and how values are converted.

Source: AP_Logger/LogStructure.h, AP_Logger/AP_Logger_Backend.cpp (Write).
"""

import math
import operator
import struct
from collections.abc import Callable
from typing import Final

import numpy as np

from ap_core.cint import int64_of_float, int_of_float

LogValue = int | float | np.float32 | np.float64 | str | bytes
"""Values for fields: integers are raw, floats physical, text and bytes for the text formats."""

Converter = Callable[[LogValue], int | bytes]


# Tuples made once: a union in the call would be built again for each value.
_TEXT_TYPES: Final = (str, bytes)
FLOAT_TYPES: Final = (float, np.floating)
_I64_LIMIT: Final = 1 << 63


def scaled(value: float | np.floating, scale: int) -> float:
    """Return a physical value in an integer field's unit, before truncation."""
    product = float(value) * scale
    if isinstance(value, np.float32) and abs(product) < _I64_LIMIT:
        return float(np.float32(product))  # exact product rounded once, as a float32 multiplication
    return product


def _integer(bits: int, *, wide: bool = False, scale: int = 1) -> Converter:
    """Make the converter of an integer field: floats are multiplied and truncated, everything wraps."""
    mask = (1 << bits) - 1
    truncate = int64_of_float if wide else int_of_float  # x86-64 converts to uint32 through a 64-bit register as well

    def convert(value: LogValue) -> int:
        if isinstance(value, _TEXT_TYPES):
            raise TypeError("text in a numeric field")
        if isinstance(value, FLOAT_TYPES):
            return truncate(scaled(value, scale)) & mask
        return operator.index(value) & mask

    return convert


def _floating(code: str) -> Converter:
    """Make the converter of a float field: overflow gives infinity, as in C."""
    packer = struct.Struct("<" + code)

    def convert(value: LogValue) -> bytes:
        if isinstance(value, _TEXT_TYPES):
            raise TypeError("text in a numeric field")
        if code == "f" and isinstance(value, np.float32) and value != value:
            return struct.pack("<I", int(value.view(np.uint32)))  # struct would quieten a signalling NaN
        try:
            return packer.pack(value)
        except (OverflowError, struct.error):  # the second for integers beyond the range of floats
            return packer.pack(math.inf if value > 0 else -math.inf)

    return convert


def _text(size: int) -> Converter:
    """Make the converter of a text field: text ends at its first NUL, bytes are kept whole."""

    def convert(value: LogValue) -> bytes:
        if isinstance(value, str):
            return value.encode("utf-8", "replace").partition(b"\0")[0][:size]
        if isinstance(value, bytes):
            return value[:size]
        raise TypeError("a number in a text field")

    return convert


FORMATS: Final[dict[str, tuple[str, Converter]]] = {
    "a": ("64s", _text(64)),  # int16[32], given as bytes
    "b": ("B", _integer(8)),
    "B": ("B", _integer(8)),
    "M": ("B", _integer(8)),
    "h": ("H", _integer(16)),
    "H": ("H", _integer(16)),
    "i": ("I", _integer(32)),
    "I": ("I", _integer(32, wide=True)),
    "q": ("Q", _integer(64, wide=True)),
    "Q": ("Q", _integer(64, wide=True)),
    "c": ("H", _integer(16, scale=100)),
    "C": ("H", _integer(16, scale=100)),
    "e": ("I", _integer(32, scale=100)),
    "E": ("I", _integer(32, wide=True, scale=100)),
    "L": ("I", _integer(32, scale=10_000_000)),
    "g": ("2s", _floating("e")),
    "f": ("4s", _floating("f")),
    "d": ("8s", _floating("d")),
    "n": ("4s", _text(4)),
    "N": ("16s", _text(16)),
    "Z": ("64s", _text(64)),
}
"""Format character: struct code, converter. Integers arrive reduced to their width, floats as their bytes."""

SCALES: Final[dict[str, int]] = {**dict.fromkeys("cCeE", 100), "L": 10_000_000}
"""Format character of an integer that holds a physical value: its factor."""

DIRECT: Final[dict[str, str]] = {
    **dict.fromkeys("MB", "B"),
    **dict.fromkeys("hc", "h"),
    **dict.fromkeys("HC", "H"),
    **dict.fromkeys("ieL", "i"),
    **dict.fromkeys("IE", "I"),
    **{char: char for char in "bqQfd"},
    "g": "e",
}
"""Format character of a number: the struct code that packs plain numbers to the same bytes.

Plain numbers are integers within the field's range and, in float fields, numbers that fit and are not NaN."""
