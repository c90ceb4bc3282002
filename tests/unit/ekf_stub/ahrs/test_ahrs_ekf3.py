# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The AHRS of a parked vehicle that runs the filter: how it starts, by what it navigates, and how that ends.

Times and texts are those of the recorded benches; the estimator may be a step of 12.5 ms off.
"""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import pytest

from ap_core.fmath import f32
from ap_core.location import Location
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ap_visualodom.ports import Ahrs
from viso.firmware.releases import JULY_2025

if TYPE_CHECKING:
    from tests.unit.ekf_stub.bench_rig import BenchRig

MakeBench = Callable[..., "BenchRig"]
STEP_MS = 13
BOOT = [
    (4455, 6, "EKF3 IMU0 initialised"),
    (4455, 6, "EKF3 IMU1 initialised"),
    (4457, 6, "AHRS: EKF3 active"),
    (pytest.approx(5777, abs=STEP_MS), 6, "EKF3 IMU0 tilt alignment complete"),
    (pytest.approx(5777, abs=STEP_MS), 6, "EKF3 IMU1 tilt alignment complete"),
]
START_BY_EXT_NAV = "is using external nav data"


# Starting


def test_it_is_what_the_port_asks_for(make_bench: MakeBench) -> None:
    ahrs: Ahrs = make_bench().ahrs
    assert ahrs.get_yaw_rad() == f32(0)


def test_boot_is_told_as_in_the_recordings(make_bench: MakeBench) -> None:
    assert make_bench(run_s=8).texts == BOOT


def test_flags_while_booting(make_bench: MakeBench) -> None:
    bench = make_bench(run_s=8)
    tilt_ms = bench.when("tilt alignment complete")
    assert bench.statuses == [
        (0, None),
        (3455, 1024),
        (pytest.approx(5455, abs=STEP_MS), 0),
        (pytest.approx(tilt_ms, abs=STEP_MS), 167),
    ]


def test_attitude_is_there_before_the_estimator(make_bench: MakeBench) -> None:
    bench = make_bench(heading_deg=90)
    bench.run_to(2.45)
    assert bench.ahrs.get_quaternion() is None
    bench.run_to(2.46)
    assert bench.ahrs.get_quaternion() == Quaternion.from_euler(f32(0), f32(0), f32(math.pi / 2))
    assert bench.ahrs.get_yaw_rad() == f32(math.pi / 2)


def test_filter_begins_level_and_facing_north_whatever_the_heading(make_bench: MakeBench) -> None:
    bench = make_bench(heading_deg=90)
    bench.run_to(6)
    assert [math.degrees(angle) for angle in bench.report.rpy_rad] == pytest.approx([0, 0, 0], abs=0.1)
    assert math.degrees(bench.ahrs.get_yaw_rad()) == pytest.approx(0, abs=0.1)


def test_it_is_initialised_20_s_after_it_began(make_bench: MakeBench) -> None:
    bench = make_bench()
    bench.clock.set_us(22_455_000)
    assert not bench.ahrs.initialised()
    bench.clock.set_us(22_456_000)
    assert bench.ahrs.initialised()


@pytest.mark.parametrize(("time_s", "has_compass", "initialised"), [
    (2.45, True, False),
    (2.46, True, True),
    (2.46, False, False),
])  # fmt: skip
def test_dcm_yaw_takes_a_compass(make_bench: MakeBench, time_s: float, has_compass: bool, initialised: bool) -> None:
    bench = make_bench(has_compass=has_compass)
    bench.run_to(time_s)
    assert bench.ahrs.dcm_yaw_initialised() is initialised


@pytest.mark.parametrize("mask", [1, 2])
def test_one_core_speaks_for_itself(make_bench: MakeBench, mask: int) -> None:
    bench = make_bench(EK3_IMU_MASK=mask)
    bench.run_to(5)
    assert bench.said() == [f"EKF3 IMU{mask - 1} initialised", "AHRS: EKF3 active"]


@pytest.mark.parametrize("params", [{"EK3_ENABLE": 0}, {"EK3_IMU_MASK": 0}])
def test_without_cores_it_never_starts(make_bench: MakeBench, params: dict[str, float]) -> None:
    bench = make_bench(**params)
    bench.run_to(6)
    bench.pose()
    assert bench.texts == []
    assert bench.flags is None
    assert not bench.ahrs.healthy()
    assert bench.ahrs.pre_arm_failure(requires_position=False) == "EKF3 not started"
    assert bench.ahrs.ext_nav_counts == {("pose", "not_started"): 1}


def test_compass_aligns_yaw_and_the_vehicle_is_told(make_bench: MakeBench) -> None:
    bench = make_bench("00101", has_compass=True, heading_deg=-100)
    bench.run_to(8)
    aligned = "MAG0 initial yaw alignment complete"
    assert bench.said(since_s=5.8) == [f"EKF3 IMU0 {aligned}", f"EKF3 IMU1 {aligned}"]
    assert bench.when(aligned) == pytest.approx(5862, abs=STEP_MS)
    assert bench.yaw_resets == [bench.when(aligned)]
    assert math.degrees(bench.ahrs.get_yaw_rad()) == pytest.approx(-100, abs=0.1)
    assert bench.flags == 167


def test_heading_of_the_compass_is_true_once_there_is_an_origin(make_bench: MakeBench) -> None:
    bench = make_bench("00101", has_compass=True, heading_deg=-100)
    bench.run_to(8)
    bench.ahrs.set_origin(Location(473977420, 85455940, 48800))
    bench.run_to(90)
    assert math.degrees(bench.ahrs.get_yaw_rad()) == pytest.approx(-100, abs=1)


def test_frame_without_sensor_data_is_skipped(make_bench: MakeBench) -> None:
    bench = make_bench(run_s=6)
    horizon_ms = bench.core.ext_nav.horizon_ms
    for _ in range(20):
        bench.ahrs.update()
    assert bench.core.ext_nav.horizon_ms == horizon_ms
    bench.run_for(0.02)
    assert bench.core.ext_nav.horizon_ms > horizon_ms


# The worked example in short: poses and velocities, silence, and poses from elsewhere


@pytest.fixture(scope="module")
def example(make_bench: MakeBench) -> "BenchRig":
    """Return a bench that was given data from 6 to 9 s, and again from 25 s on."""
    bench = make_bench(run_s=6)
    bench.stream(9, lambda: bench.pose(1, 2, -0.5), bench.speed)
    bench.run_to(25)
    bench.stream(26, lambda: bench.pose(35, 2, -0.5), bench.speed)
    return bench


def test_first_pose_aligns_yaw_and_starts_aiding(example: "BenchRig") -> None:
    assert [text for time_ms, _, text in example.texts if 6000 < time_ms < 9000] == [
        "EKF3 IMU0 yaw aligned",
        "EKF3 IMU1 yaw aligned",
        *(
            f"EKF3 IMU{core} {text}"
            for core in (0, 1)
            for text in (
                START_BY_EXT_NAV,
                "initial pos NED = 1.0,2.0,-0.5 (m)",
                "initial vel NED = 0.0,0.0,0.0 (m/s)",
            )
        ),
    ]
    assert example.when("yaw aligned") == pytest.approx(6054, abs=STEP_MS)
    assert 0 < example.when(START_BY_EXT_NAV) - example.when("yaw aligned") <= 3
    assert {severity for time_ms, severity, _ in example.texts if time_ms < 9000} == {6}


def test_flags_change_with_aiding_and_need_no_origin(example: "BenchRig") -> None:
    time_ms, flags = next(status for status in example.statuses if status[0] > 6000)
    assert flags == 831
    assert 0 < time_ms - example.when(START_BY_EXT_NAV) <= STEP_MS
    assert example.ahrs.origin() is None


def test_silence_takes_position_at_7_s_and_aiding_at_15_s(example: "BenchRig") -> None:
    (lost_ms, lost), (ended_ms, ended) = example.statuses[-3:-1]
    assert (lost, ended) == (39, 167)
    assert lost_ms == pytest.approx(16_030, abs=50)
    assert ended_ms == pytest.approx(24_030, abs=50)
    warnings = [(severity, text) for _, severity, text in example.texts if severity != 6]
    assert warnings == [(4, "EKF3 IMU0 stopped aiding"), (4, "EKF3 IMU1 stopped aiding")]
    assert example.when("stopped aiding") == pytest.approx(24_030, abs=50)


def test_data_that_comes_back_starts_aiding_at_once(example: "BenchRig") -> None:
    assert example.when(START_BY_EXT_NAV, since_s=9) == pytest.approx(25_056, abs=STEP_MS)
    assert "EKF3 IMU0 initial pos NED = 35.0,2.0,-0.5 (m)" in example.said(since_s=25)
    assert example.position == pytest.approx((35, 2, -0.5), abs=0.05)
    assert example.flags == 831


@pytest.mark.slow
def test_position_is_told_from_the_start_of_aiding_to_its_end(make_bench: MakeBench) -> None:
    bench = make_bench(run_s=6)
    assert bench.position is None
    bench.stream(7, lambda: bench.pose(1, 2, -0.5), bench.speed)
    assert bench.position == pytest.approx((1, 2, -0.5), abs=0.01)
    bench.run_to(21)
    assert bench.position == pytest.approx((1, 2, -0.5), abs=0.5)
    bench.run_to(22.2)
    assert bench.position is None
    assert bench.velocity == pytest.approx((0, 0, 0), abs=0.1)


# What it navigates by


@pytest.mark.slow
@pytest.mark.parametrize(("down", "lost"), [(-0.5, 39), (1.0, 37)])
def test_poses_alone_lose_their_velocity_too_but_on_the_ground(make_bench: MakeBench, down: float, lost: int) -> None:
    # The ground is where the first pose puts the vehicle, which the barometer puts elsewhere after that.
    bench = make_bench("60106", firmware=JULY_2025)
    bench.run_to(6)
    bench.stream(8, lambda: bench.pose(0, 0, down))
    bench.run_for(16)
    assert [flags for _, flags in bench.statuses[-3:]] == [831, lost, 167]


def test_data_before_the_filter_starts_aiding_after_tilt_alignment(make_bench: MakeBench) -> None:
    bench = make_bench("66101", has_compass=True)
    bench.run_to(4.5)
    bench.stream(7, bench.pose, bench.speed)
    assert 0 < bench.when(START_BY_EXT_NAV) - bench.when("tilt alignment complete") < 50
    assert bench.flags == 831


def test_position_is_enough_to_start_by_and_yaw_is_not_waited_for(make_bench: MakeBench) -> None:
    bench = make_bench("60101", has_compass=True)
    bench.run_to(5.7)
    bench.stream(6, bench.pose)
    assert bench.when(START_BY_EXT_NAV) < bench.when("MAG0 initial yaw alignment complete")


def test_velocity_alone_never_starts_aiding(make_bench: MakeBench) -> None:
    bench = make_bench("06166")
    bench.run_to(6)
    bench.stream(9, bench.speed)
    assert bench.texts == BOOT
    assert bench.flags == 167
    assert bench.velocity == pytest.approx((0, 0, 0), abs=0.05)


@pytest.mark.slow
def test_moving_velocity_on_a_parked_vehicle_ends_in_forced_resets(make_bench: MakeBench) -> None:
    bench = make_bench("06166")
    bench.run_to(6)
    bench.stream(26, lambda: bench.speed(1))
    told = [text for text in bench.said(since_s=6) if text.startswith("EKF3 IMU0")]
    assert told[:3] == [f"EKF3 IMU0 {text}" for text in ("forced reset", "initialised", "tilt alignment complete")]
    assert f"EKF3 IMU0 {START_BY_EXT_NAV}" not in told


def test_velocity_of_no_source_is_unused(make_bench: MakeBench) -> None:
    bench = make_bench("60606")
    bench.run_to(6)
    bench.stream(7, bench.pose)
    bench.stream(8, bench.pose, lambda: bench.speed(1, 2, 3))
    assert bench.velocity == pytest.approx((0, 0, 0), abs=0.05)
    assert bench.ahrs.ext_nav_counts["velocity", "model_unused"] > 20
    assert bench.ahrs.ext_nav_counts["velocity", "model_fused"] == 0


def test_vertical_velocity_alone_is_never_fused_but_told(make_bench: MakeBench) -> None:
    bench = make_bench("60666")
    bench.run_to(6)
    bench.stream(8, bench.pose, lambda: bench.speed(-0.04, 0, 3))
    assert "EKF3 IMU0 initial vel NED = -0.0,0.0,3.0 (m/s)" in bench.said()
    assert bench.report.vel_ratio == 0
    assert bench.velocity == pytest.approx((0, 0, 0), abs=0.05)


@pytest.mark.parametrize(("sources", "axes"), [("66106", 2), ("66166", 3)])
def test_vertical_velocity_is_fused_with_the_horizontal_if_it_has_its_source(
    make_bench: MakeBench, sources: str, axes: int
) -> None:
    bench = make_bench(sources)
    bench.run_to(6)
    bench.stream(7, bench.pose, lambda: bench.speed(0.1, -0.1, 0.1))
    assert [value != 0 for value in bench.report.vel_innovation] == [axis < axes for axis in range(3)]


def test_without_a_yaw_source_aiding_starts_and_stops_with_every_sample(make_bench: MakeBench) -> None:
    bench = make_bench("66660")
    bench.run_to(6.1)
    bench.stream(7, bench.pose, period_s=0.2)
    said = [text for text in bench.said(since_s=6) if text.startswith("EKF3 IMU0") and "initial" not in text]
    assert said == [f"EKF3 IMU0 {START_BY_EXT_NAV}", "EKF3 IMU0 stopped aiding"] * 5


def test_compass_that_is_not_there_is_no_yaw_source(make_bench: MakeBench) -> None:
    bench = make_bench("66661")
    bench.run_to(6.1)
    bench.stream(6.4, bench.pose, period_s=0.2)
    assert "EKF3 IMU0 stopped aiding" in bench.said()


def test_armed_vehicle_without_a_yaw_source_goes_on(make_bench: MakeBench) -> None:
    bench = make_bench("66660")
    bench.state.armed = True
    bench.run_to(6.1)
    bench.stream(7, bench.pose, period_s=0.2)
    assert "EKF3 IMU0 stopped aiding" not in bench.said()


@pytest.mark.slow
def test_sources_named_after_boot_get_nothing(make_bench: MakeBench) -> None:
    bench = make_bench("00101", has_compass=True)
    bench.run_to(7)
    bench.use_sources("66666")
    bench.stream(12.5, bench.pose)
    assert bench.ahrs.ext_nav_counts["pose", "no_buffer"] > 100
    assert f"EKF3 IMU0 {START_BY_EXT_NAV}" not in bench.said()
    # Height, too, waits for samples that never reach it, and is lost after 5 s.
    assert bench.flags == 131


@pytest.mark.parametrize("value", [math.inf, -math.inf])
def test_infinite_samples_are_not_believed(make_bench: MakeBench, value: float) -> None:
    bench = make_bench(run_s=6)
    bench.stream(6.5, lambda: bench.pose(value), lambda: bench.speed(value), period_s=0.05)
    bench.stream(7, lambda: bench.odometry(value), period_s=0.06)
    for kind in ("pose", "velocity", "odometry"):
        assert bench.ahrs.ext_nav_counts[kind, "model_not_finite"] > 0
    assert f"EKF3 IMU0 {START_BY_EXT_NAV}" not in bench.said()


def test_fast_stream_is_thinned_out_and_a_reset_on_a_sample_left_out_still_acts(make_bench: MakeBench) -> None:
    bench = make_bench(run_s=6)
    bench.stream(7.005, bench.pose, period_s=0.01)
    counts = bench.ahrs.ext_nav_counts
    assert (counts["pose", "taken"], counts["pose", "too_soon"]) == (51, 50)
    bench.pose(4, reset_ms=7000)
    assert counts["pose", "too_soon"] == 51
    bench.run_for(0.01)
    bench.stream(7.1, lambda: bench.pose(4, reset_ms=7000), period_s=0.01)
    assert bench.report.moved_ne == pytest.approx((4, 0), abs=0.05)


# Body odometry


@pytest.mark.slow
def test_odometry_is_fused_at_once_and_starts_relative_aiding_once_gyros_are_known(make_bench: MakeBench) -> None:
    bench = make_bench("06101", has_compass=True)
    bench.run_to(40)
    bench.stream(42, bench.odometry, period_s=0.06)
    assert bench.when("fusing odometry") == pytest.approx(40_060, abs=20)
    assert bench.when("started relative aiding") == pytest.approx(41_400, abs=100)
    assert bench.flags == 303


@pytest.mark.slow
def test_odometry_that_ends_ends_relative_aiding_after_5_s(make_bench: MakeBench) -> None:
    bench = make_bench("06101", has_compass=True, run_s=7)
    bench.know_gyros()
    bench.stream(9, bench.odometry, period_s=0.06)
    assert bench.flags == 303
    assert bench.position == pytest.approx((0, 0, 0), abs=0.1)
    bench.run_to(16)
    assert bench.when("stopped aiding") == pytest.approx(14_000, abs=100)
    assert bench.flags == 167
    bench.know_gyros()
    bench.stream(17, bench.odometry, period_s=0.06)
    again = ("started relative aiding", "fusing odometry")
    assert bench.said(since_s=16) == [f"EKF3 IMU{core} {text}" for text in again for core in (0, 1)]


def test_odometry_that_cannot_be_is_rejected(make_bench: MakeBench) -> None:
    bench = make_bench("06101", has_compass=True, run_s=7)
    bench.stream(9, bench.odometry, period_s=0.06)
    bench.odometry(0.45)
    bench.run_for(0.1)
    assert bench.report.odometry is not None
    assert bench.report.odometry.innovation[0] == pytest.approx(-9, abs=0.2)
    assert bench.ahrs.ext_nav_counts["odometry", "model_gate_odometry"] == 1
    assert bench.velocity == pytest.approx((0, 0, 0), abs=0.1)


def test_poor_odometry_starts_nothing(make_bench: MakeBench) -> None:
    bench = make_bench("06101", has_compass=True, run_s=7)
    bench.know_gyros()
    bench.stream(8, lambda: bench.odometry(quality=-20), period_s=0.06)
    assert "EKF3 IMU0 started relative aiding" not in bench.said()
    bench.stream(9, bench.odometry, period_s=0.06)
    assert "EKF3 IMU0 started relative aiding" in bench.said()


@pytest.mark.parametrize("sources", ["00101", "03101"])
def test_odometry_of_no_source_is_not_used(make_bench: MakeBench, sources: str) -> None:
    bench = make_bench(sources, EK3_SRC2_YAW=6)
    bench.run_to(7)
    bench.stream(8, bench.odometry, period_s=0.06)
    assert bench.ahrs.ext_nav_counts["odometry", "model_unused"] > 0
    assert "EKF3 IMU0 fusing odometry" not in bench.said()


# Where the camera is


@pytest.mark.parametrize(("yaw", "told"), [(0.0, "0.5,0.0,0.0"), (math.pi / 2, "1.0,-0.5,0.0")])
def test_lever_arm_of_the_camera_is_taken_off(make_bench: MakeBench, yaw: float, told: str) -> None:
    bench = make_bench(INS_POS1_X=0.25)
    bench.camera_pos = Vector3f(0.75, 0, 0)
    bench.run_to(6)
    bench.stream(6.2, lambda: bench.pose(1, 0, 0, yaw=yaw))
    [said] = [text for text in bench.said() if text.startswith("EKF3 IMU0 initial pos")]
    numbers = [float(number) for number in said.split("= ")[1].removesuffix(" (m)").split(",")]
    assert numbers == pytest.approx([float(number) for number in told.split(",")], abs=0.051)


def test_source_that_follows_poses_hears_where_the_imu_is_and_of_resets(make_bench: MakeBench) -> None:
    bench = make_bench(INS_POS1_X=0.25)
    bench.camera_pos = Vector3f(0.75, 0, 0)
    heard: list[tuple[float, int, bool]] = []

    def take_pose(pos_ned: Vector3f, quat: Quaternion, observed_ms: int, is_reset: bool) -> None:
        heard.append((float(pos_ned.x), observed_ms, is_reset))

    bench.ahrs.source.follows_poses, bench.ahrs.source.take_pose = True, take_pose  # type: ignore[method-assign]
    bench.run_to(6)
    bench.pose(1, 0, 0)
    bench.pose(1, 0, 0, reset_ms=5990)
    bench.pose(1, 0, 0, reset_ms=5990)
    assert heard == [(0.5, 5990, False), (0.5, 5990, True), (0.5, 5990, False)]
