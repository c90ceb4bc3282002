# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How long ``viso serve`` takes from its start to the first message that it has accepted."""

import json
import socket
import subprocess
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from mav_handlers.wire.codec import Codec
from tools.bench.commands import VISO
from tools.bench.odometry import odometry_at
from viso.errors import InputError

_LOOK_S: Final = 0.2  # how often it is looked whether a process is still there


def _connection(listening: socket.socket, process: subprocess.Popen[str]) -> socket.socket:
    while process.poll() is None:
        with suppress(TimeoutError):
            return listening.accept()[0]
    raise InputError("viso serve has ended before it connected")


def _wait_for_acceptance(process: subprocess.Popen[str]) -> None:
    assert process.stdout is not None
    verdicts = (json.loads(line) for line in process.stdout)
    if not any(verdict["type"] == "ODOMETRY" and verdict["outcome"] == "accepted" for verdict in verdicts):
        raise InputError("viso serve has ended before it accepted a message")


def serve_until_accepted(folder: Path) -> float:
    """Start an autopilot with its filter that connects to us, and send it ODOMETRY over TCP as soon as it does.

    Args:
        folder: where it has its logs.

    Returns:
        The seconds until it has accepted it, by the clock on the wall.

    Raises:
        InputError: it has ended without accepting it.
    """
    with socket.create_server(("127.0.0.1", 0)) as listening:
        listening.settimeout(_LOOK_S)
        link = f"tcp:127.0.0.1:{listening.getsockname()[1]}"
        options = ("--param", "VISO_TYPE=1", "--verdicts", "json", "--log-dir", str(folder))
        begin_s = time.perf_counter()
        command = [*VISO, "serve", "--master", link, *options]
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as process:
            try:
                with _connection(listening, process) as connection:
                    connection.sendall(Codec(1, 197).encode(odometry_at(1_000_000)))
                    _wait_for_acceptance(process)
                    return time.perf_counter() - begin_s
            finally:
                process.terminate()


def prepare(stack: ExitStack) -> Callable[[], float]:
    """A round is a start; the first one has the files in the caches of the system."""
    folder = Path(stack.enter_context(TemporaryDirectory()))
    return lambda: serve_until_accepted(folder)
