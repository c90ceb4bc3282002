# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Reads a frame that is whole and plain, with tables that are made once, where pymavlink looks at each field.

What is anything else - incomplete, damaged, signed, unknown - is pymavlink's to judge, and this says nothing of it.
"""

from collections.abc import Callable
from struct import Struct
from typing import Any, Final, NamedTuple

from mav_handlers.wire.messages import Message

MARKER_V1: Final = 0xFE
MARKER_V2: Final = 0xFD
_HEADER_V1: Final = 6
_HEADER_V2: Final = 10
_CRC: Final = 2
_SHORTEST: Final = _HEADER_V1 + _CRC
_IDS_V2: Final = Struct("<3BHB").unpack_from  # sequence, system, component; the message's lower 16 bits, and 8 more


class Header(NamedTuple):
    """Who sent a frame, and the frame itself."""

    name: str
    message_id: int
    system_id: int
    component_id: int
    sequence: int
    version: int
    frame: bytes


class Received(NamedTuple):
    """A whole frame; ``message`` is None when its type is not one of ours."""

    header: Header
    message: Message | None


class Form(NamedTuple):
    """How to read the frames of one message.

    Attributes:
        name: the message's.
        crc_extra: what its checksum begins from, one byte.
        full_length: of its payload, bytes.
        unpack_from: takes bytes and an offset, and returns the payload's fields in the order of the wire.
        make: makes the message of these; None for a message that is none of ours.
    """

    name: str
    crc_extra: bytes
    full_length: int
    unpack_from: Callable[[bytes, int], tuple[Any, ...]]
    make: Callable[[tuple[Any, ...]], Message] | None


def plain_frame(
    data: bytes | bytearray, start: int, form_of: Callable[[int], Form | None], crc_of: Callable[[bytes], int]
) -> Received | None:
    """Return the frame that begins at an index; None unless it is whole, plain, known and correct.

    Args:
        data: what has been received.
        start: where to look.
        form_of: returns how to read a message by its id, None for one that is not to be read here.
        crc_of: returns the checksum of bytes.
    """
    available = len(data) - start
    if available < _SHORTEST:
        return None
    length = data[start + 1]
    if data[start] == MARKER_V2:
        version, head = 2, _HEADER_V2
        if data[start + 2] or available < _HEADER_V2 + length + _CRC:
            return None
        frame = bytes(data[start : start + _HEADER_V2 + length + _CRC])
        sequence, system_id, component_id, low, high = _IDS_V2(frame, 4)
        msg_id = low | high << 16
    elif data[start] == MARKER_V1 and available >= _HEADER_V1 + length + _CRC:
        version, head = 1, _HEADER_V1
        frame = bytes(data[start : start + _HEADER_V1 + length + _CRC])
        sequence, system_id, component_id, msg_id = frame[2], frame[3], frame[4], frame[5]
    else:
        return None
    form = form_of(msg_id)
    if form is None:
        return None
    name, crc_extra, full, unpack_from, make = form
    if crc_of(frame[1:-_CRC] + crc_extra) != frame[-2] | frame[-1] << 8:
        return None
    message = None
    if make is not None:
        # MAVLink 2 leaves zeros at the end out; what is longer than we know it is cut off.
        whole = frame if length >= full else frame[:-_CRC].ljust(head + full, b"\0")
        message = make(unpack_from(whole, head))
    # The tuples' own way of being made takes twice as long.
    header = tuple.__new__(Header, (name, msg_id, system_id, component_id, sequence, version, frame))
    return tuple.__new__(Received, (header, message))
