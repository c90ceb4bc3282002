# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""``@PARAM/param.pck``: the parameter list as one compact file, for download and upload by FTP.

Source: AP_Filesystem/AP_Filesystem_Param.cpp.
"""

import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from typing import Final

from ap_core.cint import int_of_float
from ap_core.param import Param, ParamTable, ParamType
from ap_core.param_info import MAX_NAME_SIZE, ParamValue, assigned, is_equal, to_f32

MAGIC: Final = 0x671B
MAGIC_WITH_DEFAULTS: Final = 0x671C
FLAG_DEFAULT: Final = 1
ESTIMATED_BYTES: Final = 12
MAX_UPLOAD_BYTES: Final = 0xFFFF
"""Longest upload: the header gives the length in 16 bits."""

_HEADER: Final = struct.Struct("<HHH")
_VALUES: Final = {
    ParamType.INT8: struct.Struct("<b"),
    ParamType.INT16: struct.Struct("<h"),
    ParamType.INT32: struct.Struct("<i"),
    ParamType.FLOAT: struct.Struct("<f"),
}
_ARGUMENT: Final = re.compile(r"(start|count|withdefaults)=\s*([+-]?[0-9]{1,300})?")
_UINT16_MAX: Final = 0xFFFF


@dataclass(frozen=True, slots=True)
class PckQuery:
    """A client's query: ``count`` parameters (0 for all) from index ``start``."""

    start: int = 0
    count: int = 0
    with_defaults: bool = False


def parse_query(query: str) -> PckQuery | None:
    """Read what follows the ``?`` of the file's name; None when an argument is out of range.

    As in the firmware, unknown characters are skipped one by one, and a missing number counts as 0.
    """
    numbers = {"start": 0, "count": 0, "withdefaults": 0}
    position = 0
    while (match := _ARGUMENT.search(query, position)) is not None:
        name, number = match[1], int(match[2] or 0)
        if not 0 <= number < (2 if name == "withdefaults" else _UINT16_MAX):
            return None
        numbers[name] = number
        position = query.find("&", match.end(1)) + 1
        if position == 0:
            break
    return PckQuery(numbers["start"], numbers["count"], bool(numbers["withdefaults"]))


def estimate_size(params: ParamTable) -> int:
    """Return the estimated size that directories and an opened file report."""
    return params.count * ESTIMATED_BYTES


def build_param_pck(
    params: ParamTable, *, read_size: int, start: int = 0, count: int = 0, with_defaults: bool = False
) -> bytes:
    """Return the file.

    Zero bytes keep an entry's value from crossing the boundary between two reads.

    Args:
        params: the list.
        read_size: the length of the client's reads, at least 1.
        start: index of the first parameter.
        count: how many at most; 0 for all.
        with_defaults: whether defaults follow the values that differ from them.

    Raises:
        ValueError: there is no parameter of index ``start``, or the read size is not positive.
    """
    total = params.count
    if read_size < 1:
        raise ValueError(f"read size is {read_size}, at least 1 is needed")
    if not 0 <= start < total:
        raise ValueError(f"start is {start}, there are {total} parameters")
    listed = list(islice(params, start, start + count if count else None))
    magic = MAGIC_WITH_DEFAULTS if with_defaults else MAGIC
    image = bytearray(_HEADER.pack(magic, len(listed), total))
    previous = ""
    for param in listed:
        entry = _entry(param, previous, with_defaults)
        image += bytes(_padding(len(image) + len(entry), _VALUES[param.type].size, read_size)) + entry
        previous = param.name
    return bytes(image)


def _padding(end: int, width: int, read_size: int) -> int:
    over = end % read_size
    return width - over if 0 < over < width else 0


def _entry(param: Param, previous: str, with_defaults: bool) -> bytes:
    common = _common_length(param.name, previous)
    rest = param.name[common:].encode("ascii")
    value = _VALUES[param.type].pack(param.raw)
    default = b""
    if with_defaults and not is_equal(param.value, param.default):
        default = _VALUES[param.type].pack(_default(param))
    flags = FLAG_DEFAULT if default else 0
    return bytes([param.type | flags << 4, common | (len(rest) - 1) << 4]) + rest + value + default


def _common_length(name: str, previous: str) -> int:
    differ = (index for index, (a, b) in enumerate(zip(name, previous, strict=False)) if a != b)
    # At least one character has to remain.
    return min(next(differ, len(previous)), len(name) - 1)


def _default(param: Param) -> ParamValue:
    if param.type is ParamType.FLOAT:
        return param.default
    return assigned(int_of_float(float(param.default)), param.type)


@dataclass(frozen=True, slots=True)
class PackedParam:
    """One parameter of a file, with the type given by its writer."""

    name: str
    type: ParamType
    value: ParamValue


def parse_param_pck_upload(data: bytes) -> tuple[PackedParam, ...] | None:
    """Read an uploaded file; None when it is malformed.

    Its header gives the whole length in place of the total, and there are neither defaults nor padding.
    Source: param_upload_parse.
    """
    # FIRMWARE PARITY: the firmware sets parameters as it reads on, reads beyond the end, and takes unknown types for
    # other ones; here a file with any fault is refused as a whole.
    if len(data) < _HEADER.size:
        return None
    magic, count, length = _HEADER.unpack_from(data)
    if magic != MAGIC or length != len(data):
        return None
    uploaded = tuple(islice(_entries(data[_HEADER.size :]), count))
    return uploaded if len(uploaded) == count else None


def parse_param_pck(data: bytes) -> tuple[tuple[PackedParam, ...], int] | None:
    """Read a download as far as it goes: its parameters and the vehicle's parameter count; None if malformed."""
    if len(data) < _HEADER.size:
        return None
    magic, count, total = _HEADER.unpack_from(data)
    if magic not in (MAGIC, MAGIC_WITH_DEFAULTS):
        return None
    return tuple(islice(_entries(data[_HEADER.size :], is_download=True), count)), total


def _entries(data: bytes, *, is_download: bool = False) -> Iterator[PackedParam]:
    """Yield parameters up to the first fault; padding and defaults of a download are skipped."""
    name, start = b"", 0
    while start + 2 <= len(data):
        if is_download and data[start] == 0:
            start += 1
            continue
        kind, common, rest_length = data[start], data[start + 1] & 0xF, (data[start + 1] >> 4) + 1
        has_default = is_download and kind >> 4 == FLAG_DEFAULT
        kind &= 0xF if has_default else 0xFF
        if kind not in _VALUES or common > len(name) or common + rest_length > MAX_NAME_SIZE:
            return
        form, start = _VALUES[ParamType(kind)], start + 2
        end = start + rest_length + form.size
        if len(data) < end:
            return
        name = name[:common] + data[start : start + rest_length]
        (value,) = form.unpack(data[end - form.size : end])
        yield PackedParam(name.decode("latin-1"), ParamType(kind), value if isinstance(value, int) else to_f32(value))
        start = end + has_default * form.size
