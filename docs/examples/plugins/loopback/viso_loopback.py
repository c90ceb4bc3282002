# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A link that hears what it says, for trying out what a program does with its own messages."""

from mav_handlers.links import Link, LinkFactory, LinkStats, News


class Loopback:
    """Gives back what it is given, in order."""

    def __init__(self, name: str) -> None:
        self.name, self.baud = name, None
        self._bytes, self._open = bytearray(), True
        self.stats, self.news = LinkStats(), News()
        self.peer_names: tuple[str, ...] = ()

    def admit(self) -> None:
        """Return None: nobody else can come."""

    def receive(self, max_bytes: int = 65536) -> bytes:
        """Return the oldest bytes that were sent."""
        data = bytes(self._bytes[:max_bytes])
        del self._bytes[:max_bytes]
        return data

    def send(self, data: bytes) -> None:
        """Keep the bytes."""
        self._bytes += data if self._open else b""

    def fileno(self) -> int:
        """Return -1: there is nothing to wait on."""
        return -1

    def close(self) -> None:
        """Forget all."""
        self._bytes, self._open = bytearray(), False


def open_loopback(connection: str, address: str) -> Link:
    """Return a new one; there is nothing in the address."""
    return Loopback(connection)


LOOPBACK = LinkFactory("loopback:", "hears what it says", open_loopback)
