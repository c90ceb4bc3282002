# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""One point: the same as ``viso replay`` and ``viso faults`` would give, and never an exception."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ekf_stub.ahrs.ahrs_recorded import RecordedStates
from tests.places import DATA, RECORDED
from tests.unit.viso.command_line import Viso
from tests.unit.viso.sweep.conftest import CAPTURE, UNTIL_S, MakePlan
from viso.errors import InputError
from viso.files.text_files import read_lines
from viso.replay.figures import BY_TIME, OBJECTIVES
from viso.streams.stream_kinds import TrajectoryOptions
from viso.sweep import job
from viso.sweep.job import Result, read_reference, run_point, timeline_of
from viso.sweep.plan import Faults, SweepPlan

FLIGHT = DATA / "trajectories" / "flight.tum"
LOG = RECORDED / "logs" / "prearm.BIN.xz"
USUAL = TrajectoryOptions()
LOSS = "faults: [{kind: loss, probability: 0.5}, {kind: delay, delay_ms: 40}]\nseed: 3\n"


def row_of(plan: SweepPlan, number: int = 0) -> dict[str, float | int | None]:
    result = run_point(plan, list(plan.points())[number])
    assert result.error == ""
    assert result.row is not None
    return result.row


def short(folder: Path, source: Path = CAPTURE) -> Path:
    """Return the part of a capture that these plans replay."""
    first, *lines = (line for _, line in read_lines(source))
    kept = [line for line in lines if (json.loads(line)["arrival_us"] or 0) <= UNTIL_S * 1e6]
    path = folder / "short.jsonl"
    path.write_text("".join([first, *kept]))
    return path


@pytest.fixture
def timeline(tmp_path: Path) -> Path:
    path = tmp_path / "loss.yaml"
    path.write_text(LOSS)
    return path


@pytest.mark.slow
def test_figures_are_those_of_a_replay(make_plan_of: MakePlan, viso: Viso, tmp_path: Path) -> None:
    row = row_of(make_plan_of(set=["VISO_POS_M_NSE=0.2,0.5"]), 1)
    outcome = viso("replay", short(tmp_path), "--ekf", "--param", "VISO_POS_M_NSE=0.5", "--json")
    told = json.loads(outcome.out)
    assert list(row) == [*OBJECTIVES, BY_TIME]
    assert row["texts"] == len(told["texts"])
    innovations = {one["kind"]: one for one in told["innovations"]}
    assert row["tested"] == sum(one["tested"] for one in innovations.values())
    assert row["rms_pose"] == pytest.approx(innovations["pose"]["rms"], abs=1e-6)
    assert row["rms_velocity"] == pytest.approx(innovations["velocity"]["rms"], abs=1e-6)
    assert row["worst_ratio"] == pytest.approx(max(one["worst_ratio"] for one in innovations.values()), abs=1e-4)
    starts_us = [span["start_us"] for span in told["aiding"] if span["mode"] != "none"]
    assert row["time_to_aiding_s"] == pytest.approx(starts_us[0] * 1e-6)
    fused = sum(one["count"] for one in told["filter"] if one["outcome"] in ("fused", "reset"))
    of_use = sum(one["count"] for one in told["filter"] if one["outcome"] != "unused")
    assert row["accepted_share"] == 1.0
    assert row["fused_share"] == fused / of_use


@pytest.mark.slow
def test_faults_are_those_of_viso_faults(make_plan_of: MakePlan, viso: Viso, timeline: Path, tmp_path: Path) -> None:
    row = row_of(make_plan_of(faults=[str(timeline)]))
    assert viso("faults", short(tmp_path), "-o", "faulty.jsonl", "--timeline", timeline).code == 0
    again = row_of(make_plan_of(streams=[tmp_path / "faulty.jsonl"]))
    assert row == again
    assert row != row_of(make_plan_of())


@pytest.mark.slow
def test_seeds_and_fields_of_faults_change_what_happens(make_plan_of: MakePlan, tmp_path: Path) -> None:
    (tmp_path / "loss.yaml").write_text("faults: [{kind: loss}]")
    faults, values = [str(tmp_path / "loss.yaml")], ["faults.1.probability=0,0.5"]
    plan = make_plan_of(faults=faults, set=values, seeds="3,4")
    none, half, _, other = (row_of(plan, number) for number in range(4))
    assert none["messages"] == row_of(make_plan_of())["messages"]
    assert half != other
    assert all(0 < (row["messages"] or 0) < (none["messages"] or 0) for row in (half, other))


@pytest.mark.slow
def test_the_timelines_own_seed_counts_where_none_is_given(make_plan_of: MakePlan, timeline: Path) -> None:
    assert row_of(make_plan_of(faults=[str(timeline)])) == row_of(make_plan_of(faults=[str(timeline)], seeds="3"))


@pytest.mark.slow
def test_sensor_noise_follows_the_seed(make_plan_of: MakePlan) -> None:
    plan = make_plan_of(set=["VISO_DELAY_MS=0"], seeds="0,1", imu="bench", imu_error=["accel_noise_m_s2_rthz=0.5"])
    assert row_of(plan, 0)["nis"] != row_of(plan, 1)["nis"]


def test_file_that_has_changed_is_told_and_not_replayed(make_plan_of: MakePlan, tmp_path: Path) -> None:
    path = short(tmp_path)
    plan = make_plan_of(streams=[path])
    path.write_text(path.read_text() + "\n")
    result = run_point(plan, next(plan.points()))
    assert result == Result(0, None, f"{path}: not the file that the sweep was begun with")


def test_worker_of_another_version_is_refused(plan: SweepPlan) -> None:
    result = run_point(replace(plan, code="0.0.0"), next(plan.points()))
    assert result.row is None
    assert result.error.endswith("the sweep was defined with 0.0.0")


def test_bug_in_one_point_is_told_like_any_failure(plan: SweepPlan, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(job, "run_replay", lambda *_args, **_named: 1 / 0)
    assert run_point(plan, next(plan.points())) == Result(0, None, "ZeroDivisionError: division by zero")


def test_without_a_filter_there_are_no_figures_of_one(plan: SweepPlan) -> None:
    log = Path(str(CAPTURE).replace("captures/mav.jsonl.gz", "logs/prearm.BIN.xz"))
    recorded = replace(plan.recordings[0], ahrs=str(log))
    row = row_of(replace(plan, recordings=(recorded,)))
    assert (row["nis"], row["fused_share"], row["time_to_aiding_s"]) == (None, None, None)
    assert row["accepted_share"] == 1.0


@pytest.mark.parametrize(("values", "complaint"), [
    ({"faults.3.delay_ms": 1.0}, "loss: faults.3.delay_ms: there are 2 entries"),
    ({"faults.1.delay_ms": 1.0}, "loss: entry 1 (loss): delay_ms: unknown field"),
    ({"faults.1.probability": 2.0}, "loss: entry 1 (loss): probability: 2 is not within 0 to 1"),
])  # fmt: skip
def test_field_that_does_not_fit_is_one_line(values: dict[str, float], complaint: str) -> None:
    with pytest.raises(InputError) as error:
        timeline_of(Faults("loss", LOSS), values)
    assert str(error.value).startswith(complaint)


# References on the clock of the vehicle, and the error that is measured against them


def test_log_gives_its_own_estimates_by_times_since_boot() -> None:
    truth = read_reference(LOG, CAPTURE, 0, USUAL)
    assert (np.diff(truth.times_ns) > 0).all()
    assert 5e9 < truth.times_ns[0] < truth.times_ns[-1] < 1e12
    assert np.isfinite(truth.positions).all()


def test_trajectory_is_on_the_streams_clock_if_that_is_one_too() -> None:
    own = read_reference(FLIGHT, FLIGHT, 6_000_000, USUAL)
    assert own.times_ns[0] == 6_000_000_000
    by_boot = read_reference(FLIGHT, CAPTURE, 6_000_000, USUAL)
    assert np.ptp(by_boot.times_ns - own.times_ns) == 0
    assert own.positions.tolist() == by_boot.positions.tolist()


def test_reference_without_positions_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    nothing = RecordedStates(np.ones(1), np.zeros((1, 3)), np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3)), math.inf)
    monkeypatch.setattr(job, "read_recorded_states", lambda _path: nothing)
    with pytest.raises(InputError, match=r"prearm.BIN.xz: a reference without positions"):
        read_reference(LOG, CAPTURE, 1, USUAL)


@pytest.mark.slow
def test_filter_that_follows_a_trajectory_is_near_it(make_plan_of: MakePlan) -> None:
    request = {"streams": [FLIGHT], "preset": "voxl", "lead": 6.0, "until": 11.0, "reference": str(FLIGHT)}
    plan = make_plan_of(**request, set=["VISO_SCALE=1"], param=["VISO_TYPE=1"], seeds="1,2")
    row = run_point(plan, next(plan.points())).row
    assert row is not None
    assert isinstance(row["ate_m"], float)
    assert row["ate_m"] < 0.2
    assert isinstance(row["ate_poses"], int)
    assert row["ate_poses"] > 20
