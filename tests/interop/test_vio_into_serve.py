# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Odometry on recorded pictures into the autopilot, two programs on a socket, in real time."""

import json
import signal
import socket
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from tests.places import SHARED

pytestmark = pytest.mark.interop

VISO = (sys.executable, "-c", "from viso.cli import main; main()")
LIMIT_S = 120.0
REST_S = 9.0
"""Before the flight: the vehicle that follows the stream stands still for 6 s after it has booted."""


@dataclass(frozen=True)
class Case:
    """What is flown, with which parameters of the autopilot."""

    source: Path
    options: tuple[str, ...]
    viso_type: int


CASES = {
    "karma": Case(SHARED / "karma_flight" / "karma.mp4", ("--fps", "10"), 3),
    "euroc": Case(SHARED / "euroc_mh01_clip", (), 1),
}
EXTERNAL_NAVIGATION = ("EK3_SRC1_POSXY=6", "EK3_SRC1_VELXY=6", "EK3_SRC1_POSZ=6", "EK3_SRC1_YAW=6", "GPS1_TYPE=0")


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def fly(case: Case, folder: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return what the companion and what the autopilot said in the end."""
    port = free_port()
    serve = [*VISO, "serve", "--master", f"tcpin:127.0.0.1:{port}", "--imu", "follow", "--log-dir", str(folder)]
    for param in (f"VISO_TYPE={case.viso_type}", *EXTERNAL_NAVIGATION):
        serve += ["--param", param]
    vio = [*VISO, "vio", str(case.source), *case.options, "--master", f"tcp:127.0.0.1:{port}", "--json"]
    vio += ["--wait", str(LIMIT_S / 2), "--delay", str(REST_S)]
    with subprocess.Popen([*serve, "--json"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as autopilot:
        try:
            companion = subprocess.run(vio, capture_output=True, text=True, timeout=LIMIT_S, check=False)
        finally:
            autopilot.send_signal(signal.SIGINT)
        told, _ = autopilot.communicate(timeout=LIMIT_S)
    assert companion.returncode == 0, companion.stderr
    return json.loads(companion.stdout), json.loads(told)


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Return what was said by case; they are flown one after the other, as each takes a computer's time."""
    folder = tmp_path_factory.mktemp("flights")
    return {name: fly(case, folder / name) for name, case in CASES.items() if case.source.exists()}


def of(flown: dict[str, Any], name: str) -> tuple[dict[str, Any], dict[str, Any]]:
    if name not in flown:
        pytest.skip(f"{CASES[name].source} is not there")
    companion, autopilot = flown[name]
    return companion, autopilot


@pytest.mark.parametrize("name", CASES)
def test_every_message_is_accepted(flown: dict[str, Any], name: str) -> None:
    companion, autopilot = of(flown, name)
    counts = {(row["message"], row["outcome"]): row["count"] for row in autopilot["verdicts"]}
    assert counts[("ODOMETRY", "accepted")] == companion["sent"]["ODOMETRY"] > 150
    assert {outcome for _, outcome in counts} == {"accepted", "handled"}


@pytest.mark.parametrize("name", CASES)
def test_odometry_is_never_lost(flown: dict[str, Any], name: str) -> None:
    companion, _ = of(flown, name)
    assert "LOST" not in companion["states"]
    assert companion["resets"] == 0
    assert companion["frames"] > 40


@pytest.mark.parametrize("name", CASES)
def test_autopilot_navigates_by_it(flown: dict[str, Any], name: str) -> None:
    companion, autopilot = of(flown, name)
    texts = [text["text"] for text in companion["texts"]]
    assert "EKF3 IMU0 is using external nav data" in texts
    fused = {row["kind"]: row["count"] for row in autopilot["filter"] if row["outcome"] == "fused"}
    # Of some 240: all but three on an idle computer, 93 to 95 beside six programs on two cores, as passes come late.
    assert fused["pose"] > 80


def test_good_odometry_is_hardly_ever_rejected(flown: dict[str, Any]) -> None:
    # In real time a busy computer sends a sample late now and then.
    _, autopilot = of(flown, "euroc")
    counts = dict.fromkeys(("fused", "rejected"), 0)
    for row in autopilot["filter"]:
        if row["outcome"] in counts:
            counts[row["outcome"]] += row["count"]
    assert counts["rejected"] < 0.01 * counts["fused"]
