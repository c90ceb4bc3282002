# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a parked vehicle believes to be: by GPS, by its origin, by what others tell it."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import pytest

from ap_core.fmath import f32
from ap_core.location import Location
from ap_core.vector3 import Vector3f
from viso.vehicle.sensors.errors import SensorErrors

if TYPE_CHECKING:
    from tests.unit.ekf_stub.bench_rig import BenchRig

MakeBench = Callable[..., "BenchRig"]


# By GPS


def by_gps(make_bench: MakeBench, sources: str = "33131", **params: float) -> "BenchRig":
    """Return a bench that has just begun to navigate by GPS; it knows its gyros earlier than others."""
    bench = make_bench(sources, has_compass=True, **params)
    bench.run_to(7)
    bench.know_gyros()
    bench.stream_gps(20)
    return bench


@pytest.mark.slow
def test_gps_sets_the_origin_once_it_has_passed_for_10_s(make_bench: MakeBench) -> None:
    bench = make_bench("33131", has_compass=True)
    bench.run_to(7)
    bench.stream_gps(17.1)
    assert bench.ahrs.origin() is None
    bench.stream_gps(17.9)
    assert bench.ahrs.origin() == bench.place
    assert bench.said(since_s=7) == ["EKF3 IMU0 origin set", "EKF3 IMU1 origin set"]
    assert bench.flags == 167


@pytest.mark.slow
def test_gps_starts_aiding_once_gyros_are_known_too(make_bench: MakeBench) -> None:
    bench = make_bench("33131", has_compass=True)
    bench.run_to(25)
    bench.stream_gps(41.1)
    assert "EKF3 IMU0 is using GPS" not in bench.said()
    bench.stream_gps(42)
    assert bench.when("is using GPS") == pytest.approx(41_500, abs=250)
    assert bench.flags == 831


@pytest.mark.slow
def test_gps_starts_aiding_and_gives_position_but_not_height(make_bench: MakeBench) -> None:
    bench = by_gps(make_bench)
    assert [text for text in bench.said(since_s=7) if "IMU0" in text] == [
        "EKF3 IMU0 origin set",
        "EKF3 IMU0 is using GPS",
    ]
    assert bench.flags == 831
    bench.stream_gps(26, bench.place.offset(Vector3f(1, 0.5, -5)))
    assert bench.position == pytest.approx((1, 0.5, 0), abs=0.2)


@pytest.mark.slow
def test_gps_that_jumps_is_rejected(make_bench: MakeBench) -> None:
    bench = by_gps(make_bench)
    bench.stream_gps(22, bench.place.offset(Vector3f(30, 0, 0)))
    assert bench.report.pos_ratio > 1
    assert bench.position == pytest.approx((0, 0, 0), abs=0.2)


@pytest.mark.slow
def test_gps_height_is_used_by_its_source(make_bench: MakeBench) -> None:
    bench = make_bench("30301", has_compass=True)
    bench.run_to(7)
    assert bench.flags == 135
    bench.know_gyros()
    bench.stream_gps(20)
    bench.stream_gps(32, bench.place.offset(Vector3f(0, 0, -3)))
    assert bench.position == pytest.approx((0, 0, -3), abs=0.3)
    assert bench.flags == 831


@pytest.mark.slow
def test_origin_that_was_set_stays_when_gps_comes(make_bench: MakeBench) -> None:
    bench = make_bench("30101", has_compass=True)
    bench.run_to(7)
    assert bench.ahrs.set_origin(Location(1, 2, 3))
    bench.stream_gps(19)
    assert bench.ahrs.origin() == Location(1, 2, 3)


@pytest.mark.slow
def test_switch_to_external_navigation_and_back_moves_at_once_and_hardly_says_so(make_bench: MakeBench) -> None:
    bench = by_gps(make_bench, "30101", EK3_SRC2_POSXY=6, EK3_SRC2_POSZ=6, EK3_SRC2_YAW=6)
    bench.is_logged = True
    bench.sources.active_set = 1
    bench.stream(22, lambda: bench.pose(5, -3, -2, yaw=0.5), bench.fix)
    assert bench.said(since_s=20) == ["EKF3 IMU0 yaw aligned", "EKF3 IMU1 yaw aligned"]
    assert bench.report.source_set == 1
    assert bench.report.moved_ne == pytest.approx((5, -3), abs=0.1)
    assert bench.position == pytest.approx((5, -3, -2), abs=0.1)
    assert bench.flags == 831
    bench.stream(24, lambda: bench.pose(5, -3, -2, yaw=0.5), bench.fix)
    height = bench.report.pos_ned[2]
    bench.sources.active_set = 0
    bench.stream_gps(24.5)
    assert bench.said(since_s=22) == []
    assert bench.report.source_set == 0
    assert bench.report.moved_ne == pytest.approx((-5, 3), abs=0.1)
    assert bench.position == pytest.approx((0, 0, height), abs=0.3)
    assert [values for name, values in bench.records if name == "REV3"] == [(14,), (13,)]


# By its origin


def test_origin_is_set_once_and_not_before_the_filter(make_bench: MakeBench) -> None:
    bench = make_bench()
    bench.run_to(3)
    assert not bench.ahrs.set_origin(bench.place)
    bench.run_to(6)
    assert bench.ahrs.set_origin(bench.place)
    assert not bench.ahrs.set_origin(Location(1, 2, 3))
    assert bench.ahrs.origin() == bench.place
    assert bench.said(since_s=6) == ["EKF3 IMU0 origin set", "EKF3 IMU1 origin set"]
    assert bench.report.origin_alt_cm == 58400


def test_origin_leaves_the_state_as_it_was(make_bench: MakeBench) -> None:
    bench = make_bench(run_s=6)
    bench.stream(7, lambda: bench.pose(10, 0, -2))
    before = bench.position
    bench.ahrs.set_origin(bench.place)
    assert bench.position == before


def test_place_needs_an_origin_or_gps(make_bench: MakeBench) -> None:
    bench = make_bench(run_s=6)
    bench.stream(7, lambda: bench.pose(10, 0, -2))
    assert bench.ahrs.get_location() is None
    bench.ahrs.set_origin(bench.place)
    place = bench.ahrs.get_location()
    assert place is not None
    assert bench.place.distance_ned(place).to_tuple() == pytest.approx((10, 0, -2), abs=0.05)


@pytest.mark.slow
def test_place_is_lost_with_the_position(make_bench: MakeBench) -> None:
    bench = make_bench(run_s=6)
    bench.ahrs.set_origin(bench.place)
    assert bench.ahrs.get_location() is None
    bench.stream(7, bench.pose)
    bench.run_to(15)
    assert bench.ahrs.get_location() is None
    assert bench.position is not None


@pytest.mark.parametrize(("fix_type", "known"), [(2, False), (3, True)])
def test_place_of_the_gps_serves_without_aiding(make_bench: MakeBench, fix_type: int, known: bool) -> None:
    bench = make_bench(run_s=6)
    bench.fix(fix_type=fix_type)
    assert (bench.ahrs.get_location() == bench.place) is known


# What others may tell it


def lost_bench(make_bench: MakeBench) -> "BenchRig":
    bench = make_bench(run_s=6)
    bench.ahrs.set_origin(bench.place)
    bench.stream(7, bench.pose)
    return bench


def estimate(bench: "BenchRig") -> bool:
    place = bench.place.offset(Vector3f(50, 0, 0))
    return bench.ahrs.handle_external_position_estimate(place, f32(1), bench.now_ms)


def test_place_from_elsewhere_is_taken_while_aiding_lacks_a_position(make_bench: MakeBench) -> None:
    bench = lost_bench(make_bench)
    bench.run_to(9)
    assert estimate(bench)
    assert bench.position == pytest.approx((50, 0, 0), abs=0.1)


def test_place_from_elsewhere_is_refused_while_there_is_a_position(make_bench: MakeBench) -> None:
    assert not estimate(lost_bench(make_bench))


@pytest.mark.slow
def test_place_from_elsewhere_is_refused_without_aiding(make_bench: MakeBench) -> None:
    bench = lost_bench(make_bench)
    bench.run_to(24)
    assert not estimate(bench)


def test_place_from_elsewhere_is_refused_without_an_origin(make_bench: MakeBench) -> None:
    bench = make_bench(run_s=6)
    bench.stream(7, bench.pose)
    bench.run_to(9)
    assert not estimate(bench)


def test_place_from_elsewhere_is_refused_before_the_filter(make_bench: MakeBench) -> None:
    bench = make_bench()
    bench.run_to(3)
    assert not estimate(bench)


@pytest.mark.slow
def test_height_counts_from_the_ground_when_asked_to_and_the_height_above_the_sea_stays(make_bench: MakeBench) -> None:
    bench = make_bench("60106", errors=SensorErrors(baro_bias_m=5))
    bench.run_to(6)
    bench.ahrs.set_origin(bench.place)
    bench.stream(11, lambda: bench.pose(0, 0, -5))
    place = bench.ahrs.get_location()
    assert place is not None
    assert place.alt_cm == pytest.approx(bench.place.alt_cm + 500, abs=10)
    assert bench.ahrs.reset_height_datum()
    assert bench.core.state.pos[2] == 0
    assert bench.report.origin_alt_cm == pytest.approx(58900, abs=10)
    bench.stream(22, lambda: bench.pose(0, 0, -5))
    assert bench.core.state.pos[2] == pytest.approx(0, abs=0.1)
    again = bench.ahrs.get_location()
    assert again is not None
    assert again.alt_cm == pytest.approx(place.alt_cm, abs=10)


@pytest.mark.parametrize(("recorded", "down_m"), [(False, 0.0), (True, -5.0)])
def test_recorded_heights_are_not_set_to_zero_again(make_bench: MakeBench, recorded: bool, down_m: float) -> None:
    bench = make_bench("60106", errors=SensorErrors(baro_bias_m=5))
    assert bench.ahrs.source is not None
    bench.ahrs.source.has_recorded_heights = recorded
    bench.run_to(6)
    assert bench.ahrs.reset_height_datum()
    bench.run_to(7)
    assert bench.core.height.baro_height == pytest.approx(-down_m, abs=0.3)


def test_height_is_not_begun_anew_while_armed_or_before_the_filter(make_bench: MakeBench) -> None:
    bench = make_bench()
    bench.run_to(3)
    assert not bench.ahrs.reset_height_datum()
    bench.run_to(6)
    bench.state.armed = True
    bench.run_for(0.01)
    assert not bench.ahrs.reset_height_datum()
