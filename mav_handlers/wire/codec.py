# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The one door to pymavlink's dialect: bytes to typed messages and back."""

import struct
from collections.abc import Callable
from dataclasses import MISSING, dataclass, fields
from operator import itemgetter
from typing import Any, Final, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as dialect

from mav_handlers.wire import messages
from mav_handlers.wire.drafts import draft_messages
from mav_handlers.wire.frames import Form, Header, Received, plain_frame
from mav_handlers.wire.message_class import maker_of
from mav_handlers.wire.messages import MESSAGES, Message
from mav_handlers.wire.signature import SIGNATURE_BLOCK_BYTES, LinkSigning

V2_HEADER_AND_CRC_BYTES: Final = 12
_V1_HEADER_BYTES: Final = 6
_COMPACT_ABOVE_BYTES: Final = 4096


class BadData(NamedTuple):
    """Bytes that are no frame, or a frame that failed its check."""

    reason: str
    length: int


@dataclass(frozen=True, slots=True)
class _Layout:
    cls: type[Message]
    dialect_class: Any
    names: tuple[str, ...]
    arrays: frozenset[str]
    texts: frozenset[str]
    full_length: int
    version_1_length: int


def _layout_of(cls: type[Message], dialect_class: Any) -> _Layout:
    types = dict(zip(dialect_class.fieldnames, dialect_class.fieldtypes, strict=True))
    lengths = dict(zip(dialect_class.ordered_fieldnames, dialect_class.array_lengths, strict=True))
    every = fields(cls)
    names = tuple(field.name for field in every)
    codes = dict(zip(dialect_class.ordered_fieldnames, dialect_class.native_format[1:].decode(), strict=True))
    extensions = [field.name for field in every if field.default is not MISSING]
    full_length = dialect_class.unpacker.size
    return _Layout(
        cls,
        dialect_class,
        names,
        frozenset(name for name in names if lengths[name] and types[name] != "char"),
        frozenset(name for name in names if types[name] == "char"),
        full_length,
        full_length - sum(struct.calcsize(codes[name]) * max(1, lengths[name]) for name in extensions),
    )


for _draft in draft_messages(dialect.MAVLink_message):
    dialect.mavlink_map.setdefault(_draft.id, _draft)


def _layouts() -> dict[str, _Layout]:
    known = {cls.msgname: cls for cls in dialect.mavlink_map.values()}
    return {name: _layout_of(cls, known[name]) for name, cls in MESSAGES.items()}


_LAYOUTS: Final = _layouts()
_NAME_OF_ID: Final[dict[int, str]] = {cls.id: cls.msgname for cls in dialect.mavlink_map.values()}
_ID_OF_NAME: Final[dict[str, int]] = {name: msg_id for msg_id, name in _NAME_OF_ID.items()}


class _Forms(dict[int, Form | None]):
    """How to read messages, by their ids; each form is made when it is first asked for."""

    def __missing__(self, msg_id: int) -> Form | None:
        dialect_class = dialect.mavlink_map.get(msg_id)
        if dialect_class is None:  # of which there may be millions
            return None
        layout = _LAYOUTS.get(dialect_class.msgname)
        form = None
        if layout is None or not layout.texts:  # text is pymavlink's to decode
            make = None if layout is None else _maker(layout)
            crc_extra, payload = bytes((dialect_class.crc_extra,)), dialect_class.unpacker
            form = Form(dialect_class.msgname, crc_extra, payload.size, payload.unpack_from, make)
        self[msg_id] = form
        return form


_form_of: Final = _Forms().__getitem__


def _maker(layout: _Layout) -> Callable[[tuple[Any, ...]], Message]:
    """Return what makes a message of the fields in the order of the wire, elements of arrays one by one."""
    starts, end = {}, 0
    for name, length in zip(layout.dialect_class.ordered_fieldnames, layout.dialect_class.lengths, strict=True):
        starts[name] = slice(end, end + length) if name in layout.arrays else end
        end += length
    pick = itemgetter(*[starts[name] for name in layout.names])
    return maker_of(layout.cls, pick if len(layout.names) > 1 else lambda values: (pick(values),))


def _crc_by_dialect(data: bytes) -> int:
    crc: int = dialect.x25crc(data).crc
    return crc


# Where pymavlink has found fastcrc, its checksum is one call of that.
_crc_of: Final[Callable[[bytes], int]] = getattr(dialect, "mcrf4xx", None) or _crc_by_dialect


def message_id(name: str) -> int:
    """Return the id of a message by its name. Raises KeyError if the dialect has no such message."""
    return _ID_OF_NAME[name]


def message_name(msg_id: int) -> str | None:
    """Return the name of a message by its id, or None when the dialect has none."""
    return _NAME_OF_ID.get(msg_id)


def full_length(cls: type[Message]) -> int:
    """Return the payload length of a message in bytes before MAVLink 2 trims trailing zeros."""
    return _LAYOUTS[cls.__name__].full_length


def _to_message(raw: Any) -> Message | None:
    layout = _LAYOUTS.get(raw.get_type())
    if layout is None:
        return None
    values = [tuple(getattr(raw, name)) if name in layout.arrays else getattr(raw, name) for name in layout.names]
    return layout.cls(*values)


def _to_header(raw: Any) -> Header:
    # pymavlink leaves the header of a message it does not know empty.
    frame, name = bytes(raw.get_msgbuf()), raw.get_type()
    if frame[0] == dialect.PROTOCOL_MARKER_V1:
        return Header(name, frame[5], frame[3], frame[4], frame[2], 1, frame)
    return Header(name, int.from_bytes(frame[7:10], "little"), frame[5], frame[6], frame[4], 2, frame)


def _without_extensions(frame: bytes, layout: _Layout) -> bytes:
    # MAVLink 1 knows no extension fields; pymavlink sends them all the same.
    body = bytes((layout.version_1_length,)) + frame[2 : _V1_HEADER_BYTES + layout.version_1_length]
    crc = dialect.x25crc(body + bytes((layout.dialect_class.crc_extra,))).crc
    return frame[:1] + body + struct.pack("<H", crc)


def begins_with_frame(data: bytes) -> bool:
    """Return whether bytes begin with a whole frame of a message of the dialect whose checksum is right."""
    codec = Codec(0, 0)
    codec.feed(data)
    received = codec.next_received()
    return isinstance(received, Received) and received.header.message_id in _NAME_OF_ID


class Codec:
    """One direction-pair of a link: parses what comes in, numbers and packs what goes out.

    Args:
        system_id: source system of outgoing frames, 1..255; may be changed at any time.
        component_id: source component of outgoing frames.
        version: 1 or 2, the MAVLink version of outgoing frames.
    """

    def __init__(self, system_id: int, component_id: int, version: int = 2) -> None:
        if version not in (1, 2):
            raise ValueError(f"MAVLink has versions 1 and 2, not {version}")
        self._mav = dialect.MAVLink(None, srcSystem=system_id, srcComponent=component_id)
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
        """Add received bytes; ``next_received`` then gives what is whole."""
        if self._mav.buf_index > _COMPACT_ABOVE_BYTES:
            # The parser keeps what it has read until nothing is left; a busy link never gets there.
            self._mav.buf = self._mav.buf[self._mav.buf_index :]
            self._mav.buf_index = 0
        self._mav.buf.extend(data)

    @property
    def unread_bytes(self) -> int:
        """Bytes fed and not yet part of a returned frame."""
        return len(self._mav.buf) - int(self._mav.buf_index)

    def next_received(self) -> Received | BadData | None:
        """Return the next frame or stretch of bad bytes, or None when more bytes are needed. Never raises."""
        mav = self._mav
        if mav.buf_index == len(mav.buf):
            return None
        received = self._next_plain() if self._signing is None else None
        if received is not None:
            return received
        raw = mav.parse_char(b"")
        if raw is None:
            return None
        if raw.get_type() == "BAD_DATA":
            return BadData(str(raw.reason), len(raw.data))
        return Received(_to_header(raw), _to_message(raw))

    def _next_plain(self) -> Received | None:
        """Take a frame that needs no more than reading, from where pymavlink's parser stands."""
        mav = self._mav
        received = plain_frame(mav.buf, mav.buf_index, _form_of, _crc_of)
        if received is not None:
            mav.buf_index += len(received.header.frame)
            if mav.buf_index == len(mav.buf):
                mav.buf, mav.buf_index = bytearray(), 0
        return received

    def encode(self, message: Message) -> bytes:
        """Return the next frame with this message. Raises struct.error if a field does not fit its type."""
        layout = _LAYOUTS[type(message).__name__]
        values = {
            name: getattr(message, name).encode("ascii", "replace") if name in layout.texts else getattr(message, name)
            for name in layout.names
        }
        raw = layout.dialect_class(**values)
        frame = bytes(raw.pack(self._mav, force_mavlink1=self.version == 1))
        if self.version == 1:
            frame = _without_extensions(frame, layout)
        self._mav.seq = (self._mav.seq + 1) % 256
        self.frames_sent += 1
        return frame

    # Signing

    _signing: LinkSigning | None = None

    @property
    def signing(self) -> LinkSigning | None:
        """Signing on this link, or None while frames are neither signed nor checked."""
        return self._signing

    @property
    def overhead_bytes(self) -> int:
        """Bytes that a frame takes beside its payload, the signature included (GCS_MAVLINK::packet_overhead_chan)."""
        return V2_HEADER_AND_CRC_BYTES + (0 if self._signing is None else SIGNATURE_BLOCK_BYTES)

    def configure_signing(self, signing: LinkSigning | None) -> None:
        """Sign outgoing MAVLink 2 frames and check received ones from now on; None ends both.

        A refused frame comes out of ``next_received`` as BadData whose reason is a ``signature.Refusal``.
        """
        self._signing = signing
        if signing is None:
            self._mav.signing = dialect.MAVLinkSigning()
            return
        # pymavlink's own check remembers the timestamp of a forged frame, after which the genuine ones look old.
        self._mav.check_signature = signing.check_signature
        self._mav.signing = signing
        signing.allow_unsigned_callback = _admission(signing)


def _admission(signing: LinkSigning) -> Callable[[Any, int], bool]:
    def admit(_mav: Any, msg_id: int) -> bool:
        refusal = signing.refuse_unverified(msg_id)
        if refusal is not None:
            raise dialect.MAVError(refusal.value)
        return True

    return admit


def _offset_of(dialect_class: Any, name: str) -> int | None:
    if name not in dialect_class.ordered_fieldnames:
        return None
    index: int = dialect_class.ordered_fieldnames.index(name)
    kinds = dialect_class.native_format[1:].decode()
    counts = dialect_class.array_lengths
    return sum(struct.calcsize(kinds[i]) * max(1, int(counts[i])) for i in range(index))


def target_offsets() -> dict[int, tuple[int | None, int | None]]:
    """Return where target_system and target_component stand in each message's payload, by message id."""
    return {
        cls.id: (_offset_of(cls, "target_system"), _offset_of(cls, "target_component"))
        for cls in dialect.mavlink_map.values()
    }


__all__ = [
    "V2_HEADER_AND_CRC_BYTES",
    "BadData",
    "Codec",
    "Header",
    "Received",
    "begins_with_frame",
    "full_length",
    "message_id",
    "message_name",
    "messages",
    "target_offsets",
]
