# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""TCP: a client that comes back, and a server for one client at a time, or for several."""

import os
import socket
from collections.abc import Callable, Iterator
from contextlib import ExitStack

import pytest

from mav_handlers.links import Link, LinkError, open_link, wait_readable
from mav_handlers.links import tcp as tcp_module
from mav_handlers.links.tcp import MAX_CLIENTS, TcpLink, TcpServerLink, is_connected_to_itself

Collect = Callable[[Link, int], bytes]
Until = Callable[[Callable[[], bool], Link], None]
Admit = Callable[[int], tuple[list[socket.socket], list[Link]]]


class Clock:
    now_s = 10.0

    def __call__(self) -> float:
        return self.now_s


@pytest.fixture
def server() -> Iterator[TcpServerLink]:
    link = TcpServerLink("tcpin:0", ("127.0.0.1", 0))
    yield link
    link.close()


def connect(server: TcpServerLink) -> socket.socket:
    return socket.create_connection(("127.0.0.1", server.address[1]), timeout=5)


@pytest.fixture
def unserved_port() -> Iterator[int]:
    """Return a port that nobody listens on, kept from others but not from a server of this test."""
    with socket.socket() as holder:
        holder.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        holder.bind(("127.0.0.1", 0))
        yield int(holder.getsockname()[1])


class TestServer:
    def test_port_in_use_is_an_error_in_one_line(self, server: TcpServerLink) -> None:
        name = f"tcpin:127.0.0.1:{server.address[1]}"
        with pytest.raises(LinkError) as caught:
            open_link(name)
        assert str(caught.value) == f"cannot open {name}: address already in use"

    def test_port_is_free_again_right_after_a_connection_was_closed(
        self, server: TcpServerLink, collect: Collect
    ) -> None:
        with connect(server) as client:
            client.sendall(b"x")
            collect(server, 1)
            server.close()
        again = open_link(f"tcpin:127.0.0.1:{server.address[1]}")
        again.close()

    def test_send_without_client_is_dropped_for_want_of_a_peer(self, server: TcpServerLink) -> None:
        server.send(b"hello")
        assert server.stats.drop_reasons == {"no peer": 1}
        assert server.stats.bytes_dropped == 5

    def test_listener_wakes_the_waiter_when_a_client_comes(self, server: TcpServerLink) -> None:
        with connect(server):
            assert wait_readable([server], 5.0) == [server]

    def test_second_client_waits_until_the_first_goes(self, server: TcpServerLink, collect: Collect) -> None:
        first, second = connect(server), connect(server)
        second.sendall(b"second")
        first.sendall(b"first")
        assert collect(server, 5) == b"first"
        first.close()
        assert collect(server, 6) == b"second"
        assert (server.stats.connects, server.stats.disconnects) == (2, 1)
        second.close()

    def test_last_bytes_of_a_client_that_left_are_still_read(
        self, server: TcpServerLink, collect: Collect, until: Until
    ) -> None:
        client = connect(server)
        client.sendall(b"hello")
        collect(server, 5)
        client.sendall(b"goodbye")
        client.close()

        def noticed() -> bool:
            server.send(b"telemetry")
            return "broken pipe" in server.stats.drop_reasons or "connection reset by peer" in (
                server.stats.drop_reasons
            )

        until(noticed, server)
        dropped = server.stats.bytes_dropped
        server.send(b"more")
        assert server.stats.bytes_dropped == dropped + 4
        assert collect(server, 7) == b"goodbye"

    def test_backlog_of_a_client_that_does_not_read_is_bounded(self, server: TcpServerLink, collect: Collect) -> None:
        client = connect(server)
        client.sendall(b"x")
        collect(server, 1)
        for _ in range(2000):
            server.send(bytes(8192))
        stats = server.stats
        assert stats.drop_reasons["backlog full"] > 0
        assert 0 <= 2000 * 8192 - stats.bytes_out - stats.bytes_dropped <= 65536
        client.close()

    def test_backlog_flows_when_the_client_reads_again(
        self, server: TcpServerLink, collect: Collect, until: Until
    ) -> None:
        client = connect(server)
        client.sendall(b"x")
        collect(server, 1)
        while not server.stats.bytes_dropped:
            server.send(bytes(8192))
        kept = 0
        client.setblocking(False)

        def drained() -> bool:
            nonlocal kept
            server.receive()
            try:
                kept += len(client.recv(1 << 20))
            except BlockingIOError:
                return kept == server.stats.bytes_out and server.stats.bytes_out == sent
            return False

        sent = server.stats.bytes_out + server.backlog_bytes
        until(drained, server)
        client.close()

    def test_backlog_is_counted_when_the_client_vanishes(
        self, server: TcpServerLink, collect: Collect, until: Until
    ) -> None:
        client = connect(server)
        client.sendall(b"x")
        collect(server, 1)
        while not server.stats.bytes_dropped:
            server.send(bytes(8192))
        held = server.backlog_bytes
        before = server.stats.bytes_dropped
        client.close()

        def gone() -> bool:
            server.receive()
            return server.stats.disconnects == 1

        until(gone, server)
        assert held > 0
        assert server.stats.bytes_dropped == before + held

    def test_client_that_resets_is_a_disconnect(self, server: TcpServerLink, collect: Collect, until: Until) -> None:
        client = connect(server)
        client.sendall(b"x")
        collect(server, 1)
        client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\x01\0\0\0\0\0\0\0")
        client.close()

        def gone() -> bool:
            server.receive()
            return server.stats.disconnects == 1

        until(gone, server)

    def test_failed_accept_is_counted(self, server: TcpServerLink, monkeypatch: pytest.MonkeyPatch) -> None:
        class Broken:
            def accept(self) -> None:
                raise OSError(24, "too many open files")

        with monkeypatch.context() as patch:
            patch.setattr(server, "_listener", Broken())
            assert server.receive() == b""
        assert server.stats.open_failures == 1

    def test_small_messages_are_not_held_back(self, server: TcpServerLink, collect: Collect) -> None:
        with connect(server) as client:
            client.sendall(b"x")
            collect(server, 1)
            with socket.socket(fileno=os.dup(server.fileno())) as view:
                assert view.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)


class TestSeveralClients:
    @pytest.fixture
    def told(self, server: TcpServerLink) -> list[str]:
        told: list[str] = []
        server.news.tell(told.append)
        return told

    @pytest.fixture
    def admit(self, server: TcpServerLink, until: Until) -> Iterator[Admit]:
        """Return a function that connects so many clients; it returns them, and the links of all but the first."""
        with ExitStack() as stack:

            def connect_all(count: int) -> tuple[list[socket.socket], list[Link]]:
                clients: list[socket.socket] = []
                links: list[Link] = []

                def all_in() -> bool:
                    if (link := server.admit()) is not None:
                        links.append(link)
                    return len(server.peer_names) == len(clients)

                for _ in range(count):
                    clients.append(stack.enter_context(connect(server)))
                    until(all_in, server)
                return clients, links

            yield connect_all

    def test_each_has_a_link_of_its_own(self, server: TcpServerLink, collect: Collect, admit: Admit) -> None:
        clients, (other,) = admit(2)
        for client, sent in zip(clients, (b"first", b"other"), strict=True):
            client.sendall(sent)
        assert (collect(server, 5), collect(other, 5)) == (b"first", b"other")
        other.send(b"to the other")
        server.send(b"to the first")
        assert [client.recv(100) for client in clients] == [b"to the first", b"to the other"]
        assert other.name == "tcpin:0#2"

    def test_all_are_told_by_address(self, server: TcpServerLink, told: list[str], until: Until, admit: Admit) -> None:
        clients, (other,) = admit(2)
        first, second = (f"127.0.0.1:{client.getsockname()[1]}" for client in clients)
        clients[1].close()
        until(lambda: not other.receive() and not other.peer_names, other)
        assert told == [f"{first} connected", f"{second} (#2) connected", f"{second} (#2) left: end of stream"]
        assert server.peer_names == (first,)

    def test_newcomer_gets_the_place_of_one_that_has_left(
        self, server: TcpServerLink, until: Until, admit: Admit
    ) -> None:
        clients, (other,) = admit(2)
        clients[1].close()
        until(lambda: not other.receive() and not other.peer_names, other)
        with connect(server) as client:
            until(lambda: (link := server.admit()) is not None and link.name == "tcpin:0#2", server)
            assert client.getsockname()[1] == int(server.peer_names[1].split()[0].partition(":")[2])

    def test_one_too_many_is_turned_away_by_name(
        self, server: TcpServerLink, told: list[str], until: Until, admit: Admit
    ) -> None:
        admit(MAX_CLIENTS)
        with connect(server) as client:
            until(lambda: server.admit() is None and server.stats.open_failures == 1, server)
            assert client.recv(1) == b""
            name = f"127.0.0.1:{client.getsockname()[1]}"
        assert told[-1] == f"{name} refused: {MAX_CLIENTS} are served already"


class TestClient:
    def test_absent_server_is_no_error_but_counted(self, unserved_port: int, until: Until) -> None:
        link = TcpLink("tcp:x", ("127.0.0.1", unserved_port), monotonic=Clock())

        def failed() -> bool:
            link.receive()
            return link.stats.open_failures == 1

        until(failed, link)
        assert link.fileno() == -1
        assert link.stats.unreached == "connection refused"
        told: list[str] = []
        link.news.tell(told.append)
        assert told == ["connection refused; attempts go on"]
        link.close()

    def test_send_before_the_connection_stands_is_counted(self, unserved_port: int) -> None:
        link = TcpLink("tcp:x", ("127.0.0.1", unserved_port), monotonic=Clock())
        link.send(b"early")
        assert link.stats.drop_reasons == {"no peer": 1}
        link.close()

    def test_no_attempt_before_its_time(self, unserved_port: int, until: Until) -> None:
        clock = Clock()
        link = TcpLink("tcp:x", ("127.0.0.1", unserved_port), monotonic=clock)
        until(lambda: link.receive() == b"" and link.stats.open_failures == 1, link)
        for _ in range(100):
            link.receive()
        assert link.stats.open_failures == 1
        clock.now_s += 0.25
        until(lambda: link.receive() == b"" and link.stats.open_failures == 2, link)
        link.close()

    def test_client_finds_a_server_that_starts_later(self, unserved_port: int, until: Until, collect: Collect) -> None:
        clock, port = Clock(), unserved_port
        link = TcpLink("tcp:x", ("127.0.0.1", port), monotonic=clock)
        until(lambda: link.receive() == b"" and link.stats.open_failures == 1, link)
        server = TcpServerLink("tcpin:x", ("127.0.0.1", port))
        clock.now_s += 0.25
        until(lambda: link.receive() == b"" and link.stats.connects == 1, link)
        link.send(b"found")
        assert collect(server, 5) == b"found"
        link.close()
        server.close()

    def test_client_comes_back_after_a_loss(self, server: TcpServerLink, until: Until) -> None:
        clock = Clock()
        link = TcpLink("tcp:x", ("127.0.0.1", server.address[1]), monotonic=clock)
        until(lambda: link.receive() == b"" and link.stats.connects == 1, link)
        until(lambda: server.receive() == b"" and server.stats.connects == 1, server)
        server.close()
        until(lambda: link.receive() == b"" and link.stats.disconnects == 1, link)
        again = TcpServerLink("tcpin:x", ("127.0.0.1", server.address[1]))
        clock.now_s += 0.25
        until(lambda: link.receive() == b"" and link.stats.connects == 2, link)
        link.close()
        again.close()

    def test_attempt_without_answer_is_given_up(self, server: TcpServerLink, monkeypatch: pytest.MonkeyPatch) -> None:
        clock = Clock()
        monkeypatch.setattr(tcp_module, "_writable", lambda sock: False)
        link = TcpLink("tcp:x", ("127.0.0.1", server.address[1]), monotonic=clock)
        clock.now_s += 4.9
        link.receive()
        assert link.stats.open_failures == 0
        clock.now_s += 0.1
        link.receive()
        assert link.stats.open_failures == 1
        link.close()

    def test_unreachable_network_is_counted(self) -> None:
        link = TcpLink("tcp:x", ("255.255.255.255", 9), monotonic=Clock())
        assert link.stats.open_failures == 1
        link.close()

    def test_connection_to_itself_is_refused(
        self, server: TcpServerLink, monkeypatch: pytest.MonkeyPatch, until: Until
    ) -> None:
        monkeypatch.setattr(tcp_module, "is_connected_to_itself", lambda sock: True)
        link = TcpLink("tcp:x", ("127.0.0.1", server.address[1]), monotonic=Clock())
        until(lambda: link.receive() == b"" and link.stats.open_failures == 1, link)
        assert link.stats.connects == 0
        link.close()

    def test_close_gives_up_an_attempt(self, monkeypatch: pytest.MonkeyPatch, server: TcpServerLink) -> None:
        monkeypatch.setattr(tcp_module, "_writable", lambda sock: False)
        link = TcpLink("tcp:x", ("127.0.0.1", server.address[1]))
        link.close()
        assert link.receive() == b""


def test_socket_connected_to_its_own_port_is_found_out() -> None:
    with socket.socket() as sock:
        sock.bind(("127.0.0.1", 0))
        sock.connect(sock.getsockname())
        assert is_connected_to_itself(sock)


def test_socket_without_peer_is_not_connected_to_itself() -> None:
    with socket.socket() as sock:
        assert not is_connected_to_itself(sock)
