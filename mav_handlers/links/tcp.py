# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""TCP links: ``tcp:HOST:PORT``, a client that comes back, and ``tcpin:HOST:PORT``, a server."""

import errno
import select
import socket
import time

from mav_handlers.links.address import SocketAddress, parse_host_port, resolve
from mav_handlers.links.base import cannot_open, is_short_of_descriptors, reason_of
from mav_handlers.links.retry import Backoff, Monotonic
from mav_handlers.links.stream import StreamLink

CONNECT_TIMEOUT_S = 5.0
WAITING_CLIENTS = 5


class TcpLink(StreamLink):
    """Connect to a server, and again whenever that fails or ends, without blocking.

    A server that is not there yet is no error: attempts go on, 0.25 s to 4 s apart, each given up after 5 s.
    """

    def __init__(self, name: str, address: SocketAddress, *, monotonic: Monotonic = time.monotonic) -> None:
        super().__init__(name)
        self._address = address
        self._monotonic = monotonic
        self._backoff = Backoff(monotonic)
        self._give_up_s = 0.0
        self._sock: socket.socket | None = None
        self._connected()

    def close(self) -> None:
        """Close the connection, or give up the attempt to make one."""
        super().close()
        self._close_socket()

    def _open_stream(self) -> int:
        if self._sock is None and self._backoff.due():
            self._begin()
        if self._sock is None or not self._finished(self._sock):
            return -1
        self._backoff.succeeded()
        return self._sock.fileno()

    def _close_stream(self) -> None:
        self._close_socket()
        self._backoff.lost()

    def _begin(self) -> None:
        """Start an attempt; its outcome shows when the socket becomes writable."""
        self._sock = _stream_socket()
        self._give_up_s = self._monotonic() + CONNECT_TIMEOUT_S
        error = self._sock.connect_ex(self._address)
        if error not in (0, errno.EINPROGRESS):
            self._failed(reason_of(OSError(error, "")))

    def _finished(self, sock: socket.socket) -> bool:
        """Tell whether the attempt has worked; if it failed, set the time of the next."""
        if not _writable(sock):
            if self._monotonic() >= self._give_up_s:
                self._failed(f"no answer within {CONNECT_TIMEOUT_S:g} s")
            return False
        error = sock.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
        if error == 0 and is_connected_to_itself(sock):
            error = errno.ECONNREFUSED
        if error != 0:
            self._failed(reason_of(OSError(error, "")))
            return False
        return True

    def _failed(self, why: str) -> None:
        self._close_socket()
        self._counters.open_failures += 1
        self._counters.open_failure = why
        self._backoff.failed()

    def _close_socket(self) -> None:
        if self._sock is not None:
            self._sock.close()
            self._sock = None


class TcpServerLink(StreamLink):
    """Listen, and serve one client at a time, as a TCP port of the firmware's simulator does.

    Others wait in the system's queue; the next is accepted when the present one goes. ``address``
    tells where it listens, and so what the system chose for port 0.
    """

    def __init__(self, name: str, address: SocketAddress) -> None:
        super().__init__(name)
        self._client: socket.socket | None = None
        self._listener = _stream_socket()
        try:
            # A restart need not wait for old connections to expire. A port that somebody listens on stays
            # an error.
            self._listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            self._listener.bind(address)
            self._listener.listen(WAITING_CLIENTS)
        except OSError as error:
            self._listener.close()
            raise cannot_open(name, error) from None
        self.address: SocketAddress = self._listener.getsockname()

    def fileno(self) -> int:
        """Return the client's descriptor, or the listener's while there is no client."""
        return self._fd if self._fd >= 0 else self._listener.fileno()

    def close(self) -> None:
        """Close the client's connection and stop listening."""
        super().close()
        self._listener.close()

    def _open_stream(self) -> int:
        try:
            self._client, _ = self._listener.accept()
        except BlockingIOError:
            return -1
        except OSError:  # the client has gone already, or the process is out of descriptors
            self._counters.open_failures += 1
            return -1
        if is_short_of_descriptors(self._client.fileno()):
            self._client.close()
            self._client = None
            self._counters.open_failures += 1
            return -1
        _configure(self._client)
        self._client.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        return self._client.fileno()

    def _close_stream(self) -> None:
        assert self._client is not None
        self._client.close()
        self._client = None


def is_connected_to_itself(sock: socket.socket) -> bool:
    """Tell whether both ends are one socket.

    That happens when nobody listens on a port from which the system also takes a client's own.
    """
    try:
        return bool(sock.getsockname() == sock.getpeername())
    except OSError:
        return False  # gone again; reading will say so


def open_tcp(name: str, address: str) -> TcpLink:
    """Open ``tcp:HOST:PORT``. Raises LinkError for a bad address or an unknown host."""
    return TcpLink(name, resolve(name, parse_host_port(name, address)))


def open_tcpin(name: str, address: str) -> TcpServerLink:
    """Open ``tcpin:HOST:PORT``. Raises LinkError for a bad address, or one that cannot be listened on."""
    return TcpServerLink(name, resolve(name, parse_host_port(name, address, any_port=True)))


def _stream_socket() -> socket.socket:
    sock = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    _configure(sock)
    return sock


def _configure(sock: socket.socket) -> None:
    sock.setblocking(False)
    sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)


def _writable(sock: socket.socket) -> bool:
    poller = select.poll()
    poller.register(sock, select.POLLOUT)
    return bool(poller.poll(0))
