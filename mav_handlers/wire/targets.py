# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Whom a frame is addressed to, for every message of the dialect."""

from typing import Final

from mav_handlers.wire.codec import Header, target_offsets

_V1_HEADER_BYTES: Final = 6
_V2_HEADER_BYTES: Final = 10
_OFFSETS: Final = target_offsets()
NO_TARGETS: Final = (None, None)
TARGETED: Final = frozenset(msg_id for msg_id, offsets in _OFFSETS.items() if offsets != NO_TARGETS)
"""Ids of the messages that are addressed."""


def target_fields(header: Header) -> tuple[int | None, int | None]:
    """Return target_system and target_component of a frame, each None when its message has no such field.

    A field that the sender left out, as MAVLink 2 does with trailing zeros, is 0.

    Source: GCS_MAVLink/MAVLink_routing.cpp, MAVLink_routing::get_targets.
    """
    if header.message_id not in TARGETED:
        return NO_TARGETS
    system_at, component_at = _OFFSETS[header.message_id]
    start = _V1_HEADER_BYTES if header.version == 1 else _V2_HEADER_BYTES
    payload = header.frame[start : start + header.frame[1]]
    return _byte_at(payload, system_at), _byte_at(payload, component_at)


def _byte_at(payload: bytes, offset: int | None) -> int | None:
    if offset is None:
        return None
    return payload[offset] if offset < len(payload) else 0
