# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""pymavlink's programs read our DataFlash log, and a telemetry log of our stream."""

import json
import os
import re
import subprocess
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest
from pymavlink import mavutil

from tests.interop.programs import LIMIT_S, SESSION_S, Companion, autopilot

pytestmark = pytest.mark.interop

RECORDED_S = 5.0
STREAMS_HZ = 10


@dataclass(frozen=True)
class Files:
    """The DataFlash log, the telemetry log, and a folder to write to."""

    dataflash: Path
    telemetry: Path
    folder: Path


def record(port: int, path: Path) -> None:
    """Do what a ground station does: ask for parameters and telemetry, and keep all that comes."""
    link = mavutil.mavlink_connection(
        f"tcp:127.0.0.1:{port}", source_system=255, dialect="ardupilotmega", autoreconnect=False, retries=30
    )
    link.setup_logfile(str(path))
    assert link.wait_heartbeat(timeout=LIMIT_S) is not None
    link.mav.heartbeat_send(mavutil.mavlink.MAV_TYPE_GCS, mavutil.mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 0)
    link.param_fetch_all()
    link.mav.request_data_stream_send(1, 1, 0, STREAMS_HZ, 1)
    end_s = time.monotonic() + RECORDED_S
    while time.monotonic() < end_s:
        link.recv_match(blocking=True, timeout=1)
    link.logfile.close()
    link.close()


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Files:
    folder = tmp_path_factory.mktemp("tools")
    telemetry = folder / "flight.tlog"
    with autopilot(folder, "--param=VISO_TYPE=1", links=("tcpin", "tcpin")) as vehicle:
        with Companion(vehicle.ports[1]):
            record(vehicle.ports[0], telemetry)
        vehicle.verdicts()
    return Files(folder / "logs" / "00000001.BIN", telemetry, folder)


@pytest.fixture
def tool(clients: Path, files: Files) -> Callable[..., str]:
    """Return what starts one of the programs and hands back what it printed."""

    def start(name: str, *arguments: object) -> str:
        command = [str(clients / "bin" / name), *map(str, arguments)]
        environment = {**os.environ, "HOME": str(files.folder), "MPLBACKEND": "Agg"}
        done = subprocess.run(
            command, cwd=files.folder, env=environment, capture_output=True, text=True, timeout=SESSION_S, check=False
        )
        assert done.returncode == 0, done.stderr
        assert "Traceback" not in done.stderr
        return done.stdout

    return start


def test_mavlogdump_prints_samples_of_the_log(files: Files, tool: Callable[..., str]) -> None:
    lines = tool("mavlogdump.py", "--types", "VISP", "--format", "json", files.dataflash).splitlines()
    samples = [json.loads(line) for line in lines if line.startswith("{")]
    assert len(samples) > 30
    assert {sample["data"]["Q"] for sample in samples} == {90}


def test_mavlogdump_prints_the_telemetry_log(files: Files, tool: Callable[..., str]) -> None:
    printed = tool("mavlogdump.py", "--types", "HEARTBEAT,ODOMETRY", files.telemetry)
    assert "HEARTBEAT {type : 2, autopilot : 3" in printed
    assert "ODOMETRY {" in printed


@pytest.mark.parametrize("kind", ["dataflash", "telemetry"])
def test_mavparms_prints_the_parameters(files: Files, tool: Callable[..., str], kind: str) -> None:
    printed = tool("mavparms.py", getattr(files, kind))
    assert re.search(r"^VISO_TYPE +1\.0+$", printed, re.MULTILINE)
    assert re.search(r"^VISO_QUAL_MIN +0\.0+$", printed, re.MULTILINE)


def test_mavloss_finds_no_loss_on_loopback(files: Files, tool: Callable[..., str]) -> None:
    (numbers,) = re.findall(r"(\d+) packets, (\d+) lost ([\d.]+)%", tool("mavloss.py", files.telemetry))
    packets, lost, percent = map(float, numbers)
    assert packets > RECORDED_S * STREAMS_HZ
    assert (lost, percent) == (0, 0)


@pytest.mark.parametrize(("kind", "expressions"), [("dataflash", "VISP.PX VISP.Q"), ("telemetry", "ODOMETRY.quality")])
def test_mavgraph_draws_our_files(files: Files, tool: Callable[..., str], kind: str, expressions: str) -> None:
    picture = files.folder / f"{kind}.png"
    tool("mavgraph.py", f"--output={picture}", getattr(files, kind), *expressions.split())
    assert picture.read_bytes().startswith(b"\x89PNG")
