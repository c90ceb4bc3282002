# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a recorded stream is, whatever it was recorded as."""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Final

from mav_handlers.wire.codec import MARKER_V1, Codec, Received, message_id
from viso.firmware.flown import FlownVersion

# What is further apart has a damaged stamp.
MAX_GAP_US: Final = 86_400_000_000
_V1: Final = bytes((MARKER_V1,))
LONGEST_SILENCE_US: Final = 60_000_000
"""The middle of a longer silence is passed over."""


class Aspect(Enum):
    """Something that a recording may hold or not."""

    LINK = "how messages crossed a link: MAVLink's version, ids and sequence numbers, labels of frames"
    ARRIVAL = "when messages arrived"
    RESETS = "a reset counter"
    QUALITY = "a quality"
    COVARIANCE = "a covariance"


@dataclass(frozen=True, slots=True)
class StreamMessage:
    """A frame, and when the autopilot handled it in us since boot; None when that is not known."""

    arrival_us: int | None
    frame: bytes


@dataclass(frozen=True, slots=True)
class Stream:
    """A recorded stream.

    ``shared_arrival`` tells that messages with the same arrival time were waiting together, and that one which made no
    record carries its predecessor's time. ``params`` are the vehicle's as far as they were recorded, ``baud`` the rate
    of the UART that delivered the stream, ``notes`` what the recording cannot tell, a line each. ``lacks`` is what of
    its messages was made up, because the recording does not hold it. ``called`` is what it holds instead of messages,
    by the name of the message that was made of it. ``flown`` is the release that flew, if it tells.
    """

    name: str
    messages: tuple[StreamMessage, ...]
    params: Mapping[str, float] = field(default_factory=dict)
    baud: int | None = None
    shared_arrival: bool = False
    notes: tuple[str, ...] = ()
    lacks: frozenset[Aspect] = frozenset()
    flown: FlownVersion | None = None
    called: Mapping[str, str] = field(default_factory=dict)

    @property
    def begins_us(self) -> int:
        """When the first message arrived of which that is known, us since boot; 0 if there is none."""
        return next((one.arrival_us for one in self.messages if one.arrival_us is not None), 0)


def received_in(stream: Stream, names: Collection[str] | None = None) -> Iterator[tuple[int, Received]]:
    """Yield what is in each message of a stream, with the message's number from 0; bytes that are no frame are not.

    To give the ``names`` of the messages that are wanted makes it many times faster.
    """
    wanted = None if names is None else set(map(message_id, names))
    codec = Codec(0, 0)
    for number, message in enumerate(stream.messages):
        if wanted is not None and message_id_of(message.frame) not in wanted:
            continue
        codec.feed(message.frame)
        while (received := codec.next_received()) is not None:
            if isinstance(received, Received):
                yield number, received


def message_id_of(frame: bytes) -> int:
    """Return the id that a frame's header tells, whether the frame is sound or not; -1 if it has none."""
    if frame[:1] == _V1:
        return frame[5] if len(frame) > 5 else -1
    return int.from_bytes(frame[7:10], "little") if len(frame) > 9 else -1


def timed_frames(stream: Stream) -> Iterator[tuple[int, bytes]]:
    """Yield times in us since boot and frames; a time that is not known is taken to be that of the message before."""
    time_us = stream.begins_us
    for message in stream.messages:
        time_us = time_us if message.arrival_us is None else message.arrival_us
        yield time_us, message.frame
