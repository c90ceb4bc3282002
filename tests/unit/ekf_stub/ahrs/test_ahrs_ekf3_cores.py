# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Cores whose IMUs differ: each has a filter of its own, and the vehicle is told what the primary one says."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from ap_core.vector3 import Vector3f
from ekf_stub.ahrs.cores import Cores
from ekf_stub.core.vectors import quat_of_euler
from ekf_stub.inputs.measurements import (
    DOWNWARD,
    AllGps,
    Array,
    BaroReading,
    FinderState,
    FlowMeasurement,
    GpsSample,
    RangeState,
    RangeStatus,
    first_healthy,
)
from ekf_stub.inputs.sensors import Sensors
from tests.unit.ekf_stub.bench_rig import BenchRig
from viso.vehicle.sensors.errors import SensorErrors
from viso.vehicle.sensors.source import HOME, ImuOptions
from viso.vehicle.sensors.standing import BenchSource

MakeBench = Callable[..., BenchRig]

DIFFERING = SensorErrors(accel_bias_m_s2=(0.1, 0.1, 0.2), gyro_noise_deg_s_rthz=0.01, imus=2.0)


@pytest.fixture
def bench(make_bench: MakeBench) -> BenchRig:
    """Return a vehicle with two IMUs that differ, which navigates by external navigation."""
    return make_bench("66666", errors=DIFFERING, run_s=5.6)


def cores_of(bench: BenchRig) -> Cores:
    assert bench.ahrs.cores is not None
    return bench.ahrs.cores


def let_first_be_bad(bench: BenchRig) -> None:
    first, second = cores_of(bench).lanes.cores
    first.vel_pos.height_ratio, second.vel_pos.height_ratio = 2.0, 0.1
    for core in (first, second):
        core.yaw.aligned = core.tilt_aligned = True
    bench.ahrs.check_lane_switch()
    bench.hear_of_changes()


def test_cores_that_are_given_the_same_share_a_filter(make_bench: MakeBench) -> None:
    bench = make_bench("66666", run_s=3.5)
    assert len(cores_of(bench).lanes.cores) == 1


def test_each_core_has_a_state_and_texts_of_its_own(bench: BenchRig) -> None:
    first, second = cores_of(bench).lanes.cores
    assert first.state.vel != second.state.vel
    assert [bench.said().count(f"EKF3 IMU{imu} initialised") for imu in (0, 1)] == [1, 1]
    assert bench.said().count("AHRS: EKF3 active") == 1


def test_mask_chooses_among_the_imus_that_differ(make_bench: MakeBench) -> None:
    bench = make_bench("66666", errors=SensorErrors(gyro_noise_deg_s_rthz=0.01, imus=3.0), EK3_IMU_MASK=4, run_s=4.5)
    assert len(cores_of(bench).lanes.cores) == 1
    assert bench.said()[0] == "EKF3 IMU2 initialised"


def test_sample_goes_to_all_cores_and_counts_once(bench: BenchRig) -> None:
    before = bench.ahrs.ext_nav_counts["pose", "taken"]
    bench.pose()
    assert bench.ahrs.ext_nav_counts["pose", "taken"] == before + 1
    assert all(core.ext_nav.pose_stamp_ms == bench.now_ms for core in cores_of(bench).lanes.cores)


def test_inputs_of_all_imus_are_logged(bench: BenchRig) -> None:
    bench.is_logged = True
    bench.run_for(0.01)
    imus = [values[-1] for name, values in bench.records if name == "RISI"]
    assert imus == [0, 1, 2, 0, 1, 0, 1, 0, 1][: len(imus)]
    assert len({values[:6] for name, values in bench.records if name == "RISI"}) == len(imus)


def test_better_core_takes_over_and_the_vehicle_is_told(bench: BenchRig) -> None:
    let_first_be_bad(bench)
    assert bench.said()[-1] == "EKF3 lane switch 1"
    assert bench.primaries == [1]
    assert bench.yaw_resets[-1] == bench.now_ms
    assert bench.core is cores_of(bench).lanes.cores[1]


def test_all_that_is_told_is_the_primary_cores(bench: BenchRig) -> None:
    let_first_be_bad(bench)
    second = cores_of(bench).lanes.cores[1]
    second.output.now.vel = 3.0, 2.0, 1.0
    assert bench.velocity == (3.0, 2.0, 1.0)
    assert bench.report.vel_ned == (3.0, 2.0, 1.0)
    heard: list[str] = []
    bench.ahrs.on_filter_outcome = lambda outcome: heard.append(outcome.kind)
    bench.pose()
    assert heard == ["pose", "yaw"]


def test_vehicle_goes_back_to_the_chosen_core_on_the_ground(bench: BenchRig) -> None:
    let_first_be_bad(bench)
    bench.run_for(0.1)
    assert bench.primaries == [1, 0]
    assert bench.said().count("EKF3 lane switch 0") == 0
    assert bench.core is cores_of(bench).lanes.cores[0]


def test_help_that_the_vehicle_asks_for_is_logged(bench: BenchRig) -> None:
    bench.is_logged = True
    bench.run_for(0.01)
    bench.records.clear()
    bench.ahrs.request_yaw_reset()
    bench.ahrs.check_lane_switch()
    assert [record for record in bench.records if record[0] == "REV3"] == [("REV3", (11,)), ("REV3", (12,))]


def test_core_that_is_not_well_keeps_the_vehicle_from_arming(bench: BenchRig) -> None:
    _, second = cores_of(bench).lanes.cores
    second.vel_pos.vel_ratio = second.vel_pos.pos_ratio = second.vel_pos.height_ratio = 2.0
    assert bench.ahrs.healthy()
    assert bench.ahrs.pre_arm_failure(False) == "EKF3 still initialising"


@pytest.mark.parametrize(("rpy_deg", "failure"), [
    ((9.0, 0.0, 0.0), None),
    ((0.0, -11.5, 0.0), "EKF3 Roll/Pitch inconsistent 11 deg. Wait or reboot"),
    ((0.0, 0.0, 19.0), None),
    ((0.0, 0.0, -23.5), "EKF3 Yaw inconsistent 23 deg. Wait or reboot"),
])  # fmt: skip
def test_cores_that_disagree_keep_the_vehicle_from_arming(
    bench: BenchRig, rpy_deg: tuple[float, float, float], failure: str | None
) -> None:
    for core, angles_deg in zip(cores_of(bench).lanes.cores, ((0.0, 0.0, 0.0), rpy_deg), strict=True):
        core.output.now.quat = quat_of_euler(*map(math.radians, angles_deg))
    assert cores_of(bench).disagreement(checks_yaw=True) == failure
    assert cores_of(bench).disagreement(checks_yaw=False) == (failure if rpy_deg[1] else None)


# Each core's own place


@pytest.fixture
def apart(bench: BenchRig) -> BenchRig:
    """Return the vehicle with the second IMU elsewhere."""
    bench.params.set("INS_POS2_X", 1.0)
    return bench


def test_camera_at_the_first_imu_has_a_lever_arm_from_the_second(apart: BenchRig) -> None:
    apart.run_for(0.01)
    assert [core.inputs.lever_arm for core in cores_of(apart).lanes.cores] == [(0.0, 0.0, 0.0), (-1.0, 0.0, 0.0)]


def test_range_finders_stand_where_each_core_sees_them(apart: BenchRig) -> None:
    apart.state.ranges = RangeState((FinderState((0.5, 0.0, 0.25), 2.0, DOWNWARD, RangeStatus.GOOD),), 0.125, 30.0)
    apart.run_for(0.01)
    ranges = [core.inputs.ranges for core in cores_of(apart).lanes.cores]
    assert [said and said.finders[0].place_frd for said in ranges] == [(0.5, 0.0, 0.25), (-0.5, 0.0, 0.25)]
    apart.run_for(0.01)
    assert cores_of(apart).lanes.cores[1].inputs.ranges is ranges[1]


def test_flow_is_handed_on_with_its_place_from_each_imu(make_bench: MakeBench) -> None:
    bench = make_bench("66666", errors=DIFFERING, run_s=5.6, FLOW_TYPE=5)
    bench.params.set("INS_POS2_X", 1.0)
    bench.ahrs.write_flow(FlowMeasurement(180, (0.25, -0.5), (0.125, 0.0), (0.5, 0.0, 0.25)), bench.now_ms)
    taken = [core.flow_reading.recall(bench.now_ms) for core in cores_of(bench).lanes.cores]
    assert [flow and flow.offset for flow in taken] == [(0.5, 0.0, 0.25), (-0.5, 0.0, 0.25)]


def test_gps_is_moved_from_its_antenna_to_each_imu(apart: BenchRig) -> None:
    apart.params.set("INS_POS1_Z", 0.5)
    apart.is_logged = True
    apart.fix()
    apart.run_for(0.01)
    solutions = [core.inputs.gps for core in cores_of(apart).lanes.cores]
    assert [said and said.antenna for said in solutions] == [(0.0, 0.0, -0.5), (-1.0, 0.0, 0.0)]
    apart.run_for(0.01)
    assert [core.inputs.gps for core in cores_of(apart).lanes.cores] == solutions
    assert dict(apart.records)["RGPI"][:3] == (0.0, 0.0, 0.0)


# Sensors of their own (EK3_AFFINITY)

FIRST = GpsSample(5000, 3, HOME, Vector3f(), 10)
SECOND = replace(FIRST, num_sats=12)


def solutions(bench: BenchRig, gps: AllGps) -> list[GpsSample | None]:
    bench.state.gps = gps
    bench.run_for(0.01)
    return [core.inputs.gps for core in cores_of(bench).lanes.cores]


@pytest.mark.parametrize("affinity", [0, 1])
def test_each_core_has_the_gps_of_its_number_if_asked_for(make_bench: MakeBench, affinity: int) -> None:
    bench = make_bench("33131", GPS2_TYPE=1, EK3_AFFINITY=affinity, run_s=3.5)
    assert solutions(bench, AllGps((FIRST, SECOND), primary=1)) == ([SECOND], [FIRST, SECOND])[affinity]


def test_core_whose_gps_has_no_fix_uses_the_primary_one(make_bench: MakeBench) -> None:
    bench = make_bench("33131", GPS2_TYPE=1, EK3_AFFINITY=1, run_s=3.5)
    lost = replace(SECOND, fix_type=1)
    assert solutions(bench, AllGps((FIRST, lost))) == [FIRST, FIRST]
    assert solutions(bench, AllGps((FIRST,))) == [FIRST, FIRST]
    assert solutions(bench, AllGps((FIRST, SECOND))) == [FIRST, SECOND]


class Barometers(BenchSource):
    """A vehicle on the bench with barometers that differ."""

    heights: tuple[float, ...] = (1.0, 2.0)
    failed = 9

    def sense(self, now_us: int) -> Sensors | None:
        """Return the data of the sensors."""
        sensors = super().sense(now_us)
        if sensors is None or sensors.baro is None:
            return sensors
        time_ms, _ = sensors.baro
        baros = tuple(BaroReading(time_ms, one, number != self.failed) for number, one in enumerate(self.heights))
        return replace(sensors, baro=baros[first_healthy(baros)].timed_height, baros=baros)

    def ahead(self, times_us: range) -> Array:
        """Return nothing, so that every pass has its reading."""
        return np.zeros((0, 8))


def with_barometers(make_bench: MakeBench, **params: float) -> tuple[BenchRig, Barometers]:
    bench = make_bench("66131", **params)
    source = Barometers(ImuOptions())
    bench.ahrs.source = source
    bench.run_to(3.5)
    return bench, source


def heights(bench: BenchRig) -> list[float]:
    bench.run_for(0.2)
    return [core.inputs.baro_height for core in cores_of(bench).lanes.cores]


@pytest.mark.parametrize("affinity", [0, 2])
def test_each_core_has_the_barometer_of_its_number_if_asked_for(make_bench: MakeBench, affinity: int) -> None:
    bench, _ = with_barometers(make_bench, EK3_AFFINITY=affinity)
    assert heights(bench) == ([1.0, 2.0] if affinity else [1.0])


def test_core_whose_barometer_has_failed_uses_the_first_that_works(make_bench: MakeBench) -> None:
    bench, source = with_barometers(make_bench, EK3_AFFINITY=2)
    source.failed = 1
    assert heights(bench) == [1.0, 1.0]
    source.failed = 0
    assert heights(bench) == [2.0, 2.0]


def test_each_barometer_is_zeroed_by_its_own_height(make_bench: MakeBench) -> None:
    bench, source = with_barometers(make_bench, EK3_AFFINITY=2)
    bench.run_to(5.6)
    assert bench.ahrs.reset_height_datum()
    source.heights = (1.5, 3.0)
    assert heights(bench) == [0.5, 1.0]


# What they say


def test_lines_of_a_pass_are_kept_together_by_core(make_bench: MakeBench) -> None:
    # GIVEN a filter that stands for two cores
    bench = make_bench("66666", run_s=6.0)
    # WHEN it has several things to say at once
    bench.stream(6.5, lambda: bench.pose(1.0, 2.0, -0.5))
    started = bench.when("is using external nav data")
    # THEN each core says all of it, one after the other
    said = [(severity, text) for time_ms, severity, text in bench.texts if time_ms == started]
    words = ["is using external nav data", "initial pos NED = 1.0,2.0,-0.5 (m)"]
    assert said == [(6, f"EKF3 IMU{imu} {line}") for imu in (0, 1) for line in words]


def test_origin_that_is_set_again_is_told_of_once(bench: BenchRig) -> None:
    assert bench.ahrs.set_origin(bench.place)
    cores_of(bench).lanes.set_origin(bench.place)
    cores_of(bench).send_texts()
    assert bench.said()[-3:] == ["EKF3 IMU0 origin set", "EKF3 IMU1 origin set", "EKF3: origin already set"]
    assert bench.texts[-1][1] == 4
