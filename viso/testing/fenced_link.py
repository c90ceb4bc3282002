# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A UDP port that knows when it has read everything that was sent to it so far, without waiting for anything else."""

from collections.abc import Iterator
from typing import Final

from mav_handlers.links import wait_readable
from mav_handlers.links.address import SocketAddress
from mav_handlers.links.datagram import datagram_socket
from mav_handlers.links.udp import UdpInLink

ATTEMPTS: Final = 20
ATTEMPT_S: Final = 0.25
MOST_WAITING: Final = 1000
"""How many datagrams are taken at a time; whoever sends faster than they are read must not stop everything else."""


class FencedUdpLink(UdpInLink):
    """A UDP port of its own on loopback, whose ``receive_all`` ends with what was sent before the call.

    It sends an empty datagram to itself and reads until that comes: the system hands them over in order. Raises
    LinkError if the system gives no port.
    """

    def __init__(self) -> None:
        # Before the port is open it may hear of a stranger.
        self._fence_address: SocketAddress | None = None
        self._is_fence_read = False
        super().__init__("udpin:127.0.0.1:0", ("127.0.0.1", 0))
        self._fence = datagram_socket()
        self._fence.connect(self.address)
        self._fence_address = self._fence.getsockname()

    def receive_all(self) -> Iterator[bytes]:
        """Yield the datagrams that were sent so far. Raises OSError if loopback does not carry datagrams."""
        # First of all room is made, so that the fence is not lost.
        yield from self.receive_waiting()
        for _ in range(ATTEMPTS):
            self._fence.send(b"")
            yield from self.receive_waiting()
            if self._is_fence_read:
                return
            wait_readable([self], ATTEMPT_S)
            yield from self.receive_waiting()
            if self._is_fence_read:
                return
        raise OSError(f"a datagram to {self.address[0]}:{self.address[1]} does not arrive")

    def receive_waiting(self) -> Iterator[bytes]:
        """Yield the datagrams that wait now, up to the fence, and no more of them than the system may have kept."""
        self._is_fence_read = False
        for _ in range(MOST_WAITING):
            data = self.receive()
            if not data:
                return
            yield data
            if self._is_fence_read:
                return

    def close(self) -> None:
        """Close both sockets."""
        super().close()
        self._fence.close()

    def _accept(self, peer: SocketAddress, data: bytes) -> bool:
        if peer == self._fence_address:
            self._is_fence_read = True
            return False
        return super()._accept(peer, data)
