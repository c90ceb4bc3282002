# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A stock pymavlink client talks to `viso serve` over real sockets and a pseudo-terminal, in real time."""

import os
import select
import signal
import socket
import subprocess
import sys
import threading
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from io import FileIO
from pathlib import Path
from typing import Any

import pytest
from pymavlink import mavutil
from pymavlink.DFReader import DFReader_binary
from pymavlink.dialects.v20 import ardupilotmega as mavlink2

pytestmark = pytest.mark.interop

LIMIT_S = 20.0
PAUSE_S = 0.5
VISION_POSITION = mavlink2.MAV_SYS_STATUS_SENSOR_VISION_POSITION
RUN_PREARM_CHECKS = mavlink2.MAV_CMD_RUN_PREARM_CHECKS
ARM_DISARM = mavlink2.MAV_CMD_COMPONENT_ARM_DISARM
SET_MESSAGE_INTERVAL = mavlink2.MAV_CMD_SET_MESSAGE_INTERVAL


class Autopilot:
    """A running `viso serve`; ``lines`` are what it prints, with the time left out."""

    def __init__(self, process: "subprocess.Popen[str]", log: Path) -> None:
        self.process = process
        self.log = log
        self.lines: list[str] = []
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        self.lines.extend(line.rstrip() for line in self.process.stdout)

    def stop(self, number: int) -> int:
        """Send a signal and return the exit code."""
        self.process.send_signal(number)
        code = self.process.wait(LIMIT_S)
        self._reader.join(LIMIT_S)
        return code


@contextmanager
def serving(folder: Path, *masters: str) -> Iterator[Autopilot]:
    """Start `viso serve` with VISO_TYPE 1 and end it, whatever happens."""
    links = [argument for master in masters for argument in ("--master", master)]
    command = [sys.executable, "-c", "from viso.cli import main; main()", "serve", *links]
    command += ["--param", "VISO_TYPE=1", "--log-dir", str(folder), "--speedup", "1"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as process:
        autopilot = Autopilot(process, folder / "00000001.BIN")
        try:
            yield autopilot
        finally:
            # The pipe must not be closed while the reader is still in it.
            autopilot.stop(signal.SIGKILL)


class Client:
    """What a companion's bridge does with pymavlink."""

    def __init__(self, connection: Any) -> None:
        self.link = connection

    def until(self, kind: str, wanted: Callable[[Any], bool] = lambda _message: True) -> Any:
        """Return the next message of a kind that is wanted."""
        end_s = time.monotonic() + LIMIT_S
        while (left_s := end_s - time.monotonic()) > 0:
            message = self.link.recv_match(type=kind, blocking=True, timeout=left_s)
            if message is not None and wanted(message):
                return message
        pytest.fail(f"no such {kind} within {LIMIT_S} s")

    def connect(self) -> None:
        """Make oneself heard until the autopilot's heartbeat comes."""
        end_s = time.monotonic() + LIMIT_S
        while time.monotonic() < end_s:
            self.heartbeat()
            if self.link.wait_heartbeat(timeout=0.5) is not None:
                return
        pytest.fail("no heartbeat")

    def heartbeat(self) -> None:
        kind = mavlink2.MAV_TYPE_ONBOARD_CONTROLLER
        self.link.mav.heartbeat_send(kind, mavlink2.MAV_AUTOPILOT_INVALID, 0, 0, 0)

    def command(self, command: int, *params: float) -> int:
        """Send a command and return the result that comes back."""
        seven = (*params, *(0.0,) * 7)[:7]
        self.link.mav.command_long_send(1, 1, command, 0, *seven)
        return int(self.until("COMMAND_ACK", lambda ack: ack.command == command).result)

    def wait_for_boot(self) -> None:
        self.until("STATUSTEXT", lambda text: text.text == "AHRS: DCM active")

    def odometry(self) -> None:
        """Send one sample: level, at rest, at the origin."""
        covariance = [float("nan")] + [0.0] * 20
        self.link.mav.odometry_send(
            time.monotonic_ns() // 1000, 20, 12, 0, 0, 0, [1, 0, 0, 0], 0, 0, 0, 0, 0, 0, covariance, covariance,
            0, 3, 90,
        )  # fmt: skip

    def stream(self, wanted: Callable[[Any], bool]) -> Any:
        """Send ODOMETRY at 30 Hz in real time until a wanted message comes."""
        end_s = time.monotonic() + LIMIT_S
        next_s = time.monotonic()
        while time.monotonic() < end_s:
            self.odometry()
            next_s += 1 / 30
            while (left_s := next_s - time.monotonic()) > 0:
                message = self.link.recv_match(blocking=True, timeout=left_s)
                if message is not None and wanted(message):
                    return message
        pytest.fail(f"nothing wanted came within {LIMIT_S} s")

    def stream_for(self, duration_s: float) -> None:
        """Send ODOMETRY at 30 Hz for so long."""
        end_s = time.monotonic() + duration_s
        self.stream(lambda _message: time.monotonic() > end_s)

    def arm(self) -> None:
        """Send data and ask for arming again and again: the estimator takes some seconds to start."""
        end_s = time.monotonic() + LIMIT_S
        while self.command(ARM_DISARM, 1) != mavlink2.MAV_RESULT_ACCEPTED:
            assert time.monotonic() < end_s, "never armed"
            self.stream_for(PAUSE_S)


def free_port(kind: socket.SocketKind) -> int:
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def open_udp() -> tuple[str, Callable[[], Any]]:
    port = free_port(socket.SOCK_DGRAM)
    return f"udpin:127.0.0.1:{port}", lambda: mavutil.mavlink_connection(
        f"udpout:127.0.0.1:{port}", source_system=255, source_component=197
    )


def open_tcp() -> tuple[str, Callable[[], Any]]:
    port = free_port(socket.SOCK_STREAM)
    return f"tcpin:127.0.0.1:{port}", lambda: mavutil.mavlink_connection(
        f"tcp:127.0.0.1:{port}", source_system=255, source_component=197, retries=30
    )


@pytest.fixture(autouse=True)
def mavlink_2(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let pymavlink begin with MAVLink 2; left alone it does so after the first frame that it receives."""
    monkeypatch.setenv("MAVLINK20", "1")
    mavutil.set_dialect("ardupilotmega")


LINKS = {"udp": open_udp, "tcp": open_tcp}
Session = tuple[Autopilot, Client]


@pytest.fixture(params=LINKS)
def session(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Session]:
    """Yield a running autopilot and a client that hears it, over UDP and over TCP."""
    master, connect = LINKS[request.param]()
    with serving(tmp_path / "logs", master) as autopilot, connected(connect) as client:
        yield autopilot, client


@contextmanager
def connected(connect: Callable[[], Any]) -> Iterator[Client]:
    link = connect()
    try:
        client = Client(link)
        client.connect()
        yield client
    finally:
        link.close()


def records_of(path: Path, kind: str) -> list[Any]:
    with DFReader_binary(str(path)) as log:
        return list(iter(lambda: log.recv_match(type=kind), None))


def is_healthy(message: Any) -> bool:
    return bool(message.get_type() == "SYS_STATUS" and message.onboard_control_sensors_health & VISION_POSITION)


def test_heartbeat_is_that_of_a_copter(session: Session) -> None:
    _, client = session
    heartbeat = client.until("HEARTBEAT")
    assert heartbeat.autopilot == mavlink2.MAV_AUTOPILOT_ARDUPILOTMEGA
    assert heartbeat.type == mavlink2.MAV_TYPE_QUADROTOR
    assert (heartbeat.get_srcSystem(), heartbeat.get_srcComponent()) == (1, 1)


def test_whole_parameter_list_arrives(session: Session) -> None:
    _, client = session
    client.wait_for_boot()
    client.link.param_fetch_all()
    first = client.until("PARAM_VALUE", lambda value: value.param_index == 0)
    seen = {0}
    while len(seen) < first.param_count:
        seen.add(client.until("PARAM_VALUE").param_index)
    assert seen == set(range(first.param_count))
    assert client.link.params["VISO_TYPE"] == 1


def test_set_parameter_is_echoed(session: Session) -> None:
    _, client = session
    client.wait_for_boot()
    client.link.param_set_send("VISO_DELAY_MS", 35)
    echo = client.until("PARAM_VALUE", lambda value: value.param_id == "VISO_DELAY_MS")
    assert echo.param_value == 35


def test_flight_of_a_bridge(session: Session) -> None:
    """Refused before data, healthy with data at 30 Hz, armed, ended by Ctrl-C with a log that holds it all."""
    autopilot, client = session
    client.wait_for_boot()
    assert client.command(SET_MESSAGE_INTERVAL, mavlink2.MAVLINK_MSG_ID_SYS_STATUS, 100_000) == 0
    assert not is_healthy(client.until("SYS_STATUS"))
    assert client.command(ARM_DISARM, 1) == mavlink2.MAV_RESULT_FAILED
    client.command(RUN_PREARM_CHECKS)
    client.until("STATUSTEXT", lambda text: text.text == "PreArm: VisOdom: not healthy")

    client.stream(is_healthy)
    client.arm()
    client.until("HEARTBEAT", lambda beat: beat.base_mode & mavlink2.MAV_MODE_FLAG_SAFETY_ARMED)

    assert autopilot.stop(signal.SIGINT) == 0
    assert any("handed to the EKF" in line for line in autopilot.lines)
    assert len(records_of(autopilot.log, "VISP")) > 30
    assert [record.ArmState for record in records_of(autopilot.log, "ARM")] == [1]


def test_log_of_a_killed_autopilot_is_readable(session: Session) -> None:
    autopilot, client = session
    client.wait_for_boot()
    client.stream_for(2.5)  # what waits in memory goes to the disk every 2 s
    assert autopilot.stop(signal.SIGKILL) == -signal.SIGKILL
    poses = records_of(autopilot.log, "VISP")
    assert poses
    assert all(pose.Q == 90 for pose in poses)


def test_termination_closes_the_log(session: Session) -> None:
    autopilot, client = session
    client.wait_for_boot()
    client.odometry()
    client.until("HEARTBEAT")
    assert autopilot.stop(signal.SIGTERM) == 0
    assert len(records_of(autopilot.log, "VISP")) == 1


def test_serial_link_over_a_pseudo_terminal(tmp_path: Path) -> None:
    with pseudo_terminal() as (client_end, device), serving(tmp_path / "logs", f"{device},115200") as autopilot:
        mav = mavlink2.MAVLink(client_end, 255, 197)
        read_until(client_end, mav, "HEARTBEAT")
        kind, nobody = mavlink2.MAV_TYPE_ONBOARD_CONTROLLER, mavlink2.MAV_AUTOPILOT_INVALID
        mav.heartbeat_send(kind, nobody, 0, 0, 0)
        mav.param_request_read_send(1, 1, b"VISO_TYPE", -1)
        value = read_until(client_end, mav, "PARAM_VALUE")
        assert (value.param_id, value.param_value) == ("VISO_TYPE", 1)
        assert autopilot.stop(signal.SIGINT) == 0


@contextmanager
def pseudo_terminal() -> Iterator[tuple[FileIO, str]]:
    """Yield our end of a pseudo-terminal and the device that is the other."""
    ours, theirs = os.openpty()
    with FileIO(ours, "r+") as end, FileIO(theirs, "r+"):
        tty.setraw(theirs)
        yield end, os.ttyname(theirs)


def read_until(end: FileIO, mav: Any, kind: str) -> Any:
    """Return the next message of a kind from our end."""
    end_s = time.monotonic() + LIMIT_S
    while (left_s := end_s - time.monotonic()) > 0:
        if not select.select([end], [], [], left_s)[0]:
            break
        for message in mav.parse_buffer(os.read(end.fileno(), 4096)) or []:
            if message.get_type() == kind:
                return message
    pytest.fail(f"no {kind} within {LIMIT_S} s")
