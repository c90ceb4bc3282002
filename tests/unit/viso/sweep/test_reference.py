# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""References on the clock of the vehicle, and the error that is measured against them."""

import numpy as np
import pytest

from ekf_stub.ahrs.ahrs_recorded import RecordedStates
from tests.places import DATA
from tests.unit.viso.sweep.conftest import CAPTURE, MakePlan
from viso.errors import InputError
from viso.streams.stream_kinds import TrajectoryOptions
from viso.sweep import reference
from viso.sweep.job import run_point
from viso.sweep.reference import read_reference

FLIGHT = DATA / "trajectories" / "flight.tum"
LOG = DATA / "logs" / "prearm.BIN.xz"
USUAL = TrajectoryOptions()


def test_log_gives_its_own_estimates_by_times_since_boot() -> None:
    truth = read_reference(LOG, CAPTURE, 0, USUAL)
    assert (np.diff(truth.t_ns) > 0).all()
    assert 5e9 < truth.t_ns[0] < truth.t_ns[-1] < 1e12
    assert np.isfinite(truth.positions_xyz).all()


def test_trajectory_is_on_the_streams_clock_if_that_is_one_too() -> None:
    own = read_reference(FLIGHT, FLIGHT, 6_000_000, USUAL)
    assert own.t_ns[0] == 6_000_000_000
    by_boot = read_reference(FLIGHT, CAPTURE, 6_000_000, USUAL)
    assert np.ptp(by_boot.t_ns - own.t_ns) == 0
    assert own.positions_xyz.tolist() == by_boot.positions_xyz.tolist()


def test_reference_without_positions_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    nothing = RecordedStates(np.array([1.0]), np.zeros((1, 3)), np.zeros(0), np.zeros((0, 3)))
    monkeypatch.setattr(reference, "read_recorded_states", lambda _path: nothing)
    with pytest.raises(InputError, match=r"prearm.BIN.xz: a reference without positions"):
        read_reference(LOG, CAPTURE, 0, USUAL)


@pytest.mark.slow
def test_filter_that_follows_a_trajectory_is_near_it(make_plan_of: MakePlan) -> None:
    wishes = {"streams": [FLIGHT], "preset": "voxl", "lead": 6.0, "until": 11.0, "reference": str(FLIGHT)}
    plan = make_plan_of(**wishes, set=["VISO_SCALE=1"], param=["VISO_TYPE=1"], seeds="1,2")
    row = run_point(plan, next(plan.points())).row
    assert row is not None
    assert isinstance(row["ate_m"], float)
    assert row["ate_m"] < 0.2
    assert isinstance(row["ate_poses"], int)
    assert row["ate_poses"] > 20
