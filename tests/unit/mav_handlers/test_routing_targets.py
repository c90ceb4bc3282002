# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Target fields of frames, against pymavlink's own decoding of every message of the dialect."""

from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect

from mav_handlers.routing import target_fields
from mav_handlers.wire.codec import Codec, Header, Received

CLASSES = sorted(dialect.mavlink_map.values(), key=lambda cls: cls.msgname)


def zero_fields(cls: Any) -> dict[str, Any]:
    lengths = dict(zip(cls.ordered_fieldnames, cls.array_lengths, strict=True))
    kinds = dict(zip(cls.fieldnames, cls.fieldtypes, strict=True))
    return {n: b"" if kinds[n] == "char" else [0] * lengths[n] if lengths[n] else 0 for n in cls.fieldnames}


def received(cls: Any, *, version: int = 2, **values: int) -> Header:
    peer = dialect.MAVLink(None, srcSystem=255, srcComponent=190)
    codec = Codec(1, 1)
    codec.feed(cls(**{**zero_fields(cls), **values}).pack(peer, force_mavlink1=version == 1))
    frame = codec.next_received()
    assert isinstance(frame, Received)
    return frame.header


def test_targets_are_those_that_pymavlink_packed() -> None:
    packed = {"target_system": 21, "target_component": 43}
    expected, found = {}, {}
    for cls in CLASSES:
        present = {name: value for name, value in packed.items() if name in cls.fieldnames}
        expected[cls.msgname] = tuple(present.get(name) for name in packed)
        found[cls.msgname] = target_fields(received(cls, **present))
    assert found == expected


@pytest.mark.parametrize("version", [1, 2])
def test_version_does_not_matter(version: int) -> None:
    header = received(dialect.MAVLink_param_set_message, version=version, target_system=5, target_component=6)
    assert (header.version, target_fields(header)) == (version, (5, 6))


def test_field_that_was_trimmed_is_0() -> None:
    assert target_fields(received(dialect.MAVLink_command_long_message, target_system=5)) == (5, 0)


def test_extension_field_that_the_sender_does_not_know_is_0() -> None:
    header = Header("COMMAND_ACK", 77, 255, 190, 0, 1, bytes((0xFE, 3, 0, 255, 190, 77, 1, 0, 0, 0x99, 0x99)))
    assert target_fields(header) == (0, 0)


def test_message_outside_the_dialect_has_no_targets() -> None:
    assert target_fields(Header("UNKNOWN_60000", 60000, 1, 1, 0, 2, bytes(12))) == (None, None)
