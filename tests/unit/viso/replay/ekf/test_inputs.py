# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the records of a log leave of the sensors."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from ekf_stub.inputs.measurements import FinderState, FlowMeasurement, RangeState
from ekf_stub.log.replay_log import ARMED, TAKEOFF_EXPECTED
from viso.replay.ekf.inputs import ReplayInputs, flow_of


def record(kind: str, **fields: object) -> Any:
    return SimpleNamespace(get_type=lambda: kind, **fields)


@pytest.fixture
def inputs() -> ReplayInputs:
    return ReplayInputs()


def test_nothing_is_known_at_first(inputs: ReplayInputs) -> None:
    assert inputs.baros == {}
    assert inputs.compasses.readings == []
    assert (inputs.camera_frd, inputs.gps) == (None, None)


def test_vehicle_has_home_and_flags(inputs: ReplayInputs) -> None:
    inputs.take(record("RFRN", HLat=-353632610 & 0xFFFFFFFF, Flags=65))
    assert inputs.home_lat == -353632610
    assert inputs.flags == ARMED | TAKEOFF_EXPECTED


def test_first_imus_and_their_number_are_kept(inputs: ReplayInputs) -> None:
    inputs.take(record("RISH", PG=1, PA=0, AC=2, LD=0.0025))
    assert (inputs.first_gyro, inputs.first_accel, inputs.imu_count, inputs.loop_dt) == (1, 0, 2, 0.0025)


def test_heights_are_kept_by_barometer(inputs: ReplayInputs) -> None:
    inputs.take(record("RBRH", Primary=1, NumInst=2))
    inputs.take(record("RBRI", LastUpdate=100, Alt=1.5, H=1, I=1))
    inputs.take(record("RBRI", LastUpdate=110, Alt=9.5, H=0, I=0))
    assert inputs.primary_baro == 1
    assert inputs.baros == {0: ((110, 9.5), False), 1: ((100, 1.5), True)}


def test_compasses_are_kept_by_number(inputs: ReplayInputs) -> None:
    inputs.take(record("RMGH", Dec=0.25, Avail=1, NumInst=2, AutoDec=0, C=0, FUsable=1))
    for i, is_used in enumerate((0, 1)):
        field = {"FX": 1.0, "FY": 2.0, "FZ": i, "OX": 4.0, "OY": 5.0, "OZ": i}
        inputs.take(record("RMGI", LU=100_000 + i, **field, UFY=is_used, H=1, HSF=1 - i, I=i))
    compasses = inputs.compasses
    assert (inputs.declination, compasses.first_usable, compasses.are_consistent) == (0.25, 1, False)
    assert not compasses.finds_declination
    assert [reading.has_scale for reading in compasses.readings] == [True, False]
    first, second = compasses.readings
    assert (first.is_used, second.is_used, second.time_us, second.offsets) == (False, True, 100_001, (4.0, 5.0, 1.0))
    assert second.field == (1.0, 2.0, 1.0)


def test_camera_that_is_switched_off_is_none(inputs: ReplayInputs) -> None:
    inputs.take(record("RVOH", OX=0.5, OY=0.0, OZ=-0.25, Del=10, H=1, Ena=1))
    assert (inputs.camera_frd, inputs.camera_delay_ms) == ((0.5, 0.0, -0.25), 10)
    inputs.take(record("RVOH", OX=0.5, OY=0.0, OZ=-0.25, Del=10, H=1, Ena=0))
    assert inputs.camera_frd is None


def test_unhealthy_camera_is_where_it_was(inputs: ReplayInputs) -> None:
    inputs.take(record("RVOH", OX=0.5, OY=0.0, OZ=0.0, Del=10, H=0, Ena=1))
    assert inputs.camera_frd == (0.5, 0.0, 0.0)


def test_record_that_is_not_about_sensors_is_left(inputs: ReplayInputs) -> None:
    before = vars(inputs).copy()
    assert not inputs.take(record("VISP", PX=1.0))
    assert vars(inputs) == before


def test_gps_comes_out_of_its_records(inputs: ReplayInputs) -> None:
    inputs.take(record("RGPH", NumInst=1, Primary=0))
    inputs.take(record("RGPI", OX=0.3, OY=0.0, OZ=-0.2, Lg=0.12, Flags=8, Stat=3, NSats=10, I=0))
    assert inputs.gps is None
    places = {"Lat": 10, "Lon": 20, "Alt": 30, "VX": 1.0, "VY": 2.0, "VZ": 3.0}
    inputs.take(record("RGPJ", TS=1000, SA=0.5, Y=0.0, HA=1.0, VA=2.0, HD=121, I=0, **places))
    assert inputs.gps is not None
    assert inputs.gps.time_ms == 1000
    assert (inputs.gps.lag_s, inputs.gps_lag_s, inputs.gps.antenna) == (0.12, 0.12, (0.3, 0.0, -0.2))


NO_OFFSET = dict.fromkeys(("OX", "OY", "OZ"), 0.0)


def test_lag_of_a_gps_that_is_still_sought_is_not_known(inputs: ReplayInputs) -> None:
    assert inputs.gps_lag_s is None
    inputs.take(record("RGPI", **NO_OFFSET, Lg=0.1, Flags=0, Stat=0, NSats=0, I=0))
    assert inputs.gps_lag_s is None
    inputs.take(record("RGPI", **NO_OFFSET, Lg=0.1, Flags=8, Stat=0, NSats=0, I=0))
    assert inputs.gps_lag_s == 0.1


def range_finder(index: int, distance: float, status: int = 4, orient: int = 25) -> Any:
    return record("RRNI", PX=0.1, PY=0.2, PZ=0.3, Dist=distance, Orient=orient, Status=status, I=index)


def test_ranges_are_those_of_the_range_finders_that_there_are(inputs: ReplayInputs) -> None:
    inputs.take(range_finder(0, 2.0))
    assert inputs.ranges is None
    inputs.take(record("RRNH", GCl=0.1, MaxD=40.0, NumSensors=2))
    inputs.take(range_finder(0, 2.0))
    inputs.take(range_finder(1, 3.0, status=3))
    inputs.take(range_finder(2, 4.0))
    place = (0.1, 0.2, 0.3)
    finders = FinderState(place, 2.0, 25, 4), FinderState(place, 3.0, 25, 3)
    assert inputs.ranges == RangeState(finders, 0.1, 40.0)


def test_ranges_of_4_6_are_centimetres(inputs: ReplayInputs) -> None:
    inputs.take(record("RRNH", GCl=10, MaxD=4000, NumSensors=1))
    inputs.take(range_finder(0, 57))
    assert inputs.ranges is not None
    assert inputs.ranges.finders[0].distance == np.float32(57) * np.float32(0.01)
    assert (inputs.ranges.ground_clearance, inputs.ranges.max_distance) == pytest.approx((0.1, 40.0))


@pytest.mark.parametrize(("status", "orient", "is_good"), [(4, 25, True), (4, 0, False), (1, 25, False)])
def test_range_counts_that_is_good_and_looks_down(
    inputs: ReplayInputs, status: int, orient: int, is_good: bool
) -> None:
    inputs.take(record("RRNH", GCl=0.1, MaxD=40.0, NumSensors=1))
    inputs.take(range_finder(0, 2.0, status, orient))
    assert inputs.ranges is not None
    assert inputs.ranges.finders[0].is_usable is is_good


def test_flow_is_that_of_its_record() -> None:
    place = {"PX": 0.1, "PY": 0.2, "PZ": 0.3}
    measured = flow_of(record("ROFH", FX=0.5, FY=-0.5, GX=0.1, GY=-0.1, Tms=9, HgtOvr=0.0, Qual=70, **place))
    assert measured == FlowMeasurement(70, (0.5, -0.5), (0.1, -0.1), (0.1, 0.2, 0.3))
