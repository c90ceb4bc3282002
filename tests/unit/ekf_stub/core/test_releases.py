# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a core does otherwise in a later release."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import pytest

from ap_core.location import Location
from ekf_stub.filter.release import APRIL_2026, FEBRUARY_2026, REFERENCE, FilterRelease
from ekf_stub.fusion.aiding import AidingMode

if TYPE_CHECKING:
    from tests.unit.ekf_stub.core_rig import CoreRig

MakeCore = Callable[..., "CoreRig"]

HOME = Location(-353632610, 1491652300, 58400)
releases = pytest.mark.parametrize(
    ("release", "later"),
    [(REFERENCE, False), pytest.param(FEBRUARY_2026, False, marks=pytest.mark.slow), (APRIL_2026, True)],
)


@releases
def test_origin_of_a_filter_without_a_state(make_core: MakeCore, release: FilterRelease, later: bool) -> None:
    rig = make_core(run_s=0.0, release=release)
    assert rig.core.set_origin(HOME) is not later
    rig.run_for(1.5)
    assert (rig.core.origin is None) is later
    assert rig.core.set_origin(HOME) is later


@releases
def test_velocity_of_a_vehicle_at_rest(make_core: MakeCore, release: FilterRelease, later: bool) -> None:
    rig = make_core("60106", has_compass=True, release=release)
    rig.stream(1.0, rig.pose)
    rig.core.aiding.times.vel = before_ms = rig.now_ms - 1000
    rig.stream(0.3, rig.pose)
    assert (rig.core.aiding.times.vel > before_ms) is later


@releases
def test_stillness_is_tested_with_a_compass(make_core: MakeCore, release: FilterRelease, later: bool) -> None:
    assert (make_core("60101", has_compass=True, release=release).core.is_still() is not None) is later


@releases
def test_height_as_aiding_starts(make_core: MakeCore, release: FilterRelease, later: bool) -> None:
    rig = make_core("60106", release=release)
    rig.stream(0.2, lambda: rig.pose(0, 0, -20))
    assert rig.core.aiding.mode is AidingMode.ABSOLUTE
    assert (rig.core.state.down > -10) is later


@releases
def test_relative_aiding_without_a_source_of_yaw(make_core: MakeCore, release: FilterRelease, later: bool) -> None:
    rig = make_core("06100", release=release)
    rig.core.aiding.mode = AidingMode.RELATIVE
    rig.core.aiding.times.odometry = rig.now_ms
    rig.run_for(0.0025)
    assert (rig.core.aiding.mode is AidingMode.RELATIVE) is later


@releases
def test_field_on_the_ground_by_mag_cal_7(make_core: MakeCore, release: FilterRelease, later: bool) -> None:
    rig = make_core("60101", has_compass=True, release=release, MAG_CAL=7)
    assert rig.core.state.learns_field is later
