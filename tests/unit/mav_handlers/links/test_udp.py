# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""UDP: whom ``udpin`` answers, and what ``udpout`` learns of its peer."""

import errno
import socket
from collections.abc import Callable, Iterator

import pytest

from mav_handlers.links import Link, LinkError, open_link, wait_readable
from mav_handlers.links.udp import LIVE_S, MAX_PEERS, UdpInLink, UdpOutLink
from mav_handlers.wire.codec import Codec
from mav_handlers.wire.messages import HEARTBEAT

Collect = Callable[[Link, int], bytes]
Until = Callable[[Callable[[], bool], Link], None]
HELLO = Codec(1, 197).encode(HEARTBEAT(18, 8, 0, 0, 4, 3))


class Clock:
    now_s = 10.0

    def __call__(self) -> float:
        return self.now_s


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def server(clock: Clock) -> Iterator[UdpInLink]:
    link = UdpInLink("udpin:0", ("127.0.0.1", 0), monotonic=clock)
    yield link
    link.close()


@pytest.fixture
def clients(server: UdpInLink) -> Iterator[list[socket.socket]]:
    made = [_client(server) for _ in range(MAX_PEERS + 1)]
    yield made
    for client in made:
        client.close()


def _client(server: UdpInLink) -> socket.socket:
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sock.settimeout(5)
    sock.connect(("127.0.0.1", server.address[1]))
    return sock


class TestServer:
    def test_port_in_use_is_an_error_in_one_line(self, server: UdpInLink) -> None:
        name = f"udpin:127.0.0.1:{server.address[1]}"
        with pytest.raises(LinkError) as caught:
            open_link(name)
        assert str(caught.value) == f"cannot open {name}: address already in use"

    def test_send_before_anyone_was_heard_is_counted(self, server: UdpInLink) -> None:
        server.send(b"hello")
        assert server.stats.drop_reasons == {"no peer": 1}

    def test_every_peer_heard_lately_gets_the_data(
        self, server: UdpInLink, clients: list[socket.socket], collect: Collect
    ) -> None:
        for client in clients[:3]:
            client.send(HELLO)
            collect(server, len(HELLO))
        server.send(b"for all")
        assert [client.recv(100) for client in clients[:3]] == [b"for all"] * 3

    def test_peer_silent_for_60_s_is_kept_and_forgotten_after_that(
        self, server: UdpInLink, clock: Clock, clients: list[socket.socket], collect: Collect
    ) -> None:
        clients[0].send(HELLO)
        collect(server, len(HELLO))
        clock.now_s += 60.0
        clients[1].send(HELLO)
        collect(server, len(HELLO))
        kept = server.peers
        clock.now_s += 0.001
        assert [*kept] == [clients[0].getsockname(), clients[1].getsockname()]
        assert [*server.peers] == [clients[1].getsockname()]
        assert (server.stats.connects, server.stats.disconnects) == (2, 1)

    def test_last_peer_heard_is_forgotten_like_any_other(
        self, server: UdpInLink, clock: Clock, clients: list[socket.socket], collect: Collect
    ) -> None:
        clients[0].send(HELLO)
        collect(server, len(HELLO))
        clock.now_s += 60.001
        server.send(b"still there?")
        assert (server.peers, server.stats.drop_reasons) == ((), {"no peer": 1})

    @pytest.mark.parametrize("junk", [b"x", HELLO[:-1], HELLO[:-1] + b"x", b"x" + HELLO, b"\xfd" + bytes(30)])
    def test_sender_of_junk_is_no_peer_and_is_heard(
        self, server: UdpInLink, clients: list[socket.socket], collect: Collect, junk: bytes
    ) -> None:
        clients[0].send(junk)
        assert collect(server, len(junk)) == junk
        assert (server.peers, server.stats.connects) == ((), 0)

    def test_peer_may_send_what_it_likes_once_it_is_known(
        self, server: UdpInLink, clients: list[socket.socket], collect: Collect
    ) -> None:
        clients[0].send(HELLO)
        clients[0].send(b"x")
        collect(server, len(HELLO) + 1)
        assert server.peers == (clients[0].getsockname(),)

    def test_newcomer_does_not_push_out_a_live_peer(
        self, server: UdpInLink, clock: Clock, clients: list[socket.socket], collect: Collect
    ) -> None:
        for client in clients[:-1]:
            client.send(HELLO)
            collect(server, len(HELLO))
        clock.now_s += LIVE_S - 0.001
        clients[-1].send(HELLO)
        collect(server, len(HELLO))
        assert set(server.peers) == {client.getsockname() for client in clients[:-1]}
        assert server.stats.open_failures == 1

    def test_newcomer_takes_the_place_of_the_longest_silent_peer(
        self, server: UdpInLink, clock: Clock, clients: list[socket.socket], collect: Collect
    ) -> None:
        for client in (*clients[:-1], clients[0]):
            client.send(HELLO)
            collect(server, len(HELLO))
        clock.now_s += LIVE_S
        clients[-1].send(HELLO)
        collect(server, len(HELLO))
        assert len(server.peers) == MAX_PEERS
        assert clients[1].getsockname() not in server.peers
        assert clients[0].getsockname() in server.peers

    def test_datagrams_are_returned_one_at_a_time(
        self, server: UdpInLink, clients: list[socket.socket], until: Until
    ) -> None:
        clients[0].send(b"one")
        clients[0].send(b"two")
        got: list[bytes] = []

        def both() -> bool:
            got.extend(filter(None, [server.receive()]))
            return len(got) == 2

        until(both, server)
        assert got == [b"one", b"two"]

    def test_empty_datagram_introduces_nobody_and_hides_nothing(
        self, server: UdpInLink, clients: list[socket.socket], collect: Collect
    ) -> None:
        clients[0].send(b"")
        clients[1].send(b"data")
        assert collect(server, 4) == b"data"
        assert server.stats.connects == 0


class TestClient:
    def test_refused_datagram_is_counted_with_its_size(self, server: UdpInLink, until: Until) -> None:
        link = open_link(f"udpout:127.0.0.1:{server.address[1]}")
        server.close()
        link.send(b"12345")
        until(lambda: link.receive() == b"" and link.stats.bytes_dropped == 5, link)
        assert link.stats.drop_reasons == {"connection refused": 1}
        link.close()

    def test_report_about_one_datagram_does_not_cost_the_next(
        self, server: UdpInLink, until: Until, collect: Collect
    ) -> None:
        port = server.address[1]
        link = open_link(f"udpout:127.0.0.1:{port}")
        server.close()
        link.send(b"lost")
        again = UdpInLink("udpin:x", ("127.0.0.1", port))
        link.send(b"arrives")
        assert collect(again, 7) == b"arrives"
        assert link.stats.bytes_dropped == 4
        link.close()
        again.close()

    def test_stranger_is_not_heard(self, server: UdpInLink, clients: list[socket.socket], collect: Collect) -> None:
        link = open_link(f"udpout:127.0.0.1:{server.address[1]}")
        assert isinstance(link, UdpOutLink)
        link.send(HELLO)
        collect(server, len(HELLO))
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
            stranger.sendto(b"intruder", ("127.0.0.1", link.address[1]))
        server.send(b"friend")
        assert collect(link, 6) == b"friend"
        link.close()

    def test_each_frame_is_a_datagram(self, server: UdpInLink) -> None:
        link = open_link(f"udpout:127.0.0.1:{server.address[1]}")
        frame = Codec(1, 1).encode(HEARTBEAT(2, 3, 81, 0, 3, 3))
        link.send(frame * 3)
        wait_readable([server], 5)
        assert [server.receive() for _ in range(4)] == [frame, frame, frame, b""]
        link.close()

    def test_broadcast_address_is_an_error_in_one_line(self) -> None:
        with pytest.raises(LinkError, match=r"\Acannot open udpout:255\.255\.255\.255:9: [^\n]+\Z"):
            open_link("udpout:255.255.255.255:9")


class FailingSocket:
    """A socket whose calls fail in a given order, then find nothing to do."""

    def __init__(self, *errors: int) -> None:
        self.errors = list(errors)

    def _fail(self) -> None:
        code = self.errors.pop(0) if self.errors else errno.EAGAIN
        raise OSError(code, "")

    def send(self, data: bytes) -> None:
        self._fail()

    def recvfrom(self, size: int) -> None:
        self._fail()

    def setblocking(self, flag: bool) -> None: ...
    def close(self) -> None: ...


@pytest.fixture
def failing(server: UdpInLink, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., Link]]:
    real = UdpOutLink("udpout:x", ("127.0.0.1", server.address[1]))

    def make(*errors: int) -> Link:
        monkeypatch.setattr(real, "_sock", FailingSocket(*errors))
        return real

    yield make
    monkeypatch.undo()
    real.close()


class TestSystemErrors:
    def test_full_socket_buffer_drops_the_datagram(self, failing: Callable[..., Link]) -> None:
        link = failing(errno.EAGAIN)
        link.send(b"abc")
        assert link.stats.drop_reasons == {"backlog full": 1}

    def test_second_refusal_drops_the_datagram_too(self, failing: Callable[..., Link]) -> None:
        link = failing(errno.ECONNREFUSED, errno.ECONNREFUSED)
        link.send(b"abc")
        assert link.stats.drop_reasons == {"connection refused": 2}
        assert link.stats.bytes_dropped == 3

    def test_failed_read_is_counted_and_reading_goes_on(self, failing: Callable[..., Link]) -> None:
        link = failing(errno.ENETDOWN)
        assert link.receive() == b""
        assert link.stats.drop_reasons == {"network is down": 1}

    def test_error_that_stays_does_not_hold_the_caller(self, failing: Callable[..., Link]) -> None:
        link = failing(*[errno.ENETDOWN] * 1000)
        assert link.receive() == b""
