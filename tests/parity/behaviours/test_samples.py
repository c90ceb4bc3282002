# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Samples on their way into the filter: behaviours 29, 30, 35, 36 and 38."""

import math
from itertools import pairwise
from typing import TYPE_CHECKING

import pytest

from tests.parity.behaviours.logs import Log, Recordings
from tests.parity.behaviours.status import (
    AIDED_SS,
    AIDED_TS,
    AIDING,
    FUSED_AFTER_S,
    LOG_S,
    REJECTED_SS,
    USING_GPS,
)

if TYPE_CHECKING:
    from tests.parity.behaviours.conftest import MakeParked

pytestmark = pytest.mark.slow

STEP_S, LOOP_S = 0.0125, 0.0025
LONGEST_OTHER_DELAY_MS, IMU_PERIOD_MS, HALF_STEP_MS = 60, 12, 6
LOSS_TIMEOUT_S = 0.3


def changes_of_health(log: Log) -> list[tuple[float, int]]:
    """Return the records of the camera's health, of which no two may be alike."""
    rows = [(row.t, row.H) for row in log.rows("RVOH")]
    assert all(before[1] != after[1] for before, after in pairwise(rows))
    return rows


def test_29_reset_counter_at_100_hz_moves_the_position(recordings: Recordings) -> None:
    recording = recordings("2025-07/bench_vertical_velocity_100hz")
    samples = recording.recorded.rows("REPH")
    intervals_ms = [after.TS - before.TS for before, after in pairwise(samples)]
    assert sorted(intervals_ms)[len(intervals_ms) // 2] == 11
    reset_s = recording.input("REPH", lambda sample: sample.RT != 0)
    moved_s = recording.when(lambda log: log.first("XKF4", lambda row: row.OFN > 2.0, 7.0))
    assert moved_s - reset_s < FUSED_AFTER_S + LOG_S
    for log in recording.both:
        assert log.value("XKF4", "OFN", moved_s) == pytest.approx(3.0, abs=0.01)
        assert log.value("XKF1", "PN", moved_s) == pytest.approx(3.5, abs=0.01)


@pytest.mark.parametrize("number", [50, 51])
def test_29_pose_at_100_hz_is_used_every_other_time_and_a_counter_that_is_not_still_acts(
    make_parked: "MakeParked", number: int
) -> None:
    parked = make_parked("60606")
    parked.run_to(7.0)
    sent = 0

    def pose() -> None:
        nonlocal sent
        sent += 1
        parked.pose(3.0 if sent >= number else 0.0, counter=int(sent >= number))

    parked.stream(8.0, pose, rate_hz=100)
    counts = parked.vehicle.ahrs.ext_nav_counts
    assert (counts["pose", "taken"], counts["pose", "too_soon"]) == (50, 50)
    log = parked.log()
    assert len(log.rows("REPH")) == 100
    assert log.rows("REPH")[number - 1].RT > 0 == log.rows("REPH")[number - 2].RT
    reset_s = log.rows("REPH")[number - 1].t
    assert log.value("XKF4", "OFN", reset_s) == pytest.approx(0.0, abs=0.01)
    assert log.value("XKF4", "OFN", reset_s + FUSED_AFTER_S + 0.02) == pytest.approx(3.0, abs=0.01)
    assert log.values("XKF1", "PN", 7.9)[-1] == pytest.approx(3.0, abs=0.01)


def test_30_positions_and_quaternions_that_are_no_numbers_are_logged(recordings: Recordings) -> None:
    recording = recordings("2025-07/bench_vertical_velocity_100hz")
    samples = recording.recorded.rows("REPH")
    assert sum(math.isnan(sample.PX) for sample in samples) > 100
    assert sum(math.isnan(sample.Q1) for sample in samples) > 100
    no_number_s = recording.input("REPH", lambda sample: math.isnan(sample.PX))
    for log in recording.both:
        assert {(row.TS, row.SS) for row in log.between("XKF4", no_number_s)} == {(AIDED_TS, AIDED_SS)}
        rows = log.between("XKF1", no_number_s)
        assert [(row.PN, row.PE, row.Yaw % 359.9) for row in rows] == [pytest.approx((3.5, 0.0, 0.0), abs=0.1)] * len(
            rows
        )
        assert log.said(no_number_s) == []


def test_30_position_that_is_no_number_is_ignored(make_parked: "MakeParked") -> None:
    parked = make_parked("60606")
    parked.run_to(6.0)
    parked.stream(8.0, parked.pose)
    parked.stream(13.5, lambda: parked.pose(math.nan, yaw_deg=1.0))
    log = parked.log()
    ignored = [sample for sample in log.rows("REPH") if math.isnan(sample.PX)]
    assert len(ignored) == 165
    unused_s = log.first("XKF4", lambda row: not row.SS & USING_GPS, 8.0)
    assert unused_s - 8.0 == pytest.approx(4.0, abs=FUSED_AFTER_S + LOG_S)
    assert log.value("XKF4", "SS", unused_s) == REJECTED_SS
    # Nor is the yaw of such a sample used.
    assert max(map(abs, log.values("XKF3", "IYAW", 8.0))) < 0.1
    assert not parked.vehicle.ahrs.using_extnav_for_yaw()


def test_30_quaternion_that_is_no_number_leaves_the_position_in_use(make_parked: "MakeParked") -> None:
    parked = make_parked("60606")
    parked.run_to(6.0)
    parked.stream(8.0, parked.pose)
    assert parked.vehicle.ahrs.using_extnav_for_yaw()
    parked.stream(14.0, lambda: parked.pose(0.5, yaw_deg=math.nan))
    log = parked.log()
    assert {(row.TS, row.SS) for row in log.between("XKF4", 7.0)} == {(AIDED_TS, AIDED_SS)}
    assert log.values("XKF1", "PN", 13.9)[-1] == pytest.approx(0.5, abs=0.1)
    assert log.value("XKF3", "IPN", 8.0 + FUSED_AFTER_S) == pytest.approx(-0.5, abs=0.1)
    assert len(set(log.values("XKF3", "IYAW", 8.0 + FUSED_AFTER_S))) == 1
    assert not parked.vehicle.ahrs.using_extnav_for_yaw()


@pytest.mark.parametrize("delay_ms", [10, 100, 250])
def test_35_delay_of_the_camera_sets_back_the_horizon(make_parked: "MakeParked", delay_ms: int) -> None:
    parked = make_parked(VISO_DELAY_MS=delay_ms)
    parked.run_to(7.0)
    parked.stream(7.3, parked.pose)
    log = parked.log()
    first_s, logged_ms = log.rows("REPH")[0].t, log.rows("REPH")[0].D
    assert logged_ms == delay_ms
    longest_ms = max(LONGEST_OTHER_DELAY_MS, delay_ms)
    horizon_s = (longest_ms // IMU_PERIOD_MS) * STEP_S
    # A pose comes due once the horizon has reached the time of its observation; one that is older, in the next step.
    waits_s = max(horizon_s - 1e-3 * (delay_ms + HALF_STEP_MS), 0.0)
    assert waits_s - LOOP_S < log.when(AIDING) - first_s < waits_s + STEP_S + 2 * LOOP_S
    since_observation_s = log.when(AIDING) - first_s + 1e-3 * delay_ms
    assert since_observation_s == pytest.approx(horizon_s, abs=STEP_S)


def test_35_delay_that_changes_later_changes_no_buffer(make_parked: "MakeParked") -> None:
    parked = make_parked()
    parked.run_to(6.0)
    parked.set("VISO_DELAY_MS", 100)
    parked.run_to(7.0)
    parked.stream(7.3, parked.pose)
    log = parked.log()
    assert log.rows("REPH")[0].D == 100
    # 106 ms before it came: behind the horizon of 62 ms, and therefore fused in the next step.
    assert log.when(AIDING) - log.rows("REPH")[0].t < STEP_S + 2 * LOOP_S


@pytest.mark.parametrize(("counter", "is_reset"), [(0, False), (3, True)])
def test_36_first_counter_that_is_not_zero_counts_as_a_reset(
    make_parked: "MakeParked", counter: int, is_reset: bool
) -> None:
    parked = make_parked()
    parked.run_to(7.0)
    parked.stream(7.2, lambda: parked.pose(counter=counter))
    times = {sample.RT for sample in parked.log().rows("REPH")}
    assert times == ({7000} if is_reset else {0})


def test_38_state_of_the_camera_is_logged_when_its_health_changes(
    recordings: Recordings, make_parked: "MakeParked"
) -> None:
    recorded = changes_of_health(recordings("2025-07/bench_pose_velocity").recorded)
    parked = make_parked()
    parked.run_to(6.0)
    for start_s, end_s in ((6.0, 7.0), (9.0, 10.0)):
        parked.run_to(start_s)
        parked.stream(end_s, parked.pose)
    parked.run_to(12.0)
    ours = changes_of_health(parked.log())
    assert [health for _, health in recorded] == [0, 1, 0, 1]
    assert [health for _, health in ours] == [0, 1, 0, 1, 0]
    # A record without a time of its own: within a tenth of a second.
    last_s = [sample.t for sample in parked.log().rows("REPH") if sample.t < 8.0][-1]
    assert ours[2][0] - last_s == pytest.approx(LOSS_TIMEOUT_S, abs=LOG_S)
    assert [time_s for time_s, _ in (ours[1], ours[3])] == pytest.approx([6.0, 9.0], abs=LOG_S)
