# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""node-mavlink, a codec that shares no code with ours, decodes what we send and encodes what we take."""

import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from pymavlink.DFReader import DFReader_binary

from tests.interop.programs import CLIENTS, autopilot, session

pytestmark = pytest.mark.interop


@dataclass(frozen=True)
class Exchange:
    """What node decoded and sent, the outcome of each message, and the samples in the log."""

    met: dict[str, Any]
    verdicts: dict[str, dict[str, int]]
    poses: list[Any]


@pytest.fixture(scope="module")
def exchange(clients: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Exchange]:
    node = shutil.which("node")
    assert node is not None, "the interop tests need node"
    modules = {"NODE_PATH": str(clients / "node" / "node_modules")}
    with autopilot(tmp_path_factory.mktemp("node"), "--param=VISO_TYPE=1") as vehicle:
        met = session([node, str(CLIENTS / "node_session.cjs"), str(vehicle.ports[0])], modules)
        verdicts = vehicle.verdicts()
        with DFReader_binary(str(vehicle.logs / "00000001.BIN")) as log:
            yield Exchange(met, verdicts, list(iter(lambda: log.recv_match(type="VISP"), None)))


def test_every_frame_decodes(exchange: Exchange) -> None:
    assert exchange.met["bad_crc"] == exchange.met["invalid"] == 0
    assert exchange.met["unknown"] == {}


def test_ten_seconds_hold_the_streams_at_their_rates(exchange: Exchange) -> None:
    decoded = exchange.met["decoded"]
    assert 9 <= decoded["HEARTBEAT"] <= 12
    # Four a second, and nobody holds a stopwatch on a busy machine.
    assert 30 <= decoded["ATTITUDE"] <= 45
    assert 30 <= decoded["SYS_STATUS"] <= 45


def test_fields_have_the_values_that_were_sent(exchange: Exchange) -> None:
    last = exchange.met["last"]
    assert (last["HEARTBEAT"]["type"], last["HEARTBEAT"]["autopilot"]) == (2, 3)
    assert last["PARAM_VALUE"]["paramId"] == "VISO_TYPE"
    assert last["PARAM_VALUE"]["paramValue"] == 1


def test_odometry_of_the_other_codec_reaches_the_ekf(exchange: Exchange) -> None:
    assert exchange.met["sent"] > 200
    # What is on its way when the client leaves may be lost.
    assert exchange.met["sent"] - 3 <= exchange.verdicts["ODOMETRY"]["consumed"] <= exchange.met["sent"]
    assert "BAD_DATA" not in exchange.verdicts


def test_log_holds_the_fields_that_the_other_codec_encoded(exchange: Exchange) -> None:
    pose = exchange.poses[-1]
    assert (pose.PX, pose.PY, pose.PZ) == (1.5, -2.5, 0.25)
    assert (pose.R, pose.P, pose.Y) == (0, 0, 0)
    assert (pose.Rst, pose.Q) == (7, 88)
