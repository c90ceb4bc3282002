# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Let `viso serve` take ODOMETRY at 200 Hz and send telemetry on two UDP links, in real time, and print figures.

The first link is the companion's, the second a ground station's. Exits with 1 when a sample was lost on the way or
not accepted, when a frame of the vehicle was damaged or missing, or when memory grew by more than 10 MB after the
first third of three minutes or more.
"""

from __future__ import annotations

import argparse
import json
import os
import select
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink2

BOOT_S = 8.0
RATE_HZ = 200
STREAMS = {"RAW_SENS": 4, "EXT_STAT": 4, "RC_CHAN": 4, "POSITION": 10, "EXTRA1": 10, "EXTRA2": 10, "EXTRA3": 4}
ALLOWED_GROWTH_MB = 10.0
JUDGED_S = 180.0  # for a minute memory does grow: the vehicle keeps its newest 10000 events
LIMIT_S = 30.0
RECEIVE_BUFFER_BYTES = 1 << 22


@dataclass
class Peer:
    """The other end of one link, and what it has seen."""

    port: int
    component_id: int
    frames: int = 0
    damaged: int = 0
    missing: int = 0
    round_trips_ms: list[float] = field(default_factory=list)
    attitude_times_ms: list[int] = field(default_factory=list)
    beat_times_s: list[float] = field(default_factory=list)
    _next_sequence: int | None = None

    def __post_init__(self) -> None:
        """Open the socket."""
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.connect(("127.0.0.1", self.port))
        self._socket.setblocking(False)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER_BYTES)
        self.fileno = self._socket.fileno
        self._mav = mavlink2.MAVLink(None, 255, self.component_id)
        self._mav.robust_parsing = True

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()

    def send(self, message: Any) -> None:
        """Send a message; a port that does not listen yet is no error."""
        with suppress(ConnectionRefusedError):
            self._socket.send(message.pack(self._mav))

    def read(self) -> None:
        """Take what has come, all of it before any is looked at: the system keeps little."""
        datagrams = []
        with suppress(BlockingIOError, ConnectionRefusedError):
            while data := self._socket.recv(65535):
                datagrams.append(data)
        for data in datagrams:
            for message in self._mav.parse_buffer(data) or []:
                self._take(message)

    def _take(self, message: Any) -> None:
        if message.get_type() == "BAD_DATA":
            self.damaged += 1
            return
        if message.get_srcSystem() != 1:  # the other peer's, passed on by the vehicle
            return
        self.frames += 1
        if self._next_sequence is not None:
            self.missing += (message.get_seq() - self._next_sequence) % 256
        self._next_sequence = (message.get_seq() + 1) % 256
        if message.get_type() == "TIMESYNC" and message.tc1 != 0:
            self.round_trips_ms.append((time.monotonic_ns() - message.ts1) / 1e6)
        if message.get_type() == "HEARTBEAT":
            self.beat_times_s.append(time.monotonic())
        if message.get_type() == "ATTITUDE":
            self.attitude_times_ms.append(message.time_boot_ms)


class Process:
    """What the system says about a running process."""

    def __init__(self, process_id: int) -> None:
        self._folder = Path("/proc", str(process_id))

    def resident_mb(self) -> float:
        """Return its memory."""
        return int((self._folder / "statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6

    def open_descriptors(self) -> int:
        """Return how many files, sockets and pipes it has open."""
        return sum(1 for _ in (self._folder / "fd").iterdir())

    def cpu_s(self) -> float:
        """Return the processor time that it has used."""
        fields = (self._folder / "stat").read_text().rsplit(")", 1)[1].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


@dataclass
class Figures:
    """What a soak came to."""

    seconds: float = 0.0
    sent: int = 0
    accepted: int = 0
    sender_late_ms: float = 0.0
    begin_mb: float = 0.0
    third_mb: float = 0.0
    end_mb: float = 0.0
    cpu_share: float = 0.0
    log_mb: float = 0.0
    other_verdicts: dict[str, int] = field(default_factory=dict)

    def findings(self, peers: Sequence[Peer]) -> list[str]:
        """Return what is wrong."""
        found = [] if self.accepted == self.sent else [f"{self.sent - self.accepted} samples not accepted"]
        found += [f"component {peer.component_id}: {peer.damaged} damaged" for peer in peers if peer.damaged]
        found += [f"component {peer.component_id}: {peer.missing} missing" for peer in peers if peer.missing]
        growth_mb = self.end_mb - self.third_mb
        grew = self.seconds >= JUDGED_S and growth_mb > ALLOWED_GROWTH_MB
        return found + ([f"memory grew by {growth_mb:.1f} MB"] if grew else [])


def free_port(kind: socket.SocketKind = socket.SOCK_DGRAM) -> int:
    """Return a port that nobody uses, of UDP if not of SOCK_STREAM."""
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def odometry() -> Any:
    """Return a sample: level, at rest, at the origin."""
    variances = [0.01] * 21
    return mavlink2.MAVLink_odometry_message(
        time.monotonic_ns() // 1000, 20, 12, 0, 0, 0, [1, 0, 0, 0], 0, 0, 0, 0, 0, 0, variances, variances, 0, 3, 90
    )


def talk(peers: Sequence[Peer]) -> None:
    """Send what every peer sends once a second: its heartbeat, and the question for the time."""
    for peer in peers:
        peer.send(mavlink2.MAVLink_heartbeat_message(18, 8, 0, 0, 0, 3))
        peer.send(mavlink2.MAVLink_timesync_message(0, time.monotonic_ns()))


def fly(peers: Sequence[Peer], process: Process, seconds: float) -> Figures:
    """Send samples at their rate, read everything, and measure."""
    figures = Figures(seconds, begin_mb=process.resident_mb())
    begin_s, begin_cpu_s = time.monotonic(), process.cpu_s()
    for number in range(round(seconds * RATE_HZ)):
        due_s = begin_s + number / RATE_HZ
        read_until(due_s, peers)
        figures.sender_late_ms = max(figures.sender_late_ms, (time.monotonic() - due_s) * 1000)
        peers[0].send(odometry())
        figures.sent += 1
        if number % RATE_HZ == 0:
            talk(peers)
        if number == round(seconds * RATE_HZ) // 3:
            figures.third_mb = process.resident_mb()
    figures.end_mb = process.resident_mb()
    figures.cpu_share = (process.cpu_s() - begin_cpu_s) / (time.monotonic() - begin_s)
    return figures


def read_until(end_s: float, peers: Sequence[Peer]) -> None:
    """Read what comes, when it comes, up to a time of the monotonic clock."""
    while (wait_s := end_s - time.monotonic()) > 0:
        for peer in select.select(peers, [], [], wait_s)[0]:
            peer.read()


def boot(peers: Sequence[Peer]) -> None:
    """Let the vehicle hear its peers until it has booted."""
    end_s = time.monotonic() + BOOT_S
    while time.monotonic() < end_s:
        talk(peers)
        read_until(time.monotonic() + 0.5, peers)
    for peer in peers:
        peer.round_trips_ms.clear()
        peer.attitude_times_ms.clear()


def command(peers: Sequence[Peer], folder: str) -> list[str]:
    """Return the command line of the vehicle."""
    line = [sys.executable, "-c", "from viso.cli import main; main()", "serve", "--json", "--log-dir", folder]
    for number, peer in enumerate(peers, 1):
        line += ["--master", f"udpin:127.0.0.1:{peer.port}"]
        for group, rate_hz in STREAMS.items():
            line += ["--param", f"MAV{number}_{group}={rate_hz}"]
    return [*line, "--param", "VISO_TYPE=1"]


def soak(seconds: float, peers: Sequence[Peer]) -> Figures:
    """Run the vehicle, fly, end it, and return the figures."""
    quiet = subprocess.DEVNULL
    with (
        tempfile.TemporaryDirectory(prefix="viso-soak-") as folder,
        subprocess.Popen(command(peers, folder), stdout=subprocess.PIPE, stderr=quiet, text=True) as child,
    ):
        try:
            boot(peers)
            figures = fly(peers, Process(child.pid), seconds)
            read_until(time.monotonic() + 0.2, peers)
            child.send_signal(signal.SIGINT)
            out, _ = child.communicate(timeout=LIMIT_S)
        finally:
            with suppress(ProcessLookupError):
                child.kill()
        figures.log_mb = sum(path.stat().st_size for path in Path(folder).glob("*.BIN")) / 1e6
    for row in json.loads(out)["verdicts"]:
        if (row["message"], row["outcome"]) == ("ODOMETRY", "accepted"):
            figures.accepted += row["count"]
        else:
            figures.other_verdicts[f"{row['message']} {row['rule']}"] = row["count"]
    return figures


def intervals(times_ms: Sequence[int]) -> list[float]:
    """Return the differences between times."""
    return [float(after - before) for before, after in pairwise(times_ms)]


def spread(values_ms: Sequence[float]) -> str:
    """Return median, 99th percentile and extreme of times in ms."""
    if not values_ms:
        return "never"
    ranked = sorted(values_ms)
    median, high = ranked[len(ranked) // 2], ranked[len(ranked) * 99 // 100]
    return f"median {median:.1f}, 99 % {high:.1f}, longest {ranked[-1]:.1f} ms"


def report(figures: Figures, peers: Sequence[Peer]) -> list[str]:
    """Return the figures in lines."""
    minutes = figures.seconds / 60
    lines = [
        f"duration            {minutes:.1f} min at {RATE_HZ} Hz",
        f"ODOMETRY            sent {figures.sent}, accepted {figures.accepted}",
        f"memory              begin {figures.begin_mb:.1f}, after a third {figures.third_mb:.1f}, "
        f"end {figures.end_mb:.1f} MB",
        f"processor           {figures.cpu_share:.1%} of a core",
        f"log                 {figures.log_mb:.1f} MB",
        f"sender at most late {figures.sender_late_ms:.1f} ms",
    ]
    for peer in peers:
        loss = f"missing {peer.missing}, damaged {peer.damaged}"
        lines += [
            f"link of {peer.component_id:3}         received {peer.frames} frames, {loss}",
            f"  time asked for    {spread(peer.round_trips_ms)}",
            f"  ATTITUDE interval {spread(intervals(peer.attitude_times_ms))} (wanted: {1000 / STREAMS['EXTRA1']:.0f})",
        ]
    others = ", ".join(f"{what}: {count}" for what, count in sorted(figures.other_verdicts.items()))
    return [*lines, f"other verdicts      {others or 'none'}"]


def main(args: Sequence[str]) -> int:
    """Soak, print the figures, and return 1 when there are findings."""
    parser = argparse.ArgumentParser(prog="python -m tools.soak", description=str(__doc__).splitlines()[0])
    parser.add_argument("--minutes", type=float, default=30.0, help="how long (default 30)")
    seconds = parser.parse_args(args).minutes * 60
    peers = [Peer(free_port(), 197), Peer(free_port(), 190)]
    try:
        figures = soak(seconds, peers)
    finally:
        for peer in peers:
            peer.close()
    found = figures.findings(peers)
    print("\n".join([*report(figures, peers), *(f"FINDING: {line}" for line in found)]))
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
