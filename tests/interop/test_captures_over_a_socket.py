# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Recorded conversations, played to `viso serve` over TCP in their time, get the recorded texts and answers."""

import gzip
import json
import math
import re
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink2

from tests.places import RECORDED
from viso.compare.tolerances import TEXT_EXCEPTIONS
from viso.replay.feed import batches
from viso.streams.stream_kinds import Stream, read_stream

pytestmark = pytest.mark.interop

NAMES = sorted(path.name.removesuffix(".jsonl.gz") for path in (RECORDED / "captures").glob("*.jsonl.gz"))


def header_of(name: str) -> dict[str, Any]:
    """Return the first line of a capture: parameters, recorded texts and answers."""
    with gzip.open(RECORDED / "captures" / f"{name}.jsonl.gz", "rt", encoding="utf-8") as file:
        header: dict[str, Any] = json.loads(file.readline())
    return header


# What becomes of a capture's samples depends on the attitude of the vehicle (T265, VOXL): it is the recorded one.
ALIGNED = [name for name in NAMES if header_of(name)["params"]["VISO_TYPE"] != 1]
SPEEDUP = 2.0
UART_BAUD = 115200
LIMIT_S = 120.0
# No longer: silence makes texts of its own, and the recorder had gone by then.
AFTER_S = 0.3
# Of the simulator's airframe, not of the autopilot.
NOT_HERE = {"SIM_GPS1_ENABLE", "ARMING_SKIPCHK"}
NUMBER = re.compile(r"\d+(?:\.\d+)?")
TAKE_OFF = mavlink2.MAV_CMD_NAV_TAKEOFF

# Angles in texts depend on the instant; the vehicle turns while messages travel.
ANGLE_TOLERANCE_DEG = 1.5

# Texts only of the firmware, and only of ours.
PREARM = next(exception for exception in TEXT_EXCEPTIONS if exception.name == "prearm")


@dataclass
class Played:
    """A capture's first line, and what `viso serve` answered."""

    header: dict[str, Any]
    texts: list[tuple[int, str]]
    acks: list[tuple[int, int]]


class Conversation:
    """Plays one capture; the vehicle's clock is read with TIMESYNC."""

    def __init__(self, link: socket.socket) -> None:
        self._link = link
        self._parser = mavlink2.MAVLink(None)
        self._parser.robust_parsing = True
        self._packer = mavlink2.MAVLink(None, 1, 197)
        self._boot_s = 0.0
        self.texts: list[tuple[int, str]] = []
        self.acks: list[tuple[int, int]] = []
        self._partial = ""

    def synchronise(self) -> None:
        """Find out when the vehicle booted, by the shortest of some round trips."""
        best_s = 1e9
        for _ in range(10):
            asked_s = time.monotonic()
            self._link.sendall(
                mavlink2.MAVLink(None, 1, 197).timesync_encode(0, 7).pack(mavlink2.MAVLink(None, 1, 197))
            )
            reply = self._wait_for_timesync()
            took_s = time.monotonic() - asked_s
            if took_s < best_s:
                best_s, self._boot_s = took_s, asked_s + took_s / 2 - reply.tc1 / 1e9 / SPEEDUP

    def _wait_for_timesync(self) -> Any:
        end_s = time.monotonic() + LIMIT_S
        while time.monotonic() < end_s:
            for message in self.receive(0.5):
                if message.get_type() == "TIMESYNC" and message.ts1 == 7:
                    return message
        raise AssertionError("no answer to TIMESYNC")

    def receive(self, timeout_s: float) -> list[Any]:
        """Return the messages that come within a time, or sooner, and note texts and answers."""
        self._link.settimeout(max(timeout_s, 1e-4))
        try:
            data = self._link.recv(65536)
        except TimeoutError:
            return []
        assert data, "viso serve has closed the connection"
        messages = self._parser.parse_buffer(data) or []
        for message in messages:
            if message.get_type() == "STATUSTEXT":
                self._note_text(message)
            elif message.get_type() == "COMMAND_ACK":
                self.acks.append((message.command, message.result))
        return list(messages)

    def _note_text(self, message: Any) -> None:
        self._partial += message.text
        if message.id == 0 or len(message.text) < 50:
            self.texts.append((message.severity, self._partial))
            self._partial = ""

    def run_until(self, vehicle_s: float) -> None:
        """Receive until the vehicle's clock shows a time."""
        due_s = self._boot_s + vehicle_s / SPEEDUP
        while (left_s := due_s - time.monotonic()) > 0:
            self.receive(left_s)

    def play(self, stream: Stream) -> None:
        """Send what was waiting together, when it was handled."""
        first_us = next(message.arrival_us for message in stream.messages if message.arrival_us is not None)
        for batch in batches(stream):
            arrival_us = first_us if batch[0].arrival_us is None else batch[0].arrival_us
            self.run_until(arrival_us / 1e6)
            self._link.sendall(b"".join(message.frame for message in batch))


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def connect(port: int) -> socket.socket:
    end_s = time.monotonic() + LIMIT_S
    while True:
        try:
            return socket.create_connection(("127.0.0.1", port), timeout=1.0)
        except OSError:
            assert time.monotonic() < end_s, "viso serve does not listen"
            time.sleep(0.05)


def play(name: str, folder: Path) -> Played:
    capture, header = RECORDED / "captures" / f"{name}.jsonl.gz", header_of(name)
    attitude = ["--ahrs", str(RECORDED / "logs" / f"{name}.BIN.xz")] if name in ALIGNED else []
    port = free_port()
    command = [sys.executable, "-c", "from viso.cli import main; main()", "serve"]
    command += ["--master", f"tcpin:127.0.0.1:{port}", "--speedup", str(SPEEDUP), "--baud", str(UART_BAUD)]
    command += ["--log-dir", str(folder / name), *attitude]
    for key, value in header["params"].items():
        command += ["--param", f"{key}={value}"] if key not in NOT_HERE else []
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as process:
        try:
            with connect(port) as link:
                conversation = Conversation(link)
                conversation.synchronise()
                stream = read_stream(capture, 0)
                conversation.play(stream)
                last_us = max(message.arrival_us or 0 for message in stream.messages)
                conversation.run_until(last_us / 1e6 + AFTER_S)
        finally:
            with suppress(ProcessLookupError):
                process.kill()
    return Played(header, conversation.texts, conversation.acks)


@pytest.fixture(scope="module")
def played(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, Played]]:
    """Return every capture by name; all are played at the same time, as each takes as long as it was."""
    folder = tmp_path_factory.mktemp("captures")
    with ThreadPoolExecutor(len(NAMES)) as pool:
        yield dict(zip(NAMES, pool.map(lambda name: play(name, folder), NAMES), strict=True))


def concerns_us(text: str) -> bool:
    """Return whether a text is about external navigation or about arming."""
    return text.startswith(("VisOdom: ", "PreArm: VisOdom: ", "Arm: ", "Arming ", "Field Elevation", "Internal Err"))


def is_same(one: str, other: str) -> bool:
    """Return whether texts have the same words, and numbers that hardly differ, angles across north included."""
    numbers = [[float(number) for number in NUMBER.findall(text)] for text in (one, other)]
    return NUMBER.sub("#", one) == NUMBER.sub("#", other) and all(
        abs(math.remainder(a - b, 360)) <= ANGLE_TOLERANCE_DEG for a, b in zip(*numbers, strict=True)
    )


def without(texts: list[str], exceptions: Sequence[str]) -> list[str]:
    """Leave out each exception once, the last of its kind; all of them must be there."""
    left = list(texts)
    for exception in exceptions:
        del left[max(index for index, text in enumerate(left) if is_same(text, exception))]
    return left


@pytest.mark.parametrize("name", NAMES)
def test_texts_are_the_recorded_ones(played: dict[str, Played], name: str) -> None:
    theirs = [text for _, text in played[name].header["statustext"] if concerns_us(text)]
    ours = [text for _, text in played[name].texts if concerns_us(text)]
    only_theirs, only_ours = (PREARM.recorded, PREARM.ours) if name == PREARM.name else ((), ())
    left, expected = without(ours, only_ours), without(theirs, only_theirs)
    assert len(left) == len(expected), (left, expected)
    assert [(a, b) for a, b in zip(left, expected, strict=True) if not is_same(a, b)] == []


@pytest.mark.parametrize("name", sorted(set(NAMES) - set(ALIGNED)))
def test_estimator_tells_the_recorded_texts(played: dict[str, Played], name: str) -> None:
    # Cores tell theirs in either order. With a recorded attitude there is no estimator to tell anything.
    def by_estimator(texts: list[tuple[int, str]]) -> list[str]:
        return sorted(NUMBER.sub("#", text.replace("-", "")) for _, text in texts if text.startswith("EKF3 IMU"))

    header = [(severity, text) for severity, text in played[name].header["statustext"]]
    assert by_estimator(played[name].texts) == by_estimator(header)


@pytest.mark.parametrize("name", NAMES)
def test_texts_have_the_recorded_severity(played: dict[str, Played], name: str) -> None:
    theirs = {text: severity for severity, text in played[name].header["statustext"]}
    assert [(severity, text) for severity, text in played[name].texts if theirs.get(text, severity) != severity] == []


@pytest.mark.parametrize("name", NAMES)
def test_commands_get_the_recorded_answers(played: dict[str, Played], name: str) -> None:
    theirs = [tuple(ack) for ack in played[name].header["command_ack"]]
    assert [ack for ack in played[name].acks if ack[0] != TAKE_OFF] == [ack for ack in theirs if ack[0] != TAKE_OFF]
