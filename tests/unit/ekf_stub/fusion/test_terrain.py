# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The height of the ground: by range, by flow, and what is known of it meanwhile."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import pytest

from ekf_stub.fusion.aiding import AidingMode
from ekf_stub.inputs.flow_ingest import FlowSample

if TYPE_CHECKING:
    from tests.unit.ekf_stub.filter_parts import FilterParts

MakeParts = Callable[..., "FilterParts"]

NOW_MS = 50_000
NO_FLOW = FlowSample(0, (0.0, 0.0), (0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


def flying(make_parts: MakeParts, *, up: float = 4.0, north: float = 0.0, **params: float) -> "FilterParts":
    parts = make_parts("33130", **params)
    parts.state.pos = np.array([0.0, 0.0, -up])
    parts.state.vel = np.array([north, 0.0, 0.0])
    return parts


def see_range(parts: "FilterParts", distance: float, now_ms: int = NOW_MS, *, is_datum: bool = False) -> None:
    parts.ranges.is_due, parts.ranges.distance = True, distance
    parts.terrain.estimate(now_ms, NO_FLOW, is_datum=is_datum)
    parts.ranges.is_due = False


def test_ground_is_below_the_vehicle_as_it_stands(make_parts: MakeParts) -> None:
    parts = make_parts()
    parts.state.pos = np.array([0.0, 0.0, 2.0])
    parts.terrain.constrain()
    assert parts.terrain.down == pytest.approx(2.05)
    parts.state.pos = np.array([0.0, 0.0, -3.0])
    parts.terrain.constrain()
    assert parts.terrain.above == pytest.approx(5.05)


@pytest.mark.parametrize(("on_ground", "down"), [(True, -2.95), (False, 0.0)])
def test_reset_of_height_brings_the_ground_along_on_the_ground_alone(
    make_parts: MakeParts, on_ground: bool, down: float
) -> None:
    parts = flying(make_parts, up=3.0)
    parts.terrain.follow_height(on_ground=on_ground)
    assert parts.terrain.down == pytest.approx(down)


def test_first_range_tells_the_ground_and_later_ones_correct_it(make_parts: MakeParts) -> None:
    parts = flying(make_parts)
    see_range(parts, 5.0)
    assert parts.terrain.down == pytest.approx(1.0)
    assert parts.terrain.valid_ms == NOW_MS
    variance = parts.terrain.variance
    see_range(parts, 5.5, NOW_MS + 100)
    grown = variance + 0.1**2 * parts.state.cov[6, 6]
    gain = grown / (0.5 + grown)
    assert parts.terrain.range_innovation == pytest.approx(-0.5)
    assert parts.terrain.down == pytest.approx(1.0 + 0.5 * gain)
    assert parts.terrain.variance == pytest.approx(grown * (1 - gain))


def test_range_beyond_its_gate_is_rejected_until_the_ground_is_lost(make_parts: MakeParts) -> None:
    parts = flying(make_parts)
    see_range(parts, 4.0)
    see_range(parts, 14.0, NOW_MS + 100)
    assert parts.terrain.range_ratio > 1
    assert parts.terrain.down == pytest.approx(0.0)
    assert parts.terrain.valid_ms == NOW_MS
    see_range(parts, 14.0, NOW_MS + 5001)
    assert parts.terrain.down == pytest.approx(10.0)


def test_tilt_shortens_the_height(make_parts: MakeParts) -> None:
    parts = flying(make_parts)
    parts.turn_to(roll=0.3)
    see_range(parts, 4.0 / np.cos(0.3))
    assert parts.terrain.down == pytest.approx(0.0, abs=1e-9)


def test_way_over_the_ground_makes_it_uncertain(make_parts: MakeParts) -> None:
    parts = flying(make_parts, TERR_GRAD=0.2)
    see_range(parts, 4.0)
    variance = parts.terrain.variance
    parts.state.pos = np.array([3.0, 4.0, -4.0])
    see_range(parts, 40.0, NOW_MS)
    assert parts.terrain.variance == pytest.approx(variance + (5 * 0.2) ** 2)


def test_way_counts_from_the_moved_origin(make_parts: MakeParts) -> None:
    parts = flying(make_parts, TERR_GRAD=0.2)
    parts.state.pos = np.array([3.0, 4.0, -4.0])
    see_range(parts, 4.0)
    variance = parts.terrain.variance
    parts.terrain.move_origin()
    see_range(parts, 40.0, NOW_MS)
    assert parts.terrain.variance == pytest.approx(variance + (5 * 0.2) ** 2)


def test_ground_as_datum_is_not_estimated_nor_kept_below(make_parts: MakeParts) -> None:
    parts = flying(make_parts)
    see_range(parts, 9.0, is_datum=True)
    parts.state.pos = np.array([0.0, 0.0, 1.0])
    parts.terrain.constrain()
    assert parts.terrain.down == 0.0


# By flow


def see_flow(parts: "FilterParts", x: float, y: float) -> None:
    flow = NO_FLOW._replace(flow=(x, y), flow_comp=(x, y))
    parts.terrain.estimate(NOW_MS, flow, is_datum=False)


def with_gps(make_parts: MakeParts, *, north: float = 8.0, **params: float) -> "FilterParts":
    parts = flying(make_parts, up=8.0, north=north, **{"FLOW_USE": 2, **params})
    parts.gps.is_in_use = True
    parts.aiding.mode = AidingMode.ABSOLUTE
    return parts


def test_flow_at_speed_tells_the_ground(make_parts: MakeParts) -> None:
    parts = with_gps(make_parts)
    see_flow(parts, 0.0, -8.0 / 10.0)
    slope = 8.0 / 8.0**2
    grown = 0.25 + parts.state.cov[6, 6]
    gain = grown * slope / (slope * grown * slope + 0.25**2)
    assert parts.terrain.flow_innovation == pytest.approx((0.0, -0.2))
    assert parts.terrain.down == pytest.approx(0.2 * gain)
    assert parts.terrain.variance == pytest.approx(grown * (1 - gain * slope))
    assert parts.terrain.valid_ms == NOW_MS


def test_flow_to_the_side_tells_it_but_not_that_it_is_known(make_parts: MakeParts) -> None:
    parts = with_gps(make_parts, north=0.0)
    parts.state.vel = np.array([0.0, 8.0, 0.0])
    parts.terrain.valid_ms = 1
    see_flow(parts, 8.0 / 10.0, 1.0)  # the other axis fails its gate
    assert parts.terrain.down > 0.1
    assert parts.terrain.valid_ms == 1


def test_flow_that_does_not_show_the_height_says_nothing(make_parts: MakeParts) -> None:
    slow, fast_flow, not_for_that = (
        with_gps(make_parts, north=4.9),
        with_gps(make_parts),
        with_gps(make_parts, FLOW_USE=1),
    )
    no_gps, relative = with_gps(make_parts), with_gps(make_parts)
    no_gps.gps.is_in_use = False
    relative.aiding.mode = AidingMode.RELATIVE
    see_flow(fast_flow, 2.6, -0.8)
    for parts in (slow, not_for_that, no_gps, relative):
        see_flow(parts, 0.0, -0.8)
    assert [parts.terrain.down for parts in (slow, fast_flow, not_for_that, no_gps, relative)] == [0.0] * 5
