# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""VISION_POSITION_DELTA: behaviours 25 to 28 and 37."""

import math
from typing import TYPE_CHECKING

import pytest

from tests.parity.behaviours.logs import Recordings
from tests.parity.behaviours.parked import Parked
from tests.parity.behaviours.status import (
    FUSED_AFTER_S,
    LOG_S,
    NOT_AIDED_TS,
    PARKED_SS,
    RELATIVE_FLAGS,
    RELATIVE_SS,
    STOPPED,
)

if TYPE_CHECKING:
    from tests.parity.behaviours.conftest import MakeParked

pytestmark = pytest.mark.slow

FUSING, STARTED = "fusing odometry", "started relative aiding"
RATE_HZ = 20
BEGIN_S, OUTLIERS_S, AGREES_S, WRONG_S, AGAIN_S, END_S = 47.0, 49.0, 49.6, 51.0, 57.5, 58.5
OUTLIER_M_S = 9.0
AXIS_Z_OF_GYRO_BIAS = "V12"
GYROS_KNOWN_DEG_S = 0.15
STEP_S = 0.0125


@pytest.fixture(scope="module")
def relative(make_parked: "MakeParked") -> Parked:
    """Return a vehicle at rest that is given odometry once it knows its gyros.

    There are outliers of one axis, then all axes are wrong, then all is well again, then there is silence.
    """
    parked = make_parked("06101", compass=True, VISO_POS_X=0.1, VISO_DELAY_MS=20)
    parked.run_to(BEGIN_S)
    parked.stream(OUTLIERS_S, parked.odometry, rate_hz=RATE_HZ)
    parked.stream(AGREES_S, lambda: parked.odometry(OUTLIER_M_S), rate_hz=RATE_HZ)
    parked.stream(WRONG_S, parked.odometry, rate_hz=RATE_HZ)
    parked.stream(AGAIN_S, lambda: parked.odometry(OUTLIER_M_S, OUTLIER_M_S, OUTLIER_M_S), rate_hz=RATE_HZ)
    parked.stream(END_S, parked.odometry, rate_hz=RATE_HZ)
    parked.run_to(END_S + 6.0)
    return parked


def test_25_odometry_alone_starts_relative_aiding(relative: Parked) -> None:
    log = relative.log()
    assert log.said(40.0, WRONG_S) == [STARTED, FUSING]
    assert BEGIN_S < log.when(STARTED) < log.when(FUSING) < BEGIN_S + 0.1
    aided = log.between("XKF4", BEGIN_S + 2 * LOG_S, WRONG_S)
    assert {(row.TS, row.SS) for row in aided} == {(NOT_AIDED_TS, RELATIVE_SS)}
    assert max(abs(row.OFN) + abs(row.OFE) for row in aided) < 1e-4
    assert set(relative.flags(BEGIN_S + 2 * LOG_S, WRONG_S)) == {RELATIVE_FLAGS}
    assert max(abs(row.PN) + abs(row.PE) for row in log.between("XKF1", BEGIN_S, WRONG_S)) < 0.01


def test_25_odometry_is_fused_before_the_gyros_are_known(recordings: Recordings) -> None:
    recording = recordings("2025-07/bench_odometry")
    first_s = recording.input("RBOH", lambda sample: True)
    assert recording.when(lambda log: log.when(FUSING)) - first_s == pytest.approx(0.046, abs=0.01)
    for log in recording.both:
        assert log.said(first_s) == [FUSING]
        assert {row.SS for row in log.between("XKF4", 6.0)} == {PARKED_SS}


def test_25_relative_aiding_starts_later_once_the_gyros_are_known(
    recordings: Recordings, make_parked: "MakeParked"
) -> None:
    # The firmware, too, knew its gyros as well at this time, but had no odometry any more.
    enough = math.radians(GYROS_KNOWN_DEG_S * STEP_S) ** 2
    known_s = recordings("2025-07/bench_odometry").when(
        lambda log: log.first("XKV2", lambda row: getattr(row, AXIS_Z_OF_GYRO_BIAS) <= enough, 6.0)
    )
    parked = make_parked("06101", compass=True)
    parked.run_to(known_s - 2.0)
    parked.stream(known_s + 1.0, parked.odometry, rate_hz=RATE_HZ)
    log = parked.log()
    assert log.said(35.0) == [FUSING, STARTED]
    assert log.when(FUSING) - (known_s - 2.0) < 0.1
    assert log.when(STARTED) == pytest.approx(known_s, abs=0.6)


def test_26_outliers_of_odometry_are_not_fused(relative: Parked) -> None:
    log = relative.log()
    outliers = log.values("XKFD", "IX", OUTLIERS_S + FUSED_AFTER_S, AGREES_S)
    assert len(outliers) >= 5
    assert outliers == [pytest.approx(-OUTLIER_M_S, abs=0.01)] * len(outliers)
    assert max(map(abs, log.values("XKF1", "VN", OUTLIERS_S, WRONG_S))) < 0.01
    others = log.values("XKFD", "IX", AGREES_S + 2 * LOG_S, WRONG_S)
    assert max(map(abs, others)) < 0.01


def test_27_aiding_stops_5_s_after_the_last_odometry(relative: Parked) -> None:
    log = relative.log()
    last_s = log.rows("RBOH")[-1].t
    # It was fused some 45 ms after it came.
    assert log.when(STOPPED, END_S) - last_s == pytest.approx(5.04, abs=0.03)
    assert {(row.TS, row.SS) for row in log.between("XKF4", END_S + 5.2)} == {(NOT_AIDED_TS, PARKED_SS)}


def test_27_odometry_that_is_rejected_keeps_no_aiding_alive(relative: Parked) -> None:
    log = relative.log()
    accepted_s = [sample.t for sample in log.rows("RBOH") if sample.t < WRONG_S][-1]
    assert log.when(STOPPED) - accepted_s == pytest.approx(5.04, abs=0.03)
    assert log.said(WRONG_S) == [STOPPED, STARTED, FUSING, STOPPED]


def test_28_innovations_of_odometry_are_logged_no_more_often_than_estimates(recordings: Recordings) -> None:
    for log in recordings("2025-07/bench_odometry").both:
        start_s, end_s = (log.rows("XKFD")[i].t for i in (0, -1))
        count, estimates = len(log.rows("XKFD")), len(log.between("XKF1", start_s, end_s))
        assert 0.9 * estimates < count <= estimates
        assert {row.t for row in log.rows("XKFD")} <= {row.t for row in log.rows("XKF4")}
        assert start_s == pytest.approx(20.1, abs=0.15)
        assert end_s == pytest.approx(35.1, abs=0.15)
    for log in recordings("2025-07/bench_pose_velocity").both:
        assert not log.rows("XKFD")


def test_37_offset_and_delay_of_odometry_are_logged_as_zero(recordings: Recordings, relative: Parked) -> None:
    for log in (recordings("2025-07/bench_odometry").recorded, relative.log()):
        assert (log.rows("RVOH")[0].OX, log.rows("RVOH")[0].Del) == (pytest.approx(0.1), 20)
        assert {(sample.OX, sample.OY, sample.OZ, sample.D) for sample in log.rows("RBOH")} == {(0.0, 0.0, 0.0, 0)}
