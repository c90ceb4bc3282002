# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""GPMF, the format of GoPro's telemetry (github.com/gopro/gpmf-parser): keys, lengths and values, nested."""

import re
import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

import numpy as np

from viso.geometry.rotation import Array

COMPLEX: Final = "?"
_FORMS: Final[Mapping[str, str]] = MappingProxyType(
    # How struct calls a type; what is no number is passed over.
    dict(zip("bBsSlLfdjJqQ", "bBhHiIfdqQiq", strict=True)) | {"c": "x", "F": "4x", "G": "16x", "U": "16x"}
)
_FRACTIONS: Final = MappingProxyType({"q": 2.0**-16, "Q": 2.0**-32})
_COLUMN: Final = re.compile(r"(.)(?:\[(\d{1,4})\])?")


class GpmfError(ValueError):
    """Carries the fault of telemetry."""


@dataclass(frozen=True, slots=True)
class Item:
    """A key of four characters with its value.

    Attributes:
        kind: letter of the type; an empty text for items within the item.
        width: bytes of a row.
    """

    key: str
    kind: str
    width: int
    data: memoryview


@dataclass(frozen=True, slots=True, eq=False)
class Stream:
    """The data of a sensor in a payload.

    Attributes:
        key: key of the sensor, such as ACCL.
        rows: [N, columns], scaled (SCAL).
        total: rows of this stream so far, these included (TSMP); None if unknown.
        tick_s: the camera's time (TICK, STMP); None if unknown.
        axes: letters of the columns (ORIN), lower case for what is turned round; empty if not told.
    """

    key: str
    rows: Array
    total: int | None
    tick_s: float | None
    axes: str


def streams_of(payload: bytes) -> Iterator[Stream]:
    """Yield the streams of all devices in a payload. Raises GpmfError if it is damaged."""
    for device in items_of(memoryview(payload)):
        if device.key == "DEVC" and not device.kind:
            for item in items_of(device.data):
                if item.key == "STRM" and not item.kind:
                    yield from _stream(list(items_of(item.data)))


def items_of(data: memoryview) -> Iterator[Item]:
    """Yield the items that lie one after the other. Raises GpmfError if one is longer than what there is."""
    while len(data) >= 8:
        key, kind, width, count = struct.unpack(">4scBH", data[:8])
        length = width * count
        if length > len(data) - 8:
            raise GpmfError(f"{key!r} of {length} bytes where there are {len(data) - 8}")
        name, letter = key.decode("latin-1"), kind.decode("latin-1").strip("\0")
        yield Item(name, letter, width, data[8 : 8 + length])
        data = data[8 + (length + 3) // 4 * 4 :]


def _stream(items: list[Item]) -> Iterator[Stream]:
    """Yield the stream that items describe: the last one holds the values, those before tell about them."""
    if not items or not items[-1].kind:
        return
    about, values = {item.key: item for item in items[:-1]}, items[-1]
    columns = _columns(values, _text(about["TYPE"]) if "TYPE" in about else "")
    scale = _numbers(about["SCAL"]) if "SCAL" in about else np.ones(1)
    tick_s = None
    for key, unit_s in (("TICK", 1e-3), ("STMP", 1e-6)):
        if key in about:
            tick_s = unit_s * _number(about[key])
    total = int(_number(about["TSMP"])) if "TSMP" in about else None
    axes = _text(about["ORIN"]) if "ORIN" in about else ""
    yield Stream(values.key, _rows(values, columns, scale), total, tick_s, axes)


def _columns(item: Item, complex_type: str = "") -> str:
    """Return the letters of a row: as many as fit in for a simple type, those of a complex one, as in ``f[3]L``."""
    letters = "".join(letter * int(count or 1) for letter, count in _COLUMN.findall(complex_type))
    if not item.kind:
        raise GpmfError(f"{item.key}: items where there should be values")
    if item.kind != COMPLEX:
        letters = item.kind * max(item.width // _size(item.kind), 1)
    if len(item.data) and _size(letters) != item.width:
        raise GpmfError(f"{item.key}: rows of {item.width} bytes, their type has {_size(letters)}")
    return letters


def _size(letters: str) -> int:
    return struct.calcsize(_form(letters))


def _form(letters: str) -> str:
    unknown = set(letters) - _FORMS.keys()
    if unknown:
        raise GpmfError(f"unknown type {''.join(sorted(unknown))!r}")
    return ">" + "".join(_FORMS[letter] for letter in letters)


def _rows(item: Item, columns: str, scale: Array) -> Array:
    numeric = [letter for letter in columns if not _FORMS[letter].endswith("x")]
    if len(scale) == len(columns) > 1:
        scale = np.array([value for value, letter in zip(scale, columns, strict=True) if letter in numeric])
    if len(scale) not in (1, len(numeric)) or not scale.all():
        raise GpmfError(f"{item.key}: {len(scale)} scales for {len(numeric)} columns, or one of 0")
    rows = list(struct.iter_unpack(_form(columns), item.data)) if len(item.data) else []
    with np.errstate(all="ignore"):  # callers check for finite numbers
        factors = np.array([_FRACTIONS.get(letter, 1.0) for letter in numeric]) / scale
        return np.array(rows, np.float64).reshape(len(rows), len(numeric)) * factors


def _numbers(item: Item) -> Array:
    return _rows(item, _columns(item), np.ones(1)).ravel()


def _number(item: Item) -> float:
    numbers = _numbers(item)
    if not len(numbers) or not np.isfinite(numbers[0]):
        raise GpmfError(f"{item.key}: no number")
    return float(numbers[0])


def _text(item: Item) -> str:
    return bytes(item.data).decode("latin-1").strip("\0 ")
