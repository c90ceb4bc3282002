# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A companion's program on MAVSDK, as its Python wheel brings it, over UDP."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from tests.interop.programs import CLIENTS, autopilot, session

pytestmark = pytest.mark.interop


@dataclass(frozen=True)
class Flight:
    """What the program met, what `viso serve` printed, and what it says became of each message."""

    met: dict[str, Any]
    printed: list[str]
    verdicts: dict[str, dict[str, int]]


@pytest.fixture(scope="module")
def flight(clients: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Flight]:
    folder = tmp_path_factory.mktemp("mavsdk")
    with autopilot(folder, "--param=VISO_TYPE=1", links=("udpout",)) as vehicle:
        program = str(CLIENTS / "mavsdk_session.py")
        met = session([str(clients / "bin" / "python"), program, f"udpin://127.0.0.1:{vehicle.ports[0]}"])
        verdicts = vehicle.verdicts()
        yield Flight(met, vehicle.program.lines, verdicts)


def test_telemetry_flows_at_the_rates_that_were_asked_for(flight: Flight) -> None:
    assert set(flight.met["rates"].values()) == {""}
    assert {"armed", "attitude_euler", "flight_mode", "health", "landed_state", "in_air"} <= set(flight.met["streams"])


def test_parameters_are_set_and_read(flight: Flight) -> None:
    assert flight.met["parameters"] == {"VISO_TYPE": 1, "VISO_DELAY_MS": 35, "VISO_POS_M_NSE": 0.5}
    assert flight.met["list"] > 50


def test_no_parameter_of_the_list_is_lost(flight: Flight) -> None:
    assert not [line for line in flight.met["screen"] if "missed during initial burst" in line]


def test_version_is_the_firmwares(flight: Flight) -> None:
    assert flight.met["version"] == [4, 7]


def test_arming_without_vision_is_refused_with_the_reason_as_a_text(flight: Flight) -> None:
    assert flight.met["first_refusal"] == "FAILED"
    assert flight.met["told_why"]
    assert "Arm: VisOdom: not healthy" in flight.met["texts"]


def test_plugins_own_frame_for_odometry_is_dropped_and_the_reason_shown(flight: Flight) -> None:
    assert flight.verdicts["ODOMETRY"]["odometry_frames"] == 1
    assert any("first ODOMETRY dropped: frame_id must be 20 (LOCAL_FRD)" in line for line in flight.printed)


def test_other_messages_of_the_plugin_reach_the_ekf(flight: Flight) -> None:
    for message in ("VISION_POSITION_ESTIMATE", "VISION_SPEED_ESTIMATE", "ATT_POS_MOCAP"):
        assert flight.verdicts[message] == {"consumed": 1}


def test_arms_on_odometry_in_the_frame_of_the_autopilot(flight: Flight) -> None:
    assert flight.verdicts["ODOMETRY"]["consumed"] > 20
    assert flight.met["refusal_with_vision"] == ""
    assert flight.met["armed"]
    assert flight.met["disarm_refusal"] == ""
