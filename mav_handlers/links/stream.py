# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The base of tcp, tcpin and serial: one byte stream at a time, replaced when it breaks."""

import os
from abc import ABC, abstractmethod

from mav_handlers.links.base import (
    DROP_BACKLOG_FULL,
    DROP_CLOSED,
    DROP_NO_PEER,
    LinkParts,
    check_max_bytes,
    reason_of,
)

MAX_BACKLOG_BYTES = 65536
"""Bytes that a link keeps for a peer that does not read, beyond the system's buffer."""

END_OF_STREAM = "end of stream"


class StreamLink(LinkParts, ABC):
    """A link over one stream with a non-blocking descriptor.

    A subclass opens (``_open_stream``) and closes (``_close_stream``) the streams; every call tries to open one while
    there is none. ``_peer`` names the stream's other end.
    """

    _peer = ""

    def __init__(self, name: str, baud: int | None = None, max_backlog_bytes: int = MAX_BACKLOG_BYTES) -> None:
        super().__init__(name, baud)
        self._max_backlog_bytes = max_backlog_bytes
        self._backlog = bytearray()
        self._fd = -1
        self._write_error: str | None = None

    @abstractmethod
    def _open_stream(self) -> int:
        """Return the descriptor of a new stream, or -1 when there is none yet."""

    @abstractmethod
    def _close_stream(self) -> None:
        """Close the stream."""

    @property
    def peer_names(self) -> tuple[str, ...]:
        """Return the name of the peer, if there is one."""
        return (self._peer,) if self._fd >= 0 else ()

    @property
    def backlog_bytes(self) -> int:
        """The number of bytes in the backlog."""
        return len(self._backlog)

    def fileno(self) -> int:
        """Return the stream's descriptor, -1 while there is none."""
        return self._fd

    def receive(self, max_bytes: int = 65536) -> bytes:
        """Return bytes that have arrived, at most ``max_bytes``; also write more of the backlog."""
        check_max_bytes(max_bytes)
        if not self._connected():
            return b""
        data = self._read(max_bytes)
        self._flush()
        return data

    def send(self, data: bytes) -> None:
        """Send the bytes, or keep them in the backlog, or drop the whole call and count it."""
        if not data:
            return
        if not self._connected():
            self._counters.drop(len(data), DROP_CLOSED if self._closed else DROP_NO_PEER)
            return
        self._flush()
        if self._write_error is not None:
            self._counters.drop(len(data), self._write_error)
        elif len(self._backlog) + len(data) > self._max_backlog_bytes:
            self._counters.drop(len(data), DROP_BACKLOG_FULL)
        else:
            self._backlog += data
            self._flush()

    def close(self) -> None:
        """Close the stream; the rest of the backlog is counted as dropped."""
        if self._fd >= 0:
            self._lose(DROP_CLOSED)
        self._closed = True

    def _connected(self) -> bool:
        """Return whether there is a stream, after trying to get one."""
        if self._fd < 0 and not self._closed:
            self._fd = self._open_stream()
            if self._fd >= 0:
                self._counters.connects += 1
                self.news.connected(self._peer)
        return self._fd >= 0

    def _read(self, max_bytes: int) -> bytes:
        try:
            data = os.read(self._fd, max_bytes)
        except BlockingIOError:
            return b""
        except OSError as error:
            self._lose(reason_of(error))
            return b""
        if not data:
            self._lose(END_OF_STREAM)
        self._counters.bytes_in += len(data)
        return data

    def _flush(self) -> None:
        """Write as much of the backlog as the system takes."""
        try:
            while self._backlog:
                written = os.write(self._fd, self._backlog)
                self._counters.bytes_out += written
                del self._backlog[:written]
        except BlockingIOError:
            return
        except OSError as error:
            # The stream stays open for reading: a peer's last bytes may still wait in front of its end.
            self._write_error = reason_of(error)
            self._drop_backlog(self._write_error)

    def _lose(self, reason: str) -> None:
        self._drop_backlog(reason)
        self._close_stream()
        self._fd = -1
        self._write_error = None
        self._counters.disconnects += 1
        if reason != DROP_CLOSED:
            self.news.left(self._peer, reason)

    def _drop_backlog(self, reason: str) -> None:
        """Drop the whole backlog: the next peer must not receive half a frame."""
        if self._backlog:
            self._counters.drop(len(self._backlog), reason)
            self._backlog.clear()
