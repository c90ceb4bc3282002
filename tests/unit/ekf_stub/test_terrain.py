# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Ranges as they are read, and the height of the ground: by range, by flow, and what is known of it meanwhile."""

import itertools
import math

import pytest

from tests.unit.ekf_stub.filter_rig import HOME, SLOW_LOOP_US, FilterRig, by_gps, navigating, standing


def see(rig: FilterRig, *distances: float) -> None:
    """Let a range finder see something every 60 ms."""
    for distance in distances:
        rig.see_range(distance)
        rig.run(0.06)


def up() -> FilterRig:
    """Return a vehicle that is armed, so that nothing is assumed of its ranges."""
    rig = navigating("66106", loop_us=SLOW_LOOP_US)
    rig.arm()
    return rig


# Ranges as they are read


@pytest.mark.parametrize(("distances", "median"), [
    ((3.0, 9.0, 4.0), 4.0),
    ((3.0, 5.0, 9.0), 5.0),
    ((9.0, 3.0, 5.0), 5.0),
    ((5.0, 5.0, 5.0), 5.0),
    ((0.01, 0.02, 0.03), 0.1),
])  # fmt: skip
def test_median_of_three_counts(distances: tuple[float, ...], median: float) -> None:
    rig = up()
    see(rig, *distances)
    assert rig.core.ranges.newest == median


def test_two_samples_are_too_few_and_old_ones_do_not_count() -> None:
    rig = up()
    see(rig, 3.0, 3.0)
    rig.core.inputs.set_ranges(None)
    rig.skip(0.5)
    see(rig, 3.0)
    assert rig.core.ranges.newest == 0.0
    assert not rig.core.ranges.is_fresh(rig.now_ms)


def test_no_more_than_twenty_a_second_are_read() -> None:
    # GIVEN a range finder that is read in every step of 12.5 ms
    rig = navigating("66106")
    rig.arm()
    rig.see_range(3.0)
    rig.run(0.11)
    assert rig.core.ranges.newest == 0.0  # two of them
    rig.run(0.08)
    assert rig.core.ranges.newest == 3.0


def test_on_the_ground_the_height_of_the_sensor_stands_in_for_what_is_missing() -> None:
    rig = navigating("66106", loop_us=SLOW_LOOP_US)
    rig.see_range(3.0)
    rig.run(0.02)
    assert rig.core.ranges.newest == rig.core.ranges.on_ground == 0.1
    assert rig.core.ranges.is_fresh(rig.now_ms)


def test_range_is_moved_to_the_imu() -> None:
    rig = FilterRig("66106", loop_us=SLOW_LOOP_US)
    rig.pitch = 0.1
    rig.arm()
    rig.run(3.0)
    for _ in range(6):
        rig.see_range(3.0, place=(0.5, 0.0, 0.2))
        rig.run(0.06)
    assert rig.core.ranges.distance == pytest.approx(3.0 + 0.2 - 0.5 * math.tan(0.1), abs=1e-3)  # tilt of 0.01 deg


def test_filter_that_begins_anew_forgets_ranges() -> None:
    rig = standing("06166", loop_us=SLOW_LOOP_US)
    rig.ground = 3.0
    rig.feeds.add("ranges")
    while "forced reset" not in rig.texts:
        rig.velocity(1.5)
        rig.run(0.04)
        if not rig.core.flags:
            rig.feeds.discard("ranges")
            rig.core.inputs.set_ranges(None)
    assert rig.core.ranges.newest == 0.0
    assert not rig.core.ranges.is_due


# The ground


def test_ground_is_below_the_vehicle_as_it_stands() -> None:
    # GIVEN a vehicle that sinks below where it was, as its camera says
    rig = navigating("66666", loop_us=SLOW_LOOP_US)
    rig.camera_shift, rig.reset_ms = (0.0, 0.0, 2.0), 1
    rig.run(0.5)
    assert rig.core.height.terrain.above == pytest.approx(0.05, abs=1e-3)
    # AND it stays there as the vehicle rises again
    rig.camera_shift, rig.reset_ms = (0.0, 0.0, -3.0), 2
    rig.run(0.5)
    assert rig.core.height.terrain.above == pytest.approx(5.05, abs=0.02)


def ground_seen(distance: float = 4.0, **params: float) -> FilterRig:
    """Return a vehicle that has seen the ground for a second."""
    rig = up()
    for name, value in params.items():
        rig.set_param(name, value)
    rig.ground = distance
    rig.feeds.add("ranges")
    rig.run(1.0)
    return rig


def test_first_range_tells_the_ground_and_later_ones_correct_it() -> None:
    rig = ground_seen()
    assert rig.core.height.terrain.down == pytest.approx(4.0, abs=0.01)
    sigma = rig.core.height.terrain.sigma
    rig.ground = 4.5
    rig.run(0.4)
    assert 4.02 < rig.core.height.terrain.down < 4.5
    rig.run(3.0)
    assert rig.core.height.terrain.down == pytest.approx(4.5, abs=0.1)
    assert rig.core.height.terrain.sigma < sigma


def test_range_beyond_its_gate_is_rejected_until_the_ground_is_lost() -> None:
    rig = ground_seen()
    rig.ground = 14.0
    rig.run(4.5)
    assert rig.core.height.terrain.range_ratio > 1
    assert rig.core.height.terrain.down == pytest.approx(4.0, abs=0.1)
    rig.run(1.2)
    assert rig.core.height.terrain.down == pytest.approx(14.0, abs=0.1)


def test_tilt_shortens_the_height() -> None:
    rig = FilterRig("66106", loop_us=SLOW_LOOP_US)
    rig.roll, rig.ground = 0.3, 4.0
    rig.feeds |= {"camera", "ranges"}
    rig.arm()
    rig.run(6.0)
    assert rig.core.ranges.distance == pytest.approx(4.0 / math.cos(0.3))
    assert rig.core.height.terrain.above == pytest.approx(4.0, abs=0.05)


def test_way_over_the_ground_makes_it_uncertain() -> None:
    still, moving = ground_seen(TERR_GRAD=0.2), ground_seen(TERR_GRAD=0.2)
    moving.feeds.add("velocity")
    moving.move(3.0, 4.0, 0.0, 1.0)
    moving.run(2.0)
    still.run(3.0)
    assert moving.core.height.terrain.sigma > 1.4 * still.core.height.terrain.sigma


def test_way_counts_from_the_origin_that_moves_along() -> None:
    """Once a second the way since the last estimate is that from there to where the origin was, see the firmware."""
    rig = ground_seen(TERR_GRAD=0.2)
    rig.lanes.set_origin(HOME)
    rig.feeds.add("velocity")
    rig.move(5.0, 0.0, 0.0, 1.0)
    sigmas = []
    for _ in range(100):
        rig.run(0.02)
        sigmas.append(rig.core.height.terrain.sigma)
    jumps = [after - before for before, after in itertools.pairwise(sigmas)]
    assert max(jumps) > 10 * sorted(jumps)[-5]


def test_ground_as_datum_is_not_estimated() -> None:
    rig = FilterRig("66206", loop_us=SLOW_LOOP_US)
    rig.feeds |= {"camera", "ranges"}
    rig.run(4.0)
    down = rig.core.height.terrain.down
    rig.ground = 0.6
    rig.run(2.0)
    assert rig.core.height.terrain.down == down
    assert rig.core.flow.ground_is_valid


# By flow


@pytest.mark.parametrize(("speed", "use", "tells"), [(8.0, 2, True), (4.0, 2, False), (8.0, 1, False)])
def test_flow_at_speed_tells_the_ground(speed: float, use: int, tells: bool) -> None:
    # GIVEN a vehicle that flies by GPS 8 m above where it stood, over ground that is 2 m deeper there
    rig = by_gps(FLOW_USE=2)
    rig.arm()
    rig.climb(8.0, 4.0)
    rig.set_param("FLOW_USE", use)
    rig.move(speed / 2, 0.0, 0.0, 2.0)
    rig.run(1.0)
    before = rig.core.height.terrain.down
    rig.ground = 2.1
    # WHEN it sees flow
    rig.feeds.add("flow")
    rig.run(3.0)
    # THEN it knows how deep the ground is, if it is fast and flow is for that
    assert (rig.core.height.terrain.down > before + 0.5) is tells
    assert (rig.core.height.terrain.flow_innovation != (0.0, 0.0)) is tells
