# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What happens 4, 7, 10 and 15 s after a loss or a jump, row by row; and the worked example as a whole."""

from collections.abc import Callable
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import pytest

from tests.parity.behaviours.logs import Log, Recording, Recordings
from tests.parity.behaviours.parked import Parked
from tests.parity.behaviours.status import (
    AIDED_FLAGS,
    AIDED_SS,
    AIDED_TS,
    FUSED_AFTER_S,
    LOG_S,
    LOST_TS,
    NOT_AIDED_TS,
    PARKED_SS,
    REJECTED_SS,
    REPORTED,
    STICKY_FLAGS,
    STICKY_REJECTED_SS,
    STICKY_SS,
    STICKY_TS,
    STOPPED,
    USING_GPS,
    VEL_TIMEOUT,
)

if TYPE_CHECKING:
    from tests.parity.behaviours.conftest import MakeParked

pytestmark = pytest.mark.slow

LOST_S = 8.0
LOST_SS = 0x10027  # a vehicle so near the ground keeps the flag of velocity, as flow is zero there


def situations(log: Log, start_s: float, end_s: float) -> list[tuple[float, int, int]]:
    """Return when XKF4.TS or SS change, since ``start_s``, and to what."""
    rows = log.between("XKF4", start_s, end_s)
    changes = [b for a, b in zip([None, *rows], rows, strict=False) if a is None or (a.TS, a.SS) != (b.TS, b.SS)]
    return [(row.t - start_s, row.TS, row.SS) for row in changes]


def assert_timeline(log: Log, start_s: float, end_s: float, *expected: tuple[float, int, int]) -> None:
    """Assert what follows what, and when: logged no later than a period after it happened in a step."""
    found = situations(log, start_s, end_s)
    assert [(timeouts, hex(status)) for _, timeouts, status in found] == [(ts, hex(ss)) for _, ts, ss in expected]
    late_s = [found_s - expected_s for (found_s, *_), (expected_s, *_) in zip(found, expected, strict=True)]
    assert all(-0.01 < late < FUSED_AFTER_S + LOG_S for late in late_s), late_s


def lose_everything(parked: Parked, *send: Callable[[], None]) -> Log:
    parked.run_to(6.0)
    parked.stream(LOST_S, *send)
    parked.run_to(LOST_S + 17.0)
    return parked.log()


def test_timeline_of_poses_that_are_lost(make_parked: "MakeParked") -> None:
    parked = make_parked("60606")
    log = lose_everything(parked, parked.pose)
    assert_timeline(
        log,
        LOST_S,
        LOST_S + 16.5,
        (0.0, AIDED_TS, AIDED_SS),
        (4.0, AIDED_TS, REJECTED_SS),
        (7.0, LOST_TS, LOST_SS),
        (15.0, NOT_AIDED_TS, PARKED_SS),
    )
    assert log.said(LOST_S) == [STOPPED]
    assert log.when(STOPPED) - LOST_S == pytest.approx(15.0, abs=0.1)


def test_timeline_of_poses_and_velocities_that_are_lost_for_12_s(recordings: Recordings) -> None:
    recording = recordings("2025-07/dropout")
    samples = recording.recorded.rows("REPH")
    lost_s, again_s = next((a.t, b.t) for a, b in pairwise(samples) if b.t - a.t > 10.0)
    assert again_s - lost_s == pytest.approx(12.1, abs=0.1)
    both_timelines(
        recording,
        lost_s,
        again_s,
        (0.0, AIDED_TS, AIDED_SS),
        (4.0, AIDED_TS, REJECTED_SS),
        (7.0, LOST_TS, STICKY_REJECTED_SS),
    )


def test_timeline_of_poses_and_velocities_that_are_lost(make_parked: "MakeParked") -> None:
    parked = make_parked("66666")
    log = lose_everything(parked, parked.pose, parked.velocity)
    assert_timeline(
        log,
        LOST_S,
        LOST_S + 16.5,
        (0.0, AIDED_TS, AIDED_SS),
        (4.0, AIDED_TS, REJECTED_SS),
        (7.0, LOST_TS, STICKY_REJECTED_SS),
        (15.0, NOT_AIDED_TS, PARKED_SS),
    )
    assert log.said(LOST_S) == [STOPPED]
    assert log.when(STOPPED) - LOST_S == pytest.approx(15.0, abs=0.1)


def both_timelines(recording: Recording, start_s: float, end_s: float, *expected: tuple[float, int, int]) -> None:
    for log in recording.both:
        assert_timeline(log, start_s, end_s, *expected)
    ours, recorded = (situations(log, start_s, end_s) for log in recording.both)
    assert ours == [pytest.approx(change, abs=0.25) for change in recorded]


def test_timeline_of_a_position_jump_of_poses_alone(recordings: Recordings) -> None:
    recording = recordings("2025-07/bench_pose_baro")
    jump_s = recording.input("REPH", lambda sample: sample.PX == 30.0)
    both_timelines(
        recording,
        jump_s,
        jump_s + 12.0,
        (0.0, AIDED_TS, AIDED_SS),
        (4.0, AIDED_TS, REJECTED_SS),
        (7.0, AIDED_TS, AIDED_SS),
    )


def test_timeline_of_a_position_jump_while_velocity_passes(recordings: Recordings) -> None:
    recording = recordings("2025-07/bench_pose_velocity")
    jump_s = recording.input("REPH", lambda sample: sample.PX == 35.0)
    both_timelines(
        recording,
        jump_s,
        81.0,
        (0.0, AIDED_TS, AIDED_SS),
        (4.0, AIDED_TS, REJECTED_SS),
        (10.0, STICKY_TS, STICKY_REJECTED_SS),
        (13.65, STICKY_TS, STICKY_SS),
    )


def test_timeline_of_a_height_jump_shows_in_no_status(recordings: Recordings) -> None:
    recording = recordings("2025-07/bench_steps")
    jump_s = recording.input("REPH", lambda sample: sample.PZ == -30.0)
    both_timelines(recording, jump_s, jump_s + 12.0, (0.0, STICKY_TS, STICKY_SS))
    reset_s = recording.when(lambda log: log.first("XKF1", lambda row: row.PD < -15.0, jump_s))
    assert reset_s - jump_s == pytest.approx(10.0, abs=FUSED_AFTER_S + LOG_S)


def test_timeline_of_a_velocity_jump_shows_in_no_status(recordings: Recordings) -> None:
    recording = recordings("2025-07/bench_steps")
    jump_s = recording.input("REVH", lambda sample: sample.VX == 15.0)
    both_timelines(recording, jump_s, jump_s + 12.0, (0.0, STICKY_TS, STICKY_SS))
    for log in recording.both:
        assert min(log.values("XKF4", "SV", jump_s + FUSED_AFTER_S, jump_s + 11.9)) > 10.0


def test_worked_example(recordings: Recordings) -> None:
    recording = recordings("2025-07/bench_pose_velocity")

    def said(text: str, since_s: float = 0.0) -> float:
        return recording.when(lambda log: log.when(text, since_s))

    def status(is_so: Callable[[Any], bool], since_s: float) -> float:
        return recording.when(lambda log: log.first("XKF4", is_so, since_s))

    assert recording.recorded.rows("REPH")[0].t == 25.085
    times_s = [
        said("initialised"),
        said("tilt alignment complete"),
        said("yaw aligned"),
        said("is using external nav data"),
        status(lambda row: not row.SS & USING_GPS, 61.0),
        status(lambda row: row.TS == STICKY_TS, 61.0),
        status(lambda row: row.SP < 1.0, 71.0),
        status(lambda row: not row.SS & USING_GPS, 81.0),
        status(lambda row: bool(row.TS & VEL_TIMEOUT), 81.0),
        said(STOPPED),
        said("is using external nav data", 90.0),
    ]
    told_s = [4.454, 5.777, 25.142, 25.144, 65.15, 71.15, 74.8, 85.15, 88.15, 96.13, 101.15]
    assert times_s == pytest.approx(told_s, abs=0.06)
    for log in recording.both:
        assert log.value("XKF4", "OFN", 25.145) == pytest.approx(1.01, abs=0.005)
        assert log.value("XKF1", "PN", 55.149) == pytest.approx(5.0, abs=0.005)
        assert log.value("XKF4", "OFN", 55.2) == pytest.approx(4.0, abs=0.005)
        assert log.value("XKF4", "SP", 61.2) == pytest.approx(20.7, rel=0.02)
        assert {row.SS & REPORTED for row in log.between("XKF4", 71.2, 81.0)} == {STICKY_FLAGS}
        assert {(row.TS, row.OFN) for row in log.between("XKF4", 96.2, 101.0)} == {(NOT_AIDED_TS, 0.0)}
        assert {row.PN for row in log.between("XKF1", 96.2, 101.0)} == {0.0}
        glide = (log.value("XKF1", "PD", 96.14), log.value("XKF1", "PD", 96.74))
        assert glide == pytest.approx((-0.47, -0.10), abs=0.01)
        assert log.value("XKF4", "TS", 101.2) == AIDED_TS
        assert log.value("XKF4", "SS", 101.2) & REPORTED == AIDED_FLAGS
        assert log.value("XKF4", "OFN", 101.2) == pytest.approx(12.04, abs=0.005)
        assert log.value("XKF1", "PN", 101.2) == pytest.approx(35.0, abs=0.05)
