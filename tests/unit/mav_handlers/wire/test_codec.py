# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Bytes to typed messages and back, against pymavlink's own parser."""

import struct
from collections.abc import Sequence
from dataclasses import fields
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as dialect
from pymavlink.dialects.v20 import development

from mav_handlers.wire.codec import (
    DRAFTS,
    BadData,
    Codec,
    Defect,
    Received,
    full_length,
    message_id,
    message_name,
    sound_header,
)
from mav_handlers.wire.messages import (
    ATT_POS_MOCAP,
    ATTITUDE,
    AUTOPILOT_VERSION,
    COMMAND_ACK,
    GLOBAL_VISION_POSITION_ESTIMATE,
    GPS_GLOBAL_ORIGIN,
    HEARTBEAT,
    HOME_POSITION,
    MESSAGES,
    ODOMETRY,
    PARAM_REQUEST_READ,
    SET_GPS_GLOBAL_ORIGIN,
    STATUSTEXT,
    SYS_STATUS,
    TIMESYNC,
    VICON_POSITION_ESTIMATE,
    VISION_POSITION_ESTIMATE,
    VISION_SPEED_ESTIMATE,
    Message,
)
from tools.make_messages import definition

EVERY = list(MESSAGES.values())
BEAT = HEARTBEAT(2, 3, 81, 0, 3, 3)
SIGNED = 1
DRAFT_IDS = {draft.id.to_bytes(3, "little") for draft in DRAFTS}
STRATEGIES: dict[str, st.SearchStrategy[Any]] = {
    "float": st.floats(width=32, allow_nan=False),
    "int8_t": st.integers(-(1 << 7), (1 << 7) - 1),
    "uint8_t": st.integers(0, (1 << 8) - 1),
    "int16_t": st.integers(-(1 << 15), (1 << 15) - 1),
    "uint16_t": st.integers(0, (1 << 16) - 1),
    "int32_t": st.integers(-(1 << 31), (1 << 31) - 1),
    "uint32_t": st.integers(0, (1 << 32) - 1),
    "int64_t": st.integers(-(1 << 63), (1 << 63) - 1),
    "uint64_t": st.integers(0, (1 << 64) - 1),
}


def names_of(cls: type[Message]) -> list[str]:
    return [field.name for field in fields(cls)]


def field_strategy(kind: str, length: int) -> st.SearchStrategy[Any]:
    if kind == "char":
        return st.text(st.characters(codec="ascii", exclude_characters="\0"), max_size=length)
    return st.tuples(*[STRATEGIES[kind]] * length) if length else STRATEGIES[kind]


@st.composite
def messages(draw: st.DrawFn, kinds: Sequence[type[Message]] = EVERY) -> Message:
    """Draw a message of any of some kinds with any fields but NaN, which equals nothing."""
    cls = draw(st.sampled_from(kinds))
    raw = definition(cls.__name__)
    types = dict(zip(raw.fieldnames, raw.fieldtypes, strict=True))
    lengths = dict(zip(raw.ordered_fieldnames, raw.array_lengths, strict=True))
    return cls(*(draw(field_strategy(types[name], lengths[name])) for name in names_of(cls)))


def filled(cls: type[Message]) -> Message:
    """Return a message without a zero in any field, so that nothing is trimmed."""
    raw = definition(cls.__name__)
    kinds = dict(zip(raw.fieldnames, raw.fieldtypes, strict=True))
    lengths = dict(zip(raw.ordered_fieldnames, raw.array_lengths, strict=True))

    def value(name: str) -> Any:
        if kinds[name] == "char":
            return "x" * lengths[name]
        return (1,) * lengths[name] if lengths[name] else 1

    return cls(*(value(name) for name in names_of(cls)))


def receive(codec: Codec, data: bytes) -> list[Received | BadData]:
    codec.feed(data)
    out = []
    while (received := codec.next_received()) is not None:
        out.append(received)
    return out


def only(data: bytes) -> Received:
    [received] = receive(Codec(1, 1), data)
    assert isinstance(received, Received)
    return received


def independent(data: bytes) -> list[Any]:
    parser = (development if data[7:10] in DRAFT_IDS else dialect).MAVLink(None)
    return parser.parse_buffer(bytearray(data)) or []


class TestEncode:
    """Messages to frames."""

    @given(message=messages())
    def test_message_comes_back_as_it_was(self, message: Message) -> None:
        assert only(Codec(255, 190).encode(message)).message == message

    @given(message=messages())
    def test_pymavlink_reads_the_same_fields(self, message: Message) -> None:
        [raw] = independent(Codec(255, 190).encode(message))
        assert raw.get_type() == type(message).__name__
        for name in names_of(type(message)):
            wanted = getattr(message, name)
            assert getattr(raw, name) == (list(wanted) if isinstance(wanted, tuple) else wanted)

    @pytest.mark.parametrize(
        ("cls", "length"),
        [
            (ATT_POS_MOCAP, 36),
            (AUTOPILOT_VERSION, 60),
            (COMMAND_ACK, 3),
            (GLOBAL_VISION_POSITION_ESTIMATE, 32),
            (GPS_GLOBAL_ORIGIN, 12),
            (HEARTBEAT, 9),
            (HOME_POSITION, 52),
            (SET_GPS_GLOBAL_ORIGIN, 13),
            (STATUSTEXT, 51),
            (SYS_STATUS, 31),
            (VICON_POSITION_ESTIMATE, 32),
            (VISION_POSITION_ESTIMATE, 32),
            (VISION_SPEED_ESTIMATE, 20),
        ],
    )
    def test_mavlink_1_frame_has_no_extension_fields(self, cls: type[Message], length: int) -> None:
        frame = Codec(255, 190, version=1).encode(filled(cls))
        assert (frame[0], frame[1], len(frame)) == (0xFE, length, length + 8)
        [raw] = independent(frame)
        assert raw.get_type() == cls.__name__

    def test_mavlink_2_frame_loses_trailing_zeros(self) -> None:
        frame = Codec(255, 190).encode(TIMESYNC(1, 0))
        assert (frame[0], frame[1]) == (0xFD, 1)

    def test_sequence_numbers_wrap_after_255(self) -> None:
        codec = Codec(255, 190)
        sequences = [only(codec.encode(BEAT)).header.sequence for _ in range(257)]
        assert sequences == [*range(256), 0]
        assert codec.frames_sent == 257

    def test_text_beyond_ascii_is_replaced(self) -> None:
        message = only(Codec(1, 1).encode(STATUSTEXT(6, "5\N{DEGREE SIGN}"))).message
        assert message == STATUSTEXT(6, "5?")

    def test_text_that_fills_its_field_has_no_terminator(self) -> None:
        frame = Codec(1, 1).encode(STATUSTEXT(6, "x" * 50, 0, 1))
        assert frame[10:].startswith(b"\x06" + b"x" * 50 + b"\0\0\x01")

    def test_field_that_does_not_fit_raises(self) -> None:
        with pytest.raises(struct.error):
            Codec(1, 1).encode(TIMESYNC(1 << 63, 0))

    def test_system_id_may_change_at_any_time(self) -> None:
        codec = Codec(1, 1)
        codec.system_id = 42
        assert codec.system_id == 42
        assert only(codec.encode(BEAT)).header.system_id == 42

    def test_sequence_number_may_be_chosen_and_goes_on_from_there(self) -> None:
        codec = Codec(1, 1)
        codec.sequence = 254
        assert [only(codec.encode(BEAT)).header.sequence for _ in range(3)] == [254, 255, 0]
        assert codec.sequence == 1

    @pytest.mark.parametrize("version", [0, 3])
    def test_other_versions_are_refused(self, version: int) -> None:
        with pytest.raises(ValueError, match="versions 1 and 2"):
            Codec(1, 1, version)


class TestDecode:
    """Frames to messages."""

    @pytest.mark.parametrize("version", [1, 2])
    def test_header_tells_who_sent_what(self, version: int) -> None:
        frame = Codec(7, 8, version).encode(BEAT)
        header = only(frame).header
        assert (header.name, header.message_id, header.version) == ("HEARTBEAT", 0, version)
        assert (header.system_id, header.component_id, header.sequence) == (7, 8, 0)
        assert header.frame == frame

    def test_missing_end_of_a_payload_reads_as_zero(self) -> None:
        frame = Codec(1, 1).encode(ATTITUDE(5, 0, 0, 0, 0, 0, 0))
        assert only(frame).message == ATTITUDE(5, 0, 0, 0, 0, 0, 0)

    def test_mavlink_1_frame_reads_with_zero_extensions(self) -> None:
        message = only(Codec(1, 1, version=1).encode(COMMAND_ACK(400, 4, 1, 2, 3, 4))).message
        assert message == COMMAND_ACK(400, 4)

    def test_text_ends_at_its_first_nul(self) -> None:
        frame = Codec(1, 1).encode(PARAM_REQUEST_READ(1, 1, "AB\0CD", -1))
        assert only(frame).message == PARAM_REQUEST_READ(1, 1, "AB", -1)

    def test_message_of_the_dialect_that_is_not_ours_has_a_header_only(self) -> None:
        packer = dialect.MAVLink(None, srcSystem=3, srcComponent=4)
        received = only(bytes(dialect.MAVLink_rpm_message(1.0, 2.0).pack(packer)))
        assert received.message is None
        assert (received.header.name, received.header.system_id) == ("RPM", 3)

    @pytest.mark.parametrize(
        ("frame", "version"),
        [("fe01112223cf000000", 1), ("fd010000112223bbaa15000000", 2)],
        ids=["MAVLink 1", "MAVLink 2"],
    )
    def test_message_outside_the_dialect_has_a_header_only(self, frame: str, version: int) -> None:
        received = only(bytes.fromhex(frame))
        number = 0xCF if version == 1 else 0x15AABB
        assert received.message is None
        header = received.header
        assert (header.name, header.message_id, header.version) == (f"UNKNOWN_{number}", number, version)
        assert (header.sequence, header.system_id, header.component_id) == (0x11, 0x22, 0x23)

    def test_signed_frame_is_read(self) -> None:
        packer = dialect.MAVLink(None, srcSystem=3, srcComponent=4)
        packer.signing.secret_key = bytes(32)
        packer.signing.sign_outgoing = True
        frame = bytes(dialect.MAVLink_heartbeat_message(2, 3, 81, 0, 3, 3).pack(packer))
        assert frame[2] == SIGNED
        assert only(frame).message == BEAT

    def test_damaged_frame_is_bad_data_of_its_length(self) -> None:
        frame = bytearray(Codec(1, 1).encode(BEAT))
        frame[-1] ^= 0xFF
        [bad] = receive(Codec(1, 1), bytes(frame))
        assert bad == BadData(Defect.CRC, len(frame))

    def test_unknown_flags_are_bad_data(self) -> None:
        frame = bytearray(Codec(1, 1).encode(BEAT))
        frame[2] = 0x82
        [bad] = receive(Codec(1, 1), bytes(frame))
        assert bad == BadData(Defect.FLAGS, len(frame))

    def test_bytes_between_frames_are_one_stretch_of_bad_data(self) -> None:
        frame = Codec(1, 1).encode(BEAT)
        kinds = [type(received) for received in receive(Codec(1, 1), frame + b"noise" + frame)]
        assert kinds == [Received, BadData, Received]

    def test_unfinished_frame_waits(self) -> None:
        codec = Codec(1, 1)
        frame = Codec(7, 8).encode(BEAT)
        assert receive(codec, frame[:-1]) == []
        assert codec.unread_bytes == len(frame) - 1
        [received] = receive(codec, frame[-1:])
        assert isinstance(received, Received)
        assert codec.unread_bytes == 0

    def test_busy_link_does_not_pile_up_what_was_read(self) -> None:
        codec, sender = Codec(1, 1), Codec(7, 8)
        frames = [sender.encode(BEAT) for _ in range(2000)]
        stream, step = b"".join(frames), 10 * len(frames[0])
        # A part of the next frame always waits, so that the parser's buffer is never empty.
        received = receive(codec, stream[:5])
        received += [one for at in range(5, len(stream), step) for one in receive(codec, stream[at : at + step])]
        assert [one.header.sequence for one in received if isinstance(one, Received)] == [n % 256 for n in range(2000)]

    @given(data=st.binary(max_size=600))
    def test_any_bytes_are_accounted_for(self, data: bytes) -> None:
        codec = Codec(1, 1)
        lengths = [
            len(received.header.frame) if isinstance(received, Received) else received.length
            for received in receive(codec, data)
        ]
        assert sum(lengths) + codec.unread_bytes == len(data)


class TestNames:
    """Ids, names and lengths."""

    def test_names_and_ids_are_each_other_s_inverse(self) -> None:
        assert all(message_name(message_id(cls.__name__)) == cls.__name__ for cls in EVERY)

    def test_unknown_id_has_no_name(self) -> None:
        assert message_name(0xFFFFFF) is None

    def test_unknown_name_raises(self) -> None:
        with pytest.raises(KeyError):
            message_id("NO_SUCH_MESSAGE")

    @pytest.mark.parametrize(("cls", "length"), [(ODOMETRY, 233), (TIMESYNC, 16), (COMMAND_ACK, 10)])
    def test_full_length_includes_extensions(self, cls: type[Message], length: int) -> None:
        assert full_length(cls) == length


@pytest.mark.parametrize("version", [1, 2])
def test_header_of_one_whole_sound_frame_alone(version: int) -> None:
    frame = Codec(7, 8, version).encode(BEAT)
    damaged = frame[:-1] + bytes((frame[-1] ^ 1,))
    header = sound_header(frame)
    assert header is not None
    assert (header.name, header.system_id, header.component_id, header.version) == ("HEARTBEAT", 7, 8, version)
    assert [sound_header(data) for data in (damaged, frame[:-1], frame + b"\0", frame * 2, b"", b"\xfe")] == [None] * 6
