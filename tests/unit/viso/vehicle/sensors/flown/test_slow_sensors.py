# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Barometer, compass, heading and declination of an ordinary log."""

import math

import numpy as np
import pytest

from ap_core.declination import get_declination_rad
from ap_core.location import Location
from tests.unit.viso.vehicle.sensors.flown.made import log_of
from viso.vehicle.sensors.flown.slow_sensors import slow_sensors

PASSES_US = np.array([1_000_000, 1_102_500, 1_205_000, 3_000_000, 9_000_000])


def test_readings_are_those_of_the_first_sensor_with_their_own_times() -> None:
    log = log_of(
        BARO=[[1.1e6, 0, 0.5, 1095], [1.1e6, 1, 9.0, 1096], [1.2e6, 0, 0.75, 1195]],
        MAG=[[1.1e6, 0, 230, -12, 500, 1_094_000], [1.1e6, 1, 9, 9, 9, 1_094_000]],
        ATT=[[1.1e6, 0, 0, 350]],
    )
    slow = slow_sensors(log, PASSES_US)
    assert [slow.baro.at(number) for number in range(3)] == [None, (1095, 0.5), (1195, 0.75)]
    reading = slow.mag.at(1)
    assert reading is not None
    assert (reading[0], reading[1].tolist()) == (1_094_000, [230, -12, 500])
    assert slow.yaw_rad.at(1) == pytest.approx(math.radians(-10))


def declinations(params: dict[str, float] | None = None, **records: list[list[float]]) -> list[float | None]:
    slow = slow_sensors(log_of(params, **records), PASSES_US)
    return [slow.declination.at(number) for number in (0, 2, 3, 4)]


def test_declination_is_that_of_the_place_once_there_is_one() -> None:
    there = float(get_declination_rad(Location(100_000_000, 100_000_000, 0)))
    assert declinations(ORGN=[[2e6, 0, 1e8, 1e8, 0]], POS=[[2.5e6, 1e8, 1e8, 0]]) == [0.0, 0.0, there, there]
    assert declinations(ORGN=[[2e6, 0, 1e8, 1e8, 0]], POS=[[1.1e6, 1e8, 1e8, 0]]) == [0.0, there, there, there]


def test_without_a_place_it_is_the_parameter() -> None:
    assert declinations({"COMPASS_DEC": 0.25}) == [0.25] * 4
    assert declinations() == [0.0] * 4


def test_it_stays_the_parameter_if_that_is_wanted() -> None:
    params = {"COMPASS_DEC": 0.25, "COMPASS_AUTODEC": 0.0}
    assert declinations(params, ORGN=[[1e6, 0, 1e8, 1e8, 0]]) == [0.25] * 4
