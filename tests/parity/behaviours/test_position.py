# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Position that steps, is lost and comes again: behaviours 8, 10 to 14 and 34."""

from itertools import pairwise
from typing import TYPE_CHECKING

import pytest

from tests.parity.behaviours.logs import Log, Recordings
from tests.parity.behaviours.status import (
    AIDED_FLAGS,
    AIDED_SS,
    AIDED_TS,
    AIDING,
    FUSED_AFTER_S,
    LOG_S,
    LOST_TS,
    NOT_AIDED_TS,
    PARKED_SS,
    REPORTED,
    STICKY_FLAGS,
    STICKY_TS,
    USING_GPS,
)

if TYPE_CHECKING:
    from tests.parity.behaviours.conftest import MakeParked

pytestmark = pytest.mark.slow


def timeouts(log: Log, start_s: float, end_s: float) -> list[int]:
    """Return the values of XKF4.TS one after the other."""
    values = log.values("XKF4", "TS", start_s, end_s)
    return [now for before, now in zip([None, *values], values, strict=False) if now != before]


def moves(log: Log, start_s: float, end_s: float) -> list[tuple[float, float]]:
    """Return the resets of position."""
    values = [(row.OFN, row.OFE) for row in log.between("XKF4", start_s, end_s)]
    return [now for before, now in pairwise(values) if now != before]


def test_08_reset_counter_steps_the_position_at_once_and_nothing_else(recordings: Recordings) -> None:
    recording = recordings("2025-07/bench_pose_velocity")
    reset_s = recording.input("REPH", lambda sample: sample.RT != 0)
    assert reset_s == recording.input("REPH", lambda sample: sample.PX == 5.0)
    for log in recording.both:
        assert log.values("XKF1", "PN", reset_s - 1.0, reset_s) == [pytest.approx(1.0, abs=0.01)] * 10
        after = log.between("XKF1", reset_s + FUSED_AFTER_S, reset_s + 5.0)
        assert after[0].t < reset_s + FUSED_AFTER_S + LOG_S
        assert [row.PN for row in after] == [pytest.approx(5.0, abs=0.01)] * len(after)
        assert moves(log, reset_s - 1.0, reset_s + 5.0) == [pytest.approx((4.0, 0.0), abs=0.01)]
        assert {(row.TS, row.SS) for row in log.between("XKF4", reset_s - 1.0, reset_s + 5.0)} == {(AIDED_TS, AIDED_SS)}
        assert max(map(abs, log.values("XKF1", "VN", reset_s - 1.0, reset_s + 5.0))) < 0.01
        assert log.said(reset_s - 1.0, reset_s + 5.0) == []


def test_10_position_step_without_counter_is_reset_to_after_7_s(recordings: Recordings) -> None:
    recording = recordings("2025-07/bench_pose_baro")
    step_s = recording.input("REPH", lambda sample: sample.PX == 30.0)
    unused_s = recording.when(lambda log: log.first("XKF4", lambda row: not row.SS & USING_GPS, step_s))
    reset_s = recording.when(lambda log: log.first("XKF4", lambda row: row.OFN > 20.0, step_s))
    assert unused_s - step_s == pytest.approx(4.0, abs=FUSED_AFTER_S + LOG_S)
    assert reset_s - step_s == pytest.approx(7.0, abs=FUSED_AFTER_S + LOG_S)
    for log in recording.both:
        rejected = log.values("XKF3", "IPN", step_s + FUSED_AFTER_S, reset_s - LOG_S)
        assert rejected == [pytest.approx(-30.0, abs=0.2)] * len(rejected)
        assert min(log.values("XKF4", "SP", step_s + FUSED_AFTER_S, reset_s - LOG_S)) > 1.0
        north = log.values("XKF1", "PN", step_s, reset_s - LOG_S)
        assert north == [pytest.approx(0.0, abs=0.2)] * len(north)
        assert moves(log, step_s, reset_s + 5.0) == [pytest.approx((30.15, -0.15), abs=0.02)]
        assert log.value("XKF1", "PN", reset_s) == pytest.approx(30.0, abs=0.01)
        after = log.values("XKF3", "IPN", reset_s + LOG_S, reset_s + 5.0)
        assert after == [pytest.approx(0.0, abs=0.01)] * len(after)
        assert set(log.values("XKF4", "TS", step_s, reset_s + 5.0)) == {AIDED_TS}
        assert log.said(step_s, reset_s + 5.0) == []


def test_11_position_step_with_velocity_that_agrees_makes_a_timeout_that_stays(recordings: Recordings) -> None:
    recording = recordings("2025-07/bench_pose_velocity")
    step_s = recording.input("REPH", lambda sample: sample.PX == 35.0)
    lost_s = recording.when(lambda log: log.first("XKF4", lambda row: row.TS == STICKY_TS, step_s))
    assert lost_s - step_s == pytest.approx(10.0, abs=FUSED_AFTER_S + LOG_S)
    within_s = recording.when(lambda log: log.first("XKF4", lambda row: row.SP < 1.0, lost_s))
    assert within_s == pytest.approx(74.8, abs=0.1)
    end_s = 81.0
    for log in recording.both:
        assert moves(log, step_s, end_s) == []
        assert log.value("XKF1", "PN", lost_s - LOG_S) == pytest.approx(5.0, abs=0.01)
        assert log.value("XKF1", "PN", lost_s + 1.0) == pytest.approx(27.0, abs=2.0)
        assert log.value("XKF1", "PN", end_s) == pytest.approx(35.0, abs=0.05)
        flags = {(row.TS, row.SS & REPORTED) for row in log.between("XKF4", lost_s, end_s)}
        assert flags == {(STICKY_TS, STICKY_FLAGS)}


def test_12_aiding_stops_15_s_after_everything_is_lost(recordings: Recordings) -> None:
    recording = recordings("2025-07/bench_pose_velocity")
    lost_s = max(sample.t for sample in recording.recorded.rows("REPH") if sample.t < 90.0)
    unused_s = recording.when(lambda log: log.first("XKF4", lambda row: not row.SS & USING_GPS, lost_s))
    velocity_s = recording.when(lambda log: log.first("XKF4", lambda row: row.TS == LOST_TS, lost_s))
    stopped_s = recording.when(lambda log: log.when("stopped aiding"))
    assert unused_s - lost_s == pytest.approx(4.0, abs=FUSED_AFTER_S + LOG_S)
    assert velocity_s - lost_s == pytest.approx(7.0, abs=FUSED_AFTER_S + LOG_S)
    assert stopped_s - lost_s == pytest.approx(15.0, abs=0.1)
    for log in recording.both:
        assert timeouts(log, lost_s, 101.0) == [STICKY_TS, LOST_TS, NOT_AIDED_TS]
        assert set(log.values("XKF4", "SS", stopped_s + LOG_S, 101.0)) == {PARKED_SS}
        assert {(row.OFN, row.OFE) for row in log.between("XKF4", stopped_s, 101.0)} == {(0.0, 0.0)}
        assert {(row.PN, row.PE) for row in log.between("XKF1", stopped_s, 101.0)} == {(0.0, 0.0)}


def test_13_data_that_comes_again_starts_aiding_at_once(recordings: Recordings) -> None:
    recording = recordings("2025-07/bench_pose_velocity")
    again_s = recording.input("REPH", lambda sample: True, 90.0)
    started_s = recording.when(lambda log: log.when(AIDING, 90.0))
    assert started_s - again_s == pytest.approx(0.054, abs=0.0125)
    for log in recording.both:
        assert log.said(again_s) == [
            AIDING,
            "initial pos NED = 35.0,2.0,-0.5 (m)",
            "initial vel NED = 0.0,0.0,0.0 (m/s)",
        ]
        assert log.values("XKF1", "PN", started_s) == [pytest.approx(35.0, abs=0.05)] * len(
            log.between("XKF1", started_s)
        )
        assert log.value("XKF4", "OFN", started_s) == pytest.approx(12.04, abs=0.01)
        settled = {(row.TS, row.SS & REPORTED) for row in log.between("XKF4", started_s + LOG_S)}
        assert settled == {(AIDED_TS, AIDED_FLAGS)}


def test_14_pose_lost_for_12_s_is_reset_to_once(recordings: Recordings) -> None:
    recording = recordings("2025-07/bench_pose_baro")
    lost_s = max(sample.t for sample in recording.recorded.rows("REPH") if sample.t < 40.0)
    again_s = recording.input("REPH", lambda sample: True, 40.0)
    recording.when(lambda log: log.first("XKF4", lambda row: row.TS == LOST_TS, lost_s))
    recording.when(lambda log: log.first("XKF4", lambda row: row.TS == AIDED_TS, again_s))
    for log in recording.both:
        assert timeouts(log, lost_s, again_s + 5.0) == [AIDED_TS, LOST_TS, AIDED_TS]
        assert len(moves(log, lost_s, again_s + 5.0)) == 1
        assert log.value("XKF1", "PN", again_s + FUSED_AFTER_S) == pytest.approx(30.0, abs=0.01)
        assert log.said(lost_s) == []


def test_14_pose_lost_for_8_s_is_reset_to_once(make_parked: "MakeParked") -> None:
    parked = make_parked("60606")
    parked.run_to(6.0)
    parked.stream(8.0, parked.pose)
    parked.run_to(16.0)
    parked.stream(18.0, lambda: parked.pose(3.0, -1.0))
    log = parked.log()
    assert timeouts(log, 7.0, 18.0) == [AIDED_TS, LOST_TS, AIDED_TS]
    assert moves(log, 7.0, 18.0) == [pytest.approx((3.0, -1.0), abs=0.05)]
    assert log.value("XKF1", "PN", 16.0 + FUSED_AFTER_S) == pytest.approx(3.0, abs=0.01)
    assert log.said(7.0) == []


def test_34_without_a_glitch_radius_a_step_is_fused_at_full_gain(recordings: Recordings) -> None:
    recording = recordings("2025-07/bench_glitch_radius_0")
    step_s = recording.input("REPH", lambda sample: sample.PX == 30.0)
    arrived_s = recording.when(lambda log: log.first("XKF1", lambda row: row.PN > 28.0, step_s))
    assert arrived_s - step_s < 1.0
    for log in recording.both:
        assert max(log.values("XKF4", "SP", step_s, step_s + 0.3)) > 10.0
        assert log.value("XKF4", "SP", arrived_s) < 1.0
        assert set(log.values("XKF4", "TS", step_s)) == {AIDED_TS}
        assert moves(log, step_s, step_s + 5.0) == []
        assert log.said(step_s) == []
