# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""TCP links: ``tcp:HOST:PORT``, a client that reconnects, and ``tcpin:HOST:PORT``, a server."""

import errno
import select
import socket
import time

from mav_handlers.links.address import SocketAddress, parse_host_port, resolve, text_of
from mav_handlers.links.base import Backoff, Link, Monotonic, News, cannot_open, is_short_of_descriptors, reason_of
from mav_handlers.links.stream import StreamLink

CONNECT_TIMEOUT_S = 5.0
WAITING_CLIENTS = 5
MAX_CLIENTS = 8
"""The clients that a server serves at once; further ones are refused."""


class TcpLink(StreamLink):
    """A client that connects to a server, and reconnects after a failure or loss, without blocking.

    An absent server is no error: attempts repeat, 0.25 s to 4 s apart, each with a timeout of 5 s.
    """

    def __init__(self, name: str, address: SocketAddress, *, monotonic: Monotonic = time.monotonic) -> None:
        super().__init__(name)
        self._address = address
        self._peer = text_of(address)
        self._monotonic = monotonic
        self._backoff = Backoff(monotonic)
        self._give_up_s = 0.0
        self._sock: socket.socket | None = None
        self._connected()

    def close(self) -> None:
        """Close the connection, or abandon the attempt."""
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
        """Start an attempt; it has an outcome when the socket becomes writable."""
        self._sock = _stream_socket()
        self._give_up_s = self._monotonic() + CONNECT_TIMEOUT_S
        error = self._sock.connect_ex(self._address)
        if error not in (0, errno.EINPROGRESS):
            self._failed(reason_of(OSError(error, "")))

    def _finished(self, sock: socket.socket) -> bool:
        """Return whether the attempt has succeeded; if it failed, set the time of the next."""
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
        self.news.failed(why)
        self._backoff.failed()

    def _close_socket(self) -> None:
        if self._sock is not None:
            self._sock.close()
            self._sock = None


class TcpServerLink(StreamLink):
    """A server and the link of one client at a time, like a TCP port of the firmware's simulator.

    ``admit`` accepts up to 7 further clients, each with a link of its own. Without it they wait in the system's queue,
    and the next is accepted when the present one leaves. ``address`` is the listening address, with the port that the
    system chose for port 0.
    """

    def __init__(self, name: str, address: SocketAddress) -> None:
        super().__init__(name)
        self._client: socket.socket | None = None
        self._others: dict[int, TcpClientLink] = {}
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

    @property
    def peer_names(self) -> tuple[str, ...]:
        """Return the addresses of all clients."""
        own = super().peer_names
        return (*own, *(name for link in self._others.values() for name in link.peer_names))

    def admit(self) -> Link | None:
        """Return a link for a waiting further client; its name is this link's with a number from 2 on."""
        if self._closed or not self._connected():
            return None
        self._others = {number: link for number, link in self._others.items() if link.peer_names}
        number = next((number for number in range(2, MAX_CLIENTS + 1) if number not in self._others), None)
        sock = self._accept()
        while sock is not None and number is None:
            self._turn_away(sock, f"{MAX_CLIENTS} are served already")
            sock = self._accept()
        if sock is None or number is None:
            return None
        self._others[number] = link = TcpClientLink(self.name, number, sock, self.news)
        return link

    def fileno(self) -> int:
        """Return the client's descriptor, or the listener's while there is no client."""
        return self._fd if self._fd >= 0 else self._listener.fileno()

    def close(self) -> None:
        """Close the clients' connections and stop listening."""
        super().close()
        for link in self._others.values():
            link.close()
        self._listener.close()

    def _open_stream(self) -> int:
        self._client = self._accept()
        if self._client is None:
            return -1
        self._peer = _peer_of(self._client)
        return self._client.fileno()

    def _accept(self) -> socket.socket | None:
        """Return the connection of a waiting client, if there is room for it."""
        try:
            sock, _ = self._listener.accept()
        except BlockingIOError:
            return None
        except OSError:  # the client has left already, or the process is out of descriptors
            self._counters.open_failures += 1
            return None
        if is_short_of_descriptors(sock.fileno()):
            self._turn_away(sock, "too many files are open")
            return None
        _configure(sock)
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        return sock

    def _turn_away(self, sock: socket.socket, why: str) -> None:
        self.news.refused(_peer_of(sock), why)
        sock.close()
        self._counters.open_failures += 1

    def _close_stream(self) -> None:
        assert self._client is not None
        self._client.close()
        self._client = None


class TcpClientLink(StreamLink):
    """The link of a server's further client; it ends when the client leaves."""

    def __init__(self, server: str, number: int, sock: socket.socket, news: News) -> None:
        super().__init__(f"{server}#{number}")
        self.news = news
        self._peer = f"{_peer_of(sock)} (#{number})"
        self._sock: socket.socket | None = sock
        self._connected()

    def _open_stream(self) -> int:
        return -1 if self._sock is None else self._sock.fileno()

    def _close_stream(self) -> None:
        assert self._sock is not None
        self._sock.close()
        self._sock = None


def is_connected_to_itself(sock: socket.socket) -> bool:
    """Return whether a socket is connected to itself.

    That happens when nobody listens on a port of the system's range for clients, and the client gets that very port.
    """
    try:
        return bool(sock.getsockname() == sock.getpeername())
    except OSError:
        return False  # disconnected again; reading reports it


def open_tcp(name: str, address: str) -> TcpLink:
    """Open ``tcp:HOST:PORT``. Raises LinkError for a bad address or an unknown host."""
    return TcpLink(name, resolve(name, parse_host_port(name, address)))


def open_tcpin(name: str, address: str) -> TcpServerLink:
    """Open ``tcpin:HOST:PORT``. Raises LinkError for a bad address, or one that cannot be bound."""
    return TcpServerLink(name, resolve(name, parse_host_port(name, address, any_port=True)))


def _peer_of(sock: socket.socket) -> str:
    try:
        return text_of(sock.getpeername())
    except OSError:
        return "somebody"  # disconnected again


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
