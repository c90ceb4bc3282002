# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Cuts bytes into frames and what lies between them, and loses none."""

from mav_handlers.wire.codec import Codec


class FrameSplitter:
    """Gives back all the bytes that it is fed, in order: a frame a piece, and what is no frame in pieces of its own."""

    def __init__(self) -> None:
        self._codec = Codec(0, 0)
        self._bytes = bytearray()

    @property
    def unread_bytes(self) -> int:
        """How many bytes wait for the rest of a frame."""
        return len(self._bytes)

    def feed(self, data: bytes) -> list[bytes]:
        """Return the pieces that are whole."""
        self._codec.feed(data)
        self._bytes += data
        pieces = []
        while self._codec.next_received() is not None:
            size = len(self._bytes) - self._codec.unread_bytes
            pieces.append(bytes(self._bytes[:size]))
            del self._bytes[:size]
        return pieces
