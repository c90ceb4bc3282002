# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The server on loopback: files, sockets, and who is turned away."""

import asyncio
import http.client
import json
import socket
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Origin

from tests.places import ROOT
from tests.unit.viso.conftest import Bench
from viso.errors import InputError
from viso.web.live_view import LiveView
from viso.web.server import FILES, MAX_CLIENTS, MAX_CONNECTIONS, MESSAGES_WAITING, WAITING_CONNECTIONS, Client

LIMIT_S = 20.0
STATIC = ROOT / "viso" / "web" / "static"


class Served:
    """A vehicle with its page at a free port of loopback; it moves when a test moves it."""

    def __init__(self, bench: Bench) -> None:
        self.bench = bench
        self.view = LiveView("127.0.0.1:0", [], "a banner")
        self.view.feed.watch(bench.vehicle)
        self.port = int(self.view.url.rstrip("/").rpartition(":")[2])

    def get(self, path: str, host: str | None = None) -> tuple[int, dict[str, str], bytes]:
        """Ask for a file; return status, headers and content."""
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=LIMIT_S)
        try:
            connection.request("GET", path, headers={} if host is None else {"Host": host})
            answer = connection.getresponse()
            return answer.status, {name.lower(): value for name, value in answer.getheaders()}, answer.read()
        finally:
            connection.close()

    @contextmanager
    def page(self, origin: str | None = "own", host: str | None = None) -> Iterator[ClientConnection]:
        """Open a socket as a page of some origin does, under some name."""
        whose = f"http://127.0.0.1:{self.port}" if origin == "own" else origin
        with connect(
            f"ws://{host or '127.0.0.1'}:{self.port}/live",
            sock=socket.create_connection(("127.0.0.1", self.port), LIMIT_S),
            origin=None if whose is None else Origin(whose),
            compression=None,
            open_timeout=LIMIT_S,
        ) as opened:
            yield opened


@contextmanager
def serving() -> Iterator[Served]:
    bench = Bench({"VISO_TYPE": 1})
    bench.boot()
    made = Served(bench)
    yield made
    made.view.close()


@pytest.fixture(scope="module")
def shared() -> Iterator[Served]:
    """Return one that is there for all tests that leave it as it was: it takes a fifth of a second to stop."""
    with serving() as made:
        yield made


@pytest.fixture
def served() -> Iterator[Served]:
    """Return one of its own for a test."""
    with serving() as made:
        yield made


def until(page: ClientConnection, kind: str) -> dict[str, Any]:
    """Return the next message of a kind."""
    while True:
        message = json.loads(page.recv(LIMIT_S))
        if message["type"] == kind:
            assert isinstance(message, dict)
            return message


def test_every_file_is_served_with_its_type_and_may_load_nothing_from_elsewhere(shared: Served) -> None:
    for path, (_, media_type) in FILES.items():
        status, headers, content = shared.get(path)
        assert (status, headers["content-type"]) == (200, media_type)
        assert "default-src 'none'" in headers["content-security-policy"]
        assert headers["x-content-type-options"] == "nosniff"
        assert b"SPDX-License-Identifier" in content


def test_every_file_of_the_page_is_in_the_table() -> None:
    assert sorted(name for name, _ in FILES.values()) == sorted(path.name for path in STATIC.iterdir())


@pytest.mark.parametrize("path", sorted(STATIC.iterdir()), ids=lambda path: str(path.name))
def test_no_file_names_another_machine(path: Path) -> None:
    text = path.read_text(encoding="utf-8").replace("http://www.w3.org/2000/svg", "")
    assert "http://" not in text
    assert "https://" not in text


def test_nothing_else_is_there(shared: Served) -> None:
    assert [shared.get(path)[0] for path in ("/nothing", "/../server.py", "/static/app.js")] == [404] * 3


def test_strange_name_is_refused(shared: Served) -> None:
    assert shared.get("/", host="evil.example")[0] == 421


def test_socket_of_a_strange_page_is_refused(shared: Served) -> None:
    for origin in (None, "null", "http://evil.example", "http://localhost:1"):
        with pytest.raises(InvalidStatus), shared.page(origin):
            pass


def test_socket_under_a_strange_name_is_refused_though_its_page_has_the_same(shared: Served) -> None:
    with pytest.raises(InvalidStatus), shared.page(f"http://evil.example:{shared.port}", host="evil.example"):
        pass


def test_page_gets_everything_and_then_batches(shared: Served) -> None:
    with shared.page() as page:
        assert json.loads(page.recv(LIMIT_S))["banner"] == "a banner"
        shared.bench.vehicle.texts.send_text(6, "news")
        while not any(text == "news" for *_, text in until(page, "batch")["texts"]):
            pass


def test_request_is_done_when_the_vehicle_comes_to_it(served: Served) -> None:
    with served.page() as page:
        page.send('{"do":"param","name":"VISO_DELAY_MS","value":77,"id":5}')
        while not len(served.view.feed._requests._waiting):
            page.recv(LIMIT_S)
        served.view.feed.update()
        answer = until(page, "answer")
        assert answer == {"type": "answer", "id": 5, "ok": True, "text": "VISO_DELAY_MS is 77.0"}
    assert served.bench.vehicle.params.get_int("VISO_DELAY_MS") == 77


def test_nonsense_is_answered_and_the_conversation_goes_on(shared: Served) -> None:
    with shared.page() as page:
        for sent in ("", "{", b"\x00\xff", '{"do":"param","name":"X","value":"y"}', "[1]"):
            page.send(sent)
            assert until(page, "answer")["ok"] is False
        until(page, "batch")


def test_far_too_long_a_request_ends_the_conversation_and_nothing_else(shared: Served) -> None:
    with shared.page() as page:
        page.send("x" * 100_000)
        with pytest.raises(ConnectionClosed):
            until(page, "never")
    with shared.page() as page:
        until(page, "batch")


def test_answer_goes_to_the_page_that_asked(served: Served) -> None:
    with served.page() as asking, served.page() as other:
        asking.send("nonsense")
        until(asking, "answer")
        for _ in range(2):
            assert json.loads(other.recv(LIMIT_S))["type"] in ("all", "batch")


def test_there_is_a_limit_to_pages(served: Served) -> None:
    with ExitStack() as stack:
        pages = [stack.enter_context(served.page()) for _ in range(MAX_CLIENTS)]
        for page in pages:
            until(page, "all")
        with pytest.raises(InvalidStatus), served.page():
            pass


def test_connection_over_the_limit_is_closed_and_the_page_goes_on(
    served: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    most = 5  # in place of 32: more than wait at once to be accepted would try again after a second
    assert most < WAITING_CONNECTIONS < MAX_CONNECTIONS
    monkeypatch.setattr("viso.web.server.MAX_CONNECTIONS", most)
    idle = [socket.create_connection(("127.0.0.1", served.port), LIMIT_S) for _ in range(most)]
    with socket.create_connection(("127.0.0.1", served.port), LIMIT_S) as late:
        assert is_closed(late)
    for connection in idle:
        connection.close()
    for _ in range(100):  # until the server has noticed
        with suppress(ConnectionError, http.client.HTTPException):
            assert served.get("/")[0] == 200
            return
    pytest.fail("the page does not come back")


def test_connection_that_asks_for_nothing_is_closed(shared: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("viso.web.server.CONNECTION_S", 0.05)
    with socket.create_connection(("127.0.0.1", shared.port), LIMIT_S) as slow:
        slow.sendall(b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n")
        assert is_closed(slow)


def test_socket_of_a_page_stays_open(shared: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("viso.web.server.CONNECTION_S", 0.05)
    with shared.page() as page, socket.create_connection(("127.0.0.1", shared.port), LIMIT_S) as slow:
        assert is_closed(slow)  # by when the page's own time is over as well
        until(page, "batch")


def test_connection_with_one_of_the_last_descriptors_is_closed(shared: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("viso.web.server.is_short_of_descriptors", lambda _descriptor: True)
    with socket.create_connection(("127.0.0.1", shared.port), LIMIT_S) as newcomer:
        assert is_closed(newcomer)


def is_closed(connection: socket.socket) -> bool:
    """Wait until the server has closed a connection."""
    try:
        return connection.recv(1) == b""
    except ConnectionResetError:
        return True


def test_closing_leaves_every_page(served: Served) -> None:
    with served.page() as page:
        until(page, "all")
        served.view.close()
        with pytest.raises(ConnectionClosed):
            until(page, "never")
    with pytest.raises(ConnectionRefusedError):
        served.get("/")


def test_port_that_is_taken_is_one_line(shared: Served) -> None:
    address = f"127.0.0.1:{shared.port}"
    with pytest.raises(InputError, match=f"^--web {address}: address already in use$"):
        LiveView(address, [], "")


# A page that is too slow


async def everything_of(client: Client) -> list[str]:
    return await client.next(lambda: "everything")


def test_slow_page_gets_everything_anew() -> None:
    async def run() -> tuple[list[str], list[str]]:
        client = Client(1)
        first = await everything_of(client)
        for number in range(MESSAGES_WAITING + 5):
            client.put_batch(str(number))
        client.put("answer")
        return first, await everything_of(client)

    assert asyncio.run(run()) == (["everything"], ["everything", "answer"])


def test_quick_page_gets_batches_in_order() -> None:
    async def run() -> list[str]:
        client = Client(1)
        await everything_of(client)
        client.put_batch("1")
        client.put_batch("2")
        return await everything_of(client)

    assert asyncio.run(run()) == ["1", "2"]
