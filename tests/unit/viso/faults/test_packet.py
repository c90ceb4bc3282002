# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Frames by their headers, frames packed again, and frames cut out of bytes."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mav_handlers.wire.codec import Codec
from mav_handlers.wire.messages import HEARTBEAT
from tests.unit.viso.faults.rig import BEAT, decoded, encoded, every_kind, odometry, passed_over, position
from viso.faults.packet import NO_FRAME, FrameSplitter, PassedOver, decode, pack, read_packet


@pytest.mark.parametrize("version", [1, 2])
def test_header_says_what_the_codec_says(version: int) -> None:
    for frame in encoded(BEAT, position(), component_id=7, version=version):
        header, packet = decoded(frame)[0], read_packet(frame)
        assert packet.key == (header.system_id, header.component_id, header.message_id)
        assert (packet.name, packet.version, packet.sequence) == (header.name, version, header.sequence)


@given(st.binary(max_size=60))
def test_anything_else_is_no_frame_or_unknown(data: bytes) -> None:
    packet = read_packet(data)
    assert packet.frame == data
    assert packet.name == NO_FRAME or len(data) >= 8


def test_decoded_and_packed_again_is_the_same_frame() -> None:
    codec = Codec(9, 8)
    for number in range(300):
        frame = codec.encode(every_kind()[number % 7])
        assert pack(decode(read_packet(frame))).frame == frame


def test_version_1_stays_without_its_extensions() -> None:
    (frame,) = encoded(position(reset_counter=7), version=1)
    packet = decode(read_packet(frame))
    assert pack(packet).frame == frame


@pytest.mark.parametrize(("frame", "reason"), [
    (encoded(odometry())[0][:-1] + b"?", "damaged"),
    (b"\xfd\x00\x00\x00\x00\x01\x01\xff\xff\xff\x00\x00", "content not known"),
    (encoded(odometry())[0] + b"more", "damaged"),
    (b"\xfe", "damaged"),
    (b"", "damaged"),
])  # fmt: skip
def test_what_cannot_be_decoded_is_passed_over(frame: bytes, reason: str) -> None:
    assert passed_over("kind: sender_id", frame) == {reason: 1}


def test_number_that_does_not_fit_is_passed_over() -> None:
    frame = encoded(position(x=3e38))[0]
    assert passed_over("kind: scale, factor: 1000", frame) == {"does not fit its field": 1}


def test_message_without_content_cannot_be_packed() -> None:
    with pytest.raises(PassedOver, match="content not known"):
        pack(read_packet(encoded(BEAT)[0]))


def test_packing_keeps_ids_and_sequence_number() -> None:
    codec = Codec(33, 44)
    frames = [codec.encode(BEAT) for _ in range(258)]
    packet = decode(read_packet(frames[257]))
    header, message = decoded(pack(replace(packet, message=HEARTBEAT(1, 2, 3, 4, 5, 3))).frame)
    assert (header.system_id, header.component_id, header.sequence, message.type) == (33, 44, 1, 1)


SENT = encoded(BEAT, odometry(), BEAT)


def test_each_frame_is_a_piece_however_it_arrives() -> None:
    splitter, data = FrameSplitter(), b"".join(SENT)
    assert splitter.feed(data) == SENT
    assert [piece for byte in data for piece in splitter.feed(bytes([byte]))] == SENT
    assert splitter.unread_bytes == 0


def test_rest_of_a_frame_is_waited_for() -> None:
    splitter = FrameSplitter()
    assert splitter.feed(SENT[0] + SENT[1][:50]) == [SENT[0]]
    assert splitter.unread_bytes == 50
    assert splitter.feed(SENT[1][50:]) == [SENT[1]]


@given(st.lists(st.one_of(st.binary(max_size=30), st.sampled_from([*SENT, SENT[1][:70], b"\xfd", b"\xfe\x03"]))))
def test_no_byte_gets_lost_or_out_of_order(parts: list[bytes]) -> None:
    splitter = FrameSplitter()
    pieces = b"".join(piece for part in parts for piece in splitter.feed(part))
    fed = b"".join(parts)
    assert fed.startswith(pieces)
    assert len(fed) - len(pieces) == splitter.unread_bytes
