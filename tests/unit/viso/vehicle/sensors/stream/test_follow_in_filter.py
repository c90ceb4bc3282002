# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The filter, given a stream and the sensors of a vehicle that follows it: recorded streams, streams with defects."""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from ekf_stub.reports import CoreReport
from tests.dfreader import read_log
from tests.places import RECORDED
from tests.unit.viso.vehicle.sensors.conftest import LEVEL, LOOP_US, FilterLoop, Three, Wxyz, yawed
from viso.vehicle.sensors.source import ImuOptions
from viso.vehicle.sensors.stream.follow import FollowSource

if TYPE_CHECKING:
    from tests.unit.viso.vehicle.sensors.conftest import MakeLoop

LOGS = RECORDED / "logs"
POSE_US = 33_333
FIRST_POSE_US = 1_000_000
EVENT_S = 8.0
COMPASS, NO_SOURCE = 1, 0
POS_TIMEOUT, VEL_TIMEOUT = 1, 2
NOT_AIDED, AIDED = 50, 48
"""Bits of XKF4.TS, and its values with no airspeed and no drag."""
USING_POSITION = 1 << 13

MARK: Three = (1.0, 2.0, -0.5)

Stream = Callable[[float], tuple[Three, Wxyz] | None]


def at_mark(_t: float) -> tuple[Three, Wxyz]:
    return MARK, LEVEL


def moved(way: Three, from_s: float = EVENT_S) -> Stream:
    """Return a stream that stands, and stands elsewhere from a time on."""
    there = MARK[0] + way[0], MARK[1] + way[1], MARK[2] + way[2]
    return lambda t: (MARK if t < from_s else there, LEVEL)


def silent(start_s: float, end_s: float, then: Stream = at_mark) -> Stream:
    """Return a stream that stops for a while."""
    return lambda t: None if start_s <= t < end_s else (at_mark if t < start_s else then)(t)


def feed(
    loop: FilterLoop,
    stream: Stream,
    until_s: float,
    *,
    velocity: Callable[[float], Three] | None = None,
    reset_s: float = math.inf,
    age_ms: int = 10,
) -> FilterLoop:
    """Run with a stream of 30 Hz, whose samples are honest about their age."""
    next_pose_us = FIRST_POSE_US
    while loop.now_us < round(1e6 * until_s):
        loop.run_pass()
        if loop.now_us < next_pose_us:
            continue
        next_pose_us += POSE_US
        observed_s = 1e-6 * loop.now_us - 1e-3 * age_ms
        sample, stamp_ms = stream(observed_s), round(1e3 * observed_s)
        if sample is None:
            continue
        loop.tell_pose(*sample, stamp_ms=stamp_ms, delay_ms=0, reset_ms=1 if observed_s >= reset_s else 0)
        if velocity is not None:
            loop.tell_velocity(velocity(observed_s), stamp_ms=stamp_ms, delay_ms=0)
    return loop


def nowhere(_t: float) -> Three:
    return 0.0, 0.0, 0.0


def count(loop: FilterLoop, text: str) -> int:
    return sum(said.startswith(text) for _, said in loop.texts)


def horizontal(report: CoreReport) -> float:
    return math.hypot(*report.pos_innovation[:2])


@pytest.fixture
def follow() -> FollowSource:
    return FollowSource(ImuOptions())


class TestRecordedStream:
    """Streams that the firmware was given, in flights and on the ground, without their inertial data."""

    def play(self, name: str, make_loop: "MakeLoop", heading_deg: float) -> tuple[FilterLoop, FollowSource]:
        records = read_log(LOGS / f"{name}.BIN.xz", external_navigation)
        params = {record.Name: record.Value for _, record in records if record.get_type() == "PARM"}
        source = FollowSource(ImuOptions(math.radians(heading_deg), lambda: True))
        loop = make_loop(source, has_compass=True, **params)
        for now_us, record in records:
            while loop.now_us + LOOP_US <= now_us:
                loop.run_pass()
            take(loop, record)
        return loop, source

    @pytest.mark.slow
    def test_flight_is_fused_without_rejections(self, make_loop: "MakeLoop") -> None:
        loop, source = self.play("flight_t265", make_loop, 0.0)
        reports = loop.between(15.0)
        assert count(loop, "is using external nav data") == 1
        assert count(loop, "stopped aiding") == 0
        assert max(report.pos_ratio for report in reports) < 0.1**2
        assert max(report.vel_ratio for report in reports) < 1.0
        assert np.sqrt(np.mean([horizontal(report) ** 2 for report in reports])) < 0.03
        # The driver has turned the stream to the vehicle's heading once.
        assert source.jumps == {"yaw": 1}

    @pytest.mark.slow
    def test_jump_behind_a_reset_is_rejected_as_it_was_in_flight(self, make_loop: "MakeLoop") -> None:
        loop, _ = self.play("flight_voxl_reset", make_loop, 0.0)
        before, after = loop.between(15.0, 54.5), loop.between(54.8, 56.0)
        assert max(report.pos_ratio for report in before) < 0.1**2
        assert [horizontal(report) for report in after] == pytest.approx([5.5] * len(after), abs=0.1)
        assert math.sqrt(max(report.pos_ratio for report in after)) == pytest.approx(3.9, abs=0.1)

    @pytest.mark.slow
    def test_silences_of_1_4_and_12_s_are_survived(self, make_loop: "MakeLoop") -> None:
        loop, source = self.play("dropout", make_loop, 4.0)
        assert count(loop, "is using external nav data") == 1
        assert max(report.pos_ratio for report in loop.between(10.0)) < 1.0
        assert not source.jumps


def external_navigation(log: Any) -> list[tuple[int, Any]]:
    """Return parameters, calls of external navigation and what tells of arming, with the time of each."""
    records: list[tuple[int, Any]] = []
    now_us = 0
    while (record := log.recv_msg()) is not None:
        kind = record.get_type()
        if kind == "RFRH":
            now_us = record.TimeUS
        elif kind in ("PARM", "REPH", "REVH", "RFRN"):
            records.append((now_us, record))
    return records


def take(loop: FilterLoop, record: Any) -> None:
    kind = record.get_type()
    if kind == "REPH":
        pos, quat = (record.PX, record.PY, record.PZ), (record.Q1, record.Q2, record.Q3, record.Q4)
        loop.tell_pose(pos, quat, stamp_ms=record.TS, delay_ms=record.D, reset_ms=record.RT)
    elif kind == "REVH":
        loop.tell_velocity((record.VX, record.VY, record.VZ), stamp_ms=record.TS, delay_ms=record.D)
    elif kind == "RFRN":
        loop.armed = bool(record.Flags & 1)


class TestMovingCamera:
    """A stream without defects: 3 m/s, turns of 1 m/s^2, the noise of a camera."""

    @pytest.mark.slow
    @pytest.mark.parametrize("has_velocity", [pytest.param(False, marks=pytest.mark.slow), True])
    def test_innovations_stay_far_from_the_gates(
        self, make_loop: "MakeLoop", follow: FollowSource, has_velocity: bool
    ) -> None:
        rng = np.random.default_rng(3)
        radius, speed = 9.0, 3.0

        def phase(t: float) -> float:
            since = max(0.0, t - EVENT_S)
            return speed / radius * (since - 3.0 * (1.0 - math.exp(-since / 3.0)))

        def stream(t: float) -> tuple[Three, Wxyz]:
            north, east = radius * math.sin(phase(t)), radius * (1.0 - math.cos(phase(t)))
            x, y, z = np.add((north, east, 0.0), 0.01 * rng.standard_normal(3))
            return (x, y, z), yawed(math.degrees(phase(t)) + 0.2 * rng.standard_normal())

        def velocity(t: float) -> Three:
            rate = 1000.0 * (phase(t) - phase(t - 0.001))
            return radius * rate * math.cos(phase(t)), radius * rate * math.sin(phase(t)), 0.0

        loop = make_loop(follow)
        feed(loop, stream, 25.0, velocity=velocity if has_velocity else None)
        assert [text for _, text in loop.texts if not text.startswith("initial ")] == [
            "initialised",
            "tilt alignment complete",
            "yaw aligned",
            "is using external nav data",
        ]
        reports = loop.between(7.0)
        assert max(horizontal(report) for report in reports) < 0.2
        assert max(report.pos_ratio for report in reports) < 0.1
        assert max(report.vel_ratio for report in reports) < 0.2
        assert max(report.yaw_ratio for report in reports) < 0.1
        assert not follow.jumps


class TestDefect:
    """What the filter makes of streams with a defect: as on a vehicle that does not move as they say."""

    def test_jump_with_reset_counter_moves_the_position_at_once(
        self, make_loop: "MakeLoop", follow: FollowSource
    ) -> None:
        loop = feed(make_loop(follow), moved((4.0, 0.0, 0.0)), EVENT_S + 2.0, reset_s=EVENT_S)
        after = loop.at(EVENT_S + 0.2)
        assert after.pos_ned[0] == pytest.approx(5.0, abs=0.01)
        assert after.moved_ne == pytest.approx((4.0, 0.0), abs=0.01)
        assert after.timeouts == AIDED
        assert after.vel_ned[0] == pytest.approx(0.0, abs=0.001)
        assert max(horizontal(report) for report in loop.between(EVENT_S)) < 0.01

    @pytest.mark.slow
    def test_jump_of_30_m_without_counter_is_rejected_for_7_s_then_believed(
        self, make_loop: "MakeLoop", follow: FollowSource
    ) -> None:
        loop = feed(make_loop(follow), moved((30.0, 0.0, 0.0)), EVENT_S + 9.0)
        rejected = loop.between(EVENT_S + 0.1, EVENT_S + 6.9)
        assert {round(report.pos_innovation[0], 2) for report in rejected} == {-30.0}
        assert min(report.pos_ratio for report in rejected) > 1.0
        assert loop.at(EVENT_S + 3.9).flags & USING_POSITION
        assert not loop.at(EVENT_S + 4.2).flags & USING_POSITION
        believed = loop.at(EVENT_S + 7.3)
        assert believed.moved_ne[0] == pytest.approx(30.0, abs=0.01)
        assert believed.pos_innovation[0] == pytest.approx(0.0, abs=0.01)
        assert believed.timeouts == AIDED

    @pytest.mark.slow
    def test_yaw_step_on_the_ground_slews_the_yaw(self, make_loop: "MakeLoop", follow: FollowSource) -> None:
        loop = feed(make_loop(follow), lambda t: (MARK, yawed(90.0 if t > EVENT_S else 0.0)), EVENT_S + 6.0)
        first = loop.at(EVENT_S + 0.2)
        assert math.degrees(first.yaw_innovation) == pytest.approx(-90.0, abs=2.0)
        assert math.sqrt(first.yaw_ratio) == pytest.approx(2.6, abs=0.1)
        yaws = [math.degrees(report.rpy_rad[2]) for report in loop.between(EVENT_S + 0.2)]
        assert np.diff(yaws).min() > 0.0
        assert np.diff(yaws).max() < 5.0

    @pytest.mark.slow
    def test_velocity_step_is_rejected_for_ever(self, make_loop: "MakeLoop", follow: FollowSource) -> None:
        loop = feed(
            make_loop(follow), at_mark, EVENT_S + 6.0, velocity=lambda t: (15.0 if t > EVENT_S else 0.0, 0.0, 0.0)
        )
        after = loop.between(EVENT_S + 0.2)
        assert [math.sqrt(report.vel_ratio) for report in after] == pytest.approx([15.5] * len(after), abs=1.5)
        assert {report.timeouts for report in after} == {AIDED}
        assert max(abs(report.vel_ned[0]) for report in after) < 0.01

    @pytest.mark.slow
    def test_silence_of_1_s_changes_nothing(self, make_loop: "MakeLoop", follow: FollowSource) -> None:
        loop = feed(make_loop(follow), silent(EVENT_S, EVENT_S + 1.0), EVENT_S + 3.0)
        assert {report.timeouts for report in loop.between(6.0)} == {AIDED}
        assert loop.reports[-1][1].pos_ned == pytest.approx(MARK, abs=0.01)

    @pytest.mark.slow
    def test_silence_of_8_s_ends_in_a_reset(self, make_loop: "MakeLoop", follow: FollowSource) -> None:
        again = EVENT_S + 8.0
        loop = feed(make_loop(follow), silent(EVENT_S, again, moved((0.0, 3.0, 0.0), again)), EVENT_S + 10.0)
        lost = POS_TIMEOUT | VEL_TIMEOUT
        assert loop.at(EVENT_S + 6.8).timeouts == AIDED
        assert loop.at(EVENT_S + 7.3).timeouts == AIDED | lost
        after = loop.at(again + 0.2)
        assert after.timeouts == AIDED
        assert after.moved_ne == pytest.approx((0.0, 3.0), abs=0.05)
        assert count(loop, "stopped aiding") == 0

    @pytest.mark.slow
    def test_silence_of_20_s_ends_aiding_until_the_stream_comes_again(
        self, make_loop: "MakeLoop", follow: FollowSource
    ) -> None:
        again = EVENT_S + 20.0
        loop = feed(make_loop(follow), silent(EVENT_S, again), again + 1.0, velocity=nowhere)
        [stopped_s] = [time_s for time_s, text in loop.texts if text == "stopped aiding"]
        assert stopped_s == pytest.approx(EVENT_S + 15.0, abs=0.1)
        assert loop.at(EVENT_S + 16.0).timeouts == NOT_AIDED
        assert count(loop, "is using external nav data") == 2
        assert loop.at(again + 0.5).pos_ned == pytest.approx(MARK, abs=0.02)

    @pytest.mark.slow
    def test_stream_later_than_the_horizon_is_fused_late(self, make_loop: "MakeLoop", follow: FollowSource) -> None:
        # It is moved to the horizon, some 60 ms ago, and by then a vehicle of 2 m/s is 0.4 m further.
        loop = feed(
            make_loop(follow),
            lambda t: ((2.0 * max(0.0, t - EVENT_S), 0.0, 0.0), LEVEL),
            EVENT_S + 8.0,
            age_ms=260,
            velocity=lambda t: (2.0 if t > EVENT_S else 0.0, 0.0, 0.0),
        )
        now_s, report = loop.reports[-1]
        behind_m = 2.0 * (now_s - EVENT_S) - report.pos_ned[0]
        assert behind_m == pytest.approx(2.0 * (0.260 - 0.065), abs=0.06)

    @pytest.mark.slow
    @pytest.mark.parametrize(
        ("yaw_deg", "least_m", "most_m"), [(0.0, 0.0, 0.15), pytest.param(90.0, 0.5, 5.0, marks=pytest.mark.slow)]
    )
    def test_yaw_at_odds_with_the_compass_shows_as_the_vehicle_moves(
        self, make_loop: "MakeLoop", yaw_deg: float, least_m: float, most_m: float
    ) -> None:
        source = FollowSource(ImuOptions(has_compass=lambda: True))
        loop = make_loop(source, has_compass=True, EK3_SRC1_YAW=COMPASS, EK3_SRC1_VELXY=NO_SOURCE)

        def stream(t: float) -> tuple[Three, Wxyz]:
            return (3.0 - 3.0 * math.cos(0.6 * max(0.0, t - EVENT_S)), 0.0, 0.0), yawed(yaw_deg)

        feed(loop, stream, EVENT_S + 10.0)
        assert max(horizontal(report) for report in loop.between(6.0, EVENT_S)) < 0.01
        assert least_m <= max(horizontal(report) for report in loop.between(EVENT_S)) < most_m
