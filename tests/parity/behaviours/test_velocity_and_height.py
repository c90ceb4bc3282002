# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Velocity and height at odds with what is known: behaviours 15 to 19."""

from functools import partial
from typing import TYPE_CHECKING

import pytest

from tests.parity.behaviours.logs import Recordings
from tests.parity.behaviours.parked import Parked
from tests.parity.behaviours.status import (
    AIDING,
    FUSED_AFTER_S,
    HEIGHT_TIMEOUT,
    LOG_S,
    VEL_TIMEOUT,
)

if TYPE_CHECKING:
    from tests.parity.behaviours.conftest import MakeParked

pytestmark = pytest.mark.slow

GAPS_S = (0.8, 2.0, 5.5)
SHORT_GAP_S = 0.3
HEIGHT_STEP_M = 3.0


def test_15_velocity_step_is_rejected_for_ever_without_a_timeout(recordings: Recordings) -> None:
    recording = recordings("2025-07/bench_steps")
    step_s = recording.input("REVH", lambda sample: sample.VX == 15.0)
    back_s = recording.input("REVH", lambda sample: sample.VX == 0.0, step_s)
    assert back_s - step_s > 10.0
    recording.when(lambda log: log.first("XKF4", lambda row: row.SV > 1.0, step_s))
    for log in recording.both:
        ratios = log.values("XKF4", "SV", step_s + FUSED_AFTER_S, back_s)
        assert ratios == [pytest.approx(15.0, rel=0.12)] * len(ratios)
        assert len(set(log.values("XKF3", "IVN", step_s + FUSED_AFTER_S, back_s))) == 1
        assert max(map(abs, log.values("XKF1", "VN", step_s, back_s))) < 0.05
        assert not any(timeouts & VEL_TIMEOUT for timeouts in log.values("XKF4", "TS", step_s))


def test_16_vertical_velocity_alone_is_told_but_never_fused(recordings: Recordings) -> None:
    recording = recordings("2025-07/bench_vertical_velocity_100hz")
    assert {sample.VZ for sample in recording.recorded.rows("REVH")} == {3.0}
    for log in recording.both:
        assert [text for text in log.said() if text.startswith("initial vel")] == [
            "initial vel NED = -0.0,-0.0,3.0 (m/s)"
        ]
        assert set(log.values("XKF4", "SV", 0.0)) == {0.0}
        assert max(map(abs, log.values("XKF1", "VD", log.when(AIDING)))) < 0.01


def test_17_height_step_is_reset_to_after_10_s_with_velocity(recordings: Recordings) -> None:
    recording = recordings("2025-07/bench_steps")
    step_s = recording.input("REPH", lambda sample: sample.PZ == -30.0)
    reset_s = recording.when(lambda log: log.first("XKF1", lambda row: row.PD < -15.0, step_s))
    assert reset_s - step_s == pytest.approx(10.0, abs=FUSED_AFTER_S + LOG_S)
    for log in recording.both:
        rejected = log.values("XKF3", "IPD", step_s + FUSED_AFTER_S, reset_s - LOG_S)
        assert rejected == [pytest.approx(30.0, abs=0.05)] * len(rejected)
        assert min(log.values("XKF4", "SH", step_s + FUSED_AFTER_S, reset_s - LOG_S)) > 1.0
        assert max(map(abs, log.values("XKF1", "PD", step_s, reset_s - LOG_S))) < 0.05
        after = log.values("XKF1", "PD", reset_s)
        assert after == [pytest.approx(-30.0, abs=0.05)] * len(after)
        assert log.value("XKF4", "SH", reset_s + LOG_S) == pytest.approx(0.0, abs=0.05)
        assert log.said(step_s) == []


def test_17_height_step_is_reset_to_after_5_s_without_velocity(make_parked: "MakeParked") -> None:
    parked = make_parked("60606")
    parked.run_to(6.0)
    parked.stream(8.0, parked.pose)
    parked.stream(14.0, lambda: parked.pose(down=-30.0))
    log = parked.log()
    reset_s = log.first("XKF1", lambda row: row.PD < -15.0, 8.0)
    assert reset_s - 8.0 == pytest.approx(5.0, abs=FUSED_AFTER_S + LOG_S)
    rejected = log.values("XKF3", "IPD", 8.0 + FUSED_AFTER_S, reset_s - LOG_S)
    assert rejected == [pytest.approx(30.0, abs=0.05)] * len(rejected)
    assert min(log.values("XKF4", "SH", 8.0 + FUSED_AFTER_S, reset_s - LOG_S)) > 1.0
    after = log.values("XKF1", "PD", reset_s)
    assert after == [pytest.approx(-30.0, abs=0.05)] * len(after)
    assert not any(timeouts & HEIGHT_TIMEOUT for timeouts in log.values("XKF4", "TS", reset_s))


class Gaps:
    """A vehicle whose stream stops again and again, and comes with another height each time.

    Attributes:
        log: its log.
        again_s: when the stream came again, by the length of the gap before.
    """

    def __init__(self, parked: Parked) -> None:
        self.again_s: dict[float, float] = {}
        end_s, down = 8.0, 0.0
        parked.run_to(6.0)
        parked.stream(end_s, parked.pose)
        for gap_s in (*GAPS_S, SHORT_GAP_S):
            again_s = self.again_s[gap_s] = end_s + gap_s
            end_s, down = again_s + 1.0, down - HEIGHT_STEP_M
            parked.run_to(again_s)
            parked.stream(end_s, partial(parked.pose, down=down))
        self.log = parked.log()


@pytest.fixture(scope="module")
def gaps(make_parked: "MakeParked") -> Gaps:
    return Gaps(make_parked("60606"))


@pytest.mark.parametrize("gap_s", GAPS_S)
def test_18_height_after_a_gap_is_stepped_to_with_the_first_sample(gaps: Gaps, gap_s: float) -> None:
    log, again_s = gaps.log, gaps.again_s[gap_s]
    told_m = -HEIGHT_STEP_M * (1 + GAPS_S.index(gap_s))
    assert log.value("XKF1", "PD", again_s) > told_m + 0.9 * HEIGHT_STEP_M
    after_m = log.values("XKF1", "PD", again_s + FUSED_AFTER_S, again_s + 1.0)
    assert after_m == [pytest.approx(told_m, abs=0.05)] * len(after_m)
    assert max(log.values("XKF4", "SH", again_s, again_s + 1.0)) < 0.1
    assert log.said(7.0) == []


def test_18_gap_too_short_for_a_baro_height_leaves_the_gate_in_force(gaps: Gaps) -> None:
    log, again_s = gaps.log, gaps.again_s[SHORT_GAP_S]
    assert min(log.values("XKF4", "SH", again_s + FUSED_AFTER_S)) > 1.0
    heights_m = log.values("XKF1", "PD", again_s - SHORT_GAP_S)
    assert heights_m == [pytest.approx(heights_m[0], abs=0.05)] * len(heights_m)


def test_19_height_is_the_poses_as_aiding_starts_and_then_the_baros_again(recordings: Recordings) -> None:
    recording = recordings("2025-07/bench_pose_baro")
    started_s = recording.when(lambda log: log.when(AIDING))
    back_s = recording.when(lambda log: log.first("XKF1", lambda row: row.PD > 0.0, started_s))
    assert back_s - started_s == pytest.approx(2.0, abs=0.2)
    for log in recording.both:
        assert abs(log.between("XKF1", started_s - LOG_S)[0].PD) < 0.1
        assert log.value("XKF1", "PD", started_s) == pytest.approx(-5.0, abs=0.01)
        assert log.value("XKF1", "PD", started_s + 2.1) == pytest.approx(0.5, abs=0.1)
        # It swings about the height of the barometer, for more than 10 s.
        far_s = [row.t for row in log.between("XKF1", back_s, 35.0) if abs(row.PD) > 0.5]
        assert max(far_s) - started_s > 10.0
        assert abs(log.value("XKF1", "PD", 34.0)) < 0.5
