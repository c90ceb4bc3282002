# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""`viso serve` over real sockets: dying clients, floods, one that reads nothing, a log without space, and `kill -9`."""

import json
import random
import resource
import signal
import socket
import struct
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Event, Thread
from typing import Any

import pytest
from pymavlink.DFReader import DFReader_binary
from pymavlink.dialects.v20 import ardupilotmega as mavlink2

from viso.parameters.store import ParamStore

pytestmark = pytest.mark.interop

LIMIT_S = 20.0
CLIENTS = 50
KILLS = 4
SPEEDUP = 10
ALLOWED_GROWTH_KB = 4_000
START = "from viso.cli import main; main()"
LOG_LIMIT_BYTES = 60_000
LIMITED_START = f"""
import resource, sys
sys.dont_write_bytecode = True  # which it would cut short
resource.setrlimit(resource.RLIMIT_FSIZE, ({LOG_LIMIT_BYTES}, {LOG_LIMIT_BYTES}))
from viso.cli import main
main()
"""
DESCRIPTORS = 64
FEW_DESCRIPTORS_START = f"""
import resource
resource.setrlimit(resource.RLIMIT_NOFILE, ({DESCRIPTORS}, {DESCRIPTORS}))
from viso.cli import main
main()
"""


def free_port(kind: socket.SocketKind) -> int:
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


class Server:
    """A running `viso serve` with a TCP and a UDP link."""

    def __init__(self, process: "subprocess.Popen[str]", tcp_port: int, udp_port: int) -> None:
        self.process = process
        self.tcp_port = tcp_port
        self.udp_port = udp_port

    def resident_kb(self) -> int:
        """Return how much memory it has."""
        pages = int(Path(f"/proc/{self.process.pid}/statm").read_text().split()[1])
        return pages * resource.getpagesize() // 1024

    def connect(self) -> socket.socket:
        """Return a connection to the TCP link."""
        return socket.create_connection(("127.0.0.1", self.tcp_port), LIMIT_S)

    def stop(self, code: int = 0) -> tuple[dict[tuple[str, str], int], str]:
        """End it; return the counts by message and rule, and what it said to people."""
        self.process.send_signal(signal.SIGINT)
        out, err = self.process.communicate(timeout=LIMIT_S)
        assert self.process.returncode == code, err
        rows = json.loads(out)["verdicts"]
        return {(row["message"], row["rule"]): row["count"] for row in rows}, err


@contextmanager
def serving(folder: Path, start: str = START, *options: str) -> Iterator[Server]:
    """Start `viso serve` and end it, whatever happens."""
    tcp_port, udp_port = free_port(socket.SOCK_STREAM), free_port(socket.SOCK_DGRAM)
    command = [sys.executable, "-c", start, "serve", "--master", f"tcpin:127.0.0.1:{tcp_port}", "--json"]
    command += ["--master", f"udpin:127.0.0.1:{udp_port}", "--log-dir", str(folder), "--speedup", str(SPEEDUP)]
    command += ["--param", "VISO_TYPE=1", *options]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            yield Server(process, tcp_port, udp_port)
        finally:
            with suppress(ProcessLookupError):
                process.kill()


class Watcher:
    """A healthy ground station on the UDP link."""

    def __init__(self, server: Server) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.connect(("127.0.0.1", server.udp_port))
        self._socket.settimeout(0.05)
        self.mav = mavlink2.MAVLink(None, 255, 190)
        self.mav.robust_parsing = True
        self.seen: Counter[str] = Counter()

    def __enter__(self) -> "Watcher":
        return self

    def __exit__(self, *_: object) -> None:
        self._socket.close()

    def say(self, message: Any) -> None:
        with suppress(ConnectionRefusedError):
            self._socket.send(message.pack(self.mav))

    def listen(self) -> list[Any]:
        """Return what comes within a moment."""
        try:
            data = self._socket.recv(65535)
        except (TimeoutError, ConnectionRefusedError):
            return []
        messages = self.mav.parse_buffer(data) or []
        self.seen.update(message.get_type() for message in messages)
        return messages

    def wait(self, wanted: Callable[[Any], bool], ask: Any = None) -> Any:
        """Ask until a wanted message comes."""
        end_s = time.monotonic() + LIMIT_S
        while time.monotonic() < end_s:
            self.say(ask or heartbeat())
            for message in self.listen():
                if wanted(message):
                    return message
        pytest.fail("nothing wanted came")

    def wait_beats(self, count: int) -> None:
        """Wait for a number of heartbeats of the vehicle."""
        for _ in range(count):
            self.wait(lambda message: message.get_type() == "HEARTBEAT")


def heartbeat() -> Any:
    return mavlink2.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3)


def read_request(name: bytes) -> Any:
    return mavlink2.MAVLink_param_request_read_message(1, 1, name, -1)


def frames(source: random.Random) -> bytes:
    """Return what a client sends before it dies: requests that make the vehicle talk."""
    mav = mavlink2.MAVLink(None, 255, source.randrange(1, 250))
    wanted = [heartbeat(), mavlink2.MAVLink_param_request_list_message(1, 1), read_request(b"VISO_TYPE")]
    wanted.append(mavlink2.MAVLink_timesync_message(0, 12345))
    return b"".join(source.choice(wanted).pack(mav) for _ in range(source.randrange(1, 8)))


def die(client: socket.socket, source: random.Random) -> None:
    """End a connection in one of the ways in which connections end."""
    data = frames(source)
    with suppress(OSError), client:
        how = source.randrange(5)
        if how == 1:
            client.sendall(data[: source.randrange(len(data))])
        elif how == 2:
            client.sendall(data)
            client.recv(source.randrange(1, 4096))
        elif how == 3:
            client.sendall(source.randbytes(source.randrange(1, 5000)))
        elif how == 4:
            client.sendall(data)
        if source.random() < 0.5:  # reset instead of an orderly end
            client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))


def last_log_times(folder: Path) -> list[int]:
    """Return the times of all records of the only log."""
    with DFReader_binary(str(folder / "00000001.BIN")) as log:
        return [record.TimeUS for record in iter(log.recv_msg, None) if hasattr(record, "TimeUS")]


def test_fifty_clients_that_die_at_random_points_leave_the_vehicle_well(tmp_path: Path) -> None:
    source = random.Random(3)
    with serving(tmp_path) as server, Watcher(server) as watcher:
        watcher.wait_beats(6)
        for number in range(CLIENTS):
            die(server.connect(), source)
            watcher.listen()
            if number == CLIENTS // 5:
                watcher.wait_beats(3)
                early_kb = server.resident_kb()
        watcher.wait_beats(10)
        assert server.resident_kb() - early_kb < ALLOWED_GROWTH_KB
        with server.connect() as client:
            client.settimeout(LIMIT_S)
            client.sendall(heartbeat().pack(watcher.mav))
            assert client.recv(4096)
        watcher.wait(lambda message: message.get_type() == "PARAM_VALUE", read_request(b"VISO_TYPE"))
        counts, _ = server.stop()
    assert watcher.seen["BAD_DATA"] == 0
    assert counts["HEARTBEAT", "handled"] > 20
    assert counts["BAD_DATA", "bad_prefix"] > 1000
    times = last_log_times(tmp_path)
    assert times == sorted(times)


def test_client_that_reads_nothing_for_a_minute_keeps_nobody_waiting(tmp_path: Path) -> None:
    every_5_ms = mavlink2.MAVLink_command_long_message(1, 1, 511, 0, 30, 5000, 0, 0, 0, 0, 0)
    with serving(tmp_path) as server, Watcher(server) as watcher, socket.socket() as client:
        client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        watcher.wait_beats(6)
        client.connect(("127.0.0.1", server.tcp_port))
        client.sendall(every_5_ms.pack(mavlink2.MAVLink(None, 255, 191)))
        watcher.wait_beats(60)
        parser = mavlink2.MAVLink(None)
        parser.robust_parsing = True
        client.settimeout(LIMIT_S)
        read = Counter(
            message.get_type() for _ in range(40) for message in parser.parse_buffer(client.recv(4096)) or []
        )
        assert read["BAD_DATA"] == 0
        assert read["ATTITUDE"] > 100
        server.stop()
    times = last_log_times(tmp_path)
    assert times[-1] - times[0] > 60_000_000


def confirmed(watcher: Watcher, ask: Any) -> float:
    """Ask for VISO_DELAY_MS, to read or to set it, until it comes."""
    found = watcher.wait(lambda message: getattr(message, "param_id", None) == "VISO_DELAY_MS", ask)
    return float(found.param_value)


def test_value_that_was_confirmed_survives_kill_9(tmp_path: Path) -> None:
    for value in range(1, KILLS + 1):
        with serving(tmp_path) as server, Watcher(server) as watcher:
            watcher.wait_beats(1)
            change = mavlink2.MAVLink_param_set_message(1, 1, b"VISO_DELAY_MS", value, 4)
            assert confirmed(watcher, change) == value
            server.process.kill()
        assert ParamStore(tmp_path / "storage.parm").load()["VISO_DELAY_MS"] == value
    with serving(tmp_path) as server, Watcher(server) as watcher:
        watcher.wait_beats(1)
        assert confirmed(watcher, read_request(b"VISO_DELAY_MS")) == KILLS


def test_log_without_space_does_not_end_the_vehicle(tmp_path: Path) -> None:
    with serving(tmp_path, LIMITED_START) as server, Watcher(server) as watcher:
        watcher.wait_beats(6)
        for number in range(2000):
            watcher.say(mavlink2.MAVLink_vision_position_estimate_message(number, 1, 2, 3, 0, 0, 0))
            if number % 50 == 0:
                watcher.listen()
        watcher.wait_beats(4)
        watcher.wait(lambda message: message.get_type() == "PARAM_VALUE", read_request(b"VISO_TYPE"))
        _, said = server.stop(code=1)
    assert "records lost: " in said
    assert (tmp_path / "00000001.BIN").stat().st_size == LOG_LIMIT_BYTES
    assert last_log_times(tmp_path)


@pytest.mark.parametrize("target", ["page", "link"])
def test_connections_that_ask_for_nothing_cost_others_nothing(tmp_path: Path, target: str) -> None:
    web_port = free_port(socket.SOCK_STREAM)
    options = ("--web", f"127.0.0.1:{web_port}")
    with serving(tmp_path, FEW_DESCRIPTORS_START, *options) as server, Watcher(server) as watcher:
        watcher.wait_beats(6)
        port = web_port if target == "page" else server.tcp_port
        idle = []
        for _ in range(2 * DESCRIPTORS):
            connection = socket.socket()
            connection.setblocking(False)
            with suppress(BlockingIOError):
                connection.connect(("127.0.0.1", port))
            idle.append(connection)
            watcher.listen()
        watcher.wait_beats(20)
        open_descriptors = len(list(Path(f"/proc/{server.process.pid}/fd").iterdir()))
        for connection in idle:
            connection.close()
        _, said = server.stop()
    assert open_descriptors < DESCRIPTORS
    assert "Traceback" not in said
    assert last_log_times(tmp_path)


def any_frames(source: random.Random) -> bytes:
    """Return frames of every kind with random contents, but those that are obeyed without being a fault."""
    mav, frames = mavlink2.MAVLink(None, 255, 190), b""
    for kind in mavlink2.mavlink_map.values():
        if kind.msgname not in ("COMMAND_LONG", "COMMAND_INT", "SETUP_SIGNING", "PARAM_SET"):
            message = mavlink2.MAVLink_message(kind.id, kind.msgname)
            frames += message._pack(mav, kind.crc_extra, source.randbytes(kind.unpacker.size))
    return frames


def samples() -> bytes:
    """Return ODOMETRY at rest, 100 messages."""
    mav, at_rest = mavlink2.MAVLink(None, 255, 197), (0, 0, 0, [1, 0, 0, 0], 0, 0, 0, 0, 0, 0, [0.01] * 21, [0.01] * 21)
    stamps_us = range(0, 1_000_000, 10_000)
    return b"".join(mavlink2.MAVLink_odometry_message(us, 20, 12, *at_rest, 0, 3, 90).pack(mav) for us in stamps_us)


def flood(connect: Callable[[], socket.socket], data: bytes, stop: Event) -> None:
    """Send as fast as the other end takes it, and connect again when it has had enough."""
    while not stop.wait(0.01):
        with suppress(OSError), connect() as client:
            while not stop.is_set():
                client.sendall(data)


def test_floods_of_links_and_page_keep_nobody_waiting(tmp_path: Path) -> None:
    source, stop = random.Random(5), Event()
    web_port = free_port(socket.SOCK_STREAM)
    options = ("--web", f"127.0.0.1:{web_port}", "--speedup", "1")
    with serving(tmp_path, START, *options) as server, Watcher(server) as watcher:
        watcher.wait_beats(3)
        page = ("127.0.0.1", web_port)
        floods = [(server.connect, data) for data in (samples(), any_frames(source), source.randbytes(65536))]
        floods.append((lambda: socket.create_connection(page, LIMIT_S), b"GET / HTTP/1.1\r\n" + source.randbytes(4000)))
        threads = [Thread(target=flood, args=(*one, stop)) for one in floods]
        for thread in threads:
            thread.start()
        try:
            watcher.wait_beats(5)
            watcher.wait(lambda message: message.get_type() == "PARAM_VALUE", read_request(b"VISO_TYPE"))
        finally:
            stop.set()
            for thread in threads:
                thread.join(LIMIT_S)
        counts, said = server.stop()
    assert watcher.seen["BAD_DATA"] == 0
    assert counts["ODOMETRY", "consumed"] > 100
    assert counts["BAD_DATA", "bad_prefix"] > 10_000
    assert "Traceback" not in said
    assert last_log_times(tmp_path)
