# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How often the filter is logged: behaviour 42."""

from itertools import pairwise
from typing import TYPE_CHECKING

import pytest

from tests.parity.behaviours.logs import Log, Recordings

if TYPE_CHECKING:
    from tests.parity.behaviours.conftest import MakeParked

pytestmark = pytest.mark.slow

OF_ALL_CORES = ("XKF1", "XKF2", "XKF3", "XKFS", "XKQ")
OF_PRIMARY = ("XKF5",)
COVARIANCE = ("XKV1", "XKV2")
FAST_ATTITUDE = 1
START_S, END_S = 7.0, 9.0


def rate_hz(log: Log, name: str, core: int = 0) -> float:
    """Return how often a core writes a record, on average."""
    times_s = [row.t for row in log.rows(name, core) if row.t >= START_S]
    return (len(times_s) - 1) / (times_s[-1] - times_s[0]) if len(times_s) > 1 else 0.0


def test_42_estimates_are_logged_at_10_hz_and_variances_every_half_second(
    recordings: Recordings, make_parked: "MakeParked"
) -> None:
    parked = make_parked()
    parked.run_to(END_S)
    for log in (*recordings("2025-07/bench_pose_velocity").both, parked.log()):
        for name in ("XKF4", *OF_ALL_CORES, *OF_PRIMARY):
            assert rate_hz(log, name) == pytest.approx(10.0, abs=0.02)
        for name in COVARIANCE:
            times_s = [row.t for row in log.rows(name) if row.t >= START_S]
            assert [b - a for a, b in pairwise(times_s)] == [pytest.approx(0.5, abs=0.01)] * (len(times_s) - 1)
    ours = recordings("2025-07/bench_pose_velocity").ours
    for log in (ours, parked.log()):
        assert [rate_hz(log, name, core=1) for name in ("XKF4", *OF_ALL_CORES)] == [pytest.approx(10.0, abs=0.02)] * 6
        assert not [name for name in (*OF_PRIMARY, *COVARIANCE) if log.rows(name, core=1)]


def test_42_estimates_are_logged_at_25_hz_with_fast_attitude(make_parked: "MakeParked") -> None:
    parked = make_parked(LOG_BITMASK=180222 | FAST_ATTITUDE)
    parked.run_to(END_S)
    log = parked.log()
    for name in ("XKF4", *OF_ALL_CORES, *OF_PRIMARY):
        assert rate_hz(log, name) == pytest.approx(25.0, abs=0.1)
    times_s = [row.t for row in log.rows("XKV1") if row.t >= START_S]
    assert [b - a for a, b in pairwise(times_s)] == [pytest.approx(0.5, abs=0.03)] * (len(times_s) - 1)


def test_42_log_level_leaves_out_records(make_parked: "MakeParked") -> None:
    parked = make_parked()
    everything = {"XKF4", *OF_ALL_CORES, *OF_PRIMARY, *COVARIANCE}
    for start_s, level, kept in ((6.0, 0, everything), (7.0, 1, {"XKF4"}), (8.0, 2, {"XKF4"}), (9.0, 3, set[str]())):
        parked.run_to(start_s)
        parked.set("EK3_LOG_LEVEL", level)
        parked.run_to(start_s + 1.0)
        log = parked.log()
        logged = {name for name in everything if any(row.t > start_s for row in log.rows(name))}
        assert logged == kept
