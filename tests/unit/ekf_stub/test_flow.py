# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Optical flow: which measurements are taken, what is expected of them, and how they aid."""

import math
from typing import Any

import pytest

from ekf_stub.core.covariance import GYRO
from ekf_stub.core.ranges import RangeFinders
from ekf_stub.core.vectors import ONE, matrix
from ekf_stub.inputs.measurements import DOWNWARD, FinderState, RangeState, RangeStatus
from tests.unit.ekf_stub.filter_rig import (
    MOVING,
    NO_AIDING,
    RELATIVE,
    SLOW_LOOP_US,
    FilterRig,
    Start,
    run_until_due,
    standing,
)

TERRAIN, TAKEOFF_DETECTED, POSITION = 1 << 6, 1 << 10, 0x108  # of XKF4.SS
NAN, INF = math.nan, math.inf
UP = 4.0
VEL = 4


def on_the_ground() -> FilterRig:
    """Return a vehicle that has navigated by flow, on the ground, since its tilt was aligned."""
    rig = standing("05101", has_compass=True, run_s=1.1)
    rig.feeds |= {"flow", "ranges"}
    rig.run(1.4)
    return rig


def flying(**params: float) -> FilterRig:
    """Return a vehicle 4 m above the ground that has seen flow, and whose sensors say nothing for now."""
    rig = FilterRig("05106", loop_us=SLOW_LOOP_US)
    rig.arm()
    rig.ground = 0.1
    rig.feeds |= {"ranges", "camera"}
    rig.run(3.0)
    rig.lose("camera")
    rig.know_gyros()
    rig.feeds.add("flow")
    rig.climb(UP - 0.1)
    rig.run(1.0)
    assert rig.core.flags & TAKEOFF_DETECTED
    for name, value in params.items():
        rig.set_param(name, value)
    rig.lose("flow", "ranges", "baro")
    rig.run(0.2)
    rig.forget()
    return rig


def tell(start: Start, x: float, y: float, **fields: Any) -> tuple[FilterRig, FilterRig]:
    """Let a flow come due in a vehicle; return it and one without."""
    rig, other = start(), start()
    # The flow is of 66 ms before, which the horizon has reached by the time that it comes, at passes of 20 ms.
    time_ms = rig.now_ms - 66
    rig.flow(x, y, **fields)
    run_until_due(rig, other, lambda core: core.ext_nav.horizon_ms >= time_ms)
    return rig, other


def above(rig: FilterRig) -> float:
    return rig.core.height.terrain.above


# Ranges


def test_range_that_is_assumed_on_the_ground_is_of_the_finders_place() -> None:
    ranges, finder = RangeFinders(5), FinderState((0.0, 0.0, 0.5), 0.0, DOWNWARD, RangeStatus.GOOD)
    ranges.read(RangeState((finder,), 0.1, 40.0), 1000, True)
    ranges.recall(1000, matrix(ONE))
    assert ranges.distance == pytest.approx(0.6)


# What is expected


def test_flow_is_expected_to_be_velocity_over_height() -> None:
    told, other = tell(flying, 0.1, -0.2)
    north, east, _ = other.body_velocity()
    height = above(other)
    assert height == pytest.approx(UP, abs=0.3)
    assert told.core.flow.innovations[0] == pytest.approx(east / height + 0.1, abs=2e-3)  # by tilt, of 0.1 deg
    assert told.core.flow.innovations[1] == pytest.approx(-north / height - 0.2, abs=2e-3)
    # AND what it says is that the vehicle goes to the left and back
    assert told.core.state.vel[1] < other.core.state.vel[1] - 0.01


def test_flow_is_fused_with_its_noise_and_through_its_gate() -> None:
    told, other = tell(flying, 0.1, 0.0)
    height = above(other)
    spread = other.core.state.cov.var(VEL + 1) / height**2
    innovation = told.core.flow.innovations[0]
    # The attitude adds a little.
    assert told.core.flow.ratios[0] == pytest.approx(innovation**2 / (9 * (spread + 0.25**2)), rel=0.02)
    gain = spread * height / (spread + 0.25**2)
    assert other.core.state.vel[1] - told.core.state.vel[1] == pytest.approx(gain * innovation, rel=0.05)


def test_turning_is_not_taken_for_moving() -> None:
    still, _ = tell(flying, 0.0, 0.0)
    turning, _ = tell(flying, 0.5, -0.3, gyro=(0.5, -0.3))
    # But for the bias that the sensor's gyro seems to have: a hundredth of a difference of at most 0.1 rad/s.
    assert turning.core.flow.innovations == pytest.approx(still.core.flow.innovations, abs=1.1e-3)


def test_turning_moves_a_sensor_that_is_off_the_imu() -> None:
    here, _ = tell(flying, 0.0, 0.8, gyro=(0.0, 0.8))
    below, other = tell(flying, 0.0, 0.8, gyro=(0.0, 0.8), offset=(0.0, 0.0, 1.0))
    # It is a metre nearer to the ground, and swings as fast as the vehicle turns.
    expected = here.core.flow.innovations[1] - 0.8 / (above(other) - 1.0)
    assert below.core.flow.innovations[1] == pytest.approx(expected, rel=0.01)


def test_flow_beyond_its_gate_is_not_fused() -> None:
    told, other = tell(flying, 2.5, -2.5)
    assert min(told.core.flow.ratios) > 1
    assert told.core.state.vel == other.core.state.vel
    assert told.core.aiding.flow_ms < told.now_ms


@pytest.mark.parametrize("params", [{"SRC1_VELXY": 6}, {"FLOW_USE": 2}, {"FLOW_USE": 0}])
def test_flow_that_is_not_for_navigation_is_tested_alone(params: dict[str, float]) -> None:
    told, other = tell(lambda: flying(**params), 0.3, 0.2)
    assert told.core.flow.innovations[0] > 0.25
    assert told.core.state.vel == other.core.state.vel


@pytest.mark.parametrize(("rate", "is_fused"), [(1.1, True), (-1.1, False)])
def test_flow_that_turns_too_fast_one_way_round_is_not_fused(rate: float, is_fused: bool) -> None:
    # Of both, as the firmware compares with the sign: the filter has the other sign than the sensor.
    told, other = tell(lambda: flying(FLOW_MAX=1.0), rate, 0.1, gyro=(rate, 0.0))
    assert (told.core.state.vel != other.core.state.vel) is is_fused


def test_tilted_vehicle_does_not_see_the_ground() -> None:
    rig = FilterRig("05100", loop_us=SLOW_LOOP_US)
    rig.roll = 0.85
    for _ in range(60):
        rig.flow(0.3, 0.3)
        rig.run(0.06)
    assert rig.core.flow.innovations == (0.0, 0.0)
    assert rig.core.flow.is_valid


def test_sensor_on_the_ground_measures_nothing() -> None:
    told, other = tell(flying, 0.1, 0.1, offset=(0.0, 0.0, 1e9))
    # Where it is nonsense, the flow that is expected is none.
    assert told.core.state.vel == pytest.approx(other.core.state.vel, abs=1e-6)


# Which are taken


@pytest.mark.parametrize("change", [
    {"quality": 0},
    {"x": 4.2},
    {"gyro": (0.0, -4.2)},
    {"x": NAN},
    {"gyro": (0.0, INF)},
    {"offset": (0.0, NAN, 0.0)},
])  # fmt: skip
def test_bad_one_comes_in_but_is_not_kept(change: dict[str, Any]) -> None:
    def start() -> FilterRig:
        rig = flying()
        rig.run(1.2)
        return rig

    told, other = tell(start, **{"x": 0.3, "y": 0.2, **change})
    assert told.core.flow_reading.received_ms > other.core.flow_reading.received_ms
    assert told.core.flow_reading.valid_ms == other.core.flow_reading.valid_ms
    assert told.core.flow.innovations == other.core.flow.innovations
    # AND it spoils nothing of the next
    after, _ = tell(lambda: told, 0.3, 0.2)
    assert all(map(math.isfinite, (*after.core.flow.innovations, *after.core.state.vel)))


@pytest.mark.parametrize(("after_ms", "is_taken"), [(49, False), (50, True)])
def test_one_that_comes_too_soon_is_not_taken(after_ms: int, is_taken: bool) -> None:
    rig = flying()
    rig.loop_us = 1000
    rig.flow()
    first_ms = rig.core.flow_reading.received_ms
    rig.run(1e-3 * after_ms)
    rig.flow()
    assert (rig.core.flow_reading.received_ms > first_ms) is is_taken


def test_flow_before_there_is_a_state_is_not_taken() -> None:
    rig = standing("05101", has_compass=True, run_s=0.5)
    rig.flow()
    rig.run(0.6)
    assert rig.core.flow_reading.received_ms == -1


def test_measurement_waits_until_the_horizon_has_its_middle() -> None:
    # GIVEN a filter whose horizon lies 250 ms back
    rig = standing("05101", has_compass=True, longest_delay_ms=250)
    rig.flow(0.1, 0.1)
    middle_ms = rig.now_ms - 10 - 50 - 6
    # THEN it is fused in the first step at or after its time
    rig.run_until(lambda: "fusing optical flow" in rig.texts)
    assert 0 <= rig.core.ext_nav.horizon_ms - middle_ms < 13


def test_bias_of_its_gyro_is_learned_slowly() -> None:
    # GIVEN a sensor whose gyro says 0.05 rad/s too much, and whose flow agrees
    def start() -> FilterRig:
        rig = flying(SRC1_VELXY=6)  # so that its velocity does not follow the flow
        for _ in range(100):
            rig.flow(0.05, 0.0, gyro=(0.05, 0.0))
            rig.run(0.06)
        return rig

    # WHEN a flow comes without that bias
    told, _ = tell(start, 0.0, 0.0)
    still, _ = tell(flying, 0.0, 0.0)
    # THEN some of it has been learned, a hundredth of the rest with each of 100
    learned = 0.05 * (1 - 0.99**101)
    assert told.core.flow.innovations[0] - still.core.flow.innovations[0] == pytest.approx(learned, abs=0.02)


# How it aids


def test_relative_aiding_starts_as_tilt_aligns() -> None:
    rig = on_the_ground()
    said = [text for text in rig.texts if "yaw" not in text]
    assert said == ["initialised", "fusing optical flow", "tilt alignment complete", "started relative aiding"]
    assert rig.mode == RELATIVE
    assert rig.core.flags == MOVING | TERRAIN


@pytest.mark.parametrize(("silence_s", "mode"), [(4.9, RELATIVE), (5.1, NO_AIDING)])
def test_relative_aiding_ends_5_s_after_the_last_flow(silence_s: float, mode: int) -> None:
    rig = on_the_ground()
    rig.lose("flow")
    rig.forget()
    rig.skip(silence_s - 1e-3 * (rig.now_ms - rig.core.aiding.flow_ms) - 0.02)
    rig.run(0.04)
    assert rig.mode == mode
    assert rig.told() == ["stopped aiding"] * (mode == NO_AIDING)


def test_flow_is_valid_for_a_second_and_on_the_ground_anyway() -> None:
    rig = flying()
    rig.run(0.02)
    rig.flow()
    rig.run(0.9)
    assert rig.core.flow.is_valid
    rig.run(0.2)
    assert not rig.core.flow.is_valid
    rig = on_the_ground()
    rig.lose("flow")
    rig.run(1.2)
    assert rig.core.flow.is_valid


def test_near_the_ground_flow_is_zero_until_take_off() -> None:
    rig = on_the_ground()
    rig.feeds.discard("flow")
    for _ in range(10):
        rig.flow(0.4, 0.4)
        rig.run(0.06)
    assert rig.core.flow.innovations == pytest.approx((0.0, 0.0), abs=0.01)  # its velocity
    assert math.hypot(*rig.core.state.vel[:2]) < 1e-3


def test_ground_is_not_known_5_s_after_the_last_range() -> None:
    rig = on_the_ground()
    rig.feeds.discard("ranges")
    rig.core.inputs.set_ranges(None)
    rig.run(0.2)
    rig.skip(4.3)
    rig.flow()
    rig.run(0.2)
    assert rig.core.flags & TERRAIN
    rig.skip(0.4)
    rig.flow()
    rig.run(0.1)
    assert rig.core.flags == MOVING & ~POSITION


@pytest.mark.parametrize(("distance", "rate", "detected"), [
    (0.19, 0.0, False),
    (0.21, 0.0, True),
    (0.1, 0.2, True),
])  # fmt: skip
def test_take_off_is_seen_by_range_or_by_turning_after_a_second(distance: float, rate: float, detected: bool) -> None:
    rig = on_the_ground()
    rig.ground = distance
    rig.yaw_rate = rate
    rig.arm()
    rig.run(0.9)
    assert not rig.core.flags & TAKEOFF_DETECTED
    rig.run(0.2)
    assert bool(rig.core.flags & TAKEOFF_DETECTED) is detected
    rig.arm(False)
    rig.run(0.2)
    assert not rig.core.flags & TAKEOFF_DETECTED


@pytest.mark.parametrize(("distance", "in_flight"), [(0.59, False), (0.61, True)])
def test_range_shows_that_the_vehicle_flies(distance: float, in_flight: bool) -> None:
    rig = on_the_ground()
    rig.arm()
    rig.ground = distance
    rig.run(0.3)
    assert rig.core.vehicle.in_flight is in_flight


def test_vehicle_keeps_its_velocity_by_flow() -> None:
    rig = flying()
    rig.feeds |= {"flow", "ranges", "baro"}
    rig.move(1.0, 0.5, 0.0, 1.0)
    rig.run(4.0)
    assert rig.mode == RELATIVE
    assert rig.core.output.now.vel[:2] == pytest.approx(rig.vel[:2], abs=0.15)  # flow of 0.25 rad/s of noise


def test_report_tells_of_ground_and_flow() -> None:
    rig = on_the_ground()
    terrain = rig.report.terrain
    assert terrain.above == pytest.approx(0.1, abs=0.01)
    assert terrain.range_m == 0.1
    assert terrain.range_innovation == pytest.approx(0.0, abs=0.01)
    assert 0 < terrain.sigma < 0.5
    told, _ = tell(flying, 0.2, 0.1)
    assert told.report.terrain.flow_ratio == max(told.core.flow.ratios) > 0


@pytest.mark.parametrize(("sources", "begins"), [("05100", True), ("05106", False)])
def test_gyros_bias_in_yaw_need_not_be_known_where_nothing_measures_yaw(sources: str, begins: bool) -> None:
    # GIVEN a gyro whose bias is known but in yaw
    rig = standing(sources)
    rig.arm()
    rig.core.state.clear(GYRO, GYRO + 2, 1e-10)
    rig.core.state.clear(GYRO + 2, GYRO + 3, 1e-6)
    # THEN flow may aid if there is no source of yaw
    rig.flow(0.0, 0.0)
    rig.run(0.05)
    assert (rig.mode == RELATIVE) is begins
