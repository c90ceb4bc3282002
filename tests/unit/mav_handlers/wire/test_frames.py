# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What is read without pymavlink's parser is what that one reads, of every message and whatever else comes."""

from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as dialect

from mav_handlers.wire.codec import BadData, Codec, Received, message_id
from mav_handlers.wire.messages import HEARTBEAT, ODOMETRY, STATUSTEXT, Message
from tests.unit.mav_handlers.wire.test_codec import EVERY, filled, messages

BEAT = HEARTBEAT(2, 3, 81, 0, 3, 3)
LAST_ID_OF_V1 = 255


class ByPymavlink(Codec):
    """A codec whose every frame is read by pymavlink's parser."""

    def _next_plain(self) -> Received | None:
        return None


class Watched(Codec):
    """A codec that counts the frames that it has read itself.

    Attributes:
        read: how many.
    """

    read = 0

    def _next_plain(self) -> Received | None:
        received = super()._next_plain()
        self.read += received is not None
        return received


def receive(codec: Codec, *chunks: bytes) -> list[Received | BadData]:
    out = []
    for chunk in chunks:
        codec.feed(chunk)
        while (received := codec.next_received()) is not None:
            out.append(received)
    return out


def by_both(*chunks: bytes) -> list[Received | BadData]:
    codecs = Codec(1, 1), ByPymavlink(1, 1)
    ours, theirs = (receive(codec, *chunks) for codec in codecs)
    # NaN equals nothing, but is written as itself.
    assert repr(ours) == repr(theirs)
    assert codecs[0].unread_bytes == codecs[1].unread_bytes
    return ours


def sent(message: Message, version: int, system_id: int = 1, component_id: int = 2) -> bytes:
    """Return a frame of a message; MAVLink 1 has no ids above 255."""
    version = 2 if message_id(type(message).__name__) > LAST_ID_OF_V1 else version
    return Codec(system_id, component_id, version).encode(message)


@pytest.mark.parametrize("version", [1, 2])
def test_every_message_is_read_the_same(version: int) -> None:
    for cls in EVERY:
        [received] = by_both(sent(filled(cls), version))
        assert isinstance(received, Received), cls
        assert type(received.message) is cls


@given(message=messages(), version=st.sampled_from([1, 2]), ids=st.tuples(st.integers(0, 255), st.integers(0, 255)))
def test_any_fields_are_read_the_same(message: Any, version: int, ids: tuple[int, int]) -> None:
    by_both(sent(message, version, *ids))


@given(
    parts=st.lists(messages().map(lambda message: Codec(1, 2).encode(message)) | st.binary(max_size=12), max_size=6),
    cuts=st.lists(st.integers(0, 600), max_size=5),
)
def test_any_stream_is_read_the_same_however_it_is_cut(parts: list[bytes], cuts: list[int]) -> None:
    stream = b"".join(parts)
    ends = [0, *sorted(min(cut, len(stream)) for cut in cuts), len(stream)]
    by_both(*(stream[start:end] for start, end in pairwise(ends)))


@given(message=messages(), version=st.sampled_from([1, 2]), data=st.data())
def test_a_damaged_frame_is_judged_the_same(message: Any, version: int, data: st.DataObject) -> None:
    frame = bytearray(sent(message, version))
    frame[data.draw(st.integers(0, len(frame) - 1))] ^= data.draw(st.integers(1, 255))
    by_both(bytes(frame) + Codec(1, 2).encode(BEAT))


@given(msg_id=st.sampled_from(sorted(dialect.mavlink_map)), payload=st.binary(max_size=255))
def test_payload_of_any_length_is_read_the_same(msg_id: int, payload: bytes) -> None:
    # Shorter than the message's, as MAVLink 2 sends it, or longer, as a newer sender may.
    body = bytes((len(payload), 0, 0, 1, 2, 3)) + msg_id.to_bytes(3, "little") + payload
    crc = dialect.x25crc(body + bytes((dialect.mavlink_map[msg_id].crc_extra,))).crc
    [received] = by_both(b"\xfd" + body + crc.to_bytes(2, "little"))
    assert isinstance(received, Received)
    assert received.header.message_id == msg_id


def test_plain_frames_are_read_without_the_parser_and_text_is_left_to_it() -> None:
    codec, sender = Watched(1, 1), Codec(7, 8)
    assert len(receive(codec, sender.encode(BEAT), sender.encode(filled(ODOMETRY)))) == 2
    assert codec.read == 2
    assert len(receive(codec, sender.encode(STATUSTEXT(6, "text")))) == 1
    assert codec.read == 2
