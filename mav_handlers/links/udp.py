# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""UDP links: ``udpin:HOST:PORT`` (also ``udp:``), which answers its senders, and ``udpout:HOST:PORT``."""

import time

from mav_handlers.links.address import SocketAddress, parse_host_port, resolve, text_of
from mav_handlers.links.base import DROP_NO_PEER, Monotonic, cannot_open
from mav_handlers.links.datagram import DatagramLink, datagram_socket
from mav_handlers.wire.codec import begins_with_frame

PEER_TIMEOUT_S = 60.0
MAX_PEERS = 16
LIVE_S = 5.0
"""A peer heard within this many seconds keeps its place: clients send a heartbeat every second."""


class UdpInLink(DatagramLink):
    """A bound socket that sends to every peer heard in the last 60 s.

    Several programs may send to the port, as with pymavlink, which by default keeps every peer for ever. A sender
    becomes a peer by a datagram that begins with a valid frame; other datagrams are read as well. A peer that is silent
    for 60 s is dropped until it is heard again. There are at most 16 peers. A new one replaces the peer that has been
    silent for longest, if that is for 5 s or more; otherwise it is sent nothing, and counts in ``open_failures``.

    pymavlink opens a port that is in use; here that is an error, since the system would give all datagrams to one of
    the two programs.
    """

    def __init__(self, name: str, address: SocketAddress, *, monotonic: Monotonic = time.monotonic) -> None:
        sock = datagram_socket()
        try:
            sock.bind(address)
        except OSError as error:
            sock.close()
            raise cannot_open(name, error) from None
        super().__init__(name, sock)
        self._monotonic = monotonic
        self._heard_s: dict[SocketAddress, float] = {}  # the last one heard is the last key

    @property
    def peers(self) -> tuple[SocketAddress, ...]:
        """The addresses that the next datagram goes to, the last one heard at the end."""
        self._forget_silent()
        return tuple(self._heard_s)

    @property
    def peer_names(self) -> tuple[str, ...]:
        """Return the peers' addresses."""
        return tuple(map(text_of, self.peers))

    def _accept(self, peer: SocketAddress, data: bytes) -> bool:
        if self._heard_s.pop(peer, None) is None and not self._introduce(peer, data):
            return True
        self._heard_s[peer] = self._monotonic()
        return True

    def _introduce(self, peer: SocketAddress, data: bytes) -> bool:
        """Return whether a new sender becomes a peer, and make room for it."""
        if not begins_with_frame(data):
            return False
        self._forget_silent()
        if len(self._heard_s) >= MAX_PEERS:
            longest_silent, heard_s = next(iter(self._heard_s.items()))
            if self._monotonic() - heard_s < LIVE_S:
                self._counters.open_failures += 1
                self.news.refused(text_of(peer), f"{MAX_PEERS} are served already")
                return False
            self._forget(longest_silent, "it made room for another")
        self._counters.connects += 1
        self.news.connected(text_of(peer))
        return True

    def _transmit(self, data: bytes) -> None:
        peers = self.peers
        if not peers:
            self._counters.drop(len(data), DROP_NO_PEER)
        for peer in peers:
            self._send_to(self._sock, data, peer)

    def _forget_silent(self) -> None:
        now_s = self._monotonic()
        for peer, heard_s in list(self._heard_s.items()):
            if now_s - heard_s > PEER_TIMEOUT_S:
                self._forget(peer, f"silent for {PEER_TIMEOUT_S:g} s")

    def _forget(self, peer: SocketAddress, why: str) -> None:
        del self._heard_s[peer]
        self._counters.disconnects += 1
        self.news.left(text_of(peer), why)


class UdpOutLink(DatagramLink):
    """A socket that sends to and receives from one address; drops show that nobody listens there."""

    def __init__(self, name: str, address: SocketAddress) -> None:
        sock = datagram_socket()
        try:
            sock.connect(address)
        except OSError as error:
            sock.close()
            raise cannot_open(name, error) from None
        super().__init__(name, sock)
        self._peer = text_of(address)
        self._is_heard = False

    @property
    def peer_names(self) -> tuple[str, ...]:
        """Return the address, from its first datagram until nobody listens there."""
        return (self._peer,) if self._is_heard else ()

    def _accept(self, peer: SocketAddress, data: bytes) -> bool:
        if not self._is_heard:
            self._is_heard = True
            self.news.connected(self._peer)
        return True

    def _unanswered(self, why: str) -> None:
        if self._is_heard:
            self._is_heard = False
            self.news.left(self._peer, why)
        else:
            super()._unanswered(f"nobody listens there ({why})")

    def _transmit(self, data: bytes) -> None:
        self._send_to(self._sock, data)


def open_udpin(name: str, address: str) -> UdpInLink:
    """Open ``udpin:HOST:PORT``. Raises LinkError for a bad address, or one that cannot be bound."""
    return UdpInLink(name, resolve(name, parse_host_port(name, address, any_port=True)))


def open_udpout(name: str, address: str) -> UdpOutLink:
    """Open ``udpout:HOST:PORT``. Raises LinkError for a bad address or an unknown host."""
    return UdpOutLink(name, resolve(name, parse_host_port(name, address)))
