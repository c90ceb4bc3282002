# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Points on a Dask cluster, one of whose workers is killed."""

import os
import signal
import sys
from collections import Counter
from typing import Any

import pytest

from tests.unit.viso.sweep.conftest import MakePlan
from viso.errors import InputError
from viso.sweep.cluster import MISSING_EXTRA, run_on_cluster
from viso.sweep.job import run_point
from viso.sweep.plan import SweepPlan

KILLED_AFTER = 3


def pids_of_workers(cluster: Any) -> list[int]:
    return [nanny.process.pid for nanny in cluster.workers.values()]


@pytest.mark.slow
@pytest.mark.filterwarnings("default")  # the cluster's own
def test_no_result_is_lost_or_doubled_when_a_worker_is_killed(make_plan_of: MakePlan) -> None:
    """GIVEN two workers, WHEN one is killed in the middle, THEN each point comes once, as it does on this machine."""
    import distributed

    cluster_of: Any = distributed.LocalCluster
    plan = make_plan_of(set=["VISO_DELAY_MS=0:90:10"])
    points = list(plan.points())
    seen: Counter[int] = Counter()
    with cluster_of(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, host="127.0.0.1"
    ) as cluster:
        results = []
        for result in run_on_cluster(plan, points, cluster.scheduler_address):
            results.append(result)
            seen[result.number] += 1
            if len(results) == KILLED_AFTER:
                os.kill(pids_of_workers(cluster)[0], signal.SIGKILL)
    assert seen == Counter(range(len(points)))
    assert sorted(results, key=lambda result: result.number) == [run_point(plan, point) for point in points]


@pytest.mark.slow
@pytest.mark.filterwarnings("default")
def test_scheduler_that_does_not_answer_is_one_line(plan: SweepPlan, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("viso.sweep.cluster._TIMEOUT_S", 0.1)
    with pytest.raises(InputError, match=r"--scheduler tcp://127\.0\.0\.1:9: no scheduler answers"):
        next(run_on_cluster(plan, plan.points(), "tcp://127.0.0.1:9"))


@pytest.mark.slow
@pytest.mark.filterwarnings("default")
def test_cluster_without_workers_is_one_line(plan: SweepPlan, monkeypatch: pytest.MonkeyPatch) -> None:
    import distributed

    cluster_of: Any = distributed.LocalCluster
    monkeypatch.setattr("viso.sweep.cluster._TIMEOUT_S", 1)
    with (
        cluster_of(n_workers=0, dashboard_address=None, host="127.0.0.1") as cluster,
        pytest.raises(InputError, match="the cluster has no workers"),
    ):
        next(run_on_cluster(plan, plan.points(), cluster.scheduler_address))


@pytest.mark.slow
@pytest.mark.filterwarnings("default")
def test_address_that_is_none_is_one_line(plan: SweepPlan) -> None:
    with pytest.raises(InputError, match="--scheduler nowhere://x: no scheduler answers"):
        next(run_on_cluster(plan, plan.points(), "nowhere://x"))


def test_missing_extra_is_one_line(plan: SweepPlan, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InputError) as error:
        next(run_on_cluster(plan, plan.points(), "tcp://127.0.0.1:9"))
    assert str(error.value) == MISSING_EXTRA
