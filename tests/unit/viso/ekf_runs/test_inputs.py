# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the records of a log leave of the sensors."""

from types import SimpleNamespace
from typing import Any

import pytest

from viso.ekf_runs.inputs import ARMED, TAKEOFF_EXPECTED, ReplayInputs
from viso.logs.record_fields import RecordError


def record(kind: str, **fields: object) -> Any:
    return SimpleNamespace(get_type=lambda: kind, **fields)


def inertial(imu: int, first: float) -> Any:
    values = dict(zip(("DVX", "DVY", "DVZ", "DAX", "DAY", "DAZ"), (first, 2, 3, 4, 5, 6), strict=True))
    return record("RISI", **values, DVDT=0.0025, DADT=0.0024, I=imu)


@pytest.fixture
def inputs() -> ReplayInputs:
    return ReplayInputs()


def test_nothing_is_known_at_first(inputs: ReplayInputs) -> None:
    known = (inputs.delta, inputs.baro, inputs.mag, inputs.camera_frd, inputs.gps)
    assert known == (None,) * 5


def test_frame_has_time_and_flags(inputs: ReplayInputs) -> None:
    inputs.take(record("RFRH", TimeUS=5_000_000, TF=7))
    inputs.take(record("RFRN", HLat=-353632610 & 0xFFFFFFFF, Flags=65))
    assert (inputs.time_us, inputs.flying_ms, inputs.home_lat) == (5_000_000, 7, -353632610)
    assert inputs.flags == ARMED | TAKEOFF_EXPECTED


def test_inertial_data_are_those_of_the_imu_in_use(inputs: ReplayInputs) -> None:
    inputs.take(inertial(0, 1.0))
    inputs.take(inertial(1, 9.0))
    assert inputs.delta is not None
    assert (inputs.delta.del_vel.tolist(), inputs.delta.del_ang.tolist()) == ([1, 2, 3], [4, 5, 6])
    assert (inputs.delta.del_vel_dt, inputs.delta.del_ang_dt) == (0.0025, 0.0024)


def test_values_stand_until_they_change(inputs: ReplayInputs) -> None:
    inputs.take(inertial(0, 1.0))
    before = inputs.delta
    inputs.take(record("RFRH", TimeUS=1, TF=0))
    assert inputs.delta is before


def test_height_is_that_of_the_primary_barometer(inputs: ReplayInputs) -> None:
    inputs.take(record("RBRH", Primary=1, NumInst=2))
    inputs.take(record("RBRI", LastUpdate=100, Alt=1.5, I=1))
    inputs.take(record("RBRI", LastUpdate=110, Alt=9.5, I=0))
    assert inputs.baro == (100, 1.5)


def test_field_is_that_of_the_first_usable_compass(inputs: ReplayInputs) -> None:
    inputs.take(record("RMGH", Dec=0.25, FUsable=1))
    inputs.take(record("RMGI", LU=100_000, FX=1.0, FY=2.0, FZ=3.0, I=1))
    inputs.take(record("RMGI", LU=110_000, FX=9.0, FY=9.0, FZ=9.0, I=0))
    assert inputs.declination == 0.25
    assert inputs.mag is not None
    assert (inputs.mag[0], inputs.mag[1].tolist()) == (100_000, [1, 2, 3])


def test_camera_that_is_switched_off_is_none(inputs: ReplayInputs) -> None:
    inputs.take(record("RVOH", OX=0.5, OY=0.0, OZ=-0.25, Del=10, H=1, Ena=1))
    assert (inputs.camera_frd, inputs.camera_delay_ms) == ((0.5, 0.0, -0.25), 10)
    inputs.take(record("RVOH", OX=0.5, OY=0.0, OZ=-0.25, Del=10, H=1, Ena=0))
    assert inputs.camera_frd is None


def test_unhealthy_camera_is_where_it_was(inputs: ReplayInputs) -> None:
    inputs.take(record("RVOH", OX=0.5, OY=0.0, OZ=0.0, Del=10, H=0, Ena=1))
    assert inputs.camera_frd == (0.5, 0.0, 0.0)


def test_unknown_record_changes_nothing(inputs: ReplayInputs) -> None:
    before = vars(inputs).copy()
    inputs.take(record("VISP", PX=1.0))
    assert vars(inputs) == before


def test_time_may_stand_still_and_not_run_backwards(inputs: ReplayInputs) -> None:
    for time_us in (5, 5):
        inputs.take(record("RFRH", TimeUS=time_us, TF=0))
    with pytest.raises(RecordError, match=r"RFRH\.TimeUS runs backwards, from 5 to 4"):
        inputs.take(record("RFRH", TimeUS=4, TF=0))


def test_gps_comes_out_of_its_records(inputs: ReplayInputs) -> None:
    inputs.take(record("RGPH", NumInst=1, Primary=0))
    inputs.take(record("RGPI", Lg=0.12, Flags=8, Stat=3, NSats=10, I=0))
    assert inputs.gps is None
    places = {"Lat": 10, "Lon": 20, "Alt": 30, "VX": 1.0, "VY": 2.0, "VZ": 3.0}
    inputs.take(record("RGPJ", TS=1000, SA=0.5, Y=0.0, HA=1.0, VA=2.0, HD=121, I=0, **places))
    assert inputs.gps is not None
    assert inputs.gps.time_ms == 1000
    assert (inputs.gps.lag_s, inputs.gps_lag_s) == (0.12, 0.12)


def test_lag_of_a_gps_that_is_still_sought_is_not_known(inputs: ReplayInputs) -> None:
    assert inputs.gps_lag_s is None
    inputs.take(record("RGPI", Lg=0.1, Flags=0, Stat=0, NSats=0, I=0))
    assert inputs.gps_lag_s is None
    inputs.take(record("RGPI", Lg=0.1, Flags=8, Stat=0, NSats=0, I=0))
    assert inputs.gps_lag_s == 0.1
