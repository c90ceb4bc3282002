# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A core that navigates by optical flow, and knows the ground by a range finder."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import pytest

from ekf_stub.core.reporting import report_of
from ekf_stub.fusion.aiding import AidingMode
from ekf_stub.fusion.height_source import BARO, RANGE
from tests.copies import Copies

if TYPE_CHECKING:
    from tests.unit.ekf_stub.core_rig import CoreRig

MakeCore = Callable[..., "CoreRig"]

NAVIGATING, POSITION, TERRAIN, TAKEOFF_DETECTED = 0x1012F, 0x108, 1 << 6, 1 << 10  # of XKF4.SS


@pytest.fixture(scope="module")
def navigating(make_core: MakeCore) -> Callable[[], "CoreRig"]:
    """Return a function that makes a core that has navigated by flow, on the ground, since its tilt was aligned."""
    rig = make_core("05101", has_compass=True, run_s=1.1)
    rig.see_ranges(0.1)
    rig.stream(1.3, rig.flow, period_s=0.1)
    return Copies(rig).make


@pytest.fixture
def rig(navigating: Callable[[], "CoreRig"]) -> "CoreRig":
    return navigating()


def pass_by(rig: "CoreRig", duration_s: float) -> None:
    """Let time pass of which the filter hears no more than its last step."""
    rig.now_us += round(1e6 * (duration_s - 0.02))
    rig.run_for(0.02)


def test_relative_aiding_starts_as_tilt_aligns(rig: "CoreRig") -> None:
    said = [text for _, text in rig.said if "yaw" not in text]
    assert said == ["initialised", "fusing optical flow", "tilt alignment complete", "started relative aiding"]
    assert rig.core.aiding.mode is AidingMode.RELATIVE
    assert rig.flags == NAVIGATING | TERRAIN


def test_relative_aiding_ends_5_s_after_the_last_flow(rig: "CoreRig") -> None:
    rig.told()
    pass_by(rig, 4.8)
    assert rig.told() == []
    pass_by(rig, 0.3)
    assert rig.told() == ["stopped aiding"]


def test_ground_is_not_known_5_s_after_the_last_range(rig: "CoreRig") -> None:
    rig.frame["ranges"] = None
    pass_by(rig, 2.0)
    assert rig.flags & TERRAIN
    rig.core.height.terrain.valid_ms -= 3000
    rig.flow()
    rig.run_for(0.02)
    assert rig.flags == NAVIGATING & ~POSITION


@pytest.mark.parametrize(("distance", "rate", "detected"), [
    (0.19, 0.0, False),
    (0.21, 0.0, True),
    (0.1, 0.2, True),
])  # fmt: skip
def test_take_off_is_seen_by_range_or_by_turning_after_a_second(
    rig: "CoreRig", distance: float, rate: float, detected: bool
) -> None:
    rig.frame["armed"] = True
    rig.rate = (0.0, 0.0, rate)
    rig.see_ranges(distance)
    rig.run_for(0.2)
    for after_s, expected in ((0.7, False), (0.2, detected)):
        pass_by(rig, after_s)
        rig.flow()
        rig.run_for(0.02)
        assert bool(rig.flags & TAKEOFF_DETECTED) is expected
    rig.frame["armed"] = False
    pass_by(rig, 0.1)
    rig.flow()
    rig.run_for(0.02)
    assert not rig.flags & TAKEOFF_DETECTED


@pytest.mark.parametrize(("distance", "in_flight"), [(0.59, False), (0.61, True)])
def test_range_shows_that_the_vehicle_flies(rig: "CoreRig", distance: float, in_flight: bool) -> None:
    rig.frame["armed"] = True
    rig.see_ranges(distance)
    rig.run_for(0.2)
    assert rig.core.control.vehicle.in_flight is in_flight


def test_flow_before_there_is_a_state_is_not_taken(make_core: MakeCore) -> None:
    rig = make_core("05101", has_compass=True, run_s=0.5)
    rig.flow()
    rig.core.set_terrain_stable(is_stable=False)
    rig.run_for(0.6)
    assert rig.core.flow_ingest.received_ms is None
    assert rig.core.height.terrain_is_stable


def test_height_above_the_ground_is_range_finder_s_when_that_is_the_source(make_core: MakeCore) -> None:
    rig = make_core("66201", run_s=1.1)
    rig.see_ranges(0.1)
    rig.run_for(0.3)
    assert rig.core.height.active == RANGE
    assert not rig.core.reset_height_datum()
    rig.frame["ranges"] = None
    pass_by(rig, 0.6)
    assert rig.core.height.active == BARO
    rig.core.height.terrain.down = 3.0
    assert rig.core.reset_height_datum()
    assert rig.core.height.terrain.down == 0.0


def test_range_height_waits_for_stable_ground(make_core: MakeCore) -> None:
    rig = make_core("66101", run_s=1.1, RNG_USE_HGT=50)
    rig.core.set_terrain_stable(is_stable=False)
    rig.see_ranges(0.1)
    rig.run_for(0.4)
    assert rig.core.height.active == BARO
    rig.core.set_terrain_stable(is_stable=True)
    rig.run_for(0.02)
    assert rig.core.height.active == RANGE


def test_report_tells_of_ground_and_flow(rig: "CoreRig") -> None:
    rig.core.flow.takeoff_detected = True
    rig.core.state.vel = np.array([0.05, 0.0, 0.0])
    rig.stream(0.15, rig.flow, period_s=0.05)
    terrain = report_of(rig.core, rig.now_ms).terrain
    assert terrain.above == pytest.approx(0.1, abs=0.01)
    assert terrain.range_m == 0.1
    assert terrain.range_innovation == pytest.approx(0.0, abs=0.01)
    assert 0 < terrain.sigma < 0.5
    assert terrain.flow_ratio > 0
