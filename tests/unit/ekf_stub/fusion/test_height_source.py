# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which sensor gives the height, and what it says."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from ap_core.fmath import f32
from ap_core.location import Location
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ekf_stub.fusion.height_source import BARO, EXT_NAV, GPS, NO_SOURCE, RANGE, Vehicle
from ekf_stub.fusion.measurements import BaroSample
from ekf_stub.inputs.gps_reading import CENTI
from ekf_stub.inputs.gps_sample import GpsSample

if TYPE_CHECKING:
    from tests.unit.ekf_stub.filter_parts import FilterParts

MakeParts = Callable[..., "FilterParts"]

PARKED = Vehicle(armed=False, on_ground=True, in_flight=False)
FLYING = Vehicle(armed=True, on_ground=False, in_flight=True)
TAKING_OFF = Vehicle(armed=True, on_ground=False, in_flight=False, near_ground=True)
NOW_MS = 50_000
ORIGIN = Location(-353632610, 1491652300, 58400)


def select(parts: "FilterParts", now_ms: int = NOW_MS, *, vehicle: Vehicle = PARKED, baro: float | None = None) -> bool:
    """Make a step, in which the barometer may have a height."""
    parts.ingest.horizon_ms = now_ms
    if baro is not None:
        parts.height.baro.push(BaroSample(now_ms, baro))
    return parts.height.select(now_ms, vehicle)


def write_pose(parts: "FilterParts", stamp_ms: int) -> None:
    parts.ingest.write_pose(Vector3f(), Quaternion(), (f32(0.2), f32(0.2)), stamp_ms, 0, 0)


def measured(parts: "FilterParts") -> tuple[Any, Any] | None:
    """Return height and sigma, if there is another one."""
    return (parts.height.down, parts.height.variance**0.5) if parts.height.is_new else None


def good_gps(parts: "FilterParts", from_ms: int, to_ms: int, **fields: Any) -> None:
    values: dict[str, Any] = {"fix_type": 3, "location": ORIGIN.offset(Vector3f(0, 0, -7)), "num_sats": 10}
    for time_ms in range(from_ms, to_ms + 1, 200):
        sample = GpsSample(time_ms=time_ms, vel_ned=Vector3f(), hdop=100, **{**values, **fields})
        parts.gps.read(sample, time_ms, absolute=True, worst_ratios=(0.0, 0.0))
        parts.gps.push(sample, ORIGIN, CENTI * ORIGIN.alt_cm, time_ms - 400, time_ms)
        parts.gps.recall(time_ms - 206)


# The barometer


def test_barometer_is_the_first_source_and_measures_as_its_heights_come_due(make_parts: MakeParts) -> None:
    parts = make_parts()
    assert parts.height.active == BARO
    assert not select(parts)
    assert measured(parts) is None
    assert not select(parts, NOW_MS + 12, baro=3.0)
    assert measured(parts) == (-3.0, 2.0)
    assert parts.height.baro_height == 3.0


@pytest.mark.parametrize(("noise", "sigma"), [(0.01, 0.1), (5.0, 5.0), (1000.0, 100.0)])
def test_noise_of_the_barometer_has_limits(make_parts: MakeParts, noise: float, sigma: float) -> None:
    parts = make_parts("66166", ALT_M_NSE=noise)
    select(parts, baro=3.0)
    assert measured(parts) == (-3.0, pytest.approx(sigma))


def test_barometer_is_believed_half_as_much_near_the_ground(make_parts: MakeParts) -> None:
    parts = make_parts("66166")
    select(parts, baro=3.0, vehicle=TAKING_OFF)
    assert measured(parts) == (-3.0, 4.0)


# External navigation


@pytest.mark.parametrize(("age_ms", "active"), [(0, EXT_NAV), (499, EXT_NAV), (500, BARO), (-1, BARO)])
def test_poses_are_the_source_while_they_are_fresh(make_parts: MakeParts, age_ms: int, active: str) -> None:
    parts = make_parts()
    write_pose(parts, NOW_MS - age_ms)
    select(parts)
    assert parts.height.active == active


def test_poses_are_not_the_source_before_the_first(make_parts: MakeParts) -> None:
    parts = make_parts()
    select(parts, 300)
    assert parts.height.active == BARO


def test_pose_counts_as_soon_as_it_is_written_but_measures_as_it_comes_due(make_parts: MakeParts) -> None:
    parts = make_parts()
    write_pose(parts, NOW_MS)
    assert not select(parts, baro=3.0)
    assert (parts.height.active, measured(parts)) == (EXT_NAV, None)
    parts.set_pose(0, 0, -5, err=0.2)
    assert select(parts)
    assert measured(parts) == (-5.0, pytest.approx(0.2))


@pytest.mark.parametrize(("err", "sigma"), [(0.01, 0.1), (0.5, 0.5), (50.0, 10.0)])
def test_error_of_a_pose_has_limits(make_parts: MakeParts, err: float, sigma: float) -> None:
    parts = make_parts()
    write_pose(parts, NOW_MS)
    parts.set_pose(0, 0, -5, err=err)
    select(parts)
    assert measured(parts) == (-5.0, pytest.approx(sigma))


@pytest.mark.parametrize("sources", ["66166", "66066"])
def test_poses_of_no_source_measure_nothing(make_parts: MakeParts, sources: str) -> None:
    parts = make_parts(sources)
    write_pose(parts, NOW_MS)
    parts.set_pose(0, 0, -5)
    select(parts)
    assert parts.height.active != EXT_NAV
    assert parts.height.down == 0


def test_any_pose_measures_when_aiding_starts_by_it(make_parts: MakeParts) -> None:
    parts = make_parts("66166")
    parts.set_pose(0, 0, -5, err=0.5)
    parts.height.use_pose()
    assert (parts.height.down, parts.height.variance) == (-5, 0.25)


# Changing over


def test_source_that_changes_is_told_with_its_first_height(make_parts: MakeParts) -> None:
    parts = make_parts()
    parts.set_pose(0, 0, -5)
    for time_ms, changed in ((NOW_MS, True), (NOW_MS + 33, False)):
        write_pose(parts, time_ms)
        assert select(parts, time_ms) is changed
    parts.end_step()
    assert not select(parts, NOW_MS + 600)
    assert parts.height.active == BARO
    assert select(parts, NOW_MS + 612, baro=0.0)
    assert not select(parts, NOW_MS + 712, baro=0.0)


def test_gap_too_short_for_the_barometer_to_measure_changes_nothing(make_parts: MakeParts) -> None:
    parts = make_parts()
    parts.set_pose(0, 0, -5)
    write_pose(parts, NOW_MS)
    assert select(parts)
    parts.end_step()
    select(parts, NOW_MS + 520)
    assert parts.height.active == BARO
    write_pose(parts, NOW_MS + 530)
    parts.set_pose(0, 0, -9)
    assert not select(parts, NOW_MS + 530)


def test_barometer_is_followed_by_a_tenth_a_reading_while_it_is_not_the_source(make_parts: MakeParts) -> None:
    parts = make_parts()
    parts.state.pos = np.array([0.0, 0.0, -4.0])
    for number in range(3):
        write_pose(parts, NOW_MS + 100 * number)
        select(parts, NOW_MS + 100 * number, baro=1.0)
    parts.end_step()
    select(parts, NOW_MS + 1000, baro=1.0)
    offset = -3 * (1 - 0.9**3)
    assert measured(parts) == (pytest.approx(offset - 1), 2.0)


def test_barometer_far_off_is_followed_by_half_a_metre_a_reading(make_parts: MakeParts) -> None:
    parts = make_parts()
    write_pose(parts, NOW_MS)
    select(parts, baro=100.0)
    select(parts, NOW_MS + 1000, baro=100.0)
    assert measured(parts) == (pytest.approx(-99.5), 2.0)


# GPS


def test_gps_is_the_source_while_it_is_accurate_and_fresh(make_parts: MakeParts) -> None:
    parts = make_parts("33331")
    good_gps(parts, 29_000, NOW_MS - 10_000)
    select(parts, NOW_MS - 10_000)
    assert parts.height.active == GPS
    assert measured(parts) == (pytest.approx(-7), pytest.approx(0.75))
    parts.gps.recall(NOW_MS)
    select(parts, NOW_MS - 8000)
    assert parts.height.active == GPS
    select(parts, NOW_MS - 7999)
    assert parts.height.active == BARO


def test_gps_that_is_not_accurate_enough_is_not_the_source(make_parts: MakeParts) -> None:
    parts = make_parts("33331")
    good_gps(parts, 30_000, 50_000, speed_accuracy=3.0)
    select(parts, 50_000)
    assert parts.height.active == BARO


def test_vertical_accuracy_of_the_gps_counts(make_parts: MakeParts) -> None:
    parts = make_parts("33331")
    good_gps(parts, 30_000, 50_000, vertical_accuracy=3.0)
    select(parts, 50_000)
    assert measured(parts) == (pytest.approx(-7), pytest.approx(3))


# None at all


@pytest.mark.parametrize(("age_ms", "is_new"), [(70, False), (71, True)])
def test_without_a_source_height_is_0_now_and_then(make_parts: MakeParts, age_ms: int, is_new: bool) -> None:
    parts = make_parts("66066")
    parts.aiding.times.height = NOW_MS - age_ms
    select(parts, baro=3.0)
    assert parts.height.active == NO_SOURCE
    assert measured(parts) == ((0.0, 2.0) if is_new else None)


def test_without_a_source_the_noise_is_the_barometers_in_flight(make_parts: MakeParts) -> None:
    parts = make_parts("66066", ALT_M_NSE=5.0)
    select(parts)
    assert measured(parts) == (0.0, 2.0)
    select(parts, vehicle=FLYING)
    assert measured(parts) == (0.0, 5.0)


# Losing it


@pytest.mark.parametrize(("has_velocity", "vel_timeout", "after_ms"), [
    (False, False, 5000),
    (True, True, 5000),
    (True, False, 10_000),
])  # fmt: skip
def test_height_is_lost_when_nothing_passes_for_5_s_or_10_s_with_velocity(
    make_parts: MakeParts, has_velocity: bool, vel_timeout: bool, after_ms: int
) -> None:
    parts = make_parts()
    parts.ingest.have_velocity, parts.aiding.vel_timeout = has_velocity, vel_timeout
    parts.aiding.times.height = NOW_MS - after_ms
    parts.height.check_timeout(NOW_MS)
    assert not parts.height.is_lost
    parts.height.check_timeout(NOW_MS + 1)
    assert parts.height.is_lost


# Range finders


def see_range(parts: "FilterParts", distance: float, now_ms: int = NOW_MS) -> None:
    """Let a range come due that was read just now."""
    parts.ranges.is_due, parts.ranges.distance = True, distance
    parts.ranges.valid_ms, parts.ranges.max_distance = now_ms, 40.0
    parts.terrain.valid_ms = now_ms


def test_range_tells_the_height_above_the_ground(make_parts: MakeParts) -> None:
    parts = make_parts("66201")
    parts.terrain.down = 1.0
    parts.turn_to(pitch=0.3)
    see_range(parts, 5.0)
    assert select(parts)
    slope = 5.0 * 0.1 * np.sin(0.3)
    assert measured(parts) == pytest.approx((1.0 - 5.0 * np.cos(0.3), np.hypot(0.5, slope)))


def test_range_is_never_less_than_on_the_ground(make_parts: MakeParts) -> None:
    parts = make_parts("66201")
    see_range(parts, 0.01)
    select(parts)
    assert parts.height.down == -0.05


def test_tilted_vehicle_measures_no_height_by_range(make_parts: MakeParts) -> None:
    parts = make_parts("66201")
    parts.turn_to(roll=0.8)
    see_range(parts, 5.0)
    assert not select(parts)
    assert (parts.height.active, measured(parts)) == (RANGE, None)


def test_barometer_stands_in_for_ranges_that_are_missing(make_parts: MakeParts) -> None:
    parts = make_parts("66201")
    see_range(parts, 5.0)
    select(parts)
    parts.ranges.is_due = False
    select(parts, NOW_MS + 499)
    assert parts.height.active == RANGE
    select(parts, NOW_MS + 500)
    assert parts.height.active == BARO


def near_ground(make_parts: MakeParts, *, up: float = 10.0, speed: float = 0.0) -> "FilterParts":
    parts = make_parts("66101", RNG_USE_HGT=50, RNG_USE_SPD=3)
    parts.state.pos, parts.state.vel = np.array([0.0, 0.0, -up]), np.array([speed, 0.0, 0.0])
    parts.height.velocity_is_valid = True
    see_range(parts, up)
    return parts


@pytest.mark.parametrize(("up", "speed", "source"), [
    (10.0, 0.0, RANGE),
    (13.9, 0.0, RANGE),
    (14.1, 0.0, BARO),
    (10.0, 1.9, RANGE),
    (10.0, 2.1, BARO),
])  # fmt: skip
def test_range_is_taken_near_the_ground_and_slowly(make_parts: MakeParts, up: float, speed: float, source: str) -> None:
    parts = near_ground(make_parts, up=up, speed=speed)
    select(parts)
    assert parts.height.active == source


@pytest.mark.parametrize(("up", "speed", "stable", "source"), [
    (19.9, 0.0, True, RANGE),
    (20.1, 0.0, True, BARO),
    (10.0, 2.9, True, RANGE),
    (10.0, 3.1, True, BARO),
    (10.0, 0.0, False, BARO),
])  # fmt: skip
def test_range_is_kept_until_high_or_fast_or_over_uneven_ground(
    make_parts: MakeParts, up: float, speed: float, stable: bool, source: str
) -> None:
    parts = near_ground(make_parts)
    select(parts)
    parts.state.pos, parts.state.vel = np.array([0.0, 0.0, -up]), np.array([speed, 0.0, 0.0])
    parts.height.terrain_is_stable = stable
    select(parts)
    assert parts.height.active == source


def test_speed_that_is_not_known_does_not_count(make_parts: MakeParts) -> None:
    parts = near_ground(make_parts, speed=9.0)
    parts.height.velocity_is_valid = False
    select(parts)
    assert parts.height.active == RANGE


def test_range_is_not_taken_without_the_height_above_ground_or_tilted(make_parts: MakeParts) -> None:
    lost, tilted, unstable = near_ground(make_parts), near_ground(make_parts), near_ground(make_parts)
    lost.terrain.valid_ms = NOW_MS - 1000
    tilted.turn_to(roll=0.8)
    unstable.height.terrain_is_stable = False
    for parts in (lost, tilted, unstable):
        select(parts)
        assert parts.height.active == BARO
