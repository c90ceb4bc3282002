# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The codec reads what pymavlink's own decoder reads, and refuses what that refuses, of every message and any bytes."""

import subprocess
import sys
from dataclasses import astuple
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as dialect
from pymavlink.dialects.v20 import development

from ap_core.verdict import Verdict
from mav_handlers.verdicts import BAD_CRC, BAD_DATA_VERDICTS, BAD_FRAME, BAD_PREFIX
from mav_handlers.wire.codec import DRAFTS, BadData, Codec, Defect, Received, message_id
from mav_handlers.wire.messages import AVAILABLE_MODES, AVAILABLE_MODES_MONITOR, HEARTBEAT, MESSAGES, Message
from mav_handlers.wire.signature import Refusal
from tests.unit.mav_handlers.wire.test_codec import EVERY, filled, messages, names_of, receive

BEAT = HEARTBEAT(2, 3, 81, 0, 3, 3)
LAST_ID_OF_V1 = 255
IDS = st.integers(0, 255)
# Not the drafts, which pymavlink's dialect of the firmware does not know.
KNOWN = [cls for cls in EVERY if message_id(cls.__name__) in dialect.mavlink_map]
OF_DIALECT = messages(KNOWN)

Outcome = tuple[Any, ...]


def verdict_by_words(reason: str) -> Verdict:
    """Return what pymavlink's own words say of bytes that it refuses."""
    if "prefix" in reason:
        return BAD_PREFIX
    return BAD_CRC if "CRC" in reason else BAD_FRAME


def by_pymavlink(*chunks: bytes) -> list[Outcome]:
    parser = dialect.MAVLink(None)
    parser.robust_parsing = True
    outcomes: list[Outcome] = []
    for chunk in chunks:
        for raw in parser.parse_buffer(bytearray(chunk)) or []:
            kind = raw.get_type()
            if kind == "BAD_DATA":
                outcomes.append((verdict_by_words(raw.reason), len(raw.data)))
            elif kind not in MESSAGES:
                outcomes.append((kind, bytes(raw.get_msgbuf())))
            else:
                head = raw.get_header()
                values = [getattr(raw, name) for name in names_of(MESSAGES[kind])]
                values = [tuple(value) if isinstance(value, list) else value for value in values]
                sender = head.msgId, head.srcSystem, head.srcComponent, head.seq
                outcomes.append((kind, bytes(raw.get_msgbuf()), *sender, *values))
    return outcomes


def by_codec(*chunks: bytes) -> list[Outcome]:
    codec = Codec(1, 1)
    outcomes: list[Outcome] = []
    for one in (one for chunk in chunks for one in receive(codec, chunk)):
        if isinstance(one, BadData):
            outcomes.append((BAD_DATA_VERDICTS[one.reason], one.length))
        elif one.message is None:
            outcomes.append((one.header.name, one.header.frame))
        else:
            name, msg_id, system_id, component_id, sequence, _, frame = one.header
            values = [getattr(one.message, field) for field in names_of(type(one.message))]
            outcomes.append((name, frame, msg_id, system_id, component_id, sequence, *values))
    return outcomes


def by_both(*chunks: bytes) -> list[Outcome]:
    ours, theirs = by_codec(*chunks), by_pymavlink(*chunks)
    # NaN equals nothing, but is written as itself.
    assert repr(ours) == repr(theirs)
    return ours


def sent(message: Message, version: int, system_id: int = 1, component_id: int = 2) -> bytes:
    """Return a frame of a message; MAVLink 1 has no ids above 255."""
    version = 2 if message_id(type(message).__name__) > LAST_ID_OF_V1 else version
    return Codec(system_id, component_id, version).encode(message)


@pytest.mark.parametrize("version", [1, 2])
def test_every_message_is_read_the_same(version: int) -> None:
    for cls in KNOWN:
        [outcome] = by_both(sent(filled(cls), version))
        assert outcome[0] == cls.__name__


@given(message=OF_DIALECT, version=st.sampled_from([1, 2]), ids=st.tuples(IDS, IDS))
def test_any_fields_are_read_the_same(message: Any, version: int, ids: tuple[int, int]) -> None:
    by_both(sent(message, version, *ids))


@given(
    parts=st.lists(OF_DIALECT.map(lambda message: Codec(1, 2).encode(message)) | st.binary(max_size=12), max_size=6),
    cuts=st.lists(st.integers(0, 600), max_size=5),
)
def test_any_stream_is_read_and_judged_the_same_however_it_is_cut(parts: list[bytes], cuts: list[int]) -> None:
    stream = b"".join(parts)
    ends = [0, *sorted(min(cut, len(stream)) for cut in cuts), len(stream)]
    by_both(*(stream[start:end] for start, end in pairwise(ends)))


@given(message=OF_DIALECT, version=st.sampled_from([1, 2]), data=st.data())
def test_a_damaged_frame_is_judged_the_same(message: Any, version: int, data: st.DataObject) -> None:
    frame = bytearray(sent(message, version))
    frame[data.draw(st.integers(0, len(frame) - 1))] ^= data.draw(st.integers(1, 255))
    by_both(bytes(frame) + Codec(1, 2).encode(BEAT))


@given(data=st.binary(max_size=600))
def test_any_bytes_are_judged_the_same(data: bytes) -> None:
    by_both(data)


@given(msg_id=st.sampled_from(sorted(dialect.mavlink_map)), payload=st.binary(max_size=255))
def test_payload_of_any_length_is_read_the_same(msg_id: int, payload: bytes) -> None:
    # Shorter than the message's, as MAVLink 2 sends it, or longer, as a newer sender may.
    body = bytes((len(payload), 0, 0, 1, 2, 3)) + msg_id.to_bytes(3, "little") + payload
    crc = dialect.x25crc(body + bytes((dialect.mavlink_map[msg_id].crc_extra,))).crc
    [outcome] = by_both(b"\xfd" + body + crc.to_bytes(2, "little"))
    assert outcome[0] == dialect.mavlink_map[msg_id].msgname


@given(message=OF_DIALECT, system_id=IDS, component_id=IDS, sequence=IDS)
def test_frames_of_mavlink_2_are_those_of_pymavlink(
    message: Any, system_id: int, component_id: int, sequence: int
) -> None:
    codec, packer = Codec(system_id, component_id), dialect.MAVLink(None, system_id, component_id)
    codec.sequence = packer.seq = sequence
    values = [getattr(message, name) for name in names_of(type(message))]
    values = [value.encode() if isinstance(value, str) else value for value in values]
    raw = dialect.mavlink_map[message_id(type(message).__name__)](*values)
    assert codec.encode(message) == raw.pack(packer)


# Drafts


@pytest.mark.parametrize("draft", DRAFTS, ids=lambda draft: draft.msgname)
def test_drafts_are_as_in_pymavlink_s_dialect_of_drafts(draft: Any) -> None:
    theirs = development.mavlink_map[draft.id]
    assert (draft.msgname, draft.crc_extra) == (theirs.msgname, theirs.crc_extra)
    assert list(draft.ordered_fieldnames) == theirs.ordered_fieldnames
    assert list(draft.array_lengths) == theirs.array_lengths
    assert (draft.native_format, draft.unpacker.format) == (theirs.native_format, theirs.unpacker.format)


@given(message=messages([AVAILABLE_MODES, AVAILABLE_MODES_MONITOR]))
def test_drafts_are_read_by_pymavlink_as_they_were_sent(message: Any) -> None:
    [raw] = development.MAVLink(None).parse_buffer(bytearray(Codec(1, 1).encode(message)))
    values = tuple(getattr(raw, name) for name in names_of(type(message)))
    assert values == astuple(message)


# Reasons


def test_every_reason_has_a_verdict_of_its_own() -> None:
    assert set(BAD_DATA_VERDICTS) == {*Defect, *Refusal}
    assert len(set(BAD_DATA_VERDICTS.values())) == len(BAD_DATA_VERDICTS)


# Other users of pymavlink in the process

UNCHANGED = """
import importlib, pkgutil
from pymavlink.dialects.v20 import ardupilotmega as dialect

def state():
    classes = dialect.MAVLink, dialect.MAVLink_message, dialect.MAVLinkSigning
    return dict(dialect.mavlink_map), dict(vars(dialect)), [dict(vars(cls)) for cls in classes]

before = state()
import mav_handlers
for module in pkgutil.walk_packages(mav_handlers.__path__, "mav_handlers."):
    importlib.import_module(module.name)
import viso.vehicle.vehicle
print(state() == before)
"""


def test_importing_changes_nothing_in_pymavlink() -> None:
    outcome = subprocess.run([sys.executable, "-c", UNCHANGED], capture_output=True, text=True, check=True)
    assert outcome.stdout == "True\n"


def test_other_parsers_take_drafts_for_unknown() -> None:
    frame = Codec(1, 1).encode(AVAILABLE_MODES_MONITOR(7))
    [raw] = dialect.MAVLink(None).parse_buffer(bytearray(frame))
    assert raw.get_type() == "UNKNOWN_437"
    [received] = receive(Codec(1, 1), frame)
    assert isinstance(received, Received)
    assert received.message == AVAILABLE_MODES_MONITOR(7)
