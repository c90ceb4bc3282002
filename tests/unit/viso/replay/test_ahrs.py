# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where attitude and position come from: the filter on sensors, or over a log, or the records of a log."""

import lzma
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ekf_stub.ahrs.ahrs_ekf3 import Ekf3Ahrs
from ekf_stub.ahrs.ahrs_recorded import RecordedAhrs
from tests.places import RECORDED
from viso.errors import InputError
from viso.logs.recorded import read_columns
from viso.replay.ahrs import ReplayedAhrs, ahrs_maker
from viso.terminal.ahrs import AhrsChoice
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


FIRST_SECONDS = 900_000  # bytes of the log
A_TIME_US = 6_000_000


@pytest.fixture(scope="module")
def begun(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the first 8 s of a log with replay records; the filter navigates from 5.1 s on."""
    path = tmp_path_factory.mktemp("begun") / "begun.BIN"
    path.write_bytes(lzma.decompress(LOG.read_bytes())[:FIRST_SECONDS])
    return path


def changed(begun: Path, folder: Path, old: bytes, new: bytes) -> Path:
    """Return the log with some bytes exchanged."""
    path, data = folder / "changed.BIN", begun.read_bytes()
    assert old in data
    path.write_bytes(data.replace(old, new))
    return path


def following(log: Path) -> Vehicle:
    return Vehicle(VehicleConfig(ahrs_maker(replace(NOTHING, log=log))))


def test_filter_is_run_over_replay_records(begun: Path) -> None:
    vehicle = following(begun)
    assert type(vehicle.ahrs) is ReplayedAhrs
    assert vehicle.ahrs.notes == ("attitude and position: the filter, run over the replay records of begun.BIN",)
    rows = read_columns(begun).columns("XKF1", ["TimeUS", "C", "Yaw", "PN", "PE", "PD"])
    times = [row for row in zip(*(rows[label].tolist() for label in rows), strict=True) if row[1] == 0]
    aided = [row for row in times if row[0] > A_TIME_US]
    assert len(aided) > 10
    for time_us, _, yaw_deg, *position in aided:
        vehicle.clock.set_us(time_us)
        assert math.degrees(vehicle.ahrs.get_yaw_rad()) % 360 == pytest.approx(yaw_deg, abs=0.011)
        found = vehicle.ahrs.get_relative_position_NED_origin_float()
        assert found is not None
        assert found.to_tuple() == pytest.approx(position, abs=1e-5)


@pytest.mark.parametrize(("sources", "failure"), [
    ({"EK3_SRC1_POSXY": 6}, None),
    ({"EK3_SRC3_VELXY": 5}, "EK3 sources require OpticalFlow"),
    ({"EK3_SRC2_POSZ": 2}, "EK3 sources require RangeFinder"),
])  # fmt: skip
def test_source_sets_need_sensors_that_the_log_has(begun: Path, sources: dict[str, float], failure: str | None) -> None:
    without_gps = {"EK3_SRC1_POSXY": 6.0, "EK3_SRC1_VELXY": 6.0, "EK3_SRC1_VELZ": 0.0}
    make_ahrs = ahrs_maker(replace(NOTHING, log=begun))
    vehicle = Vehicle(VehicleConfig(make_ahrs, defaults={**without_gps, **sources}))
    vehicle.clock.set_us(A_TIME_US)
    assert vehicle.ahrs.pre_arm_failure(requires_position=True) == failure


def test_attitude_is_that_of_the_log_until_the_filter_runs(begun: Path) -> None:
    vehicle = following(begun)
    attitude = read_columns(begun).columns("ATT", ["TimeUS", "Yaw"])
    time_us, yaw_deg = attitude["TimeUS"][0].item(), attitude["Yaw"][0].item()
    vehicle.clock.set_us(time_us)
    assert math.degrees(vehicle.ahrs.get_yaw_rad()) % 360 == pytest.approx(yaw_deg, abs=1e-4)
    assert vehicle.ahrs.get_relative_position_NED_origin_float() is None


def test_log_without_replay_records_has_its_own_estimates(begun: Path, tmp_path: Path) -> None:
    ahrs = following(changed(begun, tmp_path, b"RFRH", b"ZZZZ")).ahrs
    assert type(ahrs) is RecordedAhrs
    note = "attitude and position: the ATT and XKF1 records of changed.BIN, which has no replay records"
    assert ahrs.notes == (note,)


def test_log_that_the_filter_cannot_be_run_over_has_its_own_estimates(begun: Path, tmp_path: Path) -> None:
    vehicle = following(changed(begun, tmp_path, b"EK3_IMU_MASK", b"EK3_IMU_MOSK"))
    vehicle.clock.set_us(A_TIME_US)
    attitude = read_columns(begun).columns("ATT", ["TimeUS", "Yaw"])
    log_yaw = np.interp(A_TIME_US, attitude["TimeUS"], attitude["Yaw"])
    assert math.degrees(vehicle.ahrs.get_yaw_rad()) % 360 == pytest.approx(log_yaw, abs=1e-4)
    (note,) = vehicle.ahrs.notes
    assert note.endswith("s on those of its ATT and XKF1 records: no PARM record of EK3_IMU_MASK")


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
