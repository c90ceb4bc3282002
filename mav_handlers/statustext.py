# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Texts for the ground station: chunks and their queue.

Source: GCS_MAVLink/GCS_Common.cpp (GCS::send_textv, GCS::service_statustext, StatusTextQueue::prune).
"""

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

from mav_handlers.channel import Channel
from mav_handlers.wire.messages import STATUSTEXT

TEXT_FIELD_LEN: Final = 50
QUEUE_CAPACITY: Final = 30
EXPIRY_US: Final = 5_000_000
PRUNE_PERIOD_US: Final = 1_000_000
MAX_TEXT_LEN: Final = 256


@dataclass(slots=True)
class QueuedChunk:
    """A chunk of a text and the links that still have to get it; None means all links."""

    message: STATUSTEXT
    queued_us: int
    channels: set[int] | None


def chunk_text(severity: int, text: str, text_id: int) -> tuple[STATUSTEXT, ...]:
    """Cut a text into messages; a chunk shorter than 50, possibly empty, marks the end.

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
    """Holds texts until the telemetry loop sends them; a new chunk replaces the oldest when 30 are waiting.

    Args:
        now_us: returns the time since boot.

    Attributes:
        on_text: called with severity and text when a text has been queued, for instance by the vehicle's log.
        listening_channels: returns the links that get a text queued now; None for all links.
        overwritten: chunks lost to newer ones.
        expired: chunks lost because they waited for more than 5 s.
    """

    def __init__(self, now_us: Callable[[], int]) -> None:
        self._now_us = now_us
        self.on_text: list[Callable[[int, str], None]] = []
        self._queue: deque[QueuedChunk] = deque()
        self._next_id = 1
        self._pruned_us = 0
        self.listening_channels: Callable[[], set[int] | None] = lambda: None
        self.overwritten = 0
        self.expired = 0

    def send_text(self, severity: int, text: str) -> None:
        """Queue a text for the links that listen now (GCS::send_textv)."""
        self._queue_text(severity, text, self.listening_channels())

    def send_text_to(self, channel_index: int, severity: int, text: str) -> None:
        """Queue a text for one link, if it listens (GCS_MAVLINK::send_text)."""
        listening = self.listening_channels()
        self._queue_text(severity, text, {channel_index} if listening is None else {channel_index} & listening)

    def _queue_text(self, severity: int, text: str, channels: set[int] | None) -> None:
        if channels is None or channels:
            for message in chunk_text(severity, text, self._take_id(text)):
                self._push(QueuedChunk(message, self._now_us(), None if channels is None else set(channels)))
        for listener in self.on_text:
            listener(severity, text)

    def _push(self, chunk: QueuedChunk) -> None:
        if len(self._queue) >= QUEUE_CAPACITY:
            self._queue.popleft()
            self.overwritten += 1
        self._queue.append(chunk)

    def _take_id(self, text: str) -> int:
        if len(text) <= TEXT_FIELD_LEN:
            return 0
        taken = self._next_id
        self._next_id = self._next_id % 65535 + 1
        return taken

    @property
    def is_empty(self) -> bool:
        """Return whether no chunk waits."""
        return not self._queue

    def pending(self) -> tuple[QueuedChunk, ...]:
        """Return the chunks that wait, oldest first."""
        return tuple(self._queue)

    def service(self, channels: Sequence[Channel]) -> None:
        """Send each link as many chunks as fit, and once a second drop chunks that have waited for more than 5 s."""
        if not self._queue:
            return
        for chunk in self._queue:
            if chunk.channels is None:
                chunk.channels = {channel.index for channel in channels}
        for channel in channels:
            self._service_channel(channel)
        self._queue = deque(chunk for chunk in self._queue if chunk.channels)
        self._prune()

    def _service_channel(self, channel: Channel) -> None:
        for chunk in self._queue:
            if chunk.channels and channel.index in chunk.channels:
                if not channel.has_space_for(STATUSTEXT, self._now_us()):
                    return
                channel.send(chunk.message)
                chunk.channels = chunk.channels - {channel.index}

    def _prune(self) -> None:
        now_us = self._now_us()
        if now_us - self._pruned_us < PRUNE_PERIOD_US:
            return
        self._pruned_us = now_us
        while self._queue and now_us - self._queue[0].queued_us > EXPIRY_US:
            self._queue.popleft()
            self.expired += 1
