# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the bench's vehicle believes to be: by GPS, by its origin, by what others tell it."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import pytest

from ap_core.fmath import f32
from ap_core.location import Location
from ap_core.vector3 import Vector3f

if TYPE_CHECKING:
    from tests.unit.ekf_stub.conftest import BenchRig

MakeBench = Callable[..., "BenchRig"]
HOME = Location(-353632610, 1491652300, 58400)


def xyz(vector: Vector3f | None) -> tuple[float, ...] | None:
    return None if vector is None else tuple(float(value) for value in vector.to_tuple())


def stream_gps(bench: "BenchRig", until_s: float, place: Location = HOME, **fields: Any) -> None:
    bench.stream(until_s, lambda: bench.fix(place, **fields), period_s=0.2)


def test_gps_sets_the_origin_and_starts_aiding(make_bench: MakeBench) -> None:
    bench = make_bench("33131", has_compass=True)
    bench.run_to(10)
    stream_gps(bench, 19.9)
    assert bench.ahrs.origin() is None
    stream_gps(bench, 47)
    assert bench.ahrs.origin() == HOME
    assert next(time for time, _, text in bench.texts if "GPS" in text) == pytest.approx(44_955, abs=300)
    assert bench.flags == 831
    stream_gps(bench, 48, HOME.offset(Vector3f(10, 20, -5)), vel_ned=Vector3f(1, 2, 3))
    assert xyz(bench.ahrs.get_relative_position_NED_origin_float()) == pytest.approx((10, 20, 0), abs=0.1)
    assert xyz(bench.ahrs.get_velocity_NED()) == (1, 2, 3)


def test_gps_height_is_used_by_its_source(make_bench: MakeBench) -> None:
    bench = make_bench("30301", has_compass=True)
    bench.run_to(10)
    assert bench.flags == 135
    stream_gps(bench, 47)
    stream_gps(bench, 48, HOME.offset(Vector3f(0, 0, -5)), vel_ned=Vector3f(1, 0, 0))
    assert xyz(bench.ahrs.get_relative_position_NED_origin_float()) == (0, 0, -5)
    assert xyz(bench.ahrs.get_velocity_NED()) == (0, 0, 0)


def test_origin_that_was_set_stays_when_gps_comes(make_bench: MakeBench) -> None:
    bench = make_bench("30101", has_compass=True)
    bench.run_to(10)
    assert bench.ahrs.set_origin(Location(1, 2, 3))
    stream_gps(bench, 22)
    assert bench.ahrs.origin() == Location(1, 2, 3)


def test_place_needs_an_origin_or_gps(make_bench: MakeBench) -> None:
    bench = make_bench()
    bench.run_to(6)
    bench.stream(7, lambda: bench.pose(10, 0, -2))
    assert bench.ahrs.get_location() is None
    bench.ahrs.set_origin(HOME)
    assert bench.ahrs.get_location() == HOME.offset(Vector3f(10, 0, -2))


def test_place_is_lost_with_the_position(make_bench: MakeBench) -> None:
    bench = make_bench()
    bench.run_to(6)
    bench.ahrs.set_origin(HOME)
    assert bench.ahrs.get_location() is None
    bench.stream(7, bench.pose)
    bench.run_to(15)
    assert bench.ahrs.get_location() is None
    assert bench.ahrs.get_relative_position_NED_origin_float() is not None


@pytest.mark.parametrize(("fix_type", "known"), [(2, False), (3, True)])
def test_place_of_the_gps_serves_without_aiding(make_bench: MakeBench, fix_type: int, known: bool) -> None:
    bench = make_bench()
    bench.run_to(6)
    bench.fix(fix_type=fix_type)
    assert (bench.ahrs.get_location() == HOME) is known


# What others may tell it


def lost_bench(make_bench: MakeBench) -> "BenchRig":
    bench = make_bench()
    bench.run_to(6)
    bench.ahrs.set_origin(HOME)
    bench.stream(7, bench.pose)
    return bench


def estimate(bench: "BenchRig") -> bool:
    place = HOME.offset(Vector3f(50, 0, 0))
    return bench.ahrs.handle_external_position_estimate(place, f32(1), bench.now_ms)


def test_place_from_elsewhere_is_taken_while_aiding_lacks_a_position(make_bench: MakeBench) -> None:
    bench = lost_bench(make_bench)
    bench.run_to(9)
    assert estimate(bench)
    assert xyz(bench.ahrs.get_relative_position_NED_origin_float()) == pytest.approx((50, 0, 0), abs=0.02)


def test_place_from_elsewhere_is_refused_while_there_is_a_position(make_bench: MakeBench) -> None:
    assert not estimate(lost_bench(make_bench))


def test_place_from_elsewhere_is_refused_without_aiding(make_bench: MakeBench) -> None:
    bench = lost_bench(make_bench)
    bench.run_to(30)
    assert not estimate(bench)


def test_place_from_elsewhere_is_refused_without_an_origin(make_bench: MakeBench) -> None:
    bench = make_bench()
    bench.run_to(6)
    bench.stream(7, bench.pose)
    bench.run_to(9)
    assert not estimate(bench)


def test_height_counts_from_the_ground_when_asked_to(make_bench: MakeBench) -> None:
    bench = lost_bench(make_bench)
    bench.stream(8, lambda: bench.pose(1, 2, -5))
    assert bench.ahrs.reset_height_datum()
    assert xyz(bench.ahrs.get_relative_position_NED_origin_float()) == (1, 2, 0)
    bench.armed = True
    assert not bench.ahrs.reset_height_datum()
