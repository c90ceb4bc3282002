# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Frames cut out of bytes; what one says, and the frame that says something else under the same sequence number."""

import struct
from dataclasses import dataclass, replace
from typing import Final

from mav_handlers.wire.codec import Codec, Received, message_name
from mav_handlers.wire.messages import Message

NO_FRAME: Final = "BAD_DATA"
LARGEST_V1_ID: Final = 255

_STX_V1: Final = 0xFE
_STX_V2: Final = 0xFD
_V1_OVERHEAD_BYTES: Final = 8
_V2_OVERHEAD_BYTES: Final = 12
_SIGNATURE_BYTES: Final = 13
_SIGNED: Final = 1

Key = tuple[int, int, int]


class PassedOver(Exception):
    """Why a fault leaves a frame alone; the text is the reason, for the count."""


@dataclass(frozen=True, slots=True)
class Packet:
    """A frame on its way.

    Attributes:
        name: of the message; BAD_DATA for bytes that are no frame.
        message_id: 0 to 2**24 - 1; -1 for bytes that are no frame.
        system_id, component_id: of the sender.
        sequence: 0 to 255.
        version: of MAVLink, 1 or 2; 0 for bytes that are no frame.
        is_signed: whether it carries a signature.
        frame: all its bytes.
        message: what it says, once somebody has asked for that.
        delay_us: for how long it is held back.
        may_overtake: whether those behind it need not wait for it.
    """

    name: str
    message_id: int
    system_id: int
    component_id: int
    sequence: int
    version: int
    is_signed: bool
    frame: bytes
    message: Message | None = None
    delay_us: int = 0
    may_overtake: bool = False

    @property
    def key(self) -> Key:
        """Tells its stream: the sender's system and component id, and the message's."""
        return self.system_id, self.component_id, self.message_id


def read_packet(frame: bytes) -> Packet:
    """Return a frame by its header; neither its checksum nor its content is looked at."""
    if frame[:1] == bytes([_STX_V2]) and len(frame) >= _V2_OVERHEAD_BYTES:
        is_signed = bool(frame[2] & _SIGNED)
        if len(frame) == frame[1] + _V2_OVERHEAD_BYTES + (_SIGNATURE_BYTES if is_signed else 0):
            message_id = int.from_bytes(frame[7:10], "little")
            return Packet(_name(message_id), message_id, frame[5], frame[6], frame[4], 2, is_signed, frame)
    if frame[:1] == bytes([_STX_V1]) and len(frame) >= 2 and len(frame) == frame[1] + _V1_OVERHEAD_BYTES:
        return Packet(_name(frame[5]), frame[5], frame[3], frame[4], frame[2], 1, False, frame)
    return Packet(NO_FRAME, -1, 0, 0, 0, 0, False, frame)


def _name(message_id: int) -> str:
    return message_name(message_id) or f"UNKNOWN_{message_id}"


def decode(packet: Packet) -> Packet:
    """Return the packet with what it says. Raises PassedOver if that cannot be told, or must not be changed."""
    if packet.message is not None:
        return packet
    if packet.is_signed:
        raise PassedOver("signed")
    codec = Codec(0, 0)
    codec.feed(packet.frame)
    received = codec.next_received()
    if not isinstance(received, Received) or received.header.frame != packet.frame:
        raise PassedOver("damaged")
    if received.message is None:
        raise PassedOver("content not known")
    return replace(packet, message=received.message)


def pack(packet: Packet) -> Packet:
    """Return the packet with the frame of its message, ids, sequence number and version; raises PassedOver for none."""
    if packet.message is None:
        raise PassedOver("content not known")
    if packet.version == 1 and packet.message_id > LARGEST_V1_ID:
        raise PassedOver("not in MAVLink 1")
    codec = Codec(packet.system_id, packet.component_id, packet.version)
    codec.sequence = packet.sequence
    try:
        return replace(packet, frame=codec.encode(packet.message))
    except (struct.error, OverflowError):
        raise PassedOver("does not fit its field") from None


class FrameSplitter:
    """Gives back all the bytes that it is fed, in order: a frame a piece, and what is no frame in pieces of its own."""

    def __init__(self) -> None:
        self._codec = Codec(0, 0)
        self._bytes = bytearray()

    @property
    def unread_bytes(self) -> int:
        """How many bytes wait for the rest of a frame."""
        return len(self._bytes)

    def feed(self, data: bytes) -> list[bytes]:
        """Return the pieces that are whole."""
        self._codec.feed(data)
        self._bytes += data
        pieces = []
        while self._codec.next_received() is not None:
            size = len(self._bytes) - self._codec.unread_bytes
            pieces.append(bytes(self._bytes[:size]))
            del self._bytes[:size]
        return pieces
