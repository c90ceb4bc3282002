# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Points in processes of their own, and what happens when one of those dies."""

import multiprocessing
import os
import signal
from contextlib import closing

import pytest

from tests.unit.viso.sweep.conftest import MakePlan
from viso.sweep import processes
from viso.sweep.job import Result, run_point
from viso.sweep.plan import Point, SweepPlan
from viso.sweep.processes import KILLED, default_jobs, run_in_processes

FATAL = 13.0


def dying(plan: SweepPlan, point: Point) -> Result:
    """Stand in for a point whose process is killed; others only say what they are."""
    if point.values == (FATAL,):
        os.kill(os.getpid(), signal.SIGKILL)
    return Result(point.number, {"nis": point.values[0]})


@pytest.mark.slow
def test_processes_give_the_same_figures_each_point_once(plan: SweepPlan) -> None:
    points = list(plan.points())
    results = sorted(run_in_processes(plan, points, 2), key=lambda result: result.number)
    assert results == [run_point(plan, point) for point in points]
    assert all(result.row is not None for result in results)


@pytest.mark.slow
def test_point_that_kills_its_process_costs_no_other(make_plan_of: MakePlan, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(processes, "run_point", dying)
    plan = make_plan_of(set=["VISO_DELAY_MS=0:20:1"])
    results = sorted(run_in_processes(plan, plan.points(), 2), key=lambda result: result.number)
    assert [result.number for result in results] == list(range(21))
    assert [result for result in results if result.row is None] == [Result(13, None, KILLED)]


@pytest.mark.slow
def test_whoever_stops_listening_leaves_no_process(make_plan_of: MakePlan, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(processes, "run_point", dying)
    plan = make_plan_of(set=["VISO_DELAY_MS=0:12:1"])
    before = set(multiprocessing.active_children())
    with closing(run_in_processes(plan, plan.points(), 2)) as results:
        next(results)
    assert set(multiprocessing.active_children()) == before


def test_all_cores_are_used_unless_told_otherwise(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda _pid: {0, 5, 7})
    assert default_jobs() == 3
