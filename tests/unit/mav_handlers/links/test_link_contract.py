# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What holds for every link, over real loopback sockets and a pseudo-terminal."""

import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Protocol

import pytest

from mav_handlers.links import Link, make_pair, open_link
from mav_handlers.links.mcast import McastLink
from mav_handlers.links.serial_port import SerialLink
from mav_handlers.links.tcp import TcpServerLink
from mav_handlers.links.udp import UdpInLink
from mav_handlers.wire.codec import Codec
from mav_handlers.wire.messages import HEARTBEAT

Collect = Callable[[Link, int], bytes]
Until = Callable[[Callable[[], bool], Link], None]


class Peer(Protocol):
    """The other end, as far as these tests use it."""

    def receive(self, max_bytes: int = 65536) -> bytes: ...
    def send(self, data: bytes) -> None: ...
    def close(self) -> None: ...


class PtyPeer:
    """The master side of a pseudo-terminal."""

    def __init__(self, master: int) -> None:
        self._master = master
        os.set_blocking(master, False)

    def receive(self, max_bytes: int = 65536) -> bytes:
        try:
            return os.read(self._master, max_bytes)
        except BlockingIOError:
            return b""

    def send(self, data: bytes) -> None:
        os.write(self._master, data)

    def close(self) -> None:
        if self._master >= 0:
            os.close(self._master)
            self._master = -1


@dataclass
class Wire:
    """A link under test, connected to a peer."""

    link: Link
    peer: Peer


def _udpin() -> Wire:
    link = UdpInLink("udpin:0", ("127.0.0.1", 0))
    return Wire(link, open_link(f"udpout:127.0.0.1:{link.address[1]}"))


def _udpout() -> Wire:
    server = UdpInLink("udpin:0", ("127.0.0.1", 0))
    return Wire(open_link(f"udpout:127.0.0.1:{server.address[1]}"), server)


def _tcp() -> Wire:
    server = TcpServerLink("tcpin:0", ("127.0.0.1", 0))
    return Wire(open_link(f"tcp:127.0.0.1:{server.address[1]}"), server)


def _tcpin() -> Wire:
    link = TcpServerLink("tcpin:0", ("127.0.0.1", 0))
    return Wire(link, open_link(f"tcp:127.0.0.1:{link.address[1]}"))


def _mcast(group: tuple[str, int]) -> Wire:
    first, second = (McastLink("mcast:", group, "127.0.0.1") for _ in range(2))
    return Wire(first, second)


def _serial() -> Wire:
    master, slave = os.openpty()
    link = SerialLink("pty", os.ttyname(slave), 57600)
    os.close(slave)
    return Wire(link, PtyPeer(master))


def _pair() -> Wire:
    return Wire(*make_pair())


WIRES = {
    "udpin": _udpin,
    "udpout": _udpout,
    "tcp": _tcp,
    "tcpin": _tcpin,
    "serial": _serial,
    "pair": _pair,
}
HELLO = Codec(1, 197).encode(HEARTBEAT(18, 8, 0, 0, 4, 3))  # without which nobody is a peer of udpin
NEVER_KNOW_OF_A_DEAD_PEER = {"udpin", "mcast"}  # sockets without connection get no report


@pytest.fixture(params=[*WIRES, "mcast"])
def scheme(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def wire(scheme: str, group: tuple[str, int], until: Until) -> Iterator[Wire]:
    made = _mcast(group) if scheme == "mcast" else WIRES[scheme]()
    got = {"link": b"", "peer": b""}

    def greeted() -> bool:
        if not got["link"]:
            made.peer.send(HELLO)
        if not got["peer"]:
            made.link.send(HELLO)
        got["link"] += made.link.receive()
        got["peer"] += made.peer.receive()
        return bool(got["link"] and got["peer"])

    until(greeted, made.link)
    _drain(made)
    yield made
    made.link.close()
    made.peer.close()


def _drain(wire: Wire) -> None:
    while wire.link.receive() or wire.peer.receive():
        pass


class TestEveryLink:
    def test_bytes_arrive_in_order(self, wire: Wire, collect: Collect) -> None:
        pieces = [bytes([number]) * 20 for number in range(30)]
        for piece in pieces:
            wire.peer.send(piece)
        assert collect(wire.link, 600) == b"".join(pieces)

    def test_bytes_leave_in_order(self, wire: Wire, until: Until) -> None:
        pieces = [bytes([number]) * 20 for number in range(30)]
        for piece in pieces:
            wire.link.send(piece)
        got = bytearray()

        def complete() -> bool:
            got.extend(wire.peer.receive())
            return len(got) >= 600

        until(complete, wire.link)
        assert bytes(got) == b"".join(pieces)

    def test_no_value_of_a_byte_is_special(self, wire: Wire, collect: Collect) -> None:
        wire.peer.send(bytes(range(256)))
        assert collect(wire.link, 256) == bytes(range(256))

    def test_receive_without_data_returns_at_once_with_nothing(self, wire: Wire) -> None:
        assert wire.link.receive() == b""

    def test_receive_keeps_to_max_bytes_and_loses_nothing(self, wire: Wire, until: Until) -> None:
        wire.peer.send(b"abcdefgh")
        pieces: list[bytes] = []

        def complete() -> bool:
            pieces.append(wire.link.receive(3))
            return sum(map(len, pieces)) >= 8

        until(complete, wire.link)
        assert b"".join(pieces) == b"abcdefgh"
        assert max(map(len, pieces)) == 3

    def test_receive_refuses_to_read_no_bytes(self, wire: Wire) -> None:
        with pytest.raises(ValueError, match="positive"):
            wire.link.receive(0)

    def test_empty_send_is_no_event(self, wire: Wire) -> None:
        before = wire.link.stats
        wire.link.send(b"")
        assert wire.link.stats == before

    def test_stats_count_both_directions(self, wire: Wire, collect: Collect) -> None:
        before = wire.link.stats
        wire.link.send(b"12345")
        wire.peer.send(b"123")
        collect(wire.link, 3)
        after = wire.link.stats
        assert (after.bytes_out - before.bytes_out, after.bytes_in - before.bytes_in) == (5, 3)

    def test_stats_are_a_snapshot(self, wire: Wire) -> None:
        before = wire.link.stats
        wire.link.close()
        wire.link.send(b"x")
        assert before.drop_reasons != wire.link.stats.drop_reasons

    def test_close_is_idempotent(self, wire: Wire) -> None:
        wire.link.close()
        wire.link.close()
        assert wire.link.fileno() == -1

    def test_receive_after_close_returns_nothing(self, wire: Wire) -> None:
        wire.peer.send(b"late")
        wire.link.close()
        assert wire.link.receive() == b""

    def test_send_after_close_is_counted(self, wire: Wire) -> None:
        before = wire.link.stats
        wire.link.close()
        wire.link.send(b"late")
        assert wire.link.stats.bytes_dropped == before.bytes_dropped + 4
        assert wire.link.stats.drop_reasons["link closed"] == 1

    def test_send_to_a_dead_peer_neither_raises_nor_vanishes(self, wire: Wire, scheme: str, until: Until) -> None:
        wire.peer.close()
        before = wire.link.stats.bytes_dropped

        def counted() -> bool:
            wire.link.send(b"anybody?")
            wire.link.receive()
            return scheme in NEVER_KNOW_OF_A_DEAD_PEER or wire.link.stats.bytes_dropped > before

        until(counted, wire.link)

    def test_each_drop_has_a_reason(self, wire: Wire) -> None:
        wire.link.close()
        wire.link.send(b"x")
        assert all(reason and "\n" not in reason for reason in wire.link.stats.drop_reasons)

    def test_only_a_serial_link_has_a_rate(self, wire: Wire, scheme: str) -> None:
        assert wire.link.baud == (57600 if scheme == "serial" else None)
