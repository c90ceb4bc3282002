# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Two links back to back in memory: no system calls, no clock, deterministic."""

from mav_handlers.links.base import DROP_BACKLOG_FULL, DROP_CLOSED, DROP_NO_PEER, LinkParts, check_max_bytes

CAPACITY_BYTES = 65536


class PairLink(LinkParts):
    """One end of a pair; ``make_pair`` makes both. Not for use by several threads.

    Bytes that the other end has not read yet are kept up to a capacity. Those sent before an end is closed
    can still be read at the other.
    """

    def __init__(self, name: str, capacity_bytes: int = CAPACITY_BYTES) -> None:
        super().__init__(name)
        self._capacity_bytes = capacity_bytes
        self._inbox = bytearray()
        self._peer: PairLink | None = None

    @property
    def peer_names(self) -> tuple[str, ...]:
        """Return the name of the other end, while it is open."""
        return () if self._peer is None else (self._peer.name,)

    def fileno(self) -> int:
        """Return -1: there is nothing to wait on."""
        return -1

    def receive(self, max_bytes: int = 65536) -> bytes:
        """Return what the other end has sent, at most ``max_bytes``."""
        check_max_bytes(max_bytes)
        data = bytes(self._inbox[:max_bytes])
        del self._inbox[:max_bytes]
        self._counters.bytes_in += len(data)
        return data

    def send(self, data: bytes) -> None:
        """Pass the bytes to the other end, or drop the whole call and count it."""
        if not data:
            return
        if self._peer is None:
            self._counters.drop(len(data), DROP_CLOSED if self._closed else DROP_NO_PEER)
        elif len(self._peer._inbox) + len(data) > self._capacity_bytes:
            self._counters.drop(len(data), DROP_BACKLOG_FULL)
        else:
            self._peer._inbox += data
            self._counters.bytes_out += len(data)

    def close(self) -> None:
        """Close this end; the other end then has no peer."""
        self._closed = True
        self._inbox.clear()
        if self._peer is not None:
            self._peer._leave()
            self._leave()

    def _join(self, peer: "PairLink") -> None:
        self._peer = peer
        self._counters.connects += 1

    def _leave(self) -> None:
        self._peer = None
        self._counters.disconnects += 1


def make_pair(
    names: tuple[str, str] = ("pair:a", "pair:b"), capacity_bytes: int = CAPACITY_BYTES
) -> tuple[PairLink, PairLink]:
    """Return two links, each of which receives what the other sends."""
    left, right = (PairLink(name, capacity_bytes) for name in names)
    left._join(right)
    right._join(left)
    return left, right
