# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""``--home``: where a vehicle starts on earth, and how it points there."""

import math
from pathlib import Path

import pytest

from ap_core.location import Location
from viso.errors import InputError
from viso.logs.logger import LogSink
from viso.replay.ahrs import ahrs_maker
from viso.terminal.ahrs import AhrsChoice, imu_options
from viso.testing import AutopilotOptions
from viso.vehicle.config import VehicleConfig, by_ekf3
from viso.vehicle.sensors.moving import FlyingSource
from viso.vehicle.sensors.source import HOME, ImuOptions
from viso.vehicle.sensors.standing import BenchSource
from viso.vehicle.vehicle import Vehicle

ZURICH = Location(473977420, 85455940, 48_800)


def no_log() -> LogSink:
    raise NotImplementedError


def test_home_is_a_place_and_a_heading() -> None:
    options = imu_options(AhrsChoice(home="47.397742,8.545594,488,270"))
    assert options.home == ZURICH
    assert options.heading_rad == pytest.approx(math.radians(-90))


@pytest.mark.parametrize("text", ["", "47,8", "47,8,488,north", "47,8,488,nan", "91,8,0,0", "47,181,0,0", "0,0,1e9,0"])
def test_what_is_no_home_is_refused_in_a_line(text: str) -> None:
    with pytest.raises(InputError, match=r"^--home .*: (not four numbers|no place on earth)"):
        imu_options(AhrsChoice(home=text))


def test_home_is_refused_where_the_source_knows_its_place() -> None:
    with pytest.raises(InputError, match="--imu hil says where it is; take bench, script, follow, fly"):
        imu_options(AhrsChoice(imu="hil", home="47,8,488,0"))
    with pytest.raises(InputError, match="--ahrs and --home"):
        ahrs_maker(AhrsChoice(log=Path("a.BIN"), home="47,8,488,0"))


def test_heading_is_said_once() -> None:
    with pytest.raises(InputError, match="--home and --heading both"):
        imu_options(AhrsChoice(heading_deg=5.0, home="47,8,488,0"))


def test_fixture_takes_home_as_numbers() -> None:
    config = AutopilotOptions(imu="fly", home=(47.397742, 8.545594, 488.0, 0.0)).vehicle_config(no_log)
    assert Vehicle(VehicleConfig(config.make_ahrs)).source.place == ZURICH
    with pytest.raises(ValueError, match=r"^home .*: not four numbers"):
        AutopilotOptions(home=(math.nan, 2.0, 3.0, 4.0)).vehicle_config(no_log)


def test_vehicle_that_flies_is_at_home_whatever_the_origin() -> None:
    vehicle = Vehicle(VehicleConfig(by_ekf3(FlyingSource, ImuOptions(home=ZURICH))))
    assert vehicle.copter.flight is not None
    assert vehicle.copter.flight.truth().place == ZURICH
    vehicle.source.stand_at(HOME)
    assert vehicle.copter.flight.truth().place == ZURICH


def test_vehicle_on_the_bench_stands_at_the_origin_unless_it_has_a_home() -> None:
    without, there = BenchSource(ImuOptions()), BenchSource(ImuOptions(home=ZURICH))
    assert without.place is None
    without.stand_at(ZURICH)
    there.stand_at(HOME)
    assert without.place == there.place == ZURICH
