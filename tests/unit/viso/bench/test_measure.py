# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How costs become figures, on a clock that goes on only when told to."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager

import pytest

from viso.bench.measure import CALIBRATION_TURNS, MIN_ROUNDS, Bench, Figure, NowS, Part, Round, measure, turn_s


class Clock:
    """Gives times one after the other, ending with the last for ever."""

    def __init__(self, *times_s: float) -> None:
        self._times_s = list(times_s)

    def __call__(self) -> float:
        return self._times_s.pop(0) if len(self._times_s) > 1 else self._times_s[0]


class TickingClock:
    """Goes on by a second each time it is read."""

    def __init__(self) -> None:
        self.now_s = 0.0

    def __call__(self) -> float:
        self.now_s += 1.0
        return self.now_s


def bench_of(rounds: Sequence[Mapping[str, Part]]) -> Bench:
    @contextmanager
    def prepare(_now_s: NowS) -> Iterator[Round]:
        left = list(rounds)
        yield lambda: left.pop(0) if len(left) > 1 else left[0]

    return Bench("things", "things", prepare)


def only_figure(rounds: Sequence[Mapping[str, Part]], seconds: float = 0.0) -> Figure:
    (figure,) = measure(bench_of(rounds), seconds, TickingClock())
    return figure


def one(elapsed_s: float, amount: float = 1.0) -> Mapping[str, Part]:
    return {"one": Part(elapsed_s, amount)}


def test_a_turn_is_a_part_of_the_calibration_loop() -> None:
    assert turn_s(Clock(10.0, 12.0)) == 2.0 / CALIBRATION_TURNS


def test_the_first_round_does_not_count() -> None:
    assert only_figure([one(1e-9), one(2.0)]).cost_us == 2e6


def test_cost_is_that_of_the_best_round_for_one() -> None:
    figure = only_figure([one(9.0), one(8.0, 2.0), one(9.0, 3.0), one(8.0)])
    assert figure.cost_us == 3e6
    assert figure.per_second == pytest.approx(1 / 3)


def test_typical_cost_is_that_of_the_median_round() -> None:
    assert only_figure([one(0.0), one(5.0), one(1.0), one(3.0), one(2.0), one(4.0)]).typical_cost_us == 3e6


def test_slow_cost_is_that_of_the_round_that_95_percent_do_not_exceed() -> None:
    rounds = [one(0.0), *[one(float(cost)) for cost in range(20, 0, -1)]]
    assert only_figure(rounds, seconds=19 * 3.0).slow_cost_us == 19e6


def test_turns_compare_with_the_calibration_loop() -> None:
    # The loop takes a second on this clock, between its two readings.
    assert only_figure([one(3.0)]).turns == pytest.approx(3.0 * CALIBRATION_TURNS)


def test_there_are_rounds_enough_even_without_time() -> None:
    assert only_figure([one(1.0)]).rounds == MIN_ROUNDS


def test_rounds_go_on_for_the_time_that_is_given() -> None:
    # A round reads the clock three times: twice for the loop, once for the end.
    assert only_figure([one(1.0)], seconds=60.0).rounds == pytest.approx(60 / 3, abs=MIN_ROUNDS)


def test_ratio_is_that_of_the_best_rounds_of_both() -> None:
    times_s = [(1e-9, 1e-9), (9.0, 2.0), (8.0, 4.0), (6.0, 5.0), (7.0, 9.0), (8.0, 9.0)]
    assert only_figure([{"one": Part(elapsed_s, 2.0, beside_s)} for elapsed_s, beside_s in times_s]).ratio == 3.0
    assert only_figure([one(1.0)]).ratio is None


def test_a_part_that_did_not_occur_in_a_round_counts_in_the_others() -> None:
    figures = measure(bench_of([one(1.0), one(1.0), {"rare": Part(4.0, 2.0)}, one(1.0)]), 0.0, TickingClock())
    assert [(figure.name, figure.cost_us, figure.rounds) for figure in figures] == [
        ("one", 1e6, MIN_ROUNDS - 1),
        ("rare", 2e6, 1),
    ]
