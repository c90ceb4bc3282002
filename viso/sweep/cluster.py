# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Works the points of a sweep out on a Dask distributed cluster."""

import importlib
import uuid
from collections.abc import Generator, Iterable
from itertools import islice
from typing import Any, Final

from viso.errors import InputError
from viso.extras import pip_install
from viso.sweep.job import Result, run_point
from viso.sweep.plan import Point, SweepPlan

MISSING_EXTRA: Final = f"--scheduler: a cluster needs Dask distributed; install it with: {pip_install('cluster')}"

_TIMEOUT_S: Final = 10
_WAITING: Final = 4
"""Points handed out for each thread of the cluster."""
_LEAST_WAITING: Final = 16


def run_on_cluster(plan: SweepPlan, points: Iterable[Point], address: str) -> Generator[Result]:
    """Yield the outcome of each point, as soon as it is done.

    Workers read the files of the plan at the same paths. The scheduler gives the points of a worker that is lost to
    others. A result that was lost with its worker is worked out again, and comes to the same figures. Raises InputError
    if the extra is missing, nothing answers at the scheduler's address, or nobody works there.
    """
    distributed = _distributed()
    try:
        client = distributed.Client(address, timeout=_TIMEOUT_S, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        raise InputError(f"--scheduler {address}: no scheduler answers: {error}") from error
    with client:
        _wait_for_workers(client, address)
        waiting, room = iter(points), _room(client)
        numbers: dict[Any, int] = {}
        keys = f"viso-sweep-{uuid.uuid4().hex}"

        def hand_out(count: int) -> list[Any]:
            futures = []
            for point in islice(waiting, count):
                future = client.submit(run_point, plan, point, key=f"{keys}-{point.number}", pure=False)
                numbers[future.key] = point.number
                futures.append(future)
            return futures

        finished = distributed.as_completed(hand_out(room), loop=client.loop)
        for future in finished:
            yield _result_of(future, numbers.pop(future.key))
            finished.update(hand_out(1))


def _distributed() -> Any:
    # By name: parts of it have no types.
    try:
        return importlib.import_module("distributed")
    except ImportError as error:
        raise InputError(MISSING_EXTRA) from error


def _wait_for_workers(client: Any, address: str) -> None:
    try:
        client.wait_for_workers(1, timeout=_TIMEOUT_S)
    except TimeoutError as error:
        raise InputError(f"--scheduler {address}: the cluster has no workers") from error


def _room(client: Any) -> int:
    threads: int = sum(worker["nthreads"] for worker in client.scheduler_info(n_workers=-1)["workers"].values())
    return max(threads * _WAITING, _LEAST_WAITING)


def _result_of(future: Any, number: int) -> Result:
    try:
        result: Result = future.result()
    except Exception as error:  # a cluster has its own reasons not to give a result, such as workers that keep dying
        return Result(number, None, " ".join(f"{type(error).__name__}: {error}".split()))
    return result
