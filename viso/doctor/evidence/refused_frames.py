# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which types of messages fail their checksum, and of whom: damage takes all alike, another definition one type."""

from collections import defaultdict
from dataclasses import dataclass
from typing import Final

from mav_handlers.verdicts import BAD_CRC, bad_data_verdict
from mav_handlers.wire.codec import BadData, Codec, message_name
from viso.streams.stream import Stream

_VERSION_1: Final = 0xFE
_LEAST: Final = 5
_IDS_1, _IDS_2 = slice(3, 6), slice(5, 10)


@dataclass(frozen=True, slots=True)
class FrameKind:
    """The frames of a type from a sender: how many are sound, and the numbers, from 1, of those that were refused."""

    name: str
    system_id: int
    component_id: int
    sound: int
    refused: list[int]

    @property
    def is_defined_otherwise(self) -> bool:
        """Whether so many failed, and none passed, that the sender must have another definition of it."""
        return not self.sound and len(self.refused) >= _LEAST


def refused_kinds(stream: Stream) -> tuple[FrameKind, ...]:
    """Return the types and senders of which at least one frame failed its checksum."""
    codec, number = Codec(0, 0), 0
    kinds: defaultdict[tuple[int, int, int], list[int]] = defaultdict(list)
    sound: defaultdict[tuple[int, int, int], int] = defaultdict(int)
    for message in stream.messages:
        codec.feed(message.frame)
        while (received := codec.next_received()) is not None:
            number += 1
            ids = _ids(message.frame)
            if not isinstance(received, BadData):
                sound[ids] += 1
            elif bad_data_verdict(received.reason) is BAD_CRC:
                kinds[ids].append(number)
    return tuple(
        FrameKind(message_name(ids[0]) or f"message {ids[0]}", ids[1], ids[2], sound[ids], numbers)
        for ids, numbers in kinds.items()
    )


def _ids(frame: bytes) -> tuple[int, int, int]:
    """Return the message's id, and the sender's two, as a frame's header tells them; 0 of what is not there."""
    is_version_1 = frame[:1] == bytes((_VERSION_1,))
    system_id, component_id, *rest = frame[_IDS_1 if is_version_1 else _IDS_2].ljust(5, b"\0")
    return int.from_bytes(bytes(rest), "little"), system_id, component_id
