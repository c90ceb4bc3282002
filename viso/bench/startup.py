# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How long a process takes from its start: to the help, and to the first message that the autopilot has accepted."""

import json
import socket
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from mav_handlers.wire.codec import Codec
from viso.bench.measure import NowS, Part, Round
from viso.bench.odometry import odometry_at
from viso.errors import InputError

FIRST_ACCEPTED: Final = "viso serve, to its first accepted ODOMETRY"
HELP: Final[Mapping[str, tuple[str, ...]]] = {
    "viso -h": ("-h",),
    "viso serve --help": ("serve", "--help"),
    "viso doctor --help": ("doctor", "--help"),
}
_VISO: Final = (sys.executable, "-c", "from viso.cli import main; main()")
_TIMEOUT_S: Final = 60.0
_LOOK_S: Final = 0.2  # how often it is looked whether a process is still there


def _help(arguments: tuple[str, ...], now_s: NowS) -> Part:
    begin_s = now_s()
    subprocess.run([*_VISO, *arguments], stdout=subprocess.DEVNULL, check=True, timeout=_TIMEOUT_S)
    return Part(now_s() - begin_s, 1)


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


def serve_until_accepted(folder: Path, now_s: NowS) -> Part:
    """Start an autopilot with its filter that connects to us, and send it ODOMETRY over TCP as soon as it does.

    Args:
        folder: where it has its logs.
        now_s: the clock.

    Raises:
        InputError: it has ended without accepting it.
    """
    with socket.create_server(("127.0.0.1", 0)) as listening:
        listening.settimeout(_LOOK_S)
        link = f"tcp:127.0.0.1:{listening.getsockname()[1]}"
        options = ("--param", "VISO_TYPE=1", "--verdicts", "json", "--log-dir", str(folder))
        begin_s = now_s()
        command = [*_VISO, "serve", "--master", link, *options]
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as process:
            try:
                with _connection(listening, process) as connection:
                    connection.sendall(Codec(1, 197).encode(odometry_at(1_000_000)))
                    _wait_for_acceptance(process)
                    return Part(now_s() - begin_s, 1)
            finally:
                process.terminate()


@contextmanager
def prepare(now_s: NowS) -> Iterator[Round]:
    """A round starts each of the processes once; the first round has them in the caches of the system."""
    with TemporaryDirectory() as folder:

        def run_round() -> Mapping[str, Part]:
            parts = {name: _help(arguments, now_s) for name, arguments in HELP.items()}
            return parts | {FIRST_ACCEPTED: serve_until_accepted(Path(folder), now_s)}

        yield run_round
