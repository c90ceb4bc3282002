# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The only use of pymavlink's dialect: bytes to typed messages and back.

pymavlink's parser cuts frames out of a stream of bytes, and its messages pack themselves into frames. Payloads are
decoded by a map of our own: pymavlink's is a global of its module, and lacks draft messages.
"""

import struct
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, fields
from enum import Enum
from typing import Any, Final, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as dialect

from mav_handlers.wire.messages import MESSAGES, Message
from mav_handlers.wire.signature import SIGNATURE_BLOCK_BYTES, LinkSigning, Refusal

MARKER_V1: Final = 0xFE
MARKER_V2: Final = 0xFD
V2_HEADER_AND_CRC_BYTES: Final = 12
_V1_HEADER_BYTES: Final = 6
_V2_HEADER_BYTES: Final = 10
_CRC_BYTES: Final = 2
_SIGNED: Final = 1
_COMPACT_ABOVE_BYTES: Final = 4096


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
    """A whole frame; ``message`` is None if its type has no dataclass here."""

    header: Header
    message: Message | None


class Defect(Enum):
    """Why bytes are no frame."""

    PREFIX = "no frame begins with the first byte"
    FLAGS = "the frame has flags that nobody knows"
    CRC = "the frame's checksum does not match"


class BadData(NamedTuple):
    """Bytes that are no frame, or a frame that was refused for its signature; ``length`` is their number."""

    reason: Defect | Refusal
    length: int


@dataclass(frozen=True, slots=True)
class _Draft:
    """A draft message, described as pymavlink's classes are; fields are in wire order."""

    id: int
    msgname: str
    crc_extra: int
    ordered_fieldnames: tuple[str, ...]
    native_format: bytes
    array_lengths: tuple[int, ...]
    unpacker: struct.Struct


# The firmware's dialect has these messages. pymavlink has them only in its dialect of drafts, which is as large as the
# firmware's and as slow to import. Source: common.xml.
DRAFTS: Final = (
    _Draft(
        435,
        "AVAILABLE_MODES",
        134,
        ("custom_mode", "properties", "number_modes", "mode_index", "standard_mode", "mode_name"),
        b"<IIBBBc",
        (0, 0, 0, 0, 0, 35),
        struct.Struct("<IIBBB35s"),
    ),
    _Draft(437, "AVAILABLE_MODES_MONITOR", 30, ("seq",), b"<B", (0,), struct.Struct("<B")),
)

_DEFINITIONS: Final[Mapping[int, Any]] = {**dialect.mavlink_map, **{draft.id: draft for draft in DRAFTS}}
_ID_OF_NAME: Final[Mapping[str, int]] = {known.msgname: msg_id for msg_id, known in _DEFINITIONS.items()}


_LAST_ID_OF_VERSION_1: Final = 255


class _Layout:
    """Conversion between a message's dataclass and its payload.

    Attributes:
        definition: pymavlink's class of the message.
        full_length: length of the payload in bytes, before MAVLink 2 trims trailing zeros.
        version_1_length: length of the payload in MAVLink 1, which has no extension fields.
    """

    def __init__(self, cls: type[Message]) -> None:
        self.definition = _DEFINITIONS[_ID_OF_NAME[cls.__name__]]
        self._cls = cls
        self._wire_names = tuple(self.definition.ordered_fieldnames)
        self._texts: set[str] = set()
        self._arrays: set[str] = set()
        extensions = {field.name for field in fields(cls) if field.default is not MISSING}
        place, places, left_out = 0, dict[str, int | slice](), 0
        codes = self.definition.native_format[1:].decode()
        for name, code, length in zip(self._wire_names, codes, self.definition.array_lengths, strict=True):
            if name in extensions:
                left_out += struct.calcsize(code) * max(1, length)
            if code == "c":
                self._texts.add(name)
            elif length:
                self._arrays.add(name)
            places[name] = slice(place, place + length) if name in self._arrays else place
            place += length if name in self._arrays else 1
        self._places = tuple(places[field.name] for field in fields(cls))
        self._struct: struct.Struct = self.definition.unpacker
        self.full_length: int = self._struct.size
        self.version_1_length = self.full_length - left_out

    def message(self, payload: bytes) -> Message:
        """Return the message of a payload; missing bytes count as zero, surplus bytes are ignored."""
        values = self._struct.unpack(payload[: self.full_length].ljust(self.full_length, b"\0"))
        if self._texts:
            values = tuple(_text(value) if isinstance(value, bytes) else value for value in values)
        return self._cls(*[values[place] for place in self._places])

    def payload(self, message: Message) -> bytes:
        """Return the payload of a message. Raises struct.error if a field does not fit its type."""
        values: list[Any] = []
        for name in self._wire_names:
            value = getattr(message, name)
            if name in self._arrays:
                values += value
            else:
                values.append(value.encode("ascii", "replace") if name in self._texts else value)
        return self._struct.pack(*values)


def _text(field: bytes) -> str:
    return field.split(b"\0", 1)[0].decode("ascii", "replace")


_LAYOUTS: Final[Mapping[str, _Layout]] = {name: _Layout(cls) for name, cls in MESSAGES.items()}


def message_id(name: str) -> int:
    """Return the id of a message by its name. Raises KeyError if the dialect has no such message."""
    return _ID_OF_NAME[name]


def message_name(msg_id: int) -> str | None:
    """Return the name of a message by its id, or None when the dialect has none."""
    known = _DEFINITIONS.get(msg_id)
    return None if known is None else str(known.msgname)


def full_length(cls: type[Message]) -> int:
    """Return the payload length of a message in bytes before MAVLink 2 trims trailing zeros."""
    return _LAYOUTS[cls.__name__].full_length


def begins_with_frame(data: bytes) -> bool:
    """Return whether bytes begin with a whole frame of a message of the dialect whose checksum is right."""
    codec = Codec(0, 0)
    codec.feed(data)
    received = codec.next_received()
    return isinstance(received, Received) and received.header.message_id in _DEFINITIONS


class _Parser(dialect.MAVLink):  # type: ignore[misc]  # pymavlink has no types
    """pymavlink's stream parser, which passes each whole frame to ``decode``.

    Attributes:
        link_signing: checks signatures; None while they are not checked.
    """

    link_signing: LinkSigning | None = None

    def decode(self, msgbuf: bytearray) -> Received | BadData:
        """Return a frame's content, or the reason why it is refused."""
        frame = bytes(msgbuf)
        header = _header_of(frame)
        known = _DEFINITIONS.get(header.message_id)
        if known is None:  # without a definition the checksum cannot be checked
            return Received(header, None)
        if not _is_sound(frame, known):
            return BadData(Defect.CRC, len(frame))
        if self.link_signing is not None:
            sender = header.system_id, header.component_id
            is_signed = header.version == 2 and bool(frame[2] & _SIGNED)
            refusal = self.link_signing.refusal(frame, header.message_id, sender, is_signed=is_signed)
            if refusal is not None:
                return BadData(refusal, len(frame))
        layout = _LAYOUTS.get(known.msgname)
        return Received(header, None if layout is None else layout.message(frame[_payload_of(frame)]))


def _header_of(frame: bytes) -> Header:
    if frame[0] == MARKER_V1:
        version = 1
        _, sequence, system_id, component_id, msg_id = frame[1:_V1_HEADER_BYTES]
    else:
        version, sequence, system_id, component_id = 2, frame[4], frame[5], frame[6]
        msg_id = int.from_bytes(frame[7:_V2_HEADER_BYTES], "little")
    known = _DEFINITIONS.get(msg_id)
    name = f"UNKNOWN_{msg_id}" if known is None else known.msgname
    return Header(name, msg_id, system_id, component_id, sequence, version, frame)


def _payload_of(frame: bytes) -> slice:
    start = _V1_HEADER_BYTES if frame[0] == MARKER_V1 else _V2_HEADER_BYTES
    return slice(start, start + frame[1])


def _is_sound(frame: bytes, known: Any) -> bool:
    """Return whether a frame's checksum is that of its content and its definition."""
    end = _payload_of(frame).stop
    checksum: int = dialect.x25crc(frame[1:end] + bytes((known.crc_extra,))).crc
    return checksum == int.from_bytes(frame[end : end + _CRC_BYTES], "little")


def sound_header(frame: bytes) -> Header | None:
    """Return the header of bytes that are one whole frame of the dialect with the right checksum; None for others.

    Signatures are not checked.
    """
    if len(frame) < _V2_HEADER_BYTES or frame[0] not in (MARKER_V1, MARKER_V2):
        return None
    flags = 0 if frame[0] == MARKER_V1 else frame[2]
    if flags & ~_SIGNED or len(frame) != _payload_of(frame).stop + _CRC_BYTES + SIGNATURE_BLOCK_BYTES * flags:
        return None
    header = _header_of(frame)
    known = _DEFINITIONS.get(header.message_id)
    return header if known is not None and _is_sound(frame, known) else None


class _Outgoing(dialect.MAVLink_message):  # type: ignore[misc]  # pymavlink has no types
    """A message that pymavlink packs into a frame."""

    def __init__(self, definition: Any, payload: bytes) -> None:
        super().__init__(definition.id, definition.msgname)
        self.crc_extra = definition.crc_extra
        self._body = payload

    def pack(self, mav: Any, force_mavlink1: bool = False) -> Any:
        return self._pack(mav, self.crc_extra, self._body, force_mavlink1=force_mavlink1)


class Codec:
    """The codec of a link: parses received bytes, numbers and packs outgoing messages.

    Args:
        system_id: source system of outgoing frames, 1..255; may be changed at any time.
        component_id: source component of outgoing frames.
        version: 1 or 2, the MAVLink version of outgoing frames.
    """

    def __init__(self, system_id: int, component_id: int, version: int = 2) -> None:
        if version not in (1, 2):
            raise ValueError(f"MAVLink has versions 1 and 2, not {version}")
        self._mav = _Parser(None, srcSystem=system_id, srcComponent=component_id)
        self._mav.robust_parsing = True
        self.version = version
        self.frames_sent = 0

    @property
    def system_id(self) -> int:
        """Source system of outgoing frames."""
        return int(self._mav.srcSystem)

    @system_id.setter
    def system_id(self, value: int) -> None:
        self._mav.srcSystem = value

    @property
    def sequence(self) -> int:
        """Sequence number of the next outgoing frame, 0..255."""
        return int(self._mav.seq)

    @sequence.setter
    def sequence(self, value: int) -> None:
        self._mav.seq = value

    def feed(self, data: bytes) -> None:
        """Add received bytes; ``next_received`` returns the whole frames."""
        if self._mav.buf_index > _COMPACT_ABOVE_BYTES:
            # The parser frees its buffer only when it is empty, which never happens on a busy link.
            self._mav.buf = self._mav.buf[self._mav.buf_index :]
            self._mav.buf_index = 0
        self._mav.buf.extend(data)

    @property
    def unread_bytes(self) -> int:
        """Bytes fed and not yet part of a returned frame."""
        return len(self._mav.buf) - int(self._mav.buf_index)

    def next_received(self) -> Received | BadData | None:
        """Return the next frame or stretch of bad bytes, or None when more bytes are needed. Never raises."""
        received = self._mav.parse_char(b"")
        if received is None or isinstance(received, Received | BadData):
            return received
        # The parser itself finds two kinds of bad data: bytes between frames, and frames with unknown flags.
        defect = Defect.FLAGS if received.data[0] == MARKER_V2 else Defect.PREFIX
        return BadData(defect, len(received.data))

    def can_send(self, message_type: type[Message]) -> bool:
        """Return whether the version of MAVLink has room for a message's id: the first has a byte."""
        return self.version != 1 or _ID_OF_NAME[message_type.__name__] <= _LAST_ID_OF_VERSION_1

    def encode(self, message: Message) -> bytes:
        """Return the next frame with this message.

        Raises struct.error if a field does not fit its type, or the message cannot be sent.
        """
        layout = _LAYOUTS[type(message).__name__]
        payload = layout.payload(message)
        if self.version == 1:
            payload = payload[: layout.version_1_length]
        frame = bytes(_Outgoing(layout.definition, payload).pack(self._mav, force_mavlink1=self.version == 1))
        self._mav.seq = (self._mav.seq + 1) % 256
        self.frames_sent += 1
        return frame

    @property
    def signing(self) -> LinkSigning | None:
        """Signing on this link, or None while frames are neither signed nor checked."""
        return self._mav.link_signing

    @property
    def overhead_bytes(self) -> int:
        """Bytes that a frame takes beside its payload, the signature included (GCS_MAVLINK::packet_overhead_chan)."""
        return V2_HEADER_AND_CRC_BYTES + (0 if self.signing is None else SIGNATURE_BLOCK_BYTES)

    def configure_signing(self, signing: LinkSigning | None) -> None:
        """Sign outgoing MAVLink 2 frames and check received ones from now on; None ends both.

        A refused frame comes out of ``next_received`` as BadData whose reason is a ``signature.Refusal``.
        """
        self._mav.link_signing = signing
        self._mav.signing = dialect.MAVLinkSigning() if signing is None else signing


def _offset_of(definition: Any, name: str) -> int | None:
    if name not in definition.ordered_fieldnames:
        return None
    index: int = definition.ordered_fieldnames.index(name)
    kinds = definition.native_format[1:].decode()
    counts = definition.array_lengths
    return sum(struct.calcsize(kinds[i]) * max(1, int(counts[i])) for i in range(index))


def target_offsets() -> dict[int, tuple[int | None, int | None]]:
    """Return the offsets of target_system and target_component in each message's payload, by message id."""
    return {
        msg_id: (_offset_of(known, "target_system"), _offset_of(known, "target_component"))
        for msg_id, known in _DEFINITIONS.items()
    }
