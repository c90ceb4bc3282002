# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The base of udpin, udpout and mcast: a socket that carries one datagram for each frame."""

import socket
from abc import ABC, abstractmethod
from collections.abc import Iterator
from typing import Final

from mav_handlers.links.address import SocketAddress
from mav_handlers.links.base import (
    DROP_BACKLOG_FULL,
    DROP_CLOSED,
    LinkParts,
    check_max_bytes,
    reason_of,
)

MAX_DATAGRAM_BYTES = 65535
READS_PER_CALL = 64
_STX_V1: Final = 0xFE
_STX_V2: Final = 0xFD
_OVERHEAD_V1: Final = 8
_OVERHEAD_V2: Final = 12
_SIGNATURE: Final = 13
_FLAG_SIGNED: Final = 1
_OTHER_BYTES: Final = 256


def datagrams(data: bytes) -> Iterator[bytes]:
    """Yield the bytes in order, frame by frame; other bytes in pieces of at most 256 (AP_HAL/utility/packetise.cpp).

    Some clients read no more than a couple of kilobytes of a datagram.
    """
    start = 0
    while start < len(data):
        end = min(start + _frame_bytes(data, start), len(data))
        yield data[start:end]
        start = end


def _frame_bytes(data: bytes, start: int) -> int:
    marker, left = data[start], len(data) - start
    if marker == _STX_V1 and left >= _OVERHEAD_V1:
        return data[start + 1] + _OVERHEAD_V1
    if marker == _STX_V2 and left >= _OVERHEAD_V2:
        return data[start + 1] + _OVERHEAD_V2 + (_SIGNATURE if data[start + 2] & _FLAG_SIGNED else 0)
    return next(
        (at - start for at in range(start + 1, min(start + _OTHER_BYTES, len(data))) if data[at] in (_STX_V1, _STX_V2)),
        _OTHER_BYTES,
    )


class DatagramLink(LinkParts, ABC):
    """A link of datagrams; the system's socket buffer is the only backlog.

    ``receive`` returns one datagram a call, or the rest of one. ``address`` is the socket's own, with the port that the
    system chose for port 0.
    """

    def __init__(self, name: str, sock: socket.socket) -> None:
        super().__init__(name)
        sock.setblocking(False)
        self.address: SocketAddress = sock.getsockname()
        self._sock = sock
        self._unread = b""
        self._last_sent_bytes = 0

    @abstractmethod
    def _accept(self, peer: SocketAddress, data: bytes) -> bool:
        """Note the sender of a datagram, and return whether to accept it."""

    @abstractmethod
    def _transmit(self, data: bytes) -> None:
        """Send one datagram to every peer."""

    def fileno(self) -> int:
        """Return the socket's descriptor, -1 once it is closed."""
        return self._sock.fileno()

    def receive(self, max_bytes: int = 65536) -> bytes:
        """Return the next datagram, or the next ``max_bytes`` of it."""
        check_max_bytes(max_bytes)
        if not self._unread and not self._closed:
            self._unread = self._next_datagram()
        data, self._unread = self._unread[:max_bytes], self._unread[max_bytes:]
        return data

    def send(self, data: bytes) -> None:
        """Send the bytes, each frame as one datagram, or drop and count them."""
        if self._closed and data:
            self._counters.drop(len(data), DROP_CLOSED)
            return
        for datagram in datagrams(data):
            self._transmit(datagram)

    def close(self) -> None:
        """Close the socket."""
        self._closed = True
        self._unread = b""
        self._sock.close()

    def _next_datagram(self) -> bytes:
        """Read until a datagram has content; the number of reads is bounded, so that nobody blocks the caller."""
        for _ in range(READS_PER_CALL):
            try:
                data, peer = self._sock.recvfrom(MAX_DATAGRAM_BYTES)
            except BlockingIOError:
                return b""
            except ConnectionRefusedError as error:
                self._refused(error)
                continue
            except OSError as error:
                self._counters.drop(0, reason_of(error))
                continue
            if self._accept(peer, data) and data:
                self._counters.bytes_in += len(data)
                return data
        return b""

    def _send_to(self, sock: socket.socket, data: bytes, peer: SocketAddress | None = None) -> None:
        """Send to a peer, or to the connected peer."""
        try:
            _put(sock, data, peer)
        except ConnectionRefusedError as error:
            self._refused(error)
            self._send_again(sock, data, peer)
        except BlockingIOError:
            self._counters.drop(len(data), DROP_BACKLOG_FULL)
        except OSError as error:
            self._counters.drop(len(data), reason_of(error))
            self.news.failed(reason_of(error))
        else:
            self._sent(len(data))

    def _send_again(self, sock: socket.socket, data: bytes, peer: SocketAddress | None) -> None:
        """Repeat a send that failed only because the system reported an earlier datagram's error."""
        try:
            _put(sock, data, peer)
        except OSError as error:
            self._counters.drop(len(data), reason_of(error))
        else:
            self._sent(len(data))

    def _sent(self, size: int) -> None:
        self._counters.bytes_out += size
        self._last_sent_bytes = size

    def _refused(self, error: ConnectionRefusedError) -> None:
        """Count an earlier datagram as lost: the system reports its error with the next call."""
        self._counters.drop(self._last_sent_bytes, reason_of(error))
        self._last_sent_bytes = 0
        self._unanswered(reason_of(error))

    def _unanswered(self, why: str) -> None:
        """Report that nobody listens."""
        self.news.failed(why)


def _put(sock: socket.socket, data: bytes, peer: SocketAddress | None) -> None:
    if peer is None:
        sock.send(data)
    else:
        sock.sendto(data, peer)


def datagram_socket() -> socket.socket:
    """Return an IPv4 UDP socket."""
    return socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
