# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where attitude and position come from, as the command line says."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from ekf_stub.ahrs.ahrs_ekf3 import Ekf3Ahrs
from ekf_stub.ahrs.ahrs_recorded import RecordedAhrs
from tests.places import RECORDED
from viso.errors import InputError
from viso.terminal.ahrs import AhrsChoice, ahrs_maker
from viso.vehicle.sensors.flown.source import RecordedSource
from viso.vehicle.sensors.hil import HilSource
from viso.vehicle.sensors.script.script import ScriptSource
from viso.vehicle.sensors.standing import BenchSource
from viso.vehicle.sensors.stream.follow import FollowSource
from viso.vehicle.vehicle import Vehicle, VehicleConfig

LOG = RECORDED / "logs" / "prearm.BIN.xz"
NOTHING = AhrsChoice(None, None, None, 0, 0.0)


def ahrs_of(choice: AhrsChoice, *default_imu: str) -> Ekf3Ahrs:
    ahrs = Vehicle(VehicleConfig(ahrs_maker(choice, *default_imu))).ahrs
    assert isinstance(ahrs, Ekf3Ahrs)
    return ahrs


@pytest.mark.parametrize(("imu", "kind"), [
    (None, BenchSource),
    ("bench", BenchSource),
    ("script:figure_eight", ScriptSource),
    ("follow", FollowSource),
    ("hil", HilSource),
    pytest.param(f"log:{LOG}", RecordedSource, marks=pytest.mark.slow),
])  # fmt: skip
def test_filter_has_the_sensors_that_were_chosen(imu: str | None, kind: Callable[..., object]) -> None:
    assert type(ahrs_of(replace(NOTHING, imu=imu)).source) is kind


@pytest.mark.parametrize(("imu", "kind"), [(None, FollowSource), ("bench", BenchSource)])
def test_default_gives_way_to_a_choice(imu: str | None, kind: Callable[..., object]) -> None:
    assert type(ahrs_of(replace(NOTHING, imu=imu), "follow").source) is kind


@pytest.mark.parametrize(("heading_deg", "yaw_deg"), [(90.0, 90.0), (350.0, -10.0), (-450.0, -90.0)])
@pytest.mark.parametrize("imu", ["bench", "follow", "script:square"])
def test_heading_is_that_of_the_sensors(imu: str, heading_deg: float, yaw_deg: float) -> None:
    ahrs = ahrs_of(replace(NOTHING, imu=imu, heading_deg=heading_deg))
    assert math.degrees(ahrs.get_yaw_rad()) == pytest.approx(yaw_deg)


def gyros(choice: AhrsChoice) -> list[tuple[float, ...]]:
    source = ahrs_of(choice).source
    assert source is not None
    passes = [source.sense(time_us) for time_us in range(2500, 12_500, 2500)]
    return [tuple(np.degrees(one.delta.del_ang / one.delta.del_ang_dt)) for one in passes if one is not None]


def test_sensors_err_as_told() -> None:
    biased = replace(NOTHING, imu_errors=["gyro_bias_deg_s=0.1,0.2,-0.3"])
    assert gyros(biased) == [pytest.approx((0.1, 0.2, -0.3), rel=1e-5)] * 4


def test_seed_of_the_noise_counts() -> None:
    noisy = replace(NOTHING, imu_errors=["gyro_noise_deg_s_rthz=0.1"])
    assert gyros(noisy) == gyros(noisy) != gyros(replace(noisy, imu_seed=1))


def test_log_takes_the_place_of_the_filter() -> None:
    vehicle = Vehicle(VehicleConfig(ahrs_maker(replace(NOTHING, log=LOG))))
    assert type(vehicle.ahrs) is RecordedAhrs


@pytest.mark.parametrize(("choice", "line"), [
    (replace(NOTHING, log=LOG, imu="bench"), "--ahrs and --imu: a vehicle that follows a log has no sensors"),
    (
        replace(NOTHING, log=LOG, imu_errors=["baro_noise_m=1"]),
        "--ahrs and --imu-error: a vehicle that follows a log has no sensors",
    ),
    (replace(NOTHING, imu="gps"), "--imu gps: no such source; there are bench, script, follow, fly, hil, log"),
    (replace(NOTHING, imu="script:"), "--imu script:: not script:FILE"),
    (replace(NOTHING, imu="follow:me"), "--imu follow:me: follow takes nothing behind it"),
    (replace(NOTHING, heading_deg=math.nan), "--heading nan: not an angle in degrees"),
])  # fmt: skip
def test_choice_that_cannot_be_used_is_one_line(choice: AhrsChoice, line: str) -> None:
    with pytest.raises(InputError) as error:
        ahrs_maker(choice)
    assert str(error.value) == line


@pytest.mark.parametrize("error", ["gyro_bias=1", "baro_noise_m=-1", "gyro_bias_deg_s=1,2", "imus=2.5"])
def test_error_that_there_is_not_is_named(error: str) -> None:
    with pytest.raises(InputError, match=f"^--imu-error '{error}': "):
        ahrs_maker(replace(NOTHING, imu_errors=[error]))
