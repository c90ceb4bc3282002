# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Texts for the ground station: the queue, and cutting into chunks.

Source: GCS_MAVLink/GCS.cpp (GCS::send_textv), GCS_MAVLink/GCS_Common.cpp (GCS::service_statustext).
"""

from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Final

from mav_handlers.wire.messages import STATUSTEXT

TEXT_FIELD_LEN: Final = 50
QUEUE_CAPACITY: Final = 30
EXPIRY_US: Final = 5_000_000
MAX_TEXT_LEN: Final = 256


@dataclass(slots=True)
class QueuedText:
    """A text and the channels that still have to get it; None means every channel there is."""

    severity: int
    text: str
    queued_us: int
    channels: set[int] | None
    chunks: tuple[STATUSTEXT, ...] = field(default=())


def chunk_text(severity: int, text: str, text_id: int) -> tuple[STATUSTEXT, ...]:
    """Cut a text into messages; the end is known by a chunk shorter than 50, which may be empty.

    Args:
        severity: MAV_SEVERITY.
        text: at most 256 characters are sent.
        text_id: 1..65535, used when there is more than one chunk.
    """
    text = text[:MAX_TEXT_LEN]
    if len(text) <= TEXT_FIELD_LEN:
        return (STATUSTEXT(severity, text),)
    pieces = [text[i : i + TEXT_FIELD_LEN] for i in range(0, len(text), TEXT_FIELD_LEN)]
    if len(pieces[-1]) == TEXT_FIELD_LEN:
        pieces.append("")
    return tuple(STATUSTEXT(severity, piece, text_id, number) for number, piece in enumerate(pieces))


class StatusTextQueue:
    """Holds texts until the telemetry loop sends them; the oldest is lost when 30 are waiting.

    Args:
        now_us: returns the time since boot.

    Attributes:
        on_text: each is called with severity and text as a text is queued; the vehicle's log listens here.
        listening_channels: tells which links are to get a text that is queued now; None for every link.
    """

    def __init__(self, now_us: Callable[[], int]) -> None:
        self._now_us = now_us
        self.on_text: list[Callable[[int, str], None]] = []
        self._queue: deque[QueuedText] = deque()
        self._next_id = 1
        self.listening_channels: Callable[[], set[int] | None] = lambda: None
        self.overwritten = 0
        self.expired = 0

    def send_text(self, severity: int, text: str) -> None:
        """Queue a text for the links that listen now (GCS::send_textv)."""
        self._queue_text(severity, text, self.listening_channels())

    def send_text_to(self, channel_index: int, severity: int, text: str) -> None:
        """Queue a text for one link (GCS_MAVLINK::send_text)."""
        self._queue_text(severity, text, {channel_index})

    def _queue_text(self, severity: int, text: str, channels: set[int] | None) -> None:
        for listener in self.on_text:
            listener(severity, text)
        if len(self._queue) >= QUEUE_CAPACITY:
            self._queue.popleft()
            self.overwritten += 1
        chunks = chunk_text(severity, text, self._take_id(text))
        self._queue.append(QueuedText(severity, text, self._now_us(), channels, chunks))

    def _take_id(self, text: str) -> int:
        if len(text) <= TEXT_FIELD_LEN:
            return 0
        taken = self._next_id
        self._next_id = self._next_id % 65535 + 1
        return taken

    def discard_expired(self) -> None:
        """Forget texts older than 5 s; the telemetry loop calls this once a second."""
        while self._queue and self._now_us() - self._queue[0].queued_us > EXPIRY_US:
            self._queue.popleft()
            self.expired += 1

    def pending(self) -> Iterator[QueuedText]:
        """Iterate over the texts that wait, oldest first."""
        return iter(tuple(self._queue))

    def done(self, entry: QueuedText) -> None:
        """Take a text off the queue once every channel has it."""
        self._queue.remove(entry)
