# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Connections to the page's server: how many there may be, and for how long one may take to ask for something."""

import asyncio
from typing import Any, Final

from uvicorn.protocols.http.h11_impl import H11Protocol

from mav_handlers.links.base import is_short_of_descriptors

MAX_CONNECTIONS: Final = 32
"""Browsers open six for each page."""
CONNECTION_S: Final = 10.0
"""The page's files are small: a connection that is not a page's socket by then has nothing to do here."""


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
