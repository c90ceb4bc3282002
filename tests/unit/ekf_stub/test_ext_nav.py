# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""External navigation at the filter's door: what is taken, with which time, and what becomes of it inside."""

import math
from collections import Counter

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ekf_stub.core.vectors import cross
from ekf_stub.inputs.ingest_rules import RULES
from tests.unit.ekf_stub.filter_rig import (
    DELAY_MS,
    MODE_ABSOLUTE,
    NAVIGATING,
    NO_AIDING,
    RELATIVE,
    SLOW_LOOP_US,
    USING_POSITION,
    WRAP_US,
    FilterRig,
    navigating,
    standing,
)

NAN, INF = math.nan, math.inf
HALF_STEP_MS = 6
KINDS = ("camera", "velocity", "odometry")
NAMES = {"camera": "pose", "velocity": "velocity", "odometry": "odometry"}


def say(rig: FilterRig, kind: str, stamp_ms: int, delay_ms: int = DELAY_MS) -> str:
    """Let the camera say something; return what becomes of it at once."""
    rig.outcomes.clear()
    rig.outcome_times_ms.clear()
    getattr(rig, kind)(stamp_ms=stamp_ms, delay_ms=delay_ms)
    return rig.outcomes[0][1]


# What is taken


@pytest.mark.parametrize("kind", KINDS)
def test_sample_is_taken(kind: str) -> None:
    rig = standing()
    assert say(rig, kind, rig.now_ms) == "taken"
    assert rig.outcomes[0][0] == NAMES[kind]


@pytest.mark.parametrize(
    ("kind", "rule"), [("camera", "not_initialised"), ("velocity", "taken"), ("odometry", "not_initialised")]
)
def test_only_velocity_is_taken_before_there_is_a_state(kind: str, rule: str) -> None:
    rig = standing(run_s=0.5)
    assert say(rig, kind, rig.now_ms) == rule


@pytest.mark.parametrize("kind", KINDS)
def test_sample_without_a_buffer_is_discarded(kind: str) -> None:
    rig = standing("33131")
    assert say(rig, kind, rig.now_ms) == "no_buffer"


def test_pose_of_which_something_is_no_number_leaves_no_trace() -> None:
    rig = standing()
    for bad in ((NAN, 0.0, 0.0), (0.0, 0.0, NAN)):
        rig.camera(*bad)
    rig.camera(err=NAN)
    assert rig.outcomes == [("pose", "nan")] * 3
    assert not rig.core.ext_nav.have_pose
    assert say(rig, "camera", rig.now_ms) == "taken"  # so that the next does not come too soon


@pytest.mark.parametrize("bad", [{"yaw": NAN}, {"yaw_err": NAN}])
def test_pose_without_a_yaw_gives_its_position_alone(bad: dict[str, float]) -> None:
    rig = standing()
    rig.camera(**bad)
    assert rig.outcomes == [("pose", "taken"), ("yaw", "yaw_nan")]
    rig.run(0.2)
    assert not rig.core.yaw.aligned
    assert ("height", "model_fused") in rig.outcomes


def test_velocity_and_odometry_of_which_something_is_no_number_are_refused() -> None:
    rig = standing()
    rig.velocity(0.0, NAN, 0.0)
    rig.velocity(err=NAN)
    rig.odometry(has_nan=True)
    assert rig.outcomes == [("velocity", "nan"), ("velocity", "nan"), ("odometry", "nan")]
    assert not rig.core.ext_nav.have_velocity


@pytest.mark.parametrize(("del_time", "rule"), [(0.0124, "too_short"), (0.0125, "too_short"), (0.0126, "taken")])
def test_odometry_must_span_a_step(del_time: float, rule: str) -> None:
    # The firmware's step is 0.0125 in single precision, which is a little more.
    rig = standing()
    rig.odometry(del_time=del_time)
    assert rig.outcomes == [("odometry", rule)]


# How often


@pytest.mark.parametrize("kind", ["camera", "velocity"])
@pytest.mark.parametrize(("later_ms", "rule"), [(0, "too_soon"), (19, "too_soon"), (20, "taken")])
@pytest.mark.parametrize("wraps", [False, True])
def test_samples_keep_20_ms_apart_by_their_stamps(kind: str, later_ms: int, rule: str, wraps: bool) -> None:
    rig = standing()
    first_ms = (1 << 32) - 10 if wraps else rig.now_ms
    say(rig, kind, first_ms)
    assert say(rig, kind, first_ms + later_ms) == rule


@pytest.mark.parametrize("kind", ["camera", "velocity"])
@pytest.mark.parametrize("back_ms", [1, 30, 4000])
def test_stamp_that_steps_backwards_is_taken(kind: str, back_ms: int) -> None:
    rig = standing()
    say(rig, kind, rig.now_ms)
    assert say(rig, kind, rig.now_ms - back_ms) == "taken"


def test_refused_sample_does_not_move_the_interval_on() -> None:
    rig = standing()
    for later_ms, rule in ((0, "taken"), (15, "too_soon"), (20, "taken")):
        assert say(rig, "camera", rig.now_ms + later_ms) == rule


@pytest.mark.parametrize(("delay_ms", "later_ms", "rule"), [
    (0, 49, "too_soon"),
    (0, 50, "taken"),
    (10, 39, "too_soon"),
    (10, 40, "taken"),
    (50, 0, "taken"),
])  # fmt: skip
def test_interval_of_odometry_is_shorter_by_its_delay(delay_ms: int, later_ms: int, rule: str) -> None:
    rig = standing()
    say(rig, "odometry", rig.now_ms, delay_ms)
    assert say(rig, "odometry", rig.now_ms + later_ms, delay_ms) == rule


# With which time


@pytest.mark.parametrize(("kind", "by_ms"), [("camera", 30 + HALF_STEP_MS), ("velocity", 30 + 6), ("odometry", 30)])
def test_observation_is_the_stamp_less_delay_and_half_a_step(kind: str, by_ms: int) -> None:
    rig = standing()
    say(rig, kind, rig.now_ms, delay_ms=30)
    assert rig.outcome_times_ms[0] == rig.now_ms - by_ms


@pytest.mark.parametrize("kind", KINDS)
def test_what_comes_late_is_of_the_horizon_but_for_odometry(kind: str) -> None:
    rig = standing()
    rig.step()
    say(rig, kind, rig.now_ms - 1000)
    of_horizon = rig.core.ext_nav.horizon_ms
    assert rig.outcome_times_ms[0] == (rig.now_ms - 1000 - DELAY_MS if kind == "odometry" else of_horizon)
    rig.run(0.05)
    lost = (NAMES[kind], "model_too_old") in rig.outcomes
    assert lost is (kind == "odometry")


def test_sample_from_the_future_waits_and_blocks_those_after_it() -> None:
    rig = navigating(loop_us=SLOW_LOOP_US)
    rig.feeds.discard("camera")
    rig.run(0.2)
    rig.became()
    rig.camera(stamp_ms=rig.now_ms + 1000)
    rig.run(0.1)
    rig.camera()
    rig.run(0.8)
    assert rig.became() == []
    rig.run(0.3)
    assert [outcome for outcome in rig.became() if outcome[0] == "pose"] == [
        ("pose", "model_too_old"),
        ("pose", "model_fused"),
    ]


@pytest.mark.parametrize("kind", ["camera", "velocity"])
def test_stamp_beyond_half_of_the_numbers_is_too_old(kind: str) -> None:
    rig = navigating(loop_us=SLOW_LOOP_US)
    rig.feeds.discard("camera")
    rig.run(0.2)
    rig.became()
    stamp_ms = rig.now_ms + (1 << 31) + 500
    assert say(rig, kind, stamp_ms) == "taken"
    assert rig.outcome_times_ms[0] == stamp_ms - DELAY_MS - HALF_STEP_MS
    rig.run(0.1)
    assert set(rig.became()) - {("yaw", "model_too_old")} == {(NAMES[kind], "model_too_old")}


def test_yaw_error_is_at_least_5_degrees() -> None:
    rig = standing()
    rig.camera(yaw=1.0, yaw_err=0.0)
    rig.run_until(lambda: rig.core.yaw.aligned)
    # The variance of yaw is what it was aligned with.
    assert rig.core.state.look_along_yaw(True) == pytest.approx(math.radians(5) ** 2, rel=0.02)


# What becomes of it inside


def test_full_buffer_gives_up_its_oldest() -> None:
    rig = standing()
    for number in range(6):
        say(rig, "camera", rig.now_ms + 20 * number)
    assert rig.outcomes == [
        ("pose", "model_overwritten"),
        ("pose", "taken"),
        ("yaw", "model_overwritten"),
        ("yaw", "taken"),
    ]
    assert rig.outcome_times_ms[0] == rig.now_ms - DELAY_MS - HALF_STEP_MS


def test_newest_sample_that_comes_due_supersedes_the_others() -> None:
    rig = standing(loop_us=50_000)
    rig.velocity(stamp_ms=rig.now_ms)
    rig.velocity(stamp_ms=rig.now_ms - 20)  # so that both are of the same step
    rig.run(0.4)
    assert rig.became() == [("velocity", "model_superseded"), ("velocity", "model_fused")]


def test_sample_100_ms_behind_the_horizon_is_too_old() -> None:
    rig = standing(loop_us=SLOW_LOOP_US)
    rig.velocity(stamp_ms=rig.now_ms + 30)
    rig.skip(0.5)  # so that the horizon passes it by as much
    rig.run(0.2)
    assert rig.became() == [("velocity", "model_too_old")]


def test_filter_that_begins_anew_forgets_what_waited() -> None:
    # GIVEN samples that wait as a filter without flags restarts
    rig = standing("06166", loop_us=SLOW_LOOP_US)
    while "forced reset" not in rig.texts:
        rig.velocity(1.5)
        rig.run(0.02)
    # THEN they are never heard of again, and the next one comes through
    assert not rig.core.ext_nav.have_velocity
    rig.became()
    rig.run(0.5)
    assert rig.became() == []
    assert not rig.core.ext_nav.have_velocity


@pytest.mark.parametrize("value", [INF, -INF])
def test_infinite_sample_is_told_of_and_not_believed(value: float) -> None:
    rig = navigating()
    before = rig.core.state.pos
    rig.lose("camera")
    rig.became()
    rig.camera(value, 0.0, 0.0, yaw=value)
    rig.velocity(0.0, value, 0.0)
    rig.odometry(0.0, 0.0, value)
    rig.run(0.2)
    outcomes = rig.became()
    assert [kind for kind, code in outcomes if code == "model_not_finite"] == ["yaw", "pose", "velocity", "odometry"]
    assert rig.core.state.pos == pytest.approx(before, abs=0.01)  # it has gone on by its velocity


@pytest.mark.parametrize("kind", ["camera", "velocity", "odometry"])
def test_sample_with_an_infinite_error_is_not_believed(kind: str) -> None:
    rig = navigating()
    rig.lose("camera")
    rig.became()
    getattr(rig, kind)(err=INF)
    rig.run(0.2)
    assert (NAMES[kind], "model_not_finite") in rig.became()


# From the camera to the IMU


@pytest.mark.parametrize("arm", [(0.5, 0.0, 0.1), (-1.0, 2.0, 0.3)])
@pytest.mark.parametrize("attitude", [(0.0, 0.0, 1.5), (0.2, -0.3, -2.5)])
def test_lever_arm_turns_with_the_vehicle(
    arm: tuple[float, float, float], attitude: tuple[float, float, float]
) -> None:
    # GIVEN a vehicle of any attitude, whose camera sees where it itself is
    rig = FilterRig()
    rig.roll, rig.pitch, rig.yaw = attitude
    rig.core.inputs.set_lever_arm(arm)
    rig.camera_shift = rig.in_earth(arm)
    rig.feeds.add("camera")
    rig.run(4.0)
    # THEN the IMU is at the origin
    assert rig.mode == MODE_ABSOLUTE
    assert rig.core.state.pos == pytest.approx((0.0, 0.0, 0.0), abs=0.01 * math.dist(arm, (0, 0, 0)) + 0.01)


def test_camera_away_from_the_imu_sees_velocity_as_the_vehicle_turns() -> None:
    # GIVEN a vehicle that turns on the spot with a camera on its nose, which sees itself going round
    arm, rate = (0.5, 0.0, 0.0), 1.0
    rig = FilterRig(loop_us=10_000)
    rig.core.inputs.set_lever_arm(arm)
    rig.run(2.6)
    rig.yaw_rate = rate
    for _ in range(100):
        x, y, z = rig.in_earth(arm)
        rig.camera(x, y, z, yaw=rig.yaw)
        rig.velocity(*rig.in_earth(cross((0.0, 0.0, rate), arm)))
        rig.run(0.04)
    # THEN the IMU neither moves nor turns otherwise
    assert rig.core.state.vel == pytest.approx((0.0, 0.0, 0.0), abs=0.02)  # seen 16 ms late, at 0.5 m/s
    assert rig.miss_m() < 0.03
    # AND without the lever arm it would
    rig.core.inputs.set_lever_arm((0.0, 0.0, 0.0))
    for _ in range(50):
        x, y, z = rig.in_earth(arm)
        rig.camera(x, y, z, yaw=rig.yaw)
        rig.velocity(*rig.in_earth(cross((0.0, 0.0, rate), arm)))
        rig.run(0.04)
    assert rig.miss_m() > 0.3


# What starts aiding, and what ends it


def test_pose_starts_aiding_one_pass_after_the_step_in_which_it_came_due() -> None:
    rig = standing()
    rig.told()
    rig.camera(1.0, 2.0, -0.5)
    rig.run_until(lambda: rig.core.ext_nav.has_pose)
    assert rig.texts == ["yaw aligned"]
    rig.one_pass()
    assert rig.told() == ["yaw aligned", "is using external nav data", "initial pos NED = 1.0,2.0,-0.5 (m)"]


def test_pose_does_not_start_aiding_before_tilt_is_known() -> None:
    rig = standing(run_s=1.01)
    rig.camera()
    rig.run(0.2)
    assert not rig.core.tilt_aligned
    assert rig.mode == NO_AIDING


def test_velocity_that_was_ever_received_is_told_and_taken_as_aiding_starts() -> None:
    rig = standing("60106")
    for _ in range(5):
        rig.camera()
        rig.velocity(1.0, -0.04, 2.0)
        rig.run(0.04)
    assert rig.told()[-1] == "initial vel NED = 1.0,-0.0,2.0 (m/s)"
    # It has been fused with the same velocity since, and predicted by a vehicle at rest.
    assert rig.core.state.vel[:2] == pytest.approx((1.0, -0.04), abs=0.01)


def test_velocity_that_was_received_but_has_not_come_due_is_told_as_0() -> None:
    rig = standing()
    rig.camera()
    rig.run(0.04)
    rig.velocity(1.0)
    rig.run_until(lambda: rig.mode == MODE_ABSOLUTE)
    assert rig.told()[-1] == "initial vel NED = 0.0,0.0,0.0 (m/s)"


@pytest.mark.parametrize(("silence_s", "timeouts"), [(6.94, 0), (7.04, 3)])
def test_everything_is_lost_after_7_s_of_silence(silence_s: float, timeouts: int) -> None:
    rig = navigating(loop_us=SLOW_LOOP_US)
    rig.lose("camera")
    before_ms = rig.now_ms - rig.core.aiding.pos_ms
    rig.skip(silence_s - 0.001 * before_ms - 0.02)
    rig.run(0.04)
    assert rig.mode == MODE_ABSOLUTE
    assert rig.core.timeouts(rig.now_ms) & 3 == timeouts


@pytest.mark.parametrize(("silence_s", "mode"), [(14.94, MODE_ABSOLUTE), (15.04, NO_AIDING)])
def test_aiding_ends_after_15_s_of_silence(silence_s: float, mode: int) -> None:
    rig = navigating(loop_us=SLOW_LOOP_US)
    rig.lose("camera")
    before_ms = rig.now_ms - rig.core.aiding.pos_ms
    rig.skip(silence_s - 0.001 * before_ms - 0.02)
    rig.run(0.04)
    assert rig.mode == mode
    assert rig.told() == ["stopped aiding"] * (mode == NO_AIDING)


def test_end_of_aiding_holds_the_position_and_puts_height_where_the_barometer_is() -> None:
    # GIVEN a vehicle at a place that only its camera knows, and a barometer that disagrees
    rig = navigating("60166", loop_us=SLOW_LOOP_US)
    rig.camera_shift = 3.0, 4.0, 0.0
    rig.reset_ms = 1
    rig.run(2.0)
    rig.baro_shift = 0.5
    rig.run(0.3)
    # WHEN it has seen nothing for 15 s
    rig.lose("camera")
    rig.skip(15.0)
    rig.run_until(lambda: rig.mode == NO_AIDING)
    # THEN it stays there, velocity counts as lost, and position no more
    assert rig.core.state.pos == pytest.approx((3.0, 4.0, -0.5), abs=0.05)
    assert rig.core.resets.last_known_ne == pytest.approx((3.0, 4.0), abs=0.05)
    assert (rig.core.aiding.pos_timeout, rig.core.aiding.vel_timeout) == (False, True)
    assert (rig.report.pos_ratio, rig.report.vel_ratio) == (0, 0)


def test_position_is_not_used_any_more_4_s_after_the_last() -> None:
    rig = navigating(loop_us=SLOW_LOOP_US)
    rig.lose("camera")
    rig.skip(3.6)
    rig.run(0.04)
    assert rig.core.flags & USING_POSITION
    rig.run(0.4)
    assert rig.core.flags == NAVIGATING & ~USING_POSITION


def test_odometry_and_poses_together_make_aiding_absolute() -> None:
    rig = standing("66101", has_compass=True, run_s=1.1, loop_us=SLOW_LOOP_US)
    rig.feeds.add("odometry")
    rig.run_until(lambda: rig.mode == RELATIVE, 60)
    rig.feeds.add("camera")
    rig.run(0.3)
    assert rig.mode == MODE_ABSOLUTE


# Whatever comes


@pytest.mark.parametrize("kind", ["velocity", "pose", "yaw", "odometry"])
@settings(max_examples=8)
@given(st.lists(st.tuples(st.integers(-40, 400), st.integers(0, 6)), min_size=1, max_size=40))
def test_every_sample_that_is_taken_leaves_once(kind: str, steps: list[tuple[int, int]]) -> None:
    rig = standing(loop_us=SLOW_LOOP_US)
    rig.forget()
    for age_ms, passes in steps:
        getattr(rig, "camera" if kind in ("pose", "yaw") else kind)(stamp_ms=rig.now_ms - age_ms)
        rig.run(0.02 * passes)
    rig.run(0.6)
    taken, left = Counter[int](), Counter[int]()
    for (what, code), time_ms in zip(rig.outcomes, rig.outcome_times_ms, strict=True):
        if what == kind and code == "taken":
            taken[time_ms] += 1
        elif what == kind and code.startswith("model_"):
            left[time_ms] += 1
    assert left == taken


def test_codes_are_unique() -> None:
    codes = [rule.code for rule in RULES]
    assert len(set(codes)) == len(codes)


def test_samples_go_on_across_the_wrap_of_milliseconds() -> None:
    rig = FilterRig(start_us=WRAP_US - 3_000_000, loop_us=SLOW_LOOP_US)
    rig.feeds.add("camera")
    rig.run(6.0)
    assert rig.core.flags == NAVIGATING
    assert {code for kind, code in rig.outcomes if kind == "pose"} <= {
        "not_initialised", "taken", "model_fused", "model_unused", "model_superseded"
    }  # fmt: skip
