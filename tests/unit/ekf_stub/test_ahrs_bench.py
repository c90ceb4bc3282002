# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The AHRS of a vehicle that stands still and believes what it is told, as the firmware's would from outside.

Times and texts are those of the recorded benches; the estimator may be a step of 12.5 ms off.
"""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import pytest

from ap_core.fmath import f32
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ap_visualodom.ports import Ahrs
from ekf_stub.ahrs_bench import BenchAhrs
from ekf_stub.ext_nav_log import ExtNavLog
from ekf_stub.sources import EkfSources

if TYPE_CHECKING:
    from tests.unit.ekf_stub.conftest import BenchRig

MakeBench = Callable[..., "BenchRig"]
STEP_MS = 13
BOOT = [
    (4455, 6, "EKF3 IMU0 initialised"),
    (4455, 6, "EKF3 IMU1 initialised"),
    (4457, 6, "AHRS: EKF3 active"),
    (5777, 6, "EKF3 IMU0 tilt alignment complete"),
    (5777, 6, "EKF3 IMU1 tilt alignment complete"),
]
START_BY_EXT_NAV = "is using external nav data"


def xyz(vector: Vector3f | None) -> tuple[float, ...] | None:
    return None if vector is None else tuple(float(value) for value in vector.to_tuple())


def when(bench: "BenchRig", text: str) -> int:
    """Return the time in ms at which the first core said something for the first time."""
    return next(time_ms for time_ms, _, said in bench.texts if said == f"EKF3 IMU0 {text}")


# Starting


def test_it_is_what_the_port_asks_for(make_bench: MakeBench) -> None:
    ahrs: Ahrs = make_bench().ahrs
    assert ahrs.get_yaw_rad() == f32(0)


def test_it_needs_nothing_but_a_clock_its_sources_and_a_log(make_bench: MakeBench) -> None:
    bench = make_bench()
    ahrs = BenchAhrs(bench.clock, EkfSources(lambda _name: 0), ExtNavLog(bench, lambda: False), heading_rad=2.0)
    for time_us in range(0, 7_000_000, 2500):
        bench.clock.set_us(time_us)
        ahrs.update()
    assert ahrs.healthy()
    assert bench.texts == []
    assert ahrs.get_quaternion() == Quaternion.from_euler(f32(0), f32(0), f32(2))


def test_boot_is_told_as_in_the_recordings(make_bench: MakeBench) -> None:
    bench = make_bench()
    bench.run_to(24)
    assert bench.texts == BOOT


def test_flags_while_booting(make_bench: MakeBench) -> None:
    bench = make_bench()
    bench.run_to(24)
    assert bench.statuses == [(0, None), (3455, 1024), (5455, 0), (5780, 167)]


def test_attitude_is_there_before_the_estimator(make_bench: MakeBench) -> None:
    bench = make_bench()
    bench.run_to(2.45)
    assert bench.ahrs.get_quaternion() is None
    bench.run_to(2.46)
    assert bench.ahrs.get_quaternion() == Quaternion.from_euler(f32(0), f32(0), f32(0))


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
    bench.run_to(10)
    bench.pose()
    assert bench.texts == []
    assert bench.flags is None
    assert not bench.ahrs.healthy()
    assert bench.ahrs.pre_arm_failure(requires_position=False) == "EKF3 not started"
    assert bench.ahrs.ext_nav_counts == {("pose", "not_started"): 1}


def test_compass_aligns_yaw_and_the_vehicle_is_told(make_bench: MakeBench) -> None:
    bench = make_bench("00001", has_compass=True)
    bench.run_to(10)
    aligned = "MAG0 initial yaw alignment complete"
    assert bench.said(since_s=5.8) == [f"EKF3 IMU0 {aligned}", f"EKF3 IMU1 {aligned}"]
    assert when(bench, aligned) == pytest.approx(5862, abs=STEP_MS)
    assert bench.yaw_resets == [when(bench, aligned)]
    assert bench.flags == 167


# The worked example: bench_pose_velocity


@pytest.fixture
def example(make_bench: MakeBench) -> "BenchRig":
    """Return the bench of bench_pose_velocity, as far as texts, flags and times go: data from 25.085 to 81.074 s."""
    bench = make_bench()
    bench.run_to(25.085)
    bench.stream(81.075, lambda: bench.pose(1, 2, -0.5), bench.speed)
    return bench


def test_first_pose_aligns_yaw_and_starts_aiding(example: "BenchRig") -> None:
    assert example.said(since_s=25) == [
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
    assert when(example, "yaw aligned") == pytest.approx(25_140, abs=STEP_MS)
    assert when(example, START_BY_EXT_NAV) == pytest.approx(25_143, abs=STEP_MS)
    assert when(example, START_BY_EXT_NAV) > when(example, "yaw aligned")
    assert {severity for _, severity, _ in example.texts} == {6}


def test_flags_change_with_aiding_and_need_no_origin(example: "BenchRig") -> None:
    time_ms, flags = example.statuses[-1]
    assert flags == 831
    assert 0 < time_ms - when(example, START_BY_EXT_NAV) <= STEP_MS
    assert example.ahrs.origin() is None


def test_silence_takes_position_at_7_s_and_aiding_at_15_s(example: "BenchRig") -> None:
    example.run_to(100)
    (lost_ms, lost), (ended_ms, ended) = example.statuses[-2:]
    assert (lost, ended) == (39, 167)
    assert lost_ms == pytest.approx(88_150, abs=50)
    assert ended_ms == pytest.approx(96_130, abs=50)
    stopped_ms, severity, text = example.texts[-1]
    assert (severity, text) == (4, "EKF3 IMU1 stopped aiding")
    assert stopped_ms == pytest.approx(96_129, abs=50)


def test_position_is_told_from_the_start_of_aiding_to_its_end(example: "BenchRig") -> None:
    assert xyz(example.ahrs.get_relative_position_NED_origin_float()) == (1, 2, -0.5)
    example.run_to(95)
    assert xyz(example.ahrs.get_relative_position_NED_origin_float()) == (1, 2, -0.5)
    example.run_to(97)
    assert example.ahrs.get_relative_position_NED_origin_float() is None
    assert xyz(example.ahrs.get_velocity_NED()) == (0, 0, 0)


def test_data_that_comes_back_starts_aiding_at_once(example: "BenchRig") -> None:
    example.run_to(101.097)
    example.stream(102, lambda: example.pose(35, 2, -0.5), example.speed)
    started = [time_ms for time_ms, _, text in example.texts if text == f"EKF3 IMU0 {START_BY_EXT_NAV}"]
    assert started[1:] == [pytest.approx(101_153, abs=STEP_MS)]
    assert "EKF3 IMU0 initial pos NED = 35.0,2.0,-0.5 (m)" in example.said()
    assert example.flags == 831


def test_position_follows_a_jump(example: "BenchRig") -> None:
    example.stream(82, lambda: example.pose(35, 2, -0.5))
    assert xyz(example.ahrs.get_relative_position_NED_origin_float()) == (35, 2, -0.5)


# Other sources


def test_poses_alone_lose_their_velocity_too(make_bench: MakeBench) -> None:
    bench = make_bench("60106")
    bench.run_to(5.9)
    bench.stream(20, bench.pose)
    bench.run_for(20)
    assert [flags for _, flags in bench.statuses[-3:]] == [831, 37, 167]


def test_position_that_comes_back_before_aiding_ends_is_good_again(make_bench: MakeBench) -> None:
    bench = make_bench("60106")
    bench.run_to(5.9)
    bench.stream(20, bench.pose)
    bench.run_for(10)
    said = len(bench.texts)
    bench.stream(30.5, lambda: bench.pose(7))
    assert bench.flags == 831
    assert len(bench.texts) == said
    assert xyz(bench.ahrs.get_relative_position_NED_origin_float()) == (7, 0, 0)


def test_data_before_the_estimator_starts_aiding_after_tilt_alignment(make_bench: MakeBench) -> None:
    bench = make_bench("66101", has_compass=True)
    bench.run_to(4.5)
    bench.stream(7, bench.pose, bench.speed)
    started_ms = when(bench, START_BY_EXT_NAV)
    assert 0 < started_ms - when(bench, "tilt alignment complete") < 40
    assert bench.flags == 831


def test_velocity_alone_never_starts_aiding(make_bench: MakeBench) -> None:
    bench = make_bench("06166")
    bench.run_to(5.9)
    bench.stream(20, lambda: bench.speed(1))
    assert bench.texts == BOOT
    assert bench.flags == 167
    assert xyz(bench.ahrs.get_velocity_NED()) == (0, 0, 0)
    assert bench.ahrs.ext_nav_counts["velocity", "model_unused"] > 0


@pytest.mark.parametrize(("sources", "velocity"), [
    ("66666", (1, 2, 3)),
    ("66106", (1, 2, 0)),
    ("60606", (0, 0, 0)),
    ("60666", (0, 0, 0)),
])  # fmt: skip
def test_velocity_is_that_of_its_sources(make_bench: MakeBench, sources: str, velocity: tuple[int, ...]) -> None:
    bench = make_bench(sources)
    bench.run_to(5.9)
    bench.stream(7, bench.pose)
    bench.stream(8, bench.pose, lambda: bench.speed(1, 2, 3))
    assert xyz(bench.ahrs.get_velocity_NED()) == velocity


def test_first_velocity_is_told_even_if_it_is_not_used(make_bench: MakeBench) -> None:
    bench = make_bench("60666")
    bench.run_to(6)
    bench.stream(7, bench.pose, lambda: bench.speed(-0.04, 0, 3))
    assert "EKF3 IMU0 initial vel NED = -0.0,0.0,3.0 (m/s)" in bench.said()


def test_without_a_yaw_source_aiding_starts_and_stops_with_every_sample(make_bench: MakeBench) -> None:
    bench = make_bench("66660")
    bench.run_to(6.1)
    bench.stream(7, bench.pose, period_s=0.2)
    said = [text for text in bench.said(since_s=6) if text.startswith("EKF3 IMU0") and "initial" not in text]
    assert said == [f"EKF3 IMU0 {START_BY_EXT_NAV}", "EKF3 IMU0 stopped aiding"] * 5


def test_armed_vehicle_without_a_yaw_source_goes_on(make_bench: MakeBench) -> None:
    bench = make_bench("66660")
    bench.armed = True
    bench.run_to(6.1)
    bench.stream(7, bench.pose, period_s=0.2)
    assert "EKF3 IMU0 stopped aiding" not in bench.said()


def test_odometry_is_fused_at_once_and_starts_relative_aiding_once_gyros_are_known(make_bench: MakeBench) -> None:
    bench = make_bench("06101", has_compass=True)
    bench.run_to(20)
    bench.stream(46, lambda: bench.odometry(0.05), period_s=0.06)
    assert when(bench, "fusing odometry") == pytest.approx(20_060, abs=20)
    assert when(bench, "started relative aiding") == pytest.approx(44_955, abs=STEP_MS)
    assert bench.flags == 303
    assert xyz(bench.ahrs.get_velocity_NED()) == pytest.approx((1, 0, 0), abs=1e-5)
    assert xyz(bench.ahrs.get_relative_position_NED_origin_float()) == (0, 0, 0)


def test_odometry_that_ends_ends_relative_aiding_after_5_s(make_bench: MakeBench) -> None:
    bench = make_bench("06101", has_compass=True)
    bench.run_to(44)
    bench.stream(50, bench.odometry, period_s=0.06)
    bench.run_to(60)
    assert when(bench, "stopped aiding") == pytest.approx(55_000, abs=100)
    assert bench.flags == 167
    bench.stream(61, bench.odometry, period_s=0.06)
    again = ("started relative aiding", "fusing odometry")
    assert bench.said(since_s=60) == [f"EKF3 IMU{core} {text}" for text in again for core in (0, 1)]


def test_poor_odometry_starts_nothing(make_bench: MakeBench) -> None:
    bench = make_bench("06101", has_compass=True)
    bench.run_to(46)
    bench.stream(48, lambda: bench.odometry(quality=-20), period_s=0.06)
    assert "EKF3 IMU0 started relative aiding" not in bench.said()


@pytest.mark.parametrize("sources", ["00101", "03101"])
def test_odometry_of_no_source_is_not_used(make_bench: MakeBench, sources: str) -> None:
    bench = make_bench(sources, EK3_SRC2_YAW=6)
    bench.run_to(20)
    bench.stream(21, bench.odometry, period_s=0.06)
    assert bench.ahrs.ext_nav_counts["odometry", "model_unused"] > 0
    assert "EKF3 IMU0 fusing odometry" not in bench.said()


def test_sources_named_after_boot_get_nothing(make_bench: MakeBench) -> None:
    bench = make_bench("00101", has_compass=True)
    bench.run_to(10)
    bench.use_sources("66666")
    bench.stream(16, bench.pose)
    assert bench.ahrs.ext_nav_counts["pose", "no_buffer"] > 100
    assert f"EKF3 IMU0 {START_BY_EXT_NAV}" not in bench.said()
    # Height, too, waits for samples that never reach it, and is lost after 5 s.
    assert bench.flags == 131


def test_height_comes_from_the_barometer_when_that_is_its_source(make_bench: MakeBench) -> None:
    bench = make_bench("66101", has_compass=True)
    bench.run_to(6)
    bench.stream(8, lambda: bench.pose(1, 0, -5))
    assert "EKF3 IMU0 initial pos NED = 1.0,0.0,-5.0 (m)" in bench.said()
    assert xyz(bench.ahrs.get_relative_position_NED_origin_float()) == (1, 0, 0)


def test_height_is_kept_when_poses_end(make_bench: MakeBench) -> None:
    bench = make_bench()
    bench.run_to(6)
    bench.stream(8, lambda: bench.pose(0, 0, -5))
    bench.run_to(14)
    assert xyz(bench.ahrs.get_relative_position_NED_origin_float()) == (0, 0, -5)


@pytest.mark.parametrize("value", [math.inf, -math.inf])
def test_infinite_samples_are_not_believed(make_bench: MakeBench, value: float) -> None:
    bench = make_bench()
    bench.run_to(6)
    bench.stream(7, lambda: bench.pose(value), lambda: bench.speed(value), period_s=0.05)
    bench.stream(8, lambda: bench.odometry(value), period_s=0.06)
    for kind in ("pose", "velocity", "odometry"):
        assert bench.ahrs.ext_nav_counts[kind, "model_not_finite"] > 0
    assert f"EKF3 IMU0 {START_BY_EXT_NAV}" not in bench.said()


def test_position_and_velocity_stay_within_the_filters_limits(make_bench: MakeBench) -> None:
    bench = make_bench()
    bench.run_to(6)
    bench.stream(7, lambda: bench.pose(1e30, -1e30, 1e30), lambda: bench.speed(1e30, -1e30, 0))
    assert xyz(bench.ahrs.get_relative_position_NED_origin_float()) == (5e7, -5e7, 1e4)
    assert xyz(bench.ahrs.get_velocity_NED()) == (500, -500, 0)


# Yaw


def test_yaw_follows_external_navigation_once_it_is_the_source(make_bench: MakeBench) -> None:
    bench = make_bench()
    bench.run_to(6)
    bench.stream(7, lambda: bench.pose(yaw=1.5))
    assert float(bench.ahrs.get_yaw_rad()) == pytest.approx(1.5)


def test_yaw_is_the_heading_when_external_navigation_is_not_its_source(make_bench: MakeBench) -> None:
    bench = make_bench("66661", has_compass=True)
    bench.run_to(6)
    bench.stream(7, lambda: bench.pose(yaw=1.5))
    assert bench.ahrs.get_yaw_rad() == f32(0)


def test_another_yaw_source_aligns_anew(make_bench: MakeBench) -> None:
    bench = make_bench("66661", has_compass=True)
    bench.use_sources("66666", 2)
    bench.run_to(6)
    bench.stream(7, lambda: bench.pose(yaw=1.5))
    bench.sources.active_set = 1
    bench.stream(8, lambda: bench.pose(yaw=1.5))
    assert bench.said(since_s=7) == ["EKF3 IMU0 yaw aligned", "EKF3 IMU1 yaw aligned"]
    assert len(bench.yaw_resets) == 2


def test_position_source_changes_without_a_word(make_bench: MakeBench) -> None:
    bench = make_bench("66106")
    bench.use_sources("36106", 2)
    bench.run_to(6)
    bench.stream(7, lambda: bench.pose(5))
    bench.sources.active_set = 1
    bench.stream(8, lambda: bench.pose(6))
    assert bench.said(since_s=7) == []
    assert xyz(bench.ahrs.get_relative_position_NED_origin_float()) == (5, 0, 0)


def test_gps_may_give_the_yaw(make_bench: MakeBench) -> None:
    bench = make_bench("00102")
    bench.run_to(6)
    bench.fix(yaw_deg=270.0)
    bench.run_to(6.1)
    assert bench.said(since_s=6) == ["EKF3 IMU0 yaw aligned", "EKF3 IMU1 yaw aligned"]
    assert math.degrees(bench.ahrs.get_yaw_rad()) == pytest.approx(-90)


@pytest.mark.parametrize(("sources", "using"), [("66666", True), ("66661", False)])
def test_yaw_without_data_counts_as_external_by_its_source(make_bench: MakeBench, sources: str, using: bool) -> None:
    bench = make_bench(sources)
    bench.run_to(20)
    assert bench.ahrs.using_extnav_for_yaw() is using


def test_yaw_does_not_count_as_external_before_the_estimator_starts(make_bench: MakeBench) -> None:
    bench = make_bench()
    bench.run_to(3.45)
    assert not bench.ahrs.using_extnav_for_yaw()
    bench.run_to(3.46)
    assert bench.ahrs.using_extnav_for_yaw()


def test_yaw_counts_as_external_for_5_s_after_its_last_sample(make_bench: MakeBench) -> None:
    bench = make_bench()
    bench.run_to(6)
    bench.stream(10, bench.pose)
    bench.run_to(14.9)
    assert bench.ahrs.using_extnav_for_yaw()
    bench.run_to(15.1)
    assert not bench.ahrs.using_extnav_for_yaw()


def test_pose_without_a_yaw_does_not_align(make_bench: MakeBench) -> None:
    bench = make_bench()
    bench.run_to(6)
    bench.stream(7, lambda: bench.pose(yaw=math.nan))
    assert "EKF3 IMU0 yaw aligned" not in bench.said()
    assert f"EKF3 IMU0 {START_BY_EXT_NAV}" in bench.said()


def test_yaw_waits_for_tilt(make_bench: MakeBench) -> None:
    bench = make_bench()
    bench.run_to(4.5)
    bench.stream(5.7, lambda: bench.pose(yaw=1.5))
    assert bench.ahrs.get_yaw_rad() == f32(0)
    bench.stream(6, lambda: bench.pose(yaw=1.5))
    assert float(bench.ahrs.get_yaw_rad()) == pytest.approx(1.5)


def test_infinite_attitude_gives_no_yaw(make_bench: MakeBench) -> None:
    bench = make_bench()
    bench.run_to(6)
    infinite = Quaternion(f32(0), f32(math.inf), f32(0), f32(0))
    bench.ahrs.writeExtNavData(Vector3f(), infinite, f32(0.2), f32(0.2), bench.now_ms, 10, 0)
    bench.run_for(0.2)
    assert bench.yaw_resets == []
    assert bench.ahrs.get_yaw_rad() == f32(0)
