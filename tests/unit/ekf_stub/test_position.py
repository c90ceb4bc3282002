# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Positions of the camera: their weight and gate, what is rejected, and what the filter is reset to."""

import math

import pytest

from ap_core.location import Location
from ap_core.vector3 import Vector3f
from ekf_stub.release import APRIL_2026
from tests.unit.ekf_stub.filter_rig import (
    HOME,
    MODE_ABSOLUTE,
    NO_AIDING,
    SLOW_LOOP_US,
    FilterRig,
    Start,
    compared,
    has_pose,
    navigating,
    reckoned,
    standing,
    weight,
)

NAN = math.nan
POS_GATE, VEL = 25.0, 4  # EK3_POS_I_GATE of 500; the number of the first state of velocity
POS = 7
MIN_VAR = 1e-4


def seen(sources: str = "66166", **options: object) -> FilterRig:
    """Return a vehicle that navigates, and whose sensors say nothing for now."""
    rig = navigating(sources, **options)
    rig.lose("camera", "baro")
    rig.forget()
    return rig


def tell_pose(rig: FilterRig, x: float, y: float, z: float = 0.0, **fields: float) -> None:
    """Let the camera see a position without a yaw, so that nothing else is fused."""
    rig.camera(x, y, z, **{"yaw": NAN, **fields})


def due_pose(start: Start, x: float, y: float, **fields: float) -> tuple[FilterRig, FilterRig]:
    """Let a pose come due in a vehicle; return it and one without."""
    return compared(start, lambda rig: tell_pose(rig, x, y, **fields), has_pose)


def variances(rig: FilterRig, first: int, count: int) -> list[float]:
    return rig.core.state.cov.variances()[first : first + count]


# Weight


@pytest.mark.parametrize(("err", "noise"), [(0.2, 0.2), (0.0, 0.01), (5.0, 5.0), (1e6, 100.0)])
def test_pose_is_fused_with_its_error_within_limits(err: float, noise: float) -> None:
    told, other = due_pose(seen, 0.1, -0.2, err=err)
    for axis, seen_at in ((0, 0.1), (1, -0.2)):
        before, variance = other.core.state.pos[axis], variances(other, POS + axis, 1)[0]
        part = weight(variance, noise)
        # North and east have next to nothing to do with each other; what they have is the tolerance.
        assert told.core.state.pos[axis] - before == pytest.approx(part * (seen_at - before), rel=1e-3)
        assert variances(told, POS + axis, 1)[0] == pytest.approx(max(variance * (1 - part), MIN_VAR), rel=1e-3)


def test_position_corrects_the_velocity_that_it_depends_on() -> None:
    told, other = due_pose(seen, 0.5, 0.0)
    cov = other.covariance()
    gain = cov[VEL, POS] / (cov[POS, POS] + 0.04)
    innovation = 0.5 - other.core.state.pos[0]
    assert told.core.state.vel[0] - other.core.state.vel[0] == pytest.approx(gain * innovation, rel=1e-3)
    assert told.core.state.vel[0] > other.core.state.vel[0] + 0.01


# Gate


def gate_m(rig: FilterRig, sigmas: float, err: float = 0.2) -> float:
    """Return how far a position may be off, as far as the covariance says now."""
    return sigmas * math.sqrt(sum(variances(rig, POS, 2)) + 2 * err**2)


def test_ratio_of_a_position_is_of_its_distance() -> None:
    told, other = due_pose(seen, 0.3, -0.4)
    north, east, _ = other.core.state.pos
    distance = math.hypot(north - 0.3, east + 0.4)
    ratio = (distance / gate_m(other, 5.0)) ** 2
    assert told.report.pos_ratio == pytest.approx(ratio)
    assert told.report.pos_innovation[:2] != (0.0, 0.0)
    assert told.last_test("pose") == ("model_fused", pytest.approx(math.sqrt(ratio)), pytest.approx(distance))
    assert told.core.aiding.pos_ms == told.now_ms


@pytest.mark.parametrize(("percent", "sigmas"), [(500, 5.0), (300, 3.0), (50, 1.0)])
@pytest.mark.parametrize("passes", [True, False])
def test_gate_of_position_is_as_wide_as_its_parameter_but_not_less_than_a_sigma(
    percent: float, sigmas: float, passes: bool
) -> None:
    def start() -> FilterRig:
        rig = seen()
        rig.set_param("POS_I_GATE", percent)
        return rig

    _, other = due_pose(start, 0.0, 0.0)
    distance = gate_m(other, sigmas) * (0.999 if passes else 1.001)
    told, other = due_pose(start, other.core.state.pos[0] + distance, other.core.state.pos[1])
    assert (told.core.state.pos[0] > other.core.state.pos[0] + 0.01) is passes
    assert told.became() == [("pose", "model_fused" if passes else "model_gate_position")]
    assert (told.core.aiding.pos_ms == told.now_ms) is passes


def test_rejected_position_still_shows_its_innovation_until_the_next_test() -> None:
    told, other = due_pose(seen, 30.0, -40.0)
    north, east, _ = other.core.state.pos
    assert told.core.state.pos == other.core.state.pos
    assert told.report.pos_innovation[:2] == pytest.approx((north - 30.0, east + 40.0))
    ratio, innovation = told.report.pos_ratio, told.report.pos_innovation
    assert ratio > 1
    told.run(0.1)
    assert (told.report.pos_ratio, told.report.pos_innovation) == (ratio, innovation)


# A camera that jumps


def test_camera_that_jumps_3_m_is_rejected_until_the_position_is_as_uncertain() -> None:
    # GIVEN a vehicle at rest
    rig = navigating("66166", loop_us=SLOW_LOOP_US)
    # WHEN the camera jumps 3 m without a word
    rig.camera_shift = 3.0, 0.0, 0.0
    rig.run(0.5)
    # THEN the filter stays where it is
    assert rig.miss_m() < 0.05
    assert rig.became()[-2:] == [("yaw", "model_fused"), ("pose", "model_gate_position")]
    # AND as it knows ever less, it believes the camera, without a reset
    rig.run(6.5)
    assert rig.core.output.now.pos[:2] == pytest.approx((3.0, 0.0), abs=0.5)  # it swings in
    assert ("pose", "model_reset") not in rig.became()


def test_camera_that_jumps_a_kilometre_is_rejected_and_after_7_s_believed() -> None:
    # GIVEN a vehicle at rest
    rig = navigating("66166", loop_us=SLOW_LOOP_US)
    # WHEN the camera jumps 1000 m without a word
    rig.camera_shift = 1000.0, 0.0, 0.0
    rig.run(6.5)
    # THEN the filter stays where it is
    assert rig.miss_m() < 0.05
    assert {code for kind, code in rig.became() if kind == "pose"} == {"model_fused", "model_gate_position"}
    # AND goes there once position has been lost for 7 s
    rig.run(1.0)
    assert ("pose", "model_reset") in rig.became()
    assert rig.core.output.now.pos[:2] == pytest.approx((1000.0, 0.0), abs=0.1)
    assert rig.report.moved_ne == pytest.approx((1000.0, 0.0), abs=0.1)


@pytest.mark.parametrize(("sources", "down"), [("66666", -5.0), ("66166", 0.0)])
def test_camera_that_tells_of_its_jump_is_followed_at_once(sources: str, down: float) -> None:
    # GIVEN a vehicle at rest
    rig = navigating(sources)
    before = rig.core.state.pos
    # WHEN the camera's frame jumps, and it says so
    rig.camera_shift, rig.reset_ms = (30.0, -40.0, -5.0), rig.now_ms
    rig.run_until(lambda: rig.core.state.pos[0] > 15)
    # THEN state and output go there by as much, height only where it is the camera's, and the same pose is fused
    assert rig.core.state.pos == pytest.approx((30.0, -40.0, down), abs=0.03)  # how far it was off before
    assert rig.core.output.now.pos == pytest.approx((30.0, -40.0, down), abs=0.03)
    assert rig.report.moved_ne == pytest.approx((30.0 - before[0], -40.0 - before[1]), abs=1e-3)
    assert rig.report.pos_ratio == pytest.approx(0.0, abs=1e-9)
    assert ("pose", "model_fused") in rig.became()
    # AND covariance and velocity are as certain as before
    assert max(variances(rig, POS, 2)) < 0.04
    # AND it stays there
    rig.run(0.5)
    assert rig.core.output.now.pos == pytest.approx((30.0, -40.0, down), abs=0.05)


def test_jump_of_a_refused_pose_is_told_by_the_next() -> None:
    rig = seen()
    rig.reset_ms = 7
    rig.camera(30.0, NAN, 0.0)
    rig.run(0.03)
    tell_pose(rig, 30.0, 0.0)
    rig.run(0.2)
    assert rig.core.state.pos[0] == pytest.approx(30.0, abs=0.01)
    # AND the one after that is no jump
    tell_pose(rig, 60.0, 0.0)
    rig.run(0.2)
    assert rig.core.state.pos[0] == pytest.approx(30.0, abs=0.01)


def test_jump_does_not_end_a_timeout() -> None:
    # GIVEN a position that has been lost for 10 s while velocity goes on
    rig = navigating("66166", "velocity", loop_us=SLOW_LOOP_US)
    rig.lose("camera")
    rig.run(10.2)
    assert rig.core.aiding.pos_timeout
    # WHEN the camera comes back with a jump
    rig.reset_ms = 7
    tell_pose(rig, 30.0, -40.0)
    rig.run(0.2)
    # THEN it is followed, and counts as lost all the same
    assert rig.core.state.pos[:2] == pytest.approx((30.0, -40.0), abs=0.1)
    assert rig.core.aiding.pos_timeout


def test_alignment_of_the_camera_to_where_the_filter_is_moves_nothing() -> None:
    # GIVEN a vehicle that navigates; WHEN the camera's frame is moved to it with a new counter
    rig = navigating()
    rig.reset_ms = 7
    rig.run(0.5)
    assert math.hypot(*rig.report.moved_ne) < 0.01
    assert rig.miss_m() < 0.01


# A position that is lost


def lost(**params: float) -> FilterRig:
    """Return a vehicle that has seen nothing for more than 7 s."""
    rig = navigating("66166", loop_us=SLOW_LOOP_US, **params)
    rig.lose("camera")
    rig.skip(7.0)
    rig.lose("baro")
    assert rig.core.timeouts(rig.now_ms) & 3 == 3
    rig.forget()
    return rig


def test_position_that_is_lost_is_reset_to() -> None:
    told, _ = due_pose(lost, 30.0, -40.0)
    assert told.core.state.pos[:2] == (30.0, -40.0)
    assert told.core.output.now.pos[:2] == pytest.approx((30.0, -40.0), abs=0.01)  # it goes on by its velocity
    assert variances(told, POS, 2) == [156.25, 156.25]  # half of EK3_GLITCH_RAD
    assert told.report.moved_ne == pytest.approx((30.0, -40.0), abs=0.3)
    assert (told.report.pos_ratio, told.report.vel_ratio) == (0, 0)
    assert (told.core.aiding.pos_timeout, told.core.aiding.vel_timeout) == (False, False)
    assert told.became() == [("pose", "model_reset")]
    # AND velocity, of which nothing was heard, to rest
    assert told.core.state.vel[:2] == (0.0, 0.0)


def test_velocity_is_reset_with_a_lost_position_and_not_fused_as_well() -> None:
    def tell(rig: FilterRig) -> None:
        rig.velocity(1.0, 2.0, 3.0, err=0.2)
        tell_pose(rig, 30.0, -40.0)

    told, _ = compared(lost, tell, has_pose)
    assert told.core.state.vel[:2] == (1.0, 2.0)
    assert variances(told, VEL, 1)[0] == pytest.approx(0.04)
    assert told.core.aiding.vel_ms == told.now_ms


def drifting(*feeds: str, seconds: float = 10.2) -> FilterRig:
    """Return a vehicle that has seen no position for more than 10 s, but its velocity."""
    rig = navigating("66166", "velocity", *feeds, loop_us=SLOW_LOOP_US)
    rig.lose("camera")
    rig.run(seconds)
    assert rig.core.timeouts(rig.now_ms) & 3 == 1
    rig.lose("baro", "velocity")
    rig.forget()
    return rig


def test_position_is_lost_after_10_s_while_velocity_goes_on() -> None:
    rig = navigating("66166", "velocity", loop_us=SLOW_LOOP_US)
    rig.feeds.discard("camera")
    rig.run(9.5)
    assert rig.core.timeouts(rig.now_ms) & 3 == 0
    rig.run(1.0)
    assert rig.core.timeouts(rig.now_ms) & 3 == 1


def test_position_that_is_lost_is_fused_without_a_gate_while_velocity_passes() -> None:
    told, other = due_pose(drifting, 30.0, -40.0)
    part = weight(variances(other, POS, 1)[0], 0.2)
    assert told.core.state.pos[0] == pytest.approx(30.0 * part, rel=0.02)  # and where it was before
    assert told.report.pos_ratio > 1
    assert told.became() == [("pose", "model_fused")]
    assert told.core.aiding.pos_timeout
    assert told.core.aiding.pos_ms < told.now_ms - 10_000


def test_good_gps_lets_a_lost_position_be_reset_all_the_same() -> None:
    def start() -> FilterRig:
        rig = drifting("gps", seconds=11.0)
        assert rig.core.gps.checks.good
        return rig

    told, _ = due_pose(start, 30.0, -40.0)
    assert told.core.state.pos[:2] == (30.0, -40.0)
    assert not told.core.aiding.pos_timeout


def test_position_stays_lost_when_samples_pass_again() -> None:
    rig = drifting()
    rig.feeds |= {"camera", "velocity"}
    rig.run(1.0)
    assert ("pose", "model_fused") in rig.became()
    assert rig.core.aiding.pos_timeout


@pytest.mark.parametrize(("gps", "silence_s", "is_reset"), [(True, 0.4, False), (True, 1.0, True), (False, 1.0, False)])
def test_position_that_passes_is_reset_to_when_it_was_uncertain_beyond_the_radius_while_gps_is_good(
    gps: bool, silence_s: float, is_reset: bool
) -> None:
    # GIVEN a vehicle whose velocity has never been measured, so that a second makes its position uncertain by 25 m
    def start() -> FilterRig:
        rig = with_gps() if gps else standing("60166", loop_us=SLOW_LOOP_US)
        tell_pose(rig, 0.0, 0.0)
        rig.run_until(lambda: rig.mode == MODE_ABSOLUTE)
        rig.forget()
        rig.feeds.clear()
        rig.run(silence_s)
        return rig

    told, other = due_pose(start, 3.0, 4.0)
    assert (sum(variances(other, POS, 2)) > 25.0**2) is (silence_s == 1.0)
    assert told.report.pos_ratio < 1
    assert (told.core.state.pos[:2] == (3.0, 4.0)) is is_reset
    assert ("pose", "model_reset" if is_reset else "model_fused") in told.became()


def with_gps() -> FilterRig:
    rig = standing("60166", loop_us=SLOW_LOOP_US)
    rig.feeds.add("gps")
    rig.run(10.6)
    assert rig.core.gps.checks.good
    rig.lose("gps")
    rig.run(0.2)  # so that its velocity is not fresh any more
    return rig


# Without a radius


@pytest.mark.parametrize("radius", [0, -1])
def test_without_a_radius_every_position_is_fused_at_full_weight(radius: float) -> None:
    def start() -> FilterRig:
        rig = seen()
        rig.set_param("GLITCH_RAD", radius)
        return rig

    told, other = due_pose(start, 3000.0, 4000.0)
    part = weight(variances(other, POS, 1)[0], 0.2)
    assert told.core.state.pos[:2] == pytest.approx((3000.0 * part, 4000.0 * part), rel=1e-3)
    assert told.report.pos_ratio > 1
    assert told.core.aiding.pos_ms == told.now_ms
    assert told.report.moved_ne == other.report.moved_ne


def test_without_a_radius_a_lost_position_is_reset_to_and_certain() -> None:
    told, _ = due_pose(lambda: lost(GLITCH_RAD=0), 30.0, -40.0)
    assert told.core.state.pos[:2] == (30.0, -40.0)
    assert variances(told, POS, 2) == [0.0, 0.0]
    assert ("pose", "model_reset") in told.became()


# Sources


@pytest.mark.parametrize("source", [0, 3])
def test_pose_is_not_used_while_another_source_is_named(source: int) -> None:
    def start() -> FilterRig:
        rig = seen()
        rig.set_param("SRC1_POSXY", source)
        return rig

    told, other = due_pose(start, 0.5, 0.5)
    assert told.core.state.pos == other.core.state.pos
    assert told.became() == [("pose", "model_unused")]


@pytest.mark.parametrize("other_source", [0, 3])
def test_camera_that_becomes_the_source_again_is_followed_with_its_first_sample(other_source: int) -> None:
    rig = seen()
    rig.set_param("SRC1_POSXY", other_source)
    rig.run(0.1)
    rig.set_param("SRC1_POSXY", 6)
    rig.run(0.03)
    tell_pose(rig, 30.0, -40.0)
    rig.run(0.2)
    assert rig.core.state.pos[:2] == pytest.approx((30.0, -40.0), abs=0.01)
    # AND not with the next
    tell_pose(rig, 60.0, -80.0)
    rig.run(0.2)
    assert rig.core.state.pos[:2] == pytest.approx((30.0, -40.0), abs=0.01)


def test_pose_alone_keeps_aiding_going() -> None:
    rig = navigating("60166", loop_us=SLOW_LOOP_US)
    rig.run(16.0)
    assert (rig.mode, rig.core.aiding.pos_timeout) == (MODE_ABSOLUTE, False)
    # AND velocity does not count as lost, as that needs a position that is
    assert not rig.core.aiding.vel_timeout


# Without aiding


@pytest.mark.parametrize(
    ("armed", "params", "noise"),
    [
        (False, {}, 0.5),
        (True, {}, 10.0),
        (True, {"NOAID_M_NSE": 0.1}, 0.5),
        (True, {"NOAID_M_NSE": 20.0}, 20.0),
        (True, {"NOAID_M_NSE": 100.0}, 50.0),
    ],
)
def test_standing_vehicle_is_held_where_it_was_with_every_height(
    armed: bool, params: dict[str, float], noise: float
) -> None:
    # GIVEN a vehicle that is pushed, and does not navigate
    def start() -> FilterRig:
        rig = standing("66166", **params)
        rig.arm(armed)
        rig.lose("baro")
        rig.accel_bias = [(2.0, 0.0, 0.0)]
        rig.run(0.3)
        rig.accel_bias = [(0.0, 0.0, 0.0)]
        return rig

    # WHEN a height comes
    def tell(rig: FilterRig) -> None:
        rig.core.inputs.set_baro(rig.now_ms, 0.0)

    told, other = compared(start, tell, lambda core: core.height.is_new)
    # THEN it is held to be where it was
    north, variance = other.core.state.pos[0], variances(other, POS, 1)[0]
    assert north > 0.05
    assert told.core.state.pos[0] == pytest.approx(north * (1 - weight(variance, noise)), rel=1e-3)
    assert told.core.aiding.pos_ms == told.now_ms
    # AND the camera's position counts for nothing
    assert told.mode == NO_AIDING


# At rest, in a release that heeds it


def test_vehicle_at_rest_is_held_to_have_no_velocity_where_nothing_tells_it() -> None:
    # GIVEN a vehicle at rest whose velocity nothing has told for a second
    def start() -> FilterRig:
        rig = navigating("60166", loop_us=SLOW_LOOP_US, release=APRIL_2026)
        rig.lose("camera", "baro")
        rig.run(1.0)
        assert rig.core.stillness.is_still
        return rig

    # WHEN a height comes, and with it a position of a large error
    def tell(rig: FilterRig) -> None:
        rig.core.inputs.set_baro(rig.now_ms, 0.0)
        tell_pose(rig, 0.5, 0.0, err=50.0, stamp_ms=rig.now_ms - 50)

    told, other = compared(start, tell, lambda core: core.height.is_new and core.ext_nav.has_pose)
    # THEN rest is fused with an error of 1 m/s, and the position with one of 10 m
    down = -other.core.height.baro_height
    rest = [(VEL + axis, 0.0, 1.0) for axis in range(3)]
    states = reckoned(other, *rest, (POS, 0.5, 100.0), (POS + 1, 0.0, 100.0), (POS + 2, down, 4.0))
    assert told.core.state.vel == pytest.approx(states[VEL : VEL + 3], abs=1e-6)
    assert told.core.state.pos == pytest.approx(states[POS : POS + 3], abs=1e-6)
    assert told.core.aiding.vel_ms == told.now_ms


# A place from elsewhere


def gone() -> FilterRig:
    """Return a vehicle with an origin whose camera has been blind for more than a second."""
    rig = navigating(loop_us=SLOW_LOOP_US)
    rig.lanes.set_origin(HOME)
    rig.lose("camera")
    rig.run(1.2)
    return rig


def test_place_is_taken_when_no_position_has_passed_for_a_second() -> None:
    rig = navigating()
    rig.lanes.set_origin(HOME)
    place = HOME.offset(Vector3f(50, -20, 9))
    rig.feeds.discard("camera")
    rig.run(0.9)
    assert not rig.lanes.set_place(place, 1.0, rig.now_ms)
    rig.run(0.3)
    assert rig.lanes.set_place(place, 1.0, rig.now_ms)
    # A place is told to a centimetre; the vehicle has drifted by its bias since.
    assert rig.core.state.pos == pytest.approx((50, -20, 0), abs=0.05)
    assert rig.core.output.now.pos == pytest.approx((50, -20, 0), abs=0.05)
    assert rig.report.moved_ne == pytest.approx((50, -20), abs=0.05)


@pytest.mark.parametrize(("accuracy_m", "sigma"), [(3.0, 3.0), (0.1, 0.5), (NAN, 0.5)])
def test_place_is_as_uncertain_as_is_said_but_not_less_than_the_parameter(accuracy_m: float, sigma: float) -> None:
    rig = gone()
    assert rig.lanes.set_place(HOME, accuracy_m, rig.now_ms)
    assert variances(rig, POS, 2) == pytest.approx([sigma**2] * 2)


@pytest.mark.parametrize(("age_ms", "ahead_s"), [(1000, 1.0), (0, 0.0), (-500, 0.0), (60_000, 5.0)])
def test_old_place_is_carried_on_by_the_velocity(age_ms: int, ahead_s: float) -> None:
    # GIVEN a vehicle that drives, blind since a second
    rig = navigating("66666", "velocity", loop_us=SLOW_LOOP_US)
    rig.lanes.set_origin(HOME)
    rig.move(2.0, -4.0, 0.0, 1.0)
    rig.lose("camera", "velocity")
    rig.run(1.2)
    vel = rig.core.state.vel
    assert vel == pytest.approx((2.0, -4.0, 0.0), abs=0.05)
    horizon_s = 1e-3 * (rig.now_ms - rig.core.ext_nav.horizon_ms)
    assert rig.lanes.set_place(HOME, 1.0, rig.now_ms - age_ms)
    expected = (ahead_s - horizon_s) * vel[0], (ahead_s - horizon_s) * vel[1]
    assert rig.core.state.pos[:2] == pytest.approx(expected, abs=0.012)  # a place is told to a centimetre


def test_place_needs_an_origin_a_state_and_a_vehicle_that_navigates() -> None:
    rig = navigating(loop_us=SLOW_LOOP_US)
    rig.lose("camera")
    rig.run(1.2)
    assert not rig.lanes.set_place(HOME, 1.0, rig.now_ms)
    for run_s in (0.5, 2.6):
        rig = standing(run_s=run_s)
        rig.lanes.set_origin(HOME)
        assert not rig.lanes.set_place(HOME, 1.0, rig.now_ms)


def test_without_aiding_the_position_is_unknown_until_there_is_an_origin() -> None:
    rig = navigating("60166", loop_us=SLOW_LOOP_US)
    rig.camera_shift, rig.reset_ms = (3.0, 4.0, 0.0), 1
    rig.run(0.5)
    rig.lose("camera")
    rig.skip(15.0)
    rig.run_until(lambda: rig.mode == NO_AIDING)
    assert rig.core.position()[:2] == (0.0, 0.0)
    rig.lanes.set_origin(HOME)
    assert rig.core.position()[:2] == pytest.approx((3.0, 4.0), abs=0.05)


@pytest.mark.parametrize(("fix_type", "is_gps"), [(1, False), (2, True), (3, True)])
def test_without_aiding_the_position_is_the_gpss_if_it_has_a_fix(fix_type: int, is_gps: bool) -> None:
    rig = standing()
    rig.lanes.set_origin(HOME)
    rig.gps, rig.gps_shift = {"fix_type": fix_type}, (30.0, 40.0, 0.0)
    rig.feeds.add("gps")
    rig.one_pass()
    assert rig.core.position()[:2] == pytest.approx((30.0, 40.0) if is_gps else (0.0, 0.0), abs=0.02)


def test_gps_does_not_count_for_the_position_while_aiding() -> None:
    rig = navigating()
    rig.lanes.set_origin(HOME)
    rig.gps_shift = 30.0, 40.0, 0.0
    rig.feeds.add("gps")
    rig.run(0.1)
    assert rig.core.position() == pytest.approx((0, 0, 0), abs=0.05)


def test_position_counts_from_the_origin_that_all_cores_share() -> None:
    rig = navigating()
    rig.lanes.common.place = HOME.offset(Vector3f(-100, 50, 2))
    # As long as the core has none of its own, that is where 0 N, 0 E is.
    from_nowhere = HOME.offset(Vector3f(-100, 50, 2)).distance_ned(Location(0, 0, 0))
    assert rig.core.position()[0] == pytest.approx(float(from_nowhere.x), abs=1.0)
    rig.core.set_origin(HOME)
    assert rig.core.position() == pytest.approx((100, -50, -2), abs=0.05)


def test_poses_count_from_the_origin_that_all_cores_share() -> None:
    # GIVEN a core whose own origin is not the one that another has found first
    rig = seen()
    rig.lanes.common.place = HOME.offset(Vector3f(-1, 0.5, 0))
    # WHEN a pose comes due before it has one of its own, THEN that is as far away as 0 N, 0 E
    tell_pose(rig, 0.0, 0.0)
    rig.run(0.2)
    assert rig.became() == [("pose", "model_gate_position")]
    assert math.hypot(*rig.core.vel_pos.pos_innovation[:2]) > 1e6
    # WHEN one comes due after that, THEN it is as far from its own origin
    rig.core.set_origin(HOME)
    tell_pose(rig, 0.0, 0.0)
    rig.run(0.2)
    assert rig.core.vel_pos.pos_innovation[:2] == pytest.approx((1.0, -0.5), abs=0.05)
