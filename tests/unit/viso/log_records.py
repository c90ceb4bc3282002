# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Reads what a DataFlash log says of itself: layouts, texts, version, parameters."""

import struct
from collections.abc import Iterator
from typing import Any, Final

from ap_core.log_structure import FMT

HEADER_BYTES = 3
_READ: Final = frozenset({"FMT", "MSG", "VER", "PARM"})
_CODES: Final = {"Q": "Q", "B": "B", "b": "b", "H": "H", "I": "I", "f": "f", "N": "16s", "Z": "64s", "n": "4s"}

Layout = tuple[str, str, str]


def records(data: bytes) -> Iterator[tuple[str, tuple[Any, ...], Layout]]:
    """Go through the descriptive records of a log: name, values, and name, format and labels of their layout."""
    layouts: dict[int, tuple[int, Layout]] = {FMT.msg_type: (FMT.length, (FMT.name, FMT.format, FMT.labels))}
    position = 0
    while position < len(data):
        kind = data[position + 2]
        length, layout = layouts[kind]
        body = data[position + HEADER_BYTES : position + length]
        if kind == FMT.msg_type:
            number, size, name, form, labels = (field(part) for part in struct.unpack("<BB4s16s64s", body))
            layouts[number] = size, (name, form, labels)
        if layout[0] in _READ:
            yield layout[0], tuple(map(field, struct.unpack("<" + "".join(_CODES[c] for c in layout[1]), body))), layout
        position += length


def field(value: Any) -> Any:
    return value.rstrip(b"\0").decode("ascii") if isinstance(value, bytes) else value
