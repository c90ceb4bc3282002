# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The emulated autopilot on a real UDP port, still in virtual time."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

from mav_handlers.links import wait_readable
from mav_handlers.links.address import SocketAddress
from mav_handlers.links.datagram import datagram_socket
from mav_handlers.links.udp import UdpInLink
from viso.testing.autopilot import Autopilot
from viso.testing.golden import GoldenFiles
from viso.testing.options import AutopilotOptions
from viso.vehicle.vehicle import LOOP_PERIOD_US

__tracebackhide__ = True  # what goes wrong for a test's own fault is shown where the test is

ATTEMPTS: Final = 20
ATTEMPT_S: Final = 0.25
MOST_WAITING: Final = 1000
"""How many datagrams are taken at a time; whoever sends faster than they are read must not stop everything else."""


class FencedUdpLink(UdpInLink):
    """A UDP port of its own on loopback, whose ``receive_all`` ends with what was sent before the call.

    It sends an empty datagram to itself and reads until that comes: the system hands them over in order. Raises
    LinkError if the system gives no port.
    """

    def __init__(self) -> None:
        # Before the port is open it may hear of a stranger.
        self._fence_address: SocketAddress | None = None
        self._is_fence_read = False
        super().__init__("udpin:127.0.0.1:0", ("127.0.0.1", 0))
        self._fence = datagram_socket()
        self._fence.connect(self.address)
        self._fence_address = self._fence.getsockname()

    def receive_all(self) -> Iterator[bytes]:
        """Yield the datagrams that were sent so far. Raises OSError if loopback does not carry datagrams."""
        # First of all room is made, so that the fence is not lost.
        yield from self.receive_waiting()
        for _ in range(ATTEMPTS):
            self._fence.send(b"")
            yield from self.receive_waiting()
            if self._is_fence_read:
                return
            wait_readable([self], ATTEMPT_S)
            yield from self.receive_waiting()
            if self._is_fence_read:
                return
        raise OSError(f"a datagram to {self.address[0]}:{self.address[1]} does not arrive")

    def receive_waiting(self) -> Iterator[bytes]:
        """Yield the datagrams that wait now, up to the fence, and no more of them than the system may have kept."""
        self._is_fence_read = False
        for _ in range(MOST_WAITING):
            data = self.receive()
            if not data:
                return
            yield data
            if self._is_fence_read:
                return

    def close(self) -> None:
        """Close both sockets."""
        super().close()
        self._fence.close()

    def _accept(self, peer: SocketAddress, data: bytes) -> bool:
        if peer == self._fence_address:
            self._is_fence_read = True
            return False
        return super()._accept(peer, data)


class UdpAutopilot(Autopilot):
    """An autopilot that also has a UDP port on loopback, which the system chooses.

    It behaves as the one without: time goes on by ``advance``, and datagrams sent before any call are handled before
    that call does anything else, at the vehicle's present time. As on every UDP port, the autopilot answers those that
    it has heard. Code that waits for the autopilot needs time that goes on by itself: see ``running``.

    Args:
        options: what vehicle it is.
        golden: where golden logs are; None if there are none.

    Raises:
        ValueError: an option cannot be used.
        LinkError: the system gives no port.
    """

    _stride_us = LOOP_PERIOD_US

    def __init__(self, options: AutopilotOptions | None = None, golden: GoldenFiles | None = None) -> None:
        super().__init__(options, golden)
        self._is_running = False
        self._link = FencedUdpLink()

    @property
    def address(self) -> tuple[str, int]:
        """Host and port to send to."""
        host, port = self._link.address
        return host, port

    @property
    def connection_string(self) -> str:
        """The port as pymavlink and this project's own programs want it: ``udpout:127.0.0.1:PORT``."""
        host, port = self.address
        return f"udpout:{host}:{port}"

    def close(self) -> None:
        """Close the port, and let go of everything."""
        self._link.close()
        super().close()

    @contextmanager
    def running(self, *, speedup: float = 10.0) -> Iterator[None]:
        """Let time go on by itself, for code that blocks until the autopilot says something.

        Within the block the vehicle runs in a thread of its own. Observations may be read; time and
        link are not to be touched.

        Args:
            speedup: seconds of the vehicle for one of the wall clock, at most; a slow machine gives less.

        Raises:
            ValueError: no such speed.
            RuntimeError: it runs already.
        """
        if not 0 < speedup <= 1000:
            raise ValueError(f"speedup {speedup}: not between 0 and 1000")
        self._begin()
        stop = threading.Event()
        failures: list[BaseException] = []

        def run() -> None:
            try:
                self._run_passes(LOOP_PERIOD_US * 1e-6 / speedup, stop)
            except BaseException as error:  # raised again where the thread is waited for
                failures.append(error)

        thread = threading.Thread(target=run, name="autopilot", daemon=True)
        self._is_running = True
        thread.start()
        try:
            yield
        finally:
            stop.set()
            thread.join()
            self._is_running = False
        if failures:
            raise failures[0]

    def _run_passes(self, period_s: float, stop: threading.Event) -> None:
        while not stop.wait(period_s):
            self._take_input()
            self._pass(self._next_pass_us())

    def _begin(self) -> None:
        if self._is_running:
            raise RuntimeError("the autopilot runs by itself: advance, send, write, read and clear have to wait")
        self._sync()

    def _sync(self) -> None:
        if not self._is_running:
            for data in self._link.receive_all():
                self._deliver(data)

    def _take_input(self) -> None:
        for data in self._link.receive_waiting():
            self._deliver(data)

    def _put_output(self, data: bytes) -> None:
        self._link.send(data)
