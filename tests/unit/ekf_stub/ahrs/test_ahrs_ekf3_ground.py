# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What looks at the ground reaches the filter and the log."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import pytest

from ekf_stub.inputs.measurements import DOWNWARD, FinderState, FlowMeasurement, RangeState, RangeStatus
from ekf_stub.reports import NO_LIMITS, ControlLimits

if TYPE_CHECKING:
    from tests.unit.ekf_stub.bench_rig import BenchRig

MakeBench = Callable[..., "BenchRig"]

SET_UP_S = 3.5
FLOW = FlowMeasurement(180, (0.25, -0.5), (0.125, 0.0), (0.5, 0.0, 0.25))
GOOD = FinderState((0.5, 0.0, 0.25), 2.0, DOWNWARD, RangeStatus.GOOD)
RANGES = RangeState((GOOD, GOOD._replace(orientation=24), GOOD._replace(status=RangeStatus.TOO_FAR)), 0.125, 30.0)


@pytest.fixture
def bench(make_bench: MakeBench) -> "BenchRig":
    """Return a bench whose IMU is not where the autopilot is."""
    return make_bench("05101", has_compass=True, FLOW_TYPE=5, INS_POS1_X=0.125)


def test_range_finders_stand_where_they_are_seen_from_the_imu(bench: "BenchRig") -> None:
    bench.run_to(SET_UP_S)
    bench.state.ranges = RANGES
    bench.run_for(0.01)
    ranges = bench.core.inputs.ranges
    assert ranges is not None
    assert ranges == RANGES._replace(
        finders=tuple(one._replace(place_frd=(0.375, 0.0, 0.25)) for one in RANGES.finders)
    )
    assert [finder.is_usable for finder in ranges.finders] == [True, False, False]
    bench.run_for(0.01)
    assert bench.core.inputs.ranges is ranges
    bench.params.set("INS_POS1_X", 0.25)
    bench.run_for(0.01)
    moved = bench.core.inputs.ranges
    assert moved is not None
    assert moved.finders[0].place_frd == (0.25, 0.0, 0.25)


def test_filter_of_a_vehicle_without_range_finders_has_none(bench: "BenchRig") -> None:
    bench.run_to(SET_UP_S)
    assert bench.core.inputs.ranges is None


def test_flow_is_handed_on_with_its_place_from_the_imu(bench: "BenchRig") -> None:
    bench.run_to(5.6)
    bench.ahrs.write_flow(FLOW, bench.now_ms)
    taken = bench.core.flow_reading.recall(bench.now_ms)
    assert taken is not None
    assert (taken.offset, taken.flow) == ((0.375, 0.0, 0.25), (-0.25, 0.5))


def test_flow_and_ranges_are_logged_with_their_places_on_the_vehicle(bench: "BenchRig") -> None:
    bench.run_to(SET_UP_S)
    bench.is_logged = True
    bench.state.ranges = RANGES
    bench.run_for(0.01)
    bench.ahrs.write_flow(FLOW, 3510)
    records = dict(bench.records)
    assert records["ROFH"][5:8] == FLOW.offset
    assert [values[:3] for name, values in bench.records if name == "RRNI"] == [GOOD.place_frd] * 3
    assert int(records["RFRN"][-1]) & 1 << 4


def test_filter_and_log_hear_of_the_ground_when_that_changes(bench: "BenchRig") -> None:
    bench.run_to(5.6)
    bench.is_logged = True
    bench.run_for(0.01)
    heard = []
    for is_stable in (False, False, True, True, False):
        bench.ahrs.set_terrain_stable(is_stable=is_stable)
        heard.append(bench.core.height.terrain_is_stable)
    assert heard == [False, False, True, True, False]
    assert [values for name, values in bench.records if name == "REV3"] == [(10,), (9,), (10,)]


@pytest.mark.parametrize(("sources", "params", "failure"), [
    ("05101", {"FLOW_TYPE": 0}, "EK3 sources require OpticalFlow"),
    ("05201", {}, "EK3 sources require RangeFinder"),
])  # fmt: skip
def test_sources_require_their_sensors(
    make_bench: MakeBench, sources: str, params: dict[str, float], failure: str
) -> None:
    bench = make_bench(sources, has_compass=True, **{"FLOW_TYPE": 5, **params})
    bench.run_to(4.6)
    assert bench.ahrs.pre_arm_failure(requires_position=True) == failure
    bench.params.set("FLOW_TYPE", 5)
    bench.state.ranges = RANGES
    assert bench.ahrs.pre_arm_failure(requires_position=True) != failure


@pytest.mark.parametrize(("ranges", "fits"), [
    (RANGES, True), (RangeState((GOOD._replace(orientation=24),), 0.0, 0.0), False), (None, False)
])  # fmt: skip
def test_only_a_range_finder_that_looks_down_is_one_for_the_filter(
    make_bench: MakeBench, ranges: RangeState | None, fits: bool
) -> None:
    bench = make_bench("00200", has_compass=True)
    bench.run_to(4.6)
    bench.state.ranges = ranges
    said = bench.ahrs.pre_arm_failure(requires_position=True)
    assert (said != "EK3 sources require RangeFinder") is fits


def navigated(bench: "BenchRig", seconds: float = 2.0, ranges: RangeState = RANGES) -> ControlLimits:
    """Return the limits after some time of flow and ranges at a standstill."""
    bench.state.ranges = ranges
    for _ in range(round(seconds / 0.1)):
        bench.ahrs.write_flow(FlowMeasurement(180, (0.0, 0.0), (0.0, 0.0)), bench.now_ms)
        bench.run_for(0.1)
    return bench.ahrs.control_limits()


def test_vehicle_that_navigates_by_flow_is_to_keep_to_what_its_sensors_see(bench: "BenchRig") -> None:
    bench.run_to(SET_UP_S)
    assert bench.ahrs.control_limits() == NO_LIMITS
    terrain_m, limits = 0.5 * 0.25 + 0.125, navigated(bench, 3.0)
    down_m, above_m = bench.core.height.terrain.down, bench.core.height.terrain.above
    assert (limits.speed_m_s, limits.gain) == (1.5 * above_m, 1.0)
    assert limits.up_m == pytest.approx(0.7 * 30 - 1 - down_m)
    assert 0 < above_m < 10 * terrain_m
    bench.params.set("EK3_FLOW_MAX", 0.5)
    assert navigated(bench, 0.2).speed_m_s == 0.0


def test_height_that_is_a_range_counts_from_the_ground(make_bench: MakeBench) -> None:
    bench = make_bench("05201", has_compass=True, FLOW_TYPE=5)
    bench.run_to(SET_UP_S)
    assert navigated(bench, 3.0).up_m == pytest.approx(20.0)
    assert navigated(bench, 0.2, RANGES._replace(max_distance=2.0)).up_m == 1.0


def test_limits_end_with_the_flow(bench: "BenchRig") -> None:
    bench.run_to(SET_UP_S)
    navigated(bench, 3.0)
    bench.run_for(6.0)
    assert bench.ahrs.control_limits() == NO_LIMITS


def test_height_above_the_ground_is_unknown_without_ranges(bench: "BenchRig") -> None:
    assert bench.ahrs.height_above_ground() is None
    bench.run_to(5)
    assert bench.ahrs.height_above_ground() is None
