# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A companion's scripts fly `viso serve --imu fly --vision vicon` over sockets, in real time."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.interop.programs import CLIENTS, autopilot, session
from tests.places import ROOT

pytestmark = pytest.mark.interop

SCRIPT = ROOT / "docs" / "examples" / "fly_square.py"
FLYING = ("--imu=fly", "--vision=vicon", "--preset=motion-capture")
LIMIT_S = 90.0


def test_example_flies_a_square_and_lands(tmp_path: Path) -> None:
    with autopilot(tmp_path, *FLYING, links=("tcpin",)) as vehicle:
        command = [sys.executable, str(SCRIPT), f"tcp:127.0.0.1:{vehicle.ports[0]}"]
        done = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT_S)
        assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == "landed"
    assert len(done.stdout.splitlines()) == 6


def test_mavsdk_takes_off_goes_somewhere_and_lands(clients: Path, tmp_path: Path) -> None:
    with autopilot(tmp_path, *FLYING, links=("udpout",)) as vehicle:
        program = str(CLIENTS / "mavsdk_flight.py")
        met = session([str(clients / "bin" / "python"), program, f"udpin://127.0.0.1:{vehicle.ports[0]}"])
    assert met["landed"]
    assert met["farthest_m"] == pytest.approx(4.0, abs=0.5)
    assert met["highest_m"] == pytest.approx(2.0, abs=0.4)
