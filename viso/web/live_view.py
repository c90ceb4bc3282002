# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The live view of a vehicle: it joins the listener, the faults and the server of the page."""

import socket
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

from mav_handlers.links.address import LOOPBACK, is_loopback, parse_host_port, resolve
from mav_handlers.links.base import Link, LinkError, reason_of
from viso.errors import InputError
from viso.extras import pip_install
from viso.running.exchange import NOW_S
from viso.terminal.process import stop_on_signal
from viso.web.faults import FaultSwitches, FaultyLink
from viso.web.feed import Feed
from viso.web.live_state import LiveState
from viso.web.requests import RequestQueue

STOP_LOOK_S: Final = 0.2
MISSING_EXTRA: Final = f"--web: the live view is served with starlette; install it with: {pip_install('web')}"


class LiveView:
    """A page that shows a vehicle, at an address, until it is closed.

    Args:
        address: ``[HOST:]PORT``; loopback without a host, any free port for 0.
        links: those of the vehicle.
        banner: what the vehicle claims to be, and where it listens.
        speedup: seconds of the vehicle for one of the wall clock.

    Attributes:
        links: the links with faults in them, to be used in place of the others.
        feed: the listener of the vehicle.
        url: where the page is.
        introduction: where the page is, and who may open it, in a line.

    Raises:
        InputError: the address cannot be used, or what serves the page is not installed.
    """

    def __init__(self, address: str, links: Sequence[Link], banner: str, *, speedup: float = 1.0) -> None:
        try:
            from viso.web.server import Broadcaster, PageServer, make_app
        except ModuleNotFoundError as error:
            raise InputError(MISSING_EXTRA) from error
        self.links = [FaultyLink(link, lambda: int(NOW_S() * speedup * 1e6)) for link in links]
        switches = FaultSwitches(self.links)
        requests = RequestQueue(switches)
        self.feed = Feed(requests, switches, links=links, now_s=NOW_S)
        listening, host = _listen(address)
        bound = listening.getsockname()
        self.url = f"http://{host}:{bound[1]}/"
        warning = "" if is_loopback(bound) else "; whoever reaches it can command the vehicle"
        self.introduction = f"live view at {self.url}{warning}"
        updates = self.feed.updates
        broadcaster = Broadcaster(LiveState(banner, lambda: updates.lost), updates.take_all, requests.ask)
        self._server = PageServer(make_app(broadcaster, host), listening)
        self._server.start()

    def close(self) -> None:
        """Close all pages, and stop the server."""
        self._server.stop()


def show_recording(address: str, message: Mapping[str, Any], show: Callable[[str], None]) -> None:
    """Serve a recording until Ctrl-C, and print where the page is; address and errors are those of ``LiveView``."""
    try:
        from viso.web.server import PageServer, RecordingBroadcaster, make_app
    except ModuleNotFoundError as error:
        raise InputError(MISSING_EXTRA) from error
    listening, host = _listen(address)
    port = listening.getsockname()[1]
    server = PageServer(make_app(RecordingBroadcaster(message), host), listening)
    with stop_on_signal() as stop:
        server.start()
        show(f"recording at http://{host}:{port}/; Ctrl-C ends")
        while not stop:
            server.wait(STOP_LOOK_S)
    server.stop()


def _listen(address: str) -> tuple[socket.socket, str]:
    """Return a bound socket, and the host as it was given."""
    try:
        where = parse_host_port(address, address, LOOPBACK, any_port=True)
        target = resolve(address, where)
    except LinkError as error:
        raise InputError(f"--web: {error}") from error
    listening = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    try:
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.bind(target)
    except OSError as error:
        listening.close()
        raise InputError(f"--web {address}: {reason_of(error)}") from error
    return listening, where.host
