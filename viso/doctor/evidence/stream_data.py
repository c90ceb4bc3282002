# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What was sent, and what the autopilot made of each message."""

from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

from mav_handlers.handlers import VISION_MESSAGES
from mav_handlers.verdicts import BAD_CRC
from mav_handlers.wire.codec import BadData, Codec, Defect, message_name
from mav_handlers.wire.messages import GPS_INPUT
from viso.doctor.evidence.motion import Motion, motions_of
from viso.doctor.evidence.tracks import (
    HandledMessage,
    Poses,
    Track,
    Velocities,
    pose_tracks,
    stamped_tracks,
    velocity_tracks,
)
from viso.streams.stream import message_id_of, received_in
from viso.streams.stream_kinds import Aspect, Stream

_MAVLINK_1: Final = 0xFE
_IDS_OF_MAVLINK_1, _IDS_OF_MAVLINK_2 = slice(3, 6), slice(5, 10)
_FEWEST_REFUSED: Final = 5


@dataclass(frozen=True, slots=True)
class FrameKind:
    """The frames of one type and sender: how many are sound, and the numbers, from 1, of the refused ones."""

    name: str
    system_id: int
    component_id: int
    sound: int
    refused: list[int]

    @property
    def is_defined_otherwise(self) -> bool:
        """Whether so many failed, and none passed, that the sender must have another definition of it."""
        return not self.sound and len(self.refused) >= _FEWEST_REFUSED


@dataclass(frozen=True, slots=True)
class StreamData:
    """What was sent.

    Attributes:
        name: of the stream.
        messages: all of them, the autopilot's own included, as the autopilot handled them.
        vision: those that carry external navigation.
        tracks: stamped messages of external navigation by sender and type.
        poses, velocities: their contents.
        motions: path and velocities of each sender, side by side.
        end_us: when the stream ends, us since boot.
        lacks: what of the messages was made up, because the recording does not hold it.
        kinds: how many messages there are by name; damaged ones by the name in their header.
        refused: the types and senders of which frames failed their checksum.
        gps_inputs: the messages of companions that act as a GPS.
    """

    name: str
    messages: tuple[HandledMessage, ...]
    vision: tuple[HandledMessage, ...]
    tracks: tuple[Track, ...]
    poses: tuple[Poses, ...]
    velocities: tuple[Velocities, ...]
    motions: tuple[Motion, ...]
    end_us: int
    lacks: frozenset[Aspect] = frozenset()
    kinds: Mapping[str, int] = field(default_factory=dict)
    refused: tuple[FrameKind, ...] = ()
    gps_inputs: tuple[GPS_INPUT, ...] = ()


def stream_data(stream: Stream, messages: tuple[HandledMessage, ...]) -> StreamData:
    """Return a stream's data, with its messages as the autopilot handled them."""
    vision = vision_of(messages)
    poses, velocities = pose_tracks(vision, stream.called), velocity_tracks(vision, stream.called)
    arrivals_us = [message.arrival_us for message in stream.messages[-1:] if message.arrival_us is not None]
    inputs = (message for _, (_, message) in received_in(stream, frozenset({GPS_INPUT.__name__})))
    return StreamData(
        name=stream.name,
        messages=messages,
        vision=vision,
        tracks=stamped_tracks(vision, stream.called),
        poses=poses,
        velocities=velocities,
        motions=motions_of(poses, velocities),
        end_us=messages[-1].arrival_us if messages else max(arrivals_us, default=0),
        lacks=stream.lacks,
        kinds=kinds_in(stream),
        refused=refused_kinds(stream) if any(message.verdict is BAD_CRC for message in messages) else (),
        gps_inputs=tuple(message for message in inputs if isinstance(message, GPS_INPUT)),
    )


def vision_of(messages: Sequence[HandledMessage]) -> tuple[HandledMessage, ...]:
    """Return the messages that carry external navigation."""
    kinds = tuple(VISION_MESSAGES)
    return tuple(message for message in messages if isinstance(message.message, kinds))


def kinds_in(stream: Stream) -> Counter[str]:
    """Return how many messages a stream has of each name; damaged ones count by the name in their header."""
    return Counter(message_name(message_id_of(message.frame)) or "unknown" for message in stream.messages)


def refused_kinds(stream: Stream) -> tuple[FrameKind, ...]:
    """Return the types and senders of which at least one frame failed its checksum.

    Damage hits all types alike; if all frames of one type fail, its sender has another definition of the message.
    """
    codec, number = Codec(0, 0), 0
    refused: defaultdict[tuple[int, int, int], list[int]] = defaultdict(list)
    sound: defaultdict[tuple[int, int, int], int] = defaultdict(int)
    for message in stream.messages:
        codec.feed(message.frame)
        while (received := codec.next_received()) is not None:
            number += 1
            ids = _ids(message.frame)
            if not isinstance(received, BadData):
                sound[ids] += 1
            elif received.reason is Defect.CRC:
                refused[ids].append(number)
    return tuple(
        FrameKind(message_name(ids[0]) or f"message {ids[0]}", ids[1], ids[2], sound[ids], numbers)
        for ids, numbers in refused.items()
    )


def _ids(frame: bytes) -> tuple[int, int, int]:
    """Return the message's id, and the sender's two, from a frame's header; 0 for what is not there."""
    is_mavlink_1 = frame[:1] == bytes((_MAVLINK_1,))
    system_id, component_id, *message_id = frame[_IDS_OF_MAVLINK_1 if is_mavlink_1 else _IDS_OF_MAVLINK_2].ljust(
        5, b"\0"
    )
    return int.from_bytes(bytes(message_id), "little"), system_id, component_id
