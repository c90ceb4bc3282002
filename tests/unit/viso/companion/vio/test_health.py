# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The health of a strategy: each row of its table, each limit to the last digit, and whatever may come."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from viso.companion.vio.config import VioConfig
from viso.companion.vio.health import GROWTH_FRAMES, FrameFacts, Growth, HealthMachine
from viso.companion.vio.imu import IMU_EMPTY, IMU_GAP
from viso.companion.vio.types import VioState

INIT, TRACKING, DEGRADED, LOST = VioState.INIT, VioState.TRACKING, VioState.DEGRADED, VioState.LOST

USUAL = Growth(trace_m2=1.0, age_s=0.5)
GOOD = FrameFacts(inliers=100, coverage=0.8, mre_px=0.5, growth=USUAL)
INITIAL = replace(GOOD, initialised=True)
NO_MODEL = replace(GOOD, has_model=False)
FEW = replace(GOOD, inliers=29)

DEGRADING: dict[str, dict[str, Any]] = {
    "few_inliers": {"inliers": 29},
    "low_coverage": {"coverage": math.nextafter(0.25, 0)},
    "high_mre": {"mre_px": math.nextafter(3.0, 4)},
    "innovation_ratio": {"innovation_ratio": math.nextafter(4.0, 5)},
    "unsure_position": {"position_sigma_m": math.nextafter(20.0, 21)},
    "unsure_velocity": {"velocity_sigma_m_s": math.nextafter(1.0, 2)},
    "imu_gap": {"imu_fault": IMU_GAP},
    "scale_unobserved": {"scale_unobserved": True},
}
AT_THE_LIMIT: dict[str, Any] = {
    "inliers": 30,
    "coverage": 0.25,
    "mre_px": 3.0,
    "innovation_ratio": 4.0,
    "position_sigma_m": 20.0,
    "velocity_sigma_m_s": 1.0,
}
LOSING: dict[str, dict[str, Any]] = {
    "too_few_inliers": {"inliers": 7},
    "no_model": {"has_model": False},
    "innovation_refused": {"innovation_refused": True},
    "non_finite": {"is_finite": False},
    "imu_empty": {"imu_fault": IMU_EMPTY},
}


class Rig:
    """A machine and its transitions."""

    def __init__(self, limits: VioConfig | None = None) -> None:
        self.transitions: list[tuple[VioState, VioState, str]] = []
        self.machine = HealthMachine(limits or VioConfig(), lambda *change: self.transitions.append(change))

    def feed(self, *frames: FrameFacts, t_ns: int = 0) -> VioState:
        for facts in frames:
            self.machine.feed(facts, t_ns)
        return self.machine.state


def tracking(limits: VioConfig | None = None) -> Rig:
    rig = Rig(limits)
    rig.feed(INITIAL)
    rig.transitions.clear()
    return rig


def degraded() -> Rig:
    rig = tracking()
    rig.feed(FEW)
    rig.transitions.clear()
    return rig


def lost(limits: VioConfig | None = None, *, at_ns: int = 0) -> Rig:
    rig = tracking(limits)
    rig.feed(*[NO_MODEL] * 9, t_ns=at_ns)
    rig.transitions.clear()
    return rig


def test_new_machine_is_in_init() -> None:
    assert Rig().machine.snapshot().state is INIT


def test_good_frames_alone_do_not_leave_init() -> None:
    assert Rig().feed(*[GOOD] * 20) is INIT


def test_init_says_what_it_waits_for() -> None:
    rig = Rig()
    rig.feed(GOOD)
    assert rig.machine.snapshot().reason == "waiting for stillness or a warm start"


def test_static_initialisation_leaves_init() -> None:
    assert Rig().feed(INITIAL) is TRACKING


@pytest.mark.parametrize(("good_frames", "state"), [(1, INIT), (2, TRACKING)])
def test_warm_start_leaves_init_after_two_good_frames(good_frames: int, state: VioState) -> None:
    rig = Rig()
    rig.machine.warm_start()
    assert rig.feed(*[GOOD] * good_frames) is state


@pytest.mark.parametrize(("inliers", "state"), [(29, INIT), (30, TRACKING)])
def test_good_frame_after_warm_start_has_min_tracked_inliers(inliers: int, state: VioState) -> None:
    rig = Rig()
    rig.machine.warm_start()
    assert rig.feed(*[replace(GOOD, inliers=inliers)] * 2) is state


@pytest.mark.parametrize("change", LOSING.values(), ids=LOSING)
def test_lost_frame_is_no_good_one_after_warm_start(change: dict[str, Any]) -> None:
    rig = Rig()
    rig.machine.warm_start()
    assert rig.feed(GOOD, replace(GOOD, **change), GOOD) is INIT


def test_frame_that_leaves_init_is_judged_too() -> None:
    rig = Rig()
    assert rig.feed(replace(INITIAL, scale_unobserved=True)) is DEGRADED
    assert [change[:2] for change in rig.transitions] == [(INIT, TRACKING), (TRACKING, DEGRADED)]


@pytest.mark.parametrize(("reason", "change"), DEGRADING.items(), ids=DEGRADING)
def test_each_condition_degrades(reason: str, change: dict[str, Any]) -> None:
    rig = tracking()
    rig.feed(replace(GOOD, **change))
    assert rig.transitions == [(TRACKING, DEGRADED, reason)]


@pytest.mark.parametrize(("field", "value"), AT_THE_LIMIT.items())
def test_limit_itself_does_not_degrade(field: str, value: Any) -> None:
    assert tracking().feed(replace(GOOD, **{field: value})) is TRACKING


@pytest.mark.parametrize(
    "field", ["coverage", "mre_px", "innovation_ratio", "position_sigma_m", "velocity_sigma_m_s", "growth"]
)
def test_nan_degrades(field: str) -> None:
    change: dict[str, Any] = {field: Growth(math.nan, 0.5) if field == "growth" else math.nan}
    assert tracking().feed(replace(GOOD, **change)) is DEGRADED


def test_bounds_of_sigmas_are_configured() -> None:
    rig = tracking(VioConfig(max_velocity_sigma_m_s=2.0, max_position_sigma_m=5.0))
    assert rig.feed(replace(GOOD, velocity_sigma_m_s=1.9, position_sigma_m=4.9)) is TRACKING
    assert rig.feed(replace(GOOD, position_sigma_m=5.1)) is DEGRADED


@pytest.mark.parametrize(("reason", "change"), LOSING.items(), ids=LOSING)
def test_single_lost_frame_degrades_and_counts(reason: str, change: dict[str, Any]) -> None:
    rig = tracking()
    rig.feed(replace(GOOD, **change))
    health = rig.machine.snapshot()
    assert (health.state, health.consecutive_lost, health.reason) == (DEGRADED, 1, reason)


def test_eight_inliers_are_not_lost() -> None:
    rig = tracking()
    rig.feed(replace(GOOD, inliers=8))
    assert rig.machine.snapshot().consecutive_lost == 0


class TestGrowth:
    """The variance of the translation since the keyframe, against those of the last 50 frames in TRACKING."""

    def usual(self, *growths: Growth, count: int = GROWTH_FRAMES) -> Rig:
        rig = tracking()
        rig.feed(*[replace(GOOD, growth=growth) for growth in growths for _ in range(count)])
        return rig

    def feed(self, rig: Rig, trace_m2: float, age_s: float = 0.5, depth_m: float = 1.0) -> VioState:
        return rig.feed(replace(GOOD, growth=Growth(trace_m2, age_s, depth_m)))

    @pytest.mark.parametrize(("trace_m2", "state"), [(4.0, TRACKING), (math.nextafter(4.0, 5), DEGRADED)])
    def test_four_times_the_median_is_the_limit(self, trace_m2: float, state: VioState) -> None:
        assert self.feed(self.usual(USUAL), trace_m2) is state

    @pytest.mark.parametrize(("trace_m2", "state"), [(16.0, TRACKING), (math.nextafter(16.0, 17), DEGRADED)])
    def test_older_keyframe_lets_it_grow_with_time(self, trace_m2: float, state: VioState) -> None:
        assert self.feed(self.usual(USUAL), trace_m2, age_s=2.0) is state

    def test_young_keyframe_has_the_noise_of_an_old_one(self) -> None:
        assert self.feed(self.usual(USUAL), 4.0, age_s=0.05) is TRACKING

    @pytest.mark.parametrize(("trace_m2", "state"), [(400.0, TRACKING), (math.nextafter(400.0, 401), DEGRADED)])
    def test_twice_the_depth_is_known_half_as_well(self, trace_m2: float, state: VioState) -> None:
        assert self.feed(self.usual(USUAL), trace_m2, depth_m=10.0) is state

    @pytest.mark.parametrize(("sigma_m", "state"), [(0.049, TRACKING), (0.051, DEGRADED)])
    def test_what_is_known_well_has_not_grown_too_much(self, sigma_m: float, state: VioState) -> None:
        assert self.feed(self.usual(Growth(1e-6, 0.5)), sigma_m**2) is state

    def test_smoother_whose_keyframes_age_is_not_degraded(self) -> None:
        rig = tracking()
        ages = [0.1 * number for number in range(1, 11)] * 10
        assert {self.feed(rig, 0.3 * age_s, age_s) for age_s in ages} == {TRACKING}

    def test_nothing_is_usual_before_50_frames(self) -> None:
        rig = self.usual(USUAL, count=GROWTH_FRAMES - 2)  # and the one that left INIT
        assert self.feed(rig, 100.0) is TRACKING

    def test_the_last_50_frames_count(self) -> None:
        assert self.feed(self.usual(USUAL, Growth(3.9, 0.5)), 15.0) is TRACKING

    def test_degraded_frames_do_not_count(self) -> None:
        rig = self.usual(USUAL)
        rig.feed(*[replace(FEW, growth=Growth(3.9, 0.5))] * GROWTH_FRAMES)
        assert self.feed(rig, 5.0) is DEGRADED
        assert rig.feed(GOOD, GOOD) is DEGRADED

    def test_frame_that_cannot_be_compared_is_passed_over(self) -> None:
        rig = self.usual(USUAL)
        assert rig.feed(*[replace(GOOD, growth=None)] * GROWTH_FRAMES) is TRACKING
        assert self.feed(rig, 4.1) is DEGRADED

    def test_warm_start_begins_anew(self) -> None:
        rig = self.usual(USUAL)
        rig.machine.warm_start()
        assert rig.feed(*[replace(GOOD, growth=Growth(100.0, 0.5))] * 2) is TRACKING


@pytest.mark.parametrize(("clear_frames", "state"), [(2, DEGRADED), (3, TRACKING)])
def test_three_clear_frames_end_degraded(clear_frames: int, state: VioState) -> None:
    assert degraded().feed(*[GOOD] * clear_frames) is state


def test_clear_frames_must_follow_each_other() -> None:
    assert degraded().feed(GOOD, GOOD, FEW, GOOD, GOOD) is DEGRADED


def test_degraded_keeps_its_reason_while_it_clears() -> None:
    rig = degraded()
    rig.feed(GOOD)
    assert rig.machine.snapshot().reason == "few_inliers"


@pytest.mark.parametrize("make", [tracking, degraded])
@pytest.mark.parametrize("change", LOSING.values(), ids=LOSING)
def test_lost_on_the_ninth_lost_frame(make: Callable[[], Rig], change: dict[str, Any]) -> None:
    rig = make()
    frame = replace(GOOD, **change)
    assert rig.feed(*[frame] * 8) is DEGRADED
    assert rig.feed(frame) is LOST
    assert rig.machine.snapshot().consecutive_lost == 9


def test_lost_frames_of_several_kinds_add_up() -> None:
    frames = [replace(GOOD, **change) for change in LOSING.values()] * 2
    assert tracking().feed(*frames[:9]) is LOST


def test_lost_frames_must_follow_each_other() -> None:
    assert tracking().feed(*[NO_MODEL] * 8, FEW, *[NO_MODEL] * 8) is DEGRADED


def test_lost_frames_fatal_is_a_limit() -> None:
    assert tracking(VioConfig(lost_frames_fatal=1)).feed(NO_MODEL) is LOST


def test_nothing_but_a_warm_start_ends_lost() -> None:
    rig = lost()
    assert rig.feed(*[INITIAL] * 20) is LOST
    rig.machine.warm_start()
    assert rig.transitions == [(LOST, INIT, "warm_start")]


def test_auto_reinit_is_off() -> None:
    assert not lost().machine.auto_reinit(10**18)


@pytest.mark.parametrize(("after_ns", "due"), [(1_999_999_999, False), (2_000_000_000, True)])
def test_auto_reinit_when_due(after_ns: int, due: bool) -> None:
    rig = lost(VioConfig(auto_reinit_s=2.0), at_ns=5_000)
    assert rig.machine.auto_reinit(5_000 + after_ns) is due
    assert rig.machine.state is (INIT if due else LOST)


def test_auto_reinit_wants_stillness() -> None:
    rig = Rig(VioConfig(auto_reinit_s=2.0))
    rig.machine.warm_start()
    rig.machine.fail("broken", 0)
    rig.machine.auto_reinit(2_000_000_000)
    assert rig.feed(*[GOOD] * 5) is INIT


def test_auto_reinit_only_from_lost() -> None:
    rig = tracking(VioConfig(auto_reinit_s=2.0))
    assert not rig.machine.auto_reinit(10**18)


def test_failure_is_lost_at_once() -> None:
    rig = tracking()
    rig.machine.fail("broken", 0)
    assert rig.transitions == [(TRACKING, LOST, "broken")]
    assert rig.machine.snapshot().consecutive_lost == 1


def test_second_failure_changes_nothing() -> None:
    rig = lost()
    before = rig.machine.snapshot()
    rig.machine.fail("broken", 0)
    assert rig.machine.snapshot() is before


def test_snapshot_tells_the_bias() -> None:
    rig = tracking()
    rig.feed(replace(GOOD, bias_norm=0.25))
    assert rig.machine.snapshot().bias_norm == 0.25


def test_leaving_init_for_the_first_time_is_no_reset() -> None:
    assert tracking().machine.resets == 0


def test_warm_start_in_flight_is_one_reset() -> None:
    rig = tracking()
    rig.machine.warm_start()
    assert rig.machine.resets == 0  # nothing is told before INIT is left
    rig.feed(GOOD, GOOD)
    assert rig.machine.resets == 1


ANY = st.one_of(st.floats(0, 5), st.floats())
FRAMES = st.builds(
    FrameFacts,
    inliers=st.sampled_from([0, 7, 8, 29, 30, 100]),
    coverage=st.sampled_from([0.0, 0.24, 0.25, 1.0, math.nan]),
    mre_px=ANY,
    growth=st.one_of(
        st.none(), st.builds(Growth, trace_m2=ANY, age_s=st.floats(1e-3, 1e3), depth_m=st.floats(0.1, 1e3))
    ),
    position_sigma_m=st.one_of(st.none(), ANY),
    velocity_sigma_m_s=st.one_of(st.none(), ANY),
    innovation_ratio=ANY,
    imu_fault=st.sampled_from([None, None, None, IMU_GAP, IMU_EMPTY]),
    has_model=st.sampled_from([True, True, False]),
    innovation_refused=st.sampled_from([False, False, True]),
    is_finite=st.sampled_from([True, True, False]),
    scale_unobserved=st.sampled_from([False, False, True]),
    initialised=st.sampled_from([False, False, True]),
)
ALLOWED = {
    (INIT, TRACKING),
    (TRACKING, DEGRADED),
    (DEGRADED, TRACKING),
    (TRACKING, LOST),
    (DEGRADED, LOST),
    (LOST, INIT),
    (INIT, LOST),  # by a failure
    (TRACKING, INIT),  # by a warm start
    (DEGRADED, INIT),  # by a warm start
}


class AnyFlight(RuleBasedStateMachine):
    """Whatever a strategy says: only known transitions, each told once, counters in step with the state."""

    def __init__(self) -> None:
        super().__init__()
        self.rig = Rig(VioConfig(lost_frames_fatal=3, auto_reinit_s=1.0))
        self.state = INIT
        self.t_ns = 0

    @rule(facts=st.one_of(FRAMES, st.sampled_from([GOOD, INITIAL, NO_MODEL, FEW])), count=st.integers(1, 4))
    def feed(self, facts: FrameFacts, count: int) -> None:
        for _ in range(count):
            self.t_ns += 100_000_000
            told = self.rig.machine.feed(facts, self.t_ns)
            health = self.rig.machine.snapshot()
            assert told == (health.state, health.reason)

    @rule()
    def warm_start(self) -> None:
        self.rig.machine.warm_start()
        assert self.rig.machine.state is INIT

    @rule()
    def fail(self) -> None:
        self.rig.machine.fail("broken", self.t_ns)
        assert self.rig.machine.state is LOST

    @rule(wait_ns=st.integers(0, 2_000_000_000))
    def auto_reinit(self, wait_ns: int) -> None:
        self.t_ns += wait_ns
        was = self.rig.machine.state
        if self.rig.machine.auto_reinit(self.t_ns):
            assert (was, self.rig.machine.state) == (LOST, INIT)

    @invariant()
    def each_change_is_told_once(self) -> None:
        for old, new, reason in self.rig.transitions:
            assert old is self.state
            assert (old, new) in ALLOWED
            assert reason
            self.state = new
        self.rig.transitions.clear()
        assert self.rig.machine.state is self.state

    @invariant()
    def lost_frames_fit_the_state(self) -> None:
        health = self.rig.machine.snapshot()
        if health.state in (INIT, TRACKING):
            assert health.consecutive_lost == 0
        elif health.state is DEGRADED:
            assert health.consecutive_lost < 3
        else:
            assert 1 <= health.consecutive_lost <= 3


TestAnyFlight = AnyFlight.TestCase
TestAnyFlight.settings = settings(stateful_step_count=30)
