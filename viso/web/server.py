# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The server of the page: its files, and a socket for each page that is open. It runs on a thread of its own."""

import asyncio
import contextlib
import json
import logging
import socket
import threading
from collections import deque
from collections.abc import AsyncIterator, Callable, Iterable, Mapping
from importlib import resources
from typing import Any, Final

import uvicorn
import websockets  # noqa: F401  # what uvicorn takes for sockets; without it there is no page
from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect
from uvicorn.protocols.http.h11_impl import H11Protocol

from mav_handlers.links.base import is_short_of_descriptors
from viso.web.diagnosis import examine
from viso.web.live_state import LiveState, StateUpdate
from viso.web.requests import MAX_REQUEST_CHARS, Answer, asks_for_diagnosis, number_of
from viso.web.same_site import SameSite

_log = logging.getLogger(__name__)

BATCH_PERIOD_S: Final = 0.1
MAX_CLIENTS: Final = 8
MESSAGES_WAITING: Final = 20
WAITING_CONNECTIONS: Final = 8  # so many are accepted at once, which must be fewer than the spare descriptors
STOP_PATIENCE_S: Final = 3.0
MAX_CONNECTIONS: Final = 32
"""Browsers open six for each page."""
CONNECTION_S: Final = 10.0
"""The page's files are small: a connection that is not a page's socket by then has nothing to do here."""

TRY_LATER: Final = 1013
_NO_VEHICLE: Final = "a recording has no vehicle to ask"
FILES: Final = {
    "/": ("index.html", "text/html; charset=utf-8"),
    "/style.css": ("style.css", "text/css; charset=utf-8"),
    "/icon.svg": ("icon.svg", "image/svg+xml"),
    **{
        f"/{name}.js": (f"{name}.js", "text/javascript; charset=utf-8")
        for name in (
            *("app", "charts", "controls", "doctor", "format", "params"),
            *("plots", "rates", "space", "time", "verdicts"),
        )
    },
}


def encode(message: Mapping[str, Any]) -> str:
    """Return an object as JSON, a list one element at a time: the vehicle's thread cannot run while one is encoded."""
    return "{" + ",".join(f"{_dumps(key)}:{_encode(value)}" for key, value in message.items()) + "}"


def _encode(value: Any) -> str:
    return "[" + ",".join(map(_dumps, value)) + "]" if isinstance(value, list) else _dumps(value)


def _dumps(value: Any) -> str:
    return json.dumps(value, separators=(",", ":"), allow_nan=False)


class Client:
    """A page that is open: what is to be sent to it; one that is too slow gets everything again instead."""

    def __init__(self, number: int) -> None:
        self.number = number
        self._waiting: deque[str] = deque()
        self._news = asyncio.Event()
        self._needs_all = True
        self._news.set()

    def put(self, text: str) -> None:
        """Have something sent."""
        self._forget_if_full()
        self._waiting.append(text)
        self._news.set()

    def put_batch(self, text: str) -> None:
        """Have a batch sent, unless the page is about to get everything."""
        self._forget_if_full()
        if not self._needs_all:
            self._waiting.append(text)
        self._news.set()

    def _forget_if_full(self) -> None:
        if len(self._waiting) >= MESSAGES_WAITING:
            self._waiting.clear()
            self._needs_all = True

    async def next(self, everything: Callable[[], str]) -> list[str]:
        """Wait for what is to be sent next, and return it."""
        await self._news.wait()
        self._news.clear()
        texts = list(self._waiting)
        self._waiting.clear()
        if self._needs_all:
            self._needs_all = False
            texts.insert(0, everything())
        return texts


class Broadcaster:
    """Sends what has changed to all pages, ten times per second.

    Args:
        state: what pages show.
        take_updates: returns the updates since the last call.
        ask: takes what a page has sent, and returns the answer if there is one already.
    """

    def __init__(
        self,
        state: LiveState,
        take_updates: Callable[[], Iterable[StateUpdate]],
        ask: Callable[[int, str], Answer | None],
    ) -> None:
        self._state = state
        self._take_updates = take_updates
        self._ask = ask
        self._clients: dict[int, Client] = {}
        self._numbers = 0
        self._diagnosis: asyncio.Task[None] | None = None

    async def run(self) -> None:
        """Go on until cancelled."""
        while True:
            await asyncio.sleep(BATCH_PERIOD_S)
            self.tick()

    def tick(self) -> None:
        """Apply the updates, and send what has changed to every page."""
        self._state.take(self._take_updates())
        for answer in self._state.take_answers():
            if answer.client in self._clients:
                self._clients[answer.client].put(_answer_text(answer))
        batch = self._state.batch()
        if self._clients:
            text = encode(batch)
            for client in self._clients.values():
                client.put_batch(text)

    def everything(self) -> str:
        """Return all that a page gets when it opens."""
        return encode(self._state.snapshot())

    async def serve(self, connection: WebSocket) -> None:
        """Serve the socket of a page until it closes."""
        if len(self._clients) >= MAX_CLIENTS:
            await connection.close(TRY_LATER)
            return
        await connection.accept()
        self._numbers += 1
        client = self._clients[self._numbers] = Client(self._numbers)
        sending = asyncio.create_task(self._send(connection, client))
        try:
            await self._receive(connection, client)
        finally:
            del self._clients[client.number]
            sending.cancel()
            await asyncio.gather(sending, return_exceptions=True)

    async def _send(self, connection: WebSocket, client: Client) -> None:
        # A page that leaves is noticed by whoever reads from it.
        with contextlib.suppress(WebSocketDisconnect, RuntimeError):
            while True:
                for text in await client.next(self.everything):
                    await connection.send_text(text)

    async def _receive(self, connection: WebSocket, client: Client) -> None:
        while (message := await connection.receive())["type"] == "websocket.receive":
            text = message.get("text") or ""
            if asks_for_diagnosis(text):
                self._diagnose(client, number_of(text))
                continue
            answer = self._ask(client.number, text)
            if answer is not None:
                client.put(_answer_text(answer))

    def _diagnose(self, client: Client, request: int) -> None:
        if self._diagnosis is not None and not self._diagnosis.done():
            client.put(_answer_text(Answer(client.number, request, False, "the doctor is at work already")))
            return
        self._diagnosis = asyncio.create_task(self._examine(client, request, self._state.material()))

    async def _examine(self, client: Client, request: int, material: dict[str, Any]) -> None:
        report = await examine(material)
        text = "the doctor failed" if report is None else f"Doctor: {report['count']}"
        answer = {"type": "answer", "id": request, "ok": report is not None, "text": text, "report": report}
        client.put(encode(answer))

    def close(self) -> None:
        """Examine no more."""
        if self._diagnosis is not None:
            self._diagnosis.cancel()


class RecordingBroadcaster(Broadcaster):
    """Shows every page a recording, which nothing changes."""

    def __init__(self, message: Mapping[str, Any]) -> None:
        super().__init__(LiveState(""), tuple, _refuse)
        self._everything = encode(message)

    def tick(self) -> None:
        """Do nothing: nothing changes."""

    def everything(self) -> str:
        """Return the recording."""
        return self._everything

    def _diagnose(self, client: Client, request: int) -> None:
        client.put(_answer_text(Answer(client.number, request, False, _NO_VEHICLE)))


def _refuse(client: int, text: str) -> Answer:
    return Answer(client, number_of(text), False, _NO_VEHICLE)


def _answer_text(answer: Answer) -> str:
    return encode({"type": "answer", "id": answer.request, "ok": answer.ok, "text": answer.text})


def make_app(broadcaster: Broadcaster, host: str) -> Starlette:
    """Return the application (ASGI), of a server that was started under a host's name."""

    @contextlib.asynccontextmanager
    async def lifespan(_app: Starlette) -> AsyncIterator[None]:
        # It would print a traceback for each connection that the system has no descriptor for.
        asyncio.get_running_loop().set_exception_handler(lambda _loop, context: _log.debug("%s", context["message"]))
        task = asyncio.create_task(broadcaster.run())
        yield
        task.cancel()
        broadcaster.close()
        await asyncio.gather(task, return_exceptions=True)

    routes: list[Any] = [Route(path, _file(*file)) for path, file in FILES.items()]
    routes.append(WebSocketRoute("/live", broadcaster.serve))
    return Starlette(routes=routes, lifespan=lifespan, middleware=[Middleware(SameSite, named=host)])


def _file(name: str, media_type: str) -> Callable[[Request], Any]:
    content = resources.files("viso.web").joinpath("static", name).read_bytes()

    async def answer(_request: Request) -> Response:
        return Response(content, media_type=media_type)

    return answer


class BoundedProtocol(H11Protocol):
    """HTTP on one connection, which ends after 10 s unless it has become a socket of the page.

    A connection is closed at once if there are 32 already, or if it took one of the last descriptors of the process.
    """

    _end: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]  # as in the base
        """Take the connection, or close it."""
        super().connection_made(transport)
        descriptor = transport.get_extra_info("socket").fileno()
        if len(self.connections) > MAX_CONNECTIONS or is_short_of_descriptors(descriptor):
            transport.abort()
        else:
            self._end = self.loop.call_later(CONNECTION_S, transport.abort)

    def connection_lost(self, exc: Exception | None) -> None:
        """Forget the connection."""
        self._keep()
        super().connection_lost(exc)

    def handle_websocket_upgrade(self, event: Any) -> None:
        """Hand the connection on to the socket of the page."""
        self._keep()
        super().handle_websocket_upgrade(event)

    def _keep(self) -> None:
        if self._end is not None:
            self._end.cancel()
            self._end = None


class PageServer:
    """Serves on a bound socket, on a thread of its own, until it is stopped, and then closes that."""

    def __init__(self, app: Starlette, listening: socket.socket) -> None:
        config = uvicorn.Config(
            app,
            log_config=None,
            log_level="critical",
            access_log=False,
            lifespan="on",
            http=BoundedProtocol,
            backlog=WAITING_CONNECTIONS,
            ws="websockets-sansio",
            ws_max_size=4 * MAX_REQUEST_CHARS,
            ws_per_message_deflate=False,
            proxy_headers=False,
            server_header=False,
            timeout_graceful_shutdown=1,
        )
        self._listening = listening
        self._server = uvicorn.Server(config)
        # What does not end in time ends with the process.
        self._thread = threading.Thread(target=self._run, name="page", daemon=True)

    def start(self) -> None:
        """Begin to serve."""
        self._listening.listen(WAITING_CONNECTIONS)
        self._thread.start()

    def _run(self) -> None:
        self._server.run(sockets=[self._listening])

    def wait(self, seconds: float) -> None:
        """Wait so long for the end of the thread."""
        self._thread.join(seconds)

    def stop(self) -> None:
        """End all conversations, and the thread."""
        self._server.should_exit = True
        self._thread.join(STOP_PATIENCE_S)
        self._listening.close()
