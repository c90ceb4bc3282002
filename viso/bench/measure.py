# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Measures how fast something is, beside a loop of plain Python that tells how fast the machine is at that moment."""

import math
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass
from statistics import median
from typing import Final, NamedTuple

NowS = Callable[[], float]
"""A clock in seconds whose differences count."""

CALIBRATION_TURNS: Final = 20_000
MIN_ROUNDS: Final = 5


class Part(NamedTuple):
    """What was done in a round: the seconds that it took, and how much it was.

    ``beside_s`` is what something else took for as much in the same round, where there is anything to compare with.
    """

    elapsed_s: float
    amount: float
    beside_s: float | None = None


Round = Callable[[], Mapping[str, Part]]
"""Does some milliseconds of work, and returns what of it is measured, by name; nothing of a name that did not occur."""


class Bench(NamedTuple):
    """One row of the table of benches.

    Attributes:
        what: what is measured, in a line.
        unit: what the work is counted in.
        prepare: gets everything ready, and gives a function that does a round.
        beside: what a part is compared with, if anything.
        waits: other processes do the work, so that the clock on the wall tells how long it takes.
    """

    what: str
    unit: str
    prepare: Callable[[NowS], AbstractContextManager[Round]]
    waits: bool = False
    beside: str = ""


@dataclass(frozen=True, slots=True)
class Figure:
    """How fast one thing is.

    Attributes:
        name: what was measured.
        unit: what it is counted in.
        per_second: how many in a second, in the best round.
        cost_us: microseconds for one, in the best round.
        typical_cost_us: the same in the median round.
        slow_cost_us: the same in the round that 95 % of all are not slower than.
        turns: how many turns of the calibration loop take as long as one; the median of the rounds, each compared with
            the loop just before it. Of all figures the one to compare between machines.
        rounds: in how many rounds it occurred.
        ratio: how many times as long it takes as what it is compared with, each in its best round; None where there is
            nothing to compare with.
    """

    name: str
    unit: str
    per_second: float
    cost_us: float
    typical_cost_us: float
    slow_cost_us: float
    turns: float
    rounds: int
    ratio: float | None = None


class _Cost(NamedTuple):
    cost_s: float
    turns: float
    beside_s: float | None


def turn_s(now_s: NowS) -> float:
    """Return how long a turn of the calibration loop takes, in seconds."""
    begin_s, value = now_s(), 0
    for number in range(CALIBRATION_TURNS):
        value = (31 * value + number) & 0xFFFF
    return (now_s() - begin_s) / CALIBRATION_TURNS


def measure(bench: Bench, seconds: float, now_s: NowS) -> list[Figure]:
    """Run rounds of a bench for a time, five at least, and return a figure for each of its parts.

    Args:
        bench: what to measure.
        seconds: for how long, without preparation.
        now_s: the clock.
    """
    rounds: dict[str, list[_Cost]] = {}
    with bench.prepare(now_s) as run_round:
        run_round()  # the first one fills caches
        end_s, number = now_s() + seconds, 0
        while number < MIN_ROUNDS or now_s() < end_s:
            number += 1
            loop_turn_s = turn_s(now_s)
            for name, part in run_round().items():
                cost_s = part.elapsed_s / part.amount
                beside_s = None if part.beside_s is None else part.beside_s / part.amount
                rounds.setdefault(name, []).append(_Cost(cost_s, cost_s / loop_turn_s, beside_s))
    return [_figure(name, bench.unit, costs) for name, costs in rounds.items()]


def _figure(name: str, unit: str, rounds: list[_Cost]) -> Figure:
    costs_s = sorted(cost.cost_s for cost in rounds)
    slow_s = costs_s[math.ceil(0.95 * len(costs_s)) - 1]
    turns = median(cost.turns for cost in rounds)
    beside_s = min((cost.beside_s for cost in rounds if cost.beside_s is not None), default=None)
    ratio = None if beside_s is None else costs_s[0] / beside_s
    costs_us = costs_s[0] * 1e6, median(costs_s) * 1e6, slow_s * 1e6
    return Figure(name, unit, 1 / costs_s[0], *costs_us, turns, len(costs_s), ratio)
