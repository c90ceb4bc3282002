# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A companion's program on MAVSDK 3, with the API of coroutines that most programs use, over UDP."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from tests.interop.programs import CLIENTS, autopilot, session

pytestmark = pytest.mark.interop


@dataclass(frozen=True)
class Flight:
    """What the program met, and what `viso serve` says became of each message."""

    met: dict[str, Any]
    verdicts: dict[str, dict[str, int]]


@pytest.fixture(scope="module")
def flight(clients: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Flight]:
    folder = tmp_path_factory.mktemp("mavsdk3")
    with autopilot(folder, "--param=VISO_TYPE=1", links=("udpout",)) as vehicle:
        program = str(CLIENTS / "mavsdk3_session.py")
        met = session([str(clients / "bin" / "python"), program, f"udpin://127.0.0.1:{vehicle.ports[0]}"])
        yield Flight(met, vehicle.verdicts())


def test_parameters_are_set_read_and_listed(flight: Flight) -> None:
    assert (flight.met["set"], flight.met["read"], flight.met["set_float"]) == ("", 35, "")
    assert flight.met["list"] > 50


def test_default_that_is_set_again_is_confirmed_with_a_type_that_it_refuses(flight: Flight) -> None:
    assert flight.met["set_to_its_default"] == "WRONG_TYPE"


def test_rates_are_set(flight: Flight) -> None:
    assert set(flight.met["rates"].values()) == {""}


def test_version_is_the_firmwares(flight: Flight) -> None:
    assert flight.met["version"] == [4, 7]


def test_arms_on_odometry_and_not_without(flight: Flight) -> None:
    assert flight.met["refusal"] not in ("", "SUCCESS")
    assert flight.verdicts["ODOMETRY"]["consumed"] > 20
    assert flight.met["refusal_with_vision"] == ""
    assert flight.met["disarm_refusal"] == ""
