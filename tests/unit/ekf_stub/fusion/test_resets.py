# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a reset puts where, with which variance, and what it leaves alone."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from ap_core.location import Location
from ap_core.vector3 import Vector3f
from ekf_stub.filter.states import POS, VEL
from ekf_stub.fusion.aiding import AidingMode
from ekf_stub.inputs.gps_sample import GpsSample

if TYPE_CHECKING:
    from tests.unit.ekf_stub.filter_parts import FilterParts

MakeParts = Callable[..., "FilterParts"]

NOW_MS = 50_000
ORIGIN = Location(-353632610, 1491652300, 58400)
MIN_VAR = 1e-4


def navigating(make_parts: MakeParts, sources: str = "66666") -> "FilterParts":
    """Return parts that navigate by position, at (10, 20, 30) with (1, 2, 3) m/s, all of it correlated."""
    parts = make_parts(sources)
    parts.aiding.mode = AidingMode.ABSOLUTE
    parts.aiding.pos_timeout = parts.aiding.vel_timeout = True
    parts.state.pos, parts.state.vel = np.array([10.0, 20.0, 30.0]), np.array([1.0, 2.0, 3.0])
    parts.output.overwrite(pos={0: 9.0, 1: 19.0, 2: 29.0}, vel={0: 0.5, 1: 0.5, 2: 0.5})
    parts.state.cov += 1e-3
    return parts


def set_fix(parts: "FilterParts", *, time_ms: int = NOW_MS, **fields: Any) -> None:
    values: dict[str, Any] = {"fix_type": 3, "location": ORIGIN, "vel_ned": Vector3f(), "num_sats": 10, "hdop": 100}
    sample = GpsSample(time_ms=time_ms, **{**values, **fields})
    parts.gps.read(sample, time_ms, absolute=True, worst_ratios=(0.0, 0.0))
    parts.gps.push(sample, ORIGIN, 0.01 * ORIGIN.alt_cm, time_ms - 300, time_ms)


def variances(parts: "FilterParts", first: int, count: int) -> list[float]:
    found: list[float] = parts.state.cov.diagonal()[first : first + count].tolist()
    return found


def correlations(parts: "FilterParts", state: int) -> float:
    row = np.delete(parts.state.cov[state], state)
    return float(np.abs(row).max())


# Position


def test_position_goes_to_the_last_pose_with_its_error_however_small(make_parts: MakeParts) -> None:
    parts = navigating(make_parts)
    parts.set_pose(4, 5, 6, err=0.2)
    parts.end_step()
    parts.resets.position(NOW_MS)
    assert parts.state.pos.tolist() == [4, 5, 30]
    assert parts.output.now.pos.tolist() == [4, 5, 29]
    assert variances(parts, POS.start, 2) == pytest.approx([0.04, 0.04])
    assert correlations(parts, POS.start) == correlations(parts, POS.start + 1) == 0
    assert parts.resets.moved_ne.tolist() == [-6, -15]
    assert (parts.aiding.pos_timeout, parts.aiding.times.pos) == (False, NOW_MS)


@pytest.mark.parametrize(("age_ms", "north"), [(249, 4.0), (250, 10.0)])
def test_position_of_no_source_counts_while_it_is_fresh(make_parts: MakeParts, age_ms: int, north: float) -> None:
    parts = navigating(make_parts, "06606")
    parts.set_pose(4, 5, 6, err=0.2, time_ms=NOW_MS - age_ms)
    parts.resets.position(NOW_MS)
    assert parts.state.pos[0] == north


def test_fresh_position_of_a_gps_counts_before_that_while_no_source_is_named(make_parts: MakeParts) -> None:
    parts = navigating(make_parts, "06606")
    parts.set_pose(4, 5, 6, err=0.2, time_ms=NOW_MS)
    set_fix(parts, time_ms=NOW_MS - 249)
    parts.resets.position(NOW_MS)
    assert parts.state.pos[:2] == pytest.approx([0, 0], abs=1e-6)


def test_position_leaves_velocity_and_its_timeout_alone(make_parts: MakeParts) -> None:
    parts = navigating(make_parts)
    before = variances(parts, VEL.start, 3)
    parts.set_pose(4, 5, 6)
    parts.resets.position(NOW_MS)
    assert parts.state.vel.tolist() == [1, 2, 3]
    assert variances(parts, VEL.start, 3) == before
    assert parts.aiding.vel_timeout


@pytest.mark.parametrize("mode", [AidingMode.NONE, AidingMode.RELATIVE])
def test_without_absolute_aiding_position_goes_to_where_it_was_known_last(
    make_parts: MakeParts, mode: AidingMode
) -> None:
    parts = navigating(make_parts)
    parts.aiding.mode = mode
    parts.resets.last_known_ne = np.array([7.0, 8.0])
    parts.set_pose(4, 5, 6)
    parts.resets.position(NOW_MS)
    assert parts.state.pos.tolist() == [7, 8, 30]
    assert variances(parts, POS.start, 2) == pytest.approx([0.25, 0.25])
    assert (parts.aiding.pos_timeout, parts.aiding.times.pos) == (False, NOW_MS)


def test_gps_position_is_carried_to_the_horizon_by_its_velocity(make_parts: MakeParts) -> None:
    parts = navigating(make_parts, "33131")
    set_fix(parts, location=ORIGIN.offset(Vector3f(40, 0, 0)), vel_ned=Vector3f(10, -10, 0), horizontal_accuracy=2.0)
    assert parts.gps.newest is not None
    parts.ingest.horizon_ms = parts.gps.newest.time_ms + 100
    parts.resets.position(NOW_MS)
    assert parts.state.pos[:2] == pytest.approx([41, -1], abs=0.02)
    assert variances(parts, POS.start, 2) == pytest.approx([4, 4])


def test_gps_position_is_not_better_than_its_noise(make_parts: MakeParts) -> None:
    parts = navigating(make_parts, "33131")
    set_fix(parts)
    parts.resets.position(NOW_MS)
    assert variances(parts, POS.start, 2) == pytest.approx([0.25, 0.25])


# A jump of the frame


def test_shift_moves_state_and_outputs_by_as_much_and_nothing_else(make_parts: MakeParts) -> None:
    parts = navigating(make_parts)
    cov = parts.state.cov.copy()
    parts.resets.shift_to(np.array([14.0, 18.0, 25.0]), with_height=False)
    assert parts.state.pos.tolist() == [14, 18, 30]
    assert parts.output.now.pos.tolist() == [13, 17, 29]
    assert parts.resets.moved_ne.tolist() == [4, -2]
    assert np.array_equal(parts.state.cov, cov)
    assert parts.state.vel.tolist() == [1, 2, 3]
    assert (parts.aiding.pos_timeout, parts.aiding.vel_timeout, parts.aiding.times.pos) == (True, True, 0)


def test_shift_moves_height_too_if_that_comes_from_the_same_source(make_parts: MakeParts) -> None:
    parts = navigating(make_parts)
    parts.resets.shift_to(np.array([10.0, 20.0, 25.0]), with_height=True)
    assert parts.state.pos.tolist() == [10, 20, 25]
    assert parts.output.now.pos.tolist() == [9, 19, 24]


# Velocity


def test_velocity_goes_to_the_last_one_measured(make_parts: MakeParts) -> None:
    parts = navigating(make_parts)
    parts.set_velocity(4, 5, 6, err=0.2)
    parts.end_step()
    parts.resets.velocity(NOW_MS, by_ext_nav=True)
    assert parts.state.vel.tolist() == [4, 5, 3]
    assert parts.output.now.vel.tolist() == [4, 5, 0.5]
    assert variances(parts, VEL.start, 2) == pytest.approx([0.04, 0.04])
    assert correlations(parts, VEL.start) == 0
    assert (parts.aiding.vel_timeout, parts.aiding.times.vel) == (False, NOW_MS)


def test_velocity_that_never_came_is_0_and_certain(make_parts: MakeParts) -> None:
    parts = navigating(make_parts)
    parts.resets.velocity(NOW_MS)
    assert parts.state.vel.tolist() == [0, 0, 3]
    assert max(variances(parts, VEL.start, 2)) <= MIN_VAR


@pytest.mark.parametrize("mode", [AidingMode.NONE, AidingMode.RELATIVE])
def test_without_absolute_aiding_velocity_is_0_and_still_lost(make_parts: MakeParts, mode: AidingMode) -> None:
    parts = navigating(make_parts)
    parts.aiding.mode = mode
    parts.set_velocity(4, 5, 6)
    parts.resets.velocity(NOW_MS)
    assert parts.state.vel.tolist() == [0, 0, 3]
    assert variances(parts, VEL.start, 2) == pytest.approx([0.09, 0.09])
    assert (parts.aiding.vel_timeout, parts.aiding.times.vel) == (True, 0)


@pytest.mark.parametrize(("age_ms", "north", "variance"), [(249, 4.0, 0.04), (250, 0.0, 625.0)])
def test_velocity_of_no_source_counts_while_it_is_fresh(
    make_parts: MakeParts, age_ms: int, north: float, variance: float
) -> None:
    parts = navigating(make_parts, "60606")
    parts.set_velocity(4, 5, 6, err=0.2)
    parts.ingest.velocity_stamp_ms = NOW_MS - age_ms
    parts.resets.velocity(NOW_MS)
    assert parts.state.vel[0] == north
    assert variances(parts, VEL.start, 1) == pytest.approx([variance])


@pytest.mark.parametrize(("age_ms", "north"), [(249, 7.0), (250, 0.0)])
def test_velocity_of_a_gps_counts_before_that_while_no_source_is_named(
    make_parts: MakeParts, age_ms: int, north: float
) -> None:
    parts = navigating(make_parts, "60606")
    set_fix(parts, time_ms=NOW_MS - age_ms, vel_ned=Vector3f(7, 8, 9), speed_accuracy=2.0)
    parts.resets.velocity(NOW_MS)
    assert parts.state.vel[0] == north
    assert variances(parts, VEL.start, 1) == pytest.approx([4.0 if north else 625.0])


# Height


def test_height_goes_to_a_measurement_with_its_variance(make_parts: MakeParts) -> None:
    parts = navigating(make_parts)
    parts.resets.height(NOW_MS, -5.0, 0.25, vertical_velocity=None)
    assert parts.state.pos.tolist() == [10, 20, -5]
    assert parts.state.vel.tolist() == [1, 2, 3]
    assert parts.output.now.pos.tolist() == [9, 19, -5]
    assert parts.output.now.vel.tolist() == [0.5, 0.5, 3]
    assert variances(parts, POS.start + 2, 1) == [0.25]
    assert variances(parts, VEL.start + 2, 1) == [0.25]  # EK3_VELD_M_NSE
    assert correlations(parts, POS.start + 2) == correlations(parts, VEL.start + 2) == 0
    assert parts.aiding.times.height == NOW_MS


def test_vertical_velocity_is_as_uncertain_as_the_last_one_measured(make_parts: MakeParts) -> None:
    parts = navigating(make_parts)
    parts.set_velocity(4, 5, 6, err=0.3)
    parts.resets.height(NOW_MS, -5.0, 0.25, vertical_velocity=6.0)
    assert parts.state.vel.tolist() == [1, 2, 6]
    assert variances(parts, VEL.start + 2, 1) == pytest.approx([0.09])


def test_other_source_of_height_moves_height_and_nothing_else(make_parts: MakeParts) -> None:
    parts = navigating(make_parts)
    cov = parts.state.cov.copy()
    parts.resets.shift_height(25.0)
    assert parts.state.pos.tolist() == [10, 20, 25]
    assert parts.output.now.pos.tolist() == [9, 19, 24]
    assert np.array_equal(parts.state.cov, cov)
    assert parts.aiding.times.height == 0
