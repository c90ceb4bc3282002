# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Who may talk to the page's server: pages that it has served itself, and nobody else's.

A browser lets any site open a socket to this machine, and a name of somebody else's may be made to mean it; it tells
in ``Origin`` and ``Host`` who is asking, and under which name.
"""

import ipaddress
import socket
from collections.abc import Awaitable, Callable, MutableMapping
from typing import Any, Final

LOOPBACK_NAME: Final = "localhost"
SECURITY_HEADERS: Final = (
    (
        b"content-security-policy",
        b"default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; connect-src 'self'; "
        b"base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    ),
    (b"x-content-type-options", b"nosniff"),
    (b"x-frame-options", b"DENY"),
    (b"referrer-policy", b"no-referrer"),
    (b"cross-origin-opener-policy", b"same-origin"),
    (b"cross-origin-resource-policy", b"same-origin"),
    (b"cache-control", b"no-cache"),
)

Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send = Callable[[MutableMapping[str, Any]], Awaitable[None]]
App = Callable[[Scope, Receive, Send], Awaitable[None]]


def is_own_name(host: str, named: str) -> bool:
    """Return whether a ``Host`` header can only mean this server, which was started under the host ``named``.

    An address always does, for nobody can make that mean another machine.
    """
    name = host[1:].partition("]")[0] if host.startswith("[") else host.partition(":")[0]
    name = name.lower().rstrip(".")
    if name in (LOOPBACK_NAME, named.lower(), socket.gethostname().lower()):
        return bool(name)
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


def is_same_site(origin: str | None, host: str) -> bool:
    """Return whether a page of this server is asking, by the headers ``Origin`` and ``Host``."""
    return origin is not None and origin.lower() == f"http://{host.lower()}"


class SameSite:
    """Refuses what comes under a strange name or, for sockets, from a strange page; adds headers to the rest."""

    def __init__(self, app: App, named: str) -> None:
        self._app = app
        self._named = named

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle a connection."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        headers = dict(scope["headers"])
        host = headers.get(b"host", b"").decode("latin-1")
        if scope["type"] == "websocket":
            origin = headers.get(b"origin")
            is_ours = is_same_site(None if origin is None else origin.decode("latin-1"), host)
            if not (is_ours and is_own_name(host, self._named)):
                await send({"type": "websocket.close", "code": 1008})
                return
            await self._app(scope, receive, send)
            return
        if not is_own_name(host, self._named):
            await _refuse(send)
            return
        await self._app(scope, receive, _with_headers(send))


async def _refuse(send: Send) -> None:
    body = b"not under this name\n"
    headers = [(b"content-type", b"text/plain"), (b"content-length", str(len(body)).encode()), *SECURITY_HEADERS]
    await send({"type": "http.response.start", "status": 421, "headers": headers})
    await send({"type": "http.response.body", "body": body})


def _with_headers(send: Send) -> Send:
    async def send_with_headers(message: MutableMapping[str, Any]) -> None:
        if message["type"] == "http.response.start":
            message["headers"] = [*message.get("headers", ()), *SECURITY_HEADERS]
        await send(message)

    return send_with_headers
