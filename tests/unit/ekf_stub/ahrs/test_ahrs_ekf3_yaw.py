# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the yaw of a parked vehicle comes from: camera, compass or GPS."""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import pytest

from ap_core.fmath import f32
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f

if TYPE_CHECKING:
    from tests.unit.ekf_stub.bench_rig import BenchRig

MakeBench = Callable[..., "BenchRig"]


def yaw_of(bench: "BenchRig") -> float:
    return float(bench.ahrs.get_yaw_rad())


def test_yaw_follows_external_navigation_once_it_is_the_source(make_bench: MakeBench) -> None:
    bench = make_bench(run_s=6)
    bench.stream(7, lambda: bench.pose(yaw=1.5))
    assert yaw_of(bench) == pytest.approx(1.5, abs=0.01)
    quat = bench.ahrs.get_quaternion()
    assert quat is not None
    assert float(quat.get_euler_yaw()) == pytest.approx(1.5, abs=0.01)


def test_yaw_is_the_compass_heading_when_external_navigation_is_not_its_source(make_bench: MakeBench) -> None:
    bench = make_bench("66661", has_compass=True, heading_deg=30)
    bench.run_to(6)
    bench.stream(7, lambda: bench.pose(yaw=1.5))
    assert yaw_of(bench) == pytest.approx(math.radians(30), abs=0.01)
    assert bench.ahrs.ext_nav_counts["yaw", "model_unused"] > 20


def test_another_yaw_source_aligns_anew(make_bench: MakeBench) -> None:
    bench = make_bench("66661", has_compass=True)
    bench.use_sources("66666", 2)
    bench.run_to(6)
    bench.stream(7, lambda: bench.pose(yaw=1.5))
    bench.sources.active_set = 1
    bench.stream(8, lambda: bench.pose(yaw=1.5))
    assert bench.said(since_s=7) == ["EKF3 IMU0 yaw aligned", "EKF3 IMU1 yaw aligned"]
    assert len(bench.yaw_resets) == 2
    assert yaw_of(bench) == pytest.approx(1.5, abs=0.01)


def test_gps_may_give_the_yaw(make_bench: MakeBench) -> None:
    bench = make_bench("00102")
    bench.run_to(6)
    assert bench.ahrs.set_origin(bench.place)
    bench.stream_gps(6.8, yaw_deg=270.0)
    assert bench.said(since_s=6) == [
        *(f"EKF3 IMU{core} {text}" for text in ("origin set", "yaw aligned") for core in (0, 1)),
    ]
    assert math.degrees(yaw_of(bench)) == pytest.approx(-90, abs=0.5)


@pytest.mark.parametrize(("sources", "using"), [("66666", True), pytest.param("66661", False, marks=pytest.mark.slow)])
def test_yaw_without_data_counts_as_external_by_its_source(make_bench: MakeBench, sources: str, using: bool) -> None:
    bench = make_bench(sources)
    bench.run_to(12)
    assert bench.ahrs.using_extnav_for_yaw() is using


def test_yaw_does_not_count_as_external_before_the_estimator_starts(make_bench: MakeBench) -> None:
    bench = make_bench()
    bench.run_to(3.45)
    assert not bench.ahrs.using_extnav_for_yaw()
    bench.run_to(3.46)
    assert bench.ahrs.using_extnav_for_yaw()


def test_yaw_counts_as_external_for_5_s_after_its_last_sample(make_bench: MakeBench) -> None:
    bench = make_bench(run_s=6)
    bench.stream(8, bench.pose)
    bench.run_to(12.9)
    assert bench.ahrs.using_extnav_for_yaw()
    bench.run_to(13.1)
    assert not bench.ahrs.using_extnav_for_yaw()


def test_pose_without_a_yaw_does_not_align(make_bench: MakeBench) -> None:
    bench = make_bench(run_s=6)
    bench.stream(7, lambda: bench.pose(yaw=math.nan))
    assert "EKF3 IMU0 yaw aligned" not in bench.said()
    assert "EKF3 IMU0 is using external nav data" in bench.said()


def test_navigating_without_an_aligned_yaw_has_no_flags(make_bench: MakeBench) -> None:
    bench = make_bench(run_s=6)
    bench.stream(7, lambda: bench.pose(yaw=math.nan))
    assert bench.flags == 0


def test_yaw_waits_for_tilt(make_bench: MakeBench) -> None:
    bench = make_bench()
    bench.run_to(4.5)
    bench.stream(4.7, lambda: bench.pose(yaw=1.5))
    assert yaw_of(bench) == pytest.approx(0, abs=0.01)
    assert bench.ahrs.ext_nav_counts["yaw", "model_unused"] > 1
    bench.stream(6, lambda: bench.pose(yaw=1.5))
    assert 0 < bench.when("yaw aligned") - bench.when("tilt alignment complete") < 50
    assert yaw_of(bench) == pytest.approx(1.5, abs=0.01)


def test_infinite_attitude_gives_no_yaw(make_bench: MakeBench) -> None:
    bench = make_bench(run_s=6)
    infinite = Quaternion(f32(0), f32(math.inf), f32(0), f32(0))
    bench.ahrs.writeExtNavData(Vector3f(), infinite, f32(0.2), f32(0.2), bench.now_ms, 10, 0)
    bench.run_for(0.2)
    assert bench.yaw_resets == []
    assert yaw_of(bench) == pytest.approx(0, abs=0.01)
