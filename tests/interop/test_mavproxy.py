# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A ground crew's session in MAVProxy, headless, while a companion is on another link."""

import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from pymavlink import mavutil

from tests.interop.programs import LIMIT_S, Companion, Program, autopilot, running

pytestmark = pytest.mark.interop

PAUSE_S = 0.5
FLIGHT_S = 2.0
MODULES = "log,ftp,param,arm,mode,misc,cmdlong"


@dataclass(frozen=True)
class Session:
    """What is left of a session: the texts on the operator's screen and the files."""

    screen: list[str]
    folder: Path
    verdicts: dict[str, dict[str, int]]

    def said(self, words: str) -> bool:
        """Return whether the operator has read these words."""
        return any(words in line for line in self.screen)


def fly(screen: Program, companion_port: int) -> None:
    """Do what an operator does, each step after the answer to the one before."""
    screen.until(r"Received \d+ parameters \(ftp\)")
    screen.type("param set VISO_TYPE 1")
    screen.type("param fetch VISO_TYPE")
    screen.until(r"VISO_TYPE = 1\.0")
    screen.type("reboot")
    screen.until("ArduPilot Ready")
    screen.type("arm throttle")
    screen.until("Arm: VisOdom: not healthy")
    with Companion(companion_port):
        insist(screen, "arm throttle")
        screen.until("Arming motors")
        time.sleep(FLIGHT_S)
        screen.type("disarm")
        screen.until("Disarming motors")
    screen.type("log list")
    screen.until(r"Log 2 +numLogs 2 lastLog 2 size [1-9]")
    screen.type("log download 2 downloaded.bin")
    screen.until(r"Finished downloading downloaded\.bin")


def insist(screen: Program, command: str) -> None:
    """Give a command again and again until it is accepted."""
    end_s = time.monotonic() + LIMIT_S
    while time.monotonic() < end_s:
        screen.type(command)
        if "ACCEPTED" in screen.until("Got COMMAND_ACK: "):
            return
        time.sleep(PAUSE_S)
    pytest.fail(f"{command}: never accepted")


@pytest.fixture(scope="module")
def session(clients: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Session]:
    folder = tmp_path_factory.mktemp("mavproxy")
    with autopilot(folder, links=("tcpin", "tcpin")) as vehicle:
        command = [str(clients / "bin" / "mavproxy.py"), f"--master=tcp:127.0.0.1:{vehicle.ports[0]}"]
        command += [f"--default-modules={MODULES}", f"--state-basedir={folder}", "--aircraft=bench"]
        with running(command, cwd=folder, env={"HOME": str(folder)}) as mavproxy:
            fly(mavproxy, vehicle.ports[1])
            mavproxy.hang_up()
        yield Session(mavproxy.lines, folder, vehicle.verdicts())


def test_parameters_come_by_mavlink_ftp(session: Session) -> None:
    assert "handled" in session.verdicts["FILE_TRANSFER_PROTOCOL"]
    assert "PARAM_REQUEST_LIST" not in session.verdicts


def test_operator_hears_why_arming_is_refused_and_that_it_is_done(session: Session) -> None:
    assert session.said("Got COMMAND_ACK: COMPONENT_ARM_DISARM: FAILED")
    assert session.said("Got COMMAND_ACK: COMPONENT_ARM_DISARM: ACCEPTED")


def test_companions_data_reach_the_ekf(session: Session) -> None:
    assert session.verdicts["ODOMETRY"]["consumed"] > 30


def test_downloaded_log_is_the_file_on_the_disk(session: Session) -> None:
    on_disk = (session.folder / "logs" / "00000002.BIN").read_bytes()
    assert on_disk
    assert (session.folder / "downloaded.bin").read_bytes() == on_disk


def test_telemetry_log_opens_and_holds_what_was_forwarded(session: Session) -> None:
    (path,) = session.folder.rglob("*.tlog")
    log = mavutil.mavlink_connection(str(path), dialect="ardupilotmega")
    kinds = {message.get_type() for message in iter(log.recv_msg, None)}
    log.close()
    assert {"HEARTBEAT", "STATUSTEXT", "ODOMETRY"} <= kinds
    assert "BAD_DATA" not in kinds


def test_mavproxy_ends_without_a_complaint(session: Session) -> None:
    assert [line for line in session.screen if "Traceback" in line or "ERROR" in line] == []
