# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Works the points of a sweep out in processes of this machine."""

import multiprocessing
import os
import signal
import threading
from collections.abc import Generator, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from itertools import islice
from typing import Final

from viso.sweep.job import Result, run_point
from viso.sweep.plan import Point, SweepPlan

KILLED: Final = "its process ended without a word (killed, or out of memory)"

_WAITING: Final = 2
"""Points handed out for each process: one at work, one next."""

_Running = dict[Future[Result], Point]


def default_jobs() -> int:
    """Return how many processes may run at the same time: all cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def run_in_processes(plan: SweepPlan, points: Iterable[Point], jobs: int) -> Generator[Result]:
    """Yield the outcome of each point, as soon as it is done.

    When a process dies, the points that it may have been at work on are tried once more, each in a process of its own.
    Closing the iterator ends what is at work.
    """
    waiting = iter(points)
    while True:
        lost: list[Point] = []
        yield from _run_pool(plan, waiting, jobs, lost)
        if not lost:
            return
        for point in lost:
            again: list[Point] = []
            yield from _run_pool(plan, iter((point,)), 1, again)
            yield from (Result(job.number, None, KILLED) for job in again)


def _run_pool(plan: SweepPlan, points: Iterator[Point], jobs: int, lost: list[Point]) -> Generator[Result]:
    """Yield results until no points are left or a process dies; then ``lost`` gets the points that have none."""
    others = set(multiprocessing.active_children())
    pool = ProcessPoolExecutor(jobs, _context(), initializer=_end_with_the_command)
    running: _Running = {}
    try:
        while True:
            _fill(pool, plan, points, running, jobs * _WAITING, lost)
            if not running:
                return
            done, _ = wait(running, return_when=FIRST_COMPLETED)
            for future in done:
                point = running.pop(future)
                try:
                    result = future.result()
                except BrokenProcessPool:
                    lost.append(point)
                else:
                    yield result
    finally:
        if running:
            for child in set(multiprocessing.active_children()) - others:
                child.terminate()
        pool.shutdown(cancel_futures=True)


def _fill(
    pool: ProcessPoolExecutor, plan: SweepPlan, points: Iterator[Point], running: _Running, room: int, lost: list[Point]
) -> None:
    if lost:
        return
    for point in islice(points, max(room - len(running), 0)):
        try:
            running[pool.submit(run_point, plan, point)] = point
        except BrokenProcessPool:
            lost.append(point)
            return


def _context() -> multiprocessing.context.BaseContext:
    # A fork of this process would share its threads' locks. The server forks ones that have loaded what it takes.
    if "forkserver" not in multiprocessing.get_all_start_methods():
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["viso.sweep.job"])
    return context


def _end_with_the_command() -> None:
    """Let Ctrl-C end this process at once, without a word, and the end of the command however it comes about."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    threading.Thread(target=_end_after_the_command, daemon=True).start()


def _end_after_the_command() -> None:
    command = multiprocessing.parent_process()
    if command is not None:
        command.join()
        os._exit(1)
