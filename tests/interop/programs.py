# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Programs that tests start and talk to: `viso serve` and its real clients, each a process of its own."""

import json
import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink2

from tests.places import ROOT

CLIENTS = ROOT / "tests" / "interop" / "clients"
# For one step of a conversation; a busy machine may take its time, a client that hangs may not.
LIMIT_S = 20.0
# For a whole session of a client.
SESSION_S = 60.0
RATE_HZ = 30
LOOPBACK = (
    '<CycloneDDS><Domain><General><Interfaces><NetworkInterface name="lo"/></Interfaces>'
    "<AllowMulticast>false</AllowMulticast></General><Discovery><Peers><Peer address='127.0.0.1'/></Peers>"
    "<ParticipantIndex>auto</ParticipantIndex></Discovery></Domain></CycloneDDS>"
)
"""What CYCLONEDDS_URI says so that DDS stays on this machine."""
SCREEN_LINES = 20


class Program:
    """A running process, its output line by line.

    Attributes:
        lines: what it has printed so far.
    """

    def __init__(self, process: "subprocess.Popen[str]") -> None:
        self._process = process
        self._news = threading.Condition()
        self._searched = 0
        self.lines: list[str] = []
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            with self._news:
                self.lines.append(line.rstrip())
                self._news.notify_all()
        with self._news:
            self._news.notify_all()

    def screen(self) -> str:
        """Return the last lines, for the message of a failing test."""
        return "\n".join(self.lines[-SCREEN_LINES:])

    def until(self, pattern: str, limit_s: float = LIMIT_S) -> str:
        """Return the next line with a match for the pattern; each line is looked at once."""
        end_s = time.monotonic() + limit_s
        with self._news:
            while True:
                for line in self.lines[self._searched :]:
                    self._searched += 1
                    if re.search(pattern, line):
                        return line
                left_s = end_s - time.monotonic()
                assert left_s > 0, f"no {pattern!r} within {limit_s} s; it said\n{self.screen()}"
                assert self._reader.is_alive(), f"ended without {pattern!r}; it said\n{self.screen()}"
                self._news.wait(left_s)

    def type(self, line: str) -> None:
        """Type a line on the program's terminal."""
        assert self._process.stdin is not None
        self._process.stdin.write(line + "\n")
        self._process.stdin.flush()

    def hang_up(self) -> int:
        """End the program's input, wait for it to end, and return its exit code."""
        assert self._process.stdin is not None
        self._process.stdin.close()
        return self.wait()

    def interrupt(self) -> int:
        """Press Ctrl-C, wait for the program to end, and return its exit code."""
        self._process.send_signal(signal.SIGINT)
        return self.wait()

    def wait(self, limit_s: float = LIMIT_S) -> int:
        """Wait for the program to end by itself, and return its exit code."""
        code = self._process.wait(limit_s)
        self._reader.join(LIMIT_S)
        return code


@contextmanager
def running(command: Sequence[str], cwd: Path | None = None, env: Mapping[str, str] | None = None) -> Iterator[Program]:
    """Start a program and end it, whatever happens."""
    environment = {**os.environ, "PYTHONUNBUFFERED": "1", **(env or {})}
    pipe = subprocess.PIPE
    with subprocess.Popen(
        command, stdin=pipe, stdout=pipe, stderr=subprocess.STDOUT, text=True, cwd=cwd, env=environment
    ) as process:
        program = Program(process)
        try:
            yield program
        finally:
            with suppress(ProcessLookupError):
                process.kill()
            print(program.screen())  # pytest shows it when a test fails


@dataclass(frozen=True)
class Autopilot:
    """A running `viso serve`: the process, its ports on loopback and its folder of logs."""

    program: Program
    ports: tuple[int, ...]
    logs: Path

    def verdicts(self) -> dict[str, dict[str, int]]:
        """End it, and return how often each message met each rule, by message and the rule's code."""
        assert self.program.interrupt() == 0, self.program.screen()
        # Lines of the running program come first, then the counts.
        start = self.program.lines.index("{")
        counts: dict[str, dict[str, int]] = {}
        for row in json.loads("\n".join(self.program.lines[start:]))["verdicts"]:
            counts.setdefault(row["message"], {})[row["rule"]] = row["count"]
        return counts


def free_port() -> int:
    """Return a port of loopback that nobody listens at."""
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@contextmanager
def autopilot(folder: Path, *options: str, links: Sequence[str] = ("tcpin",)) -> Iterator[Autopilot]:
    """Start `viso serve` with links of the given kinds, and wait until it has booted."""
    ports = tuple(free_port() for _ in links)
    masters = [f"--master={kind}:127.0.0.1:{port}" for kind, port in zip(links, ports, strict=True)]
    command = [sys.executable, "-c", "from viso.cli import main; main()", "serve", "--json", *masters]
    with running([*command, f"--log-dir={folder / 'logs'}", *options]) as program:
        program.until("ArduPilot Ready")
        yield Autopilot(program, ports, folder / "logs")


def session(command: Sequence[str], env: Mapping[str, str] | None = None) -> dict[str, Any]:
    """Run a client that prints one line of JSON at its end, and return what that says, with all lines as ``screen``."""
    with running(command, env=env) as program:
        line = program.until(r"^\{.*\}$", SESSION_S)
        assert program.wait() == 0, program.screen()
    return {**json.loads(line), "screen": program.lines}


class Companion:
    """A companion computer on a TCP link of its own: ODOMETRY at 30 Hz, level, at rest, at the origin."""

    def __init__(self, port: int) -> None:
        self._socket = socket.create_connection(("127.0.0.1", port), LIMIT_S)
        self._mav = mavlink2.MAVLink(self._socket.makefile("wb", buffering=0), srcSystem=1, srcComponent=197)
        self._gone = threading.Event()
        self._threads = [threading.Thread(target=work, daemon=True) for work in (self._send, self._discard)]

    def __enter__(self) -> "Companion":
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(self, *_exception: object) -> None:
        self._gone.set()
        with suppress(OSError):  # which has ended
            self._socket.shutdown(socket.SHUT_RDWR)
        for thread in self._threads:
            thread.join(LIMIT_S)
        self._mav.file.close()
        self._socket.close()

    def _discard(self) -> None:
        with suppress(ConnectionError):  # the link may end first
            while not self._gone.is_set() and self._socket.recv(4096):
                pass

    def _send(self) -> None:
        unknown = [float("nan")] + [0.0] * 20
        next_s = time.monotonic()
        while not self._gone.wait(max(0.0, next_s - time.monotonic())):
            next_s += 1 / RATE_HZ
            with suppress(ConnectionError):
                self._mav.odometry_send(
                    time.monotonic_ns() // 1000, 20, 12, 0, 0, 0, [1, 0, 0, 0], 0, 0, 0, 0, 0, 0, unknown, unknown,
                    0, 3, 90,
                )  # fmt: skip
