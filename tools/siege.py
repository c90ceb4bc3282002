# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Attack a running `viso serve` over real sockets, one way after the other, and print what another link felt of it.

A ground station on a UDP link of its own listens for heartbeats and asks for the time, ten times per second, while a
process beside it floods a TCP link, a second UDP link and the page. Exits with 1 when the ground station waited longer
than it should, when memory or descriptors grew, or when the vehicle or its log did not end as they should.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import random
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

from pymavlink.DFReader import DFReader_binary
from pymavlink.dialects.v20 import ardupilotmega as mavlink2

from tools.measured_page import render, replace, where
from tools.soak import LIMIT_S, Peer, Process, boot, free_port, odometry, read_until

ASK_PERIOD_S = 0.1
ALLOWED_LATE_S = 0.2
ALLOWED_GROWTH_MB = 20.0  # the vehicle keeps its newest 10000 events, and those of an attack are large
ALLOWED_DESCRIPTORS = 128
CALM_S = 3.0
CONNECTIONS = 300
STRANGERS = 40
ROUND_S = 20.0
SPARED_COMMANDS = frozenset({246})  # a reboot is obeyed, which is no fault
SPARED_MESSAGES = frozenset({"SETUP_SIGNING"})  # and so is a key that shuts the ground station out
PAGE_TABLE = "siege"


@dataclass(frozen=True)
class Target:
    """Where the vehicle is reached."""

    tcp_port: int
    udp_port: int
    web_port: int


Attack = Callable[[Target, random.Random], Iterator[None]]


def connection(port: int) -> socket.socket:
    """Return a TCP connection that never waits."""
    client = socket.create_connection(("127.0.0.1", port), LIMIT_S)
    client.setblocking(False)
    return client


def pour(port: int, make: Callable[[], bytes]) -> Iterator[None]:
    """Send on a TCP connection as fast as it takes it, and never read."""
    client, data = connection(port), b""
    with client:
        while True:
            data = data or make()
            try:
                data = data[client.send(data) :]
            except BlockingIOError:
                time.sleep(0.001)
            yield


def raw_frame(source: random.Random, mav: Any) -> bytes:
    """Return a whole frame of any known kind, with a payload of noise."""
    while True:
        kind = source.choice(list(mavlink2.mavlink_map.values()))
        if kind.msgname in SPARED_MESSAGES:
            continue
        payload = source.randbytes(kind.unpacker.size)
        if kind.msgname in ("COMMAND_LONG", "COMMAND_INT") and SPARED_COMMANDS & set(kind.unpacker.unpack(payload)):
            continue
        message = mavlink2.MAVLink_message(kind.id, kind.msgname)
        return bytes(message._pack(mav, kind.crc_extra, payload))


def flood_of_samples(target: Target, source: random.Random) -> Iterator[None]:
    """ODOMETRY as fast as TCP takes it."""
    mav = mavlink2.MAVLink(None, 255, 197)
    return pour(target.tcp_port, lambda: b"".join(odometry().pack(mav) for _ in range(100)))


def flood_of_noise(target: Target, source: random.Random) -> Iterator[None]:
    """Random bytes as fast as TCP takes them."""
    return pour(target.tcp_port, lambda: source.randbytes(65536))


def hostile_frames(target: Target, source: random.Random) -> Iterator[None]:
    """Whole frames of every kind with contents of noise, as fast as TCP takes them."""
    mav = mavlink2.MAVLink(None, 255, 190)
    return pour(target.tcp_port, lambda: b"".join(raw_frame(source, mav) for _ in range(100)))


def absurd_parameters(target: Target, source: random.Random) -> Iterator[None]:
    """PARAM_SET of the library's parameters to any float there is, and lists of all of them."""
    mav = mavlink2.MAVLink(None, 255, 190)
    names = (b"VISO_TYPE", b"VISO_POS_X", b"VISO_SCALE", b"VISO_DELAY_MS", b"VISO_VEL_M_NSE", b"EK3_POS_I_GATE")

    def make() -> bytes:
        value = mavlink2.struct.unpack("<f", source.randbytes(4))[0]
        setting = mavlink2.MAVLink_param_set_message(1, 1, source.choice(names), value, 9)
        listing = mavlink2.MAVLink_param_request_list_message(1, 1)
        return bytes(setting.pack(mav)) * 20 + bytes(listing.pack(mav))

    return pour(target.tcp_port, make)


def strangers(target: Target, source: random.Random) -> Iterator[None]:
    """Datagrams from many addresses: one byte, noise, and whole frames of a heartbeat."""
    sockets = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(STRANGERS)]
    beat = mavlink2.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3).pack(mavlink2.MAVLink(None, 250, 1))
    while True:
        for stranger in sockets:
            with suppress(OSError):
                data = source.choice((b"x", source.randbytes(source.randrange(1500)), beat))
                stranger.sendto(data, ("127.0.0.1", target.udp_port))
        yield


def idle_connections(port: int) -> Iterator[None]:
    """Open connections that ask for nothing, more than there are descriptors for."""
    opened: list[socket.socket] = []
    while True:
        with suppress(OSError):
            client = socket.socket()
            client.setblocking(False)
            opened.append(client)
            client.connect_ex(("127.0.0.1", port))
        if len(opened) > CONNECTIONS:
            opened.pop(0).close()
        yield


def idle_pages(target: Target, source: random.Random) -> Iterator[None]:
    """Connections to the page that ask for nothing."""
    return idle_connections(target.web_port)


def idle_clients(target: Target, source: random.Random) -> Iterator[None]:
    """Connections to the TCP link that say nothing."""
    return idle_connections(target.tcp_port)


def bad_requests(target: Target, source: random.Random) -> Iterator[None]:
    """Requests to the page that are broken, endless, or for a socket and then noise."""
    upgrade = (
        b"GET /live HTTP/1.1\r\nHost: 127.0.0.1\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        b"Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n"
    )
    while True:
        with suppress(OSError), connection(target.web_port) as client:
            head = source.choice((b"GET / HTTP/1.1\r\n", b"GET /" + b"a" * 60000, upgrade, source.randbytes(4000)))
            client.send(head + source.randbytes(source.randrange(4000)))
        yield


ATTACKS: dict[str, Attack] = {
    "nothing, for comparison": lambda target, source: iter(lambda: time.sleep(0.05), 0),
    "ODOMETRY without end over TCP": flood_of_samples,
    "noise without end over TCP": flood_of_noise,
    "frames of every kind with any contents": hostile_frames,
    "absurd parameters, and their list": absurd_parameters,
    f"datagrams from {STRANGERS} strangers": strangers,
    "connections to the page that ask for nothing": idle_pages,
    "connections to the link that say nothing": idle_clients,
    "broken requests to the page": bad_requests,
}


def attack(name: str, target: Target, seed: int) -> None:
    """Attack until this process is ended."""
    source = random.Random(seed)
    while True:
        with suppress(OSError):  # the vehicle shut the connection: restart
            for _ in ATTACKS[name](target, source):
                pass
        time.sleep(0.01)


@dataclass
class Felt:
    """What the ground station felt of one attack, over all rounds.

    Attributes:
        seconds: how long it was.
        beats_late_s: by how much heartbeats came later than a second after the last.
        round_trips_ms: of its questions for the time.
        missing: frames of the vehicle that did not come.
    """

    seconds: float = 0.0
    beats_late_s: list[float] = field(default_factory=list)
    round_trips_ms: list[float] = field(default_factory=list)
    missing: int = 0

    def row(self, name: str) -> tuple[str, ...]:
        """Return the figures in words."""
        ranked = sorted(self.round_trips_ms) or [float("nan")]
        late_ms = 1000 * max(self.beats_late_s, default=float("nan"))
        middle, high = ranked[len(ranked) // 2], ranked[len(ranked) * 99 // 100]
        times = f"{middle:.1f}", f"{high:.1f}", f"{ranked[-1]:.1f}"
        return name, f"{self.seconds:.0f} s", f"{late_ms:.0f} ms", *times, f"{self.missing}"

    def findings(self, name: str) -> Iterator[str]:
        """Yield what is wrong."""
        if not self.beats_late_s or max(self.beats_late_s) > ALLOWED_LATE_S:
            yield f"{name}: heartbeats late by {max(self.beats_late_s, default=float('inf')):.2f} s"
        if not self.round_trips_ms or max(self.round_trips_ms) > 1000 * ALLOWED_LATE_S:
            yield f"{name}: the time asked for came after {max(self.round_trips_ms, default=float('inf')):.0f} ms"


HEAD = ("attack", "for", "heartbeat late at most", "TIMESYNC, ms: median", "99 %", "longest", "frames missing")


@dataclass
class Siege:
    """Figures of a whole siege."""

    felt: dict[str, Felt] = field(default_factory=lambda: {name: Felt() for name in ATTACKS})
    memory_mb: list[float] = field(default_factory=list)
    descriptors: int = 0
    verdicts: int = 0
    noise_bytes: int = 0
    exit_code: int | None = None
    records: int = 0
    said: str = ""

    def findings(self) -> list[str]:
        """Return what is wrong."""
        found = [line for name, felt in self.felt.items() for line in felt.findings(name)]
        growth_mb = self.memory_mb[-1] - self.memory_mb[len(ATTACKS)]  # after every attack was made once
        if growth_mb > ALLOWED_GROWTH_MB:
            found.append(f"memory grew by {growth_mb:.1f} MB after the first round")
        if self.descriptors > ALLOWED_DESCRIPTORS:
            found.append(f"{self.descriptors} descriptors were open")
        if self.exit_code != 0 or "Traceback" in self.said:
            found.append(f"exit code {self.exit_code}: {self.said[-500:]}")
        return found if self.records else [*found, "no log"]

    def table(self) -> str:
        """Return the figures in Markdown."""
        rows = [felt.row(name) for name, felt in self.felt.items()]
        memory = f"{self.memory_mb[0]:.0f} MB at first, {self.memory_mb[len(ATTACKS)]:.0f} after a round, "
        return (
            f"{render(HEAD, rows)}\n"
            f"{self.verdicts:,} frames met their verdicts, and {self.noise_bytes:,} bytes outside frames were counted. "
            f"Memory: {memory}{self.memory_mb[-1]:.0f} in the end. At most {self.descriptors} descriptors were open. "
            f"Exit code {self.exit_code}; pymavlink reads {self.records:,} records of the log.\n\n{where()}"
        )


def watch(peer: Peer, seconds: float, felt: Felt) -> None:
    """Ask for the time and listen, and note what came late."""
    end_s, missing = time.monotonic() + seconds, peer.missing
    peer.round_trips_ms.clear()
    peer.beat_times_s.clear()
    while time.monotonic() < end_s:
        peer.send(mavlink2.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3))
        peer.send(mavlink2.MAVLink_timesync_message(0, time.monotonic_ns()))
        read_until(time.monotonic() + ASK_PERIOD_S, [peer])
    felt.seconds += seconds
    felt.beats_late_s += [after - before - 1.0 for before, after in pairwise(peer.beat_times_s)]
    felt.round_trips_ms += peer.round_trips_ms
    felt.missing += peer.missing - missing


def besiege(minutes: float, peer: Peer, target: Target, process: Process) -> Siege:
    """Attack in rounds, every attack once in each, and measure."""
    siege, number, end_s = Siege(memory_mb=[process.resident_mb()]), 0, time.monotonic() + minutes * 60
    spawn = multiprocessing.get_context("spawn")
    while number < len(ATTACKS) or time.monotonic() < end_s:
        name = list(ATTACKS)[number % len(ATTACKS)]
        attacker = spawn.Process(target=attack, args=(name, target, number), daemon=True)
        attacker.start()
        read_until(time.monotonic() + CALM_S, [peer])  # until it has begun
        watch(peer, min(ROUND_S, minutes * 60 / len(ATTACKS)), siege.felt[name])
        siege.descriptors = max(siege.descriptors, process.open_descriptors())
        siege.memory_mb.append(process.resident_mb())
        attacker.kill()
        attacker.join()
        number += 1
        print(" | ".join(siege.felt[name].row(name)), flush=True)
    return siege


def run(minutes: float) -> Siege:
    """Start the vehicle, besiege it, end it."""
    peer = Peer(free_port(), 190)
    target = Target(free_port(socket.SOCK_STREAM), free_port(), free_port(socket.SOCK_STREAM))
    line = [sys.executable, "-c", "from viso.cli import main; main()", "serve", "--json", "--param", "VISO_TYPE=1"]
    line += ["--master", f"udpin:127.0.0.1:{peer.port}", "--master", f"tcpin:127.0.0.1:{target.tcp_port}"]
    line += ["--master", f"udpin:127.0.0.1:{target.udp_port}", "--web", f"127.0.0.1:{target.web_port}"]
    with (
        tempfile.TemporaryDirectory(prefix="viso-siege-") as folder,
        Path(folder, "said.txt").open("w+") as said,  # a pipe that nobody reads would hold the vehicle up
        subprocess.Popen([*line, "--log-dir", folder], stdout=subprocess.PIPE, stderr=said, text=True) as child,
    ):
        try:
            boot([peer])
            siege = besiege(minutes, peer, target, Process(child.pid))
            child.send_signal(signal.SIGINT)
            out, _ = child.communicate(timeout=LIMIT_S)
        finally:
            peer.close()
            with suppress(ProcessLookupError):
                child.kill()
        said.seek(0)
        siege.exit_code, siege.said = child.returncode, said.read()
        for row in json.loads(out)["verdicts"]:
            if row["message"] == "BAD_DATA":
                siege.noise_bytes += row["count"]
            else:
                siege.verdicts += row["count"]
        for path in Path(folder).glob("*.BIN"):
            with DFReader_binary(str(path)) as log:
                siege.records += sum(1 for _ in iter(log.recv_msg, None))
    return siege


def main(args: Sequence[str]) -> int:
    """Besiege, print the figures, and return 1 when there are findings."""
    parser = argparse.ArgumentParser(prog="python -m tools.siege", description=str(__doc__).splitlines()[0])
    parser.add_argument("--minutes", type=float, default=20.0, help="how long (default 20)")
    parser.add_argument("--page", type=Path, help="write the table into this page as well")
    options = parser.parse_args(args)
    siege = run(options.minutes)
    found = siege.findings()
    print("\n".join([siege.table(), *(f"FINDING: {line}" for line in found)]))
    if options.page is not None:
        text = options.page.read_text(encoding="utf-8")
        options.page.write_text(replace(text, PAGE_TABLE, siege.table()), encoding="utf-8")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
