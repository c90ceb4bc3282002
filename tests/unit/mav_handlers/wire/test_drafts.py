# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The draft messages are those of pymavlink's dialect of drafts, in description, on the wire and back."""

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import development

from mav_handlers.wire.drafts import draft_messages

DRAFTS = draft_messages(development.MAVLink_message)
MODES, MONITOR = DRAFTS
DESCRIPTION = ("id", "msgname", "fieldnames", "ordered_fieldnames", "fieldtypes", "native_format", "orders", "lengths")
MORE = ("array_lengths", "crc_extra", "instance_field", "instance_offset")
BYTES = st.integers(0, 255)
WORDS = st.integers(0, 2**32 - 1)


def theirs(cls: Any) -> Any:
    return development.mavlink_map[cls.id]


def packed(message: Any) -> bytes:
    return bytes(message.pack(development.MAVLink(None, 1, 1)))


@pytest.mark.parametrize("cls", DRAFTS, ids=lambda cls: cls.__name__)
def test_description_is_the_same(cls: Any) -> None:
    for name in (*DESCRIPTION, *MORE):
        assert getattr(cls, name) == getattr(theirs(cls), name)
    assert cls.unpacker.format == theirs(cls).unpacker.format


@given(st.tuples(BYTES, BYTES, BYTES, WORDS, WORDS, st.binary(max_size=40)))
def test_modes_are_packed_and_kept_the_same(values: tuple[Any, ...]) -> None:
    ours, expected = MODES(*values), theirs(MODES)(*values)
    assert packed(ours) == packed(expected)
    assert ours.to_dict() == expected.to_dict()
    assert packed(MODES(**dict(zip(MODES.fieldnames, values, strict=True)))) == packed(ours)


@given(BYTES)
def test_monitor_is_packed_and_kept_the_same(seq: int) -> None:
    ours, expected = MONITOR(seq), theirs(MONITOR)(seq)
    assert packed(ours) == packed(expected)
    assert ours.to_dict() == expected.to_dict()
