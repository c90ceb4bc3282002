# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A script on dronekit2, over TCP."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.interop.programs import CLIENTS, autopilot, session

pytestmark = pytest.mark.interop

Flight = tuple[dict[str, Any], dict[str, dict[str, int]]]


@pytest.fixture(scope="module")
def flight(clients: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Flight]:
    """Yield what the script met, and the outcome of each message."""
    with autopilot(tmp_path_factory.mktemp("dronekit"), "--param=VISO_TYPE=1") as vehicle:
        program = str(CLIENTS / "dronekit_session.py")
        met = session([str(clients / "bin" / "python"), program, f"tcp:127.0.0.1:{vehicle.ports[0]}"])
        yield met, vehicle.verdicts()


def test_attributes_are_those_of_a_copter_on_the_ground(flight: Flight) -> None:
    met, _ = flight
    assert met["version"].startswith("APM:Copter-4.7.1")
    assert (met["mode"], met["armed"], met["status"]) == ("STABILIZE", False, "STANDBY")
    assert abs(met["yaw"]) < 0.1
    assert met["heading"] in (0, 359, 360)


def test_parameters_are_read_and_set(flight: Flight) -> None:
    met, _ = flight
    assert met["parameter"] == 1
    assert met["parameters"] > 50
    assert met["delay_ms"] == 35


def test_mode_changes_and_changes_back(flight: Flight) -> None:
    met, _ = flight
    assert met["changed_mode"]
    assert met["changed_back"]


def test_vision_messages_reach_the_ekf(flight: Flight) -> None:
    _, verdicts = flight
    assert verdicts["VISION_POSITION_ESTIMATE"] == {"consumed": 30}
