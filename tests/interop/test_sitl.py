# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""`viso sitl` as a script meets it that was written for the firmware's simulator."""

import socket
import struct
import sys
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import pytest
from pymavlink import mavutil

from tests.interop.programs import CLIENTS, LIMIT_S, Program, free_port, running, session

pytestmark = pytest.mark.interop

HOME = (-35.362938, 149.165085, 584.0, 270.0)


class Simulator:
    """A running `viso sitl` with ports of its own."""

    def __init__(self, folder: Path, *options: str) -> None:
        self.port, self.radio_port = free_port(), free_port()
        place = ",".join(map(str, HOME))
        ports = [f"--base-port={self.port}", f"--rc-in-port={self.radio_port}", "--serial1=none", "--serial2=none"]
        command = [sys.executable, "-c", "from viso.cli import main; main()", "sitl", f"--home={place}", *ports]
        self.command, self.folder = [*command, "--model", "+", *options], folder

    @contextmanager
    def started(self) -> Iterator[Program]:
        with running(self.command, cwd=self.folder) as program:
            program.until(f"bind port {self.port} for SERIAL0")
            program.until("Waiting for connection")
            yield program

    @contextmanager
    def client(self) -> Iterator[Any]:
        link = mavutil.mavlink_connection(f"tcp:127.0.0.1:{self.port}", source_system=255)
        with closing(link):
            link.wait_heartbeat(timeout=LIMIT_S)
            link.mav.request_data_stream_send(1, 1, 0, 10, 1)
            yield link

    def move(self, *pulses_us: int) -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as radio:
            radio.sendto(struct.pack("<16H", *pulses_us), ("127.0.0.1", self.radio_port))


def receive(link: Any, kind: str, **wanted: object) -> Any:
    """Return the next message of a kind with such values."""
    while True:
        message = link.recv_match(type=kind, blocking=True, timeout=LIMIT_S)
        assert message is not None, f"no {kind} with {wanted}"
        if all(getattr(message, name) == value for name, value in wanted.items()):
            return message


def test_script_of_the_simulator_finds_what_it_expects(tmp_path: Path) -> None:
    (tmp_path / "mine.parm").write_text("VISO_TYPE 1\nRC_SPEED 490\n")
    simulator = Simulator(tmp_path, "--defaults", "mine.parm", "-w", "-S", "--speedup", "5")
    with simulator.started() as program:
        with simulator.client() as link:
            program.until(f"Connection on serial port {simulator.port}")
            state = receive(link, "SIMSTATE")
            assert (state.lat / 1e7, state.lng / 1e7) == pytest.approx(HOME[:2], abs=1e-6)
            simulator.move(1500, 1500, 1200, 1500, 1300, 1000, 1900, *(1500,) * 9)
            moved = receive(link, "RC_CHANNELS", chan7_raw=1900)
            assert (moved.chan3_raw, moved.chan5_raw, moved.chan16_raw) == (1200, 1300, 1500)
            link.param_set_send("SIM_SPEEDUP", 20)
            link.param_set_send("VISO_DELAY_MS", 35)
            receive(link, "PARAM_VALUE", param_id="VISO_DELAY_MS")
            link.reboot_autopilot()
            program.until("Waiting for connection")
        with simulator.client() as link:
            for name, value in (("VISO_DELAY_MS", 35), ("VISO_TYPE", 1), ("SIM_SPEEDUP", 20)):
                link.param_fetch_one(name)
                assert receive(link, "PARAM_VALUE", param_id=name).param_value == value
        assert program.interrupt() == 0
    assert "VISO_DELAY_MS" in (tmp_path / "storage.parm").read_text()
    assert (tmp_path / "logs" / "00000001.BIN").exists()


def test_dronekit_script_flies_as_with_the_simulator(clients: Path, tmp_path: Path) -> None:
    simulator = Simulator(tmp_path, "--speedup", "5")
    with simulator.started():
        program = str(CLIENTS / "dronekit_flight.py")
        met = session([str(clients / "bin" / "python"), program, f"tcp:127.0.0.1:{simulator.port}"])
    assert met["north_m"] == pytest.approx(0.0, abs=1.0)
    assert met["alt_m"] == pytest.approx(0.0, abs=0.5)
    assert met["fix"] >= 3


def test_wipe_forgets_and_a_start_without_it_remembers(tmp_path: Path) -> None:
    (tmp_path / "storage.parm").write_text("VISO_DELAY_MS 35\n")
    for options, value in (([], 35), (["--wipe"], 10)):
        simulator = Simulator(tmp_path, *options)
        with simulator.started() as program:
            with simulator.client() as link:
                link.param_fetch_one("VISO_DELAY_MS")
                assert receive(link, "PARAM_VALUE", param_id="VISO_DELAY_MS").param_value == value
            assert program.interrupt() == 0
