# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Two TCP clients, three UDP clients and a serial one at once: `viso serve` reports each, and serves each."""

import os
import re
import socket
import sys
import time
import tty
from collections.abc import Callable
from contextlib import ExitStack
from functools import partial
from pathlib import Path

import pytest

from mav_handlers.wire.codec import Codec, Received
from mav_handlers.wire.messages import COMMAND_LONG, HEARTBEAT, PARAM_REQUEST_READ, PARAM_VALUE
from tests.interop.programs import LIMIT_S, free_port, running

pytestmark = pytest.mark.interop

UDP_CLIENTS = 3


class Client:
    """A client in MAVLink, on any way to send and to read."""

    def __init__(self, name: str, component: int, send: Callable[[bytes], object], read: Callable[[], bytes]) -> None:
        self.name = name
        self._codec = Codec(255, component)
        self._send = send
        self._read = read

    def greet(self) -> None:
        self._send(self._codec.encode(HEARTBEAT(6, 8, 0, 0, 4, 3)))

    def ask(self) -> PARAM_VALUE:
        """Ask for a parameter until the answer comes, and return it."""
        end_s = time.monotonic() + LIMIT_S
        while time.monotonic() < end_s:
            self._send(self._codec.encode(PARAM_REQUEST_READ(1, 1, "VISO_TYPE", -1)))
            self._codec.feed(self._read())
            while (received := self._codec.next_received()) is not None:
                if isinstance(received, Received) and isinstance(received.message, PARAM_VALUE):
                    return received.message
        pytest.fail(f"{self.name}: no answer")

    def restart_autopilot(self) -> None:
        self._send(self._codec.encode(COMMAND_LONG(1, 1, 246, 0, 1.0, *(0.0,) * 6)))


def tcp_client(port: int, component: int, stack: ExitStack) -> Client:
    sock = stack.enter_context(socket.create_connection(("127.0.0.1", port), LIMIT_S))
    return Client(f"127.0.0.1:{sock.getsockname()[1]}", component, sock.sendall, partial(sock.recv, 4096))


def udp_client(port: int, component: int, stack: ExitStack) -> Client:
    sock = stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
    sock.settimeout(LIMIT_S)
    sock.connect(("127.0.0.1", port))
    return Client(f"127.0.0.1:{sock.getsockname()[1]}", component, sock.send, partial(sock.recv, 4096))


def serial_client(component: int, stack: ExitStack) -> Client:
    master, slave = os.openpty()
    stack.callback(os.close, master)
    stack.callback(os.close, slave)
    tty.setraw(slave)
    return Client(os.ttyname(slave), component, partial(os.write, master), partial(os.read, master, 4096))


def test_each_of_six_clients_is_told_and_served(tmp_path: Path) -> None:
    tcp_port, udp_port = free_port(), free_port()
    with ExitStack() as stack:
        visit = stack.enter_context(ExitStack())
        serial = serial_client(16, visit)
        masters = (f"tcpin:127.0.0.1:{tcp_port}", f"udpin:127.0.0.1:{udp_port}", serial.name)
        command = [sys.executable, "-c", "from viso.cli import main; main()", "serve", f"--log-dir={tmp_path / 'logs'}"]
        program = stack.enter_context(running([*command, *(f"--master={master}" for master in masters)]))
        program.until(f"{serial.name}: {serial.name} connected")
        program.until("ArduPilot Ready")
        tcp = [tcp_client(tcp_port, 11 + number, visit) for number in range(2)]
        program.until(rf"tcpin:127.0.0.1:{tcp_port}: {tcp[0].name} connected")
        program.until(rf"tcpin:127.0.0.1:{tcp_port}: {re.escape(tcp[1].name)} \(#2\) connected")
        udp = [udp_client(udp_port, 13 + number, visit) for number in range(UDP_CLIENTS)]
        for client in udp:
            client.greet()
            program.until(rf"udpin:127.0.0.1:{udp_port}: {client.name} connected")
        for client in (*tcp, *udp, serial):
            assert client.ask().param_id == "VISO_TYPE"
        tcp[1].restart_autopilot()
        program.until("restart")
        program.until("ArduPilot Ready")
        for client in (*tcp, *udp, serial):
            client.ask()
        visit.close()
        farewells = "\n".join(program.until(" left: ") for _ in (*tcp, serial))
        assert [client.name for client in (*tcp, serial) if client.name not in farewells] == []
