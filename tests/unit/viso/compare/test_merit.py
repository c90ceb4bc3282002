# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Figures of merit of two replays, and whether innovations are larger by more than chance."""

from io import StringIO
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from viso.compare.merit import merit_rows, merits, surplus
from viso.compare.outputs import merit_lines, merit_table
from viso.replay.figures import BY_TIME, OBJECTIVES


def row(nis: float, **figures: float) -> dict[str, Any]:
    sums = [[number, 10, 10 * nis * (1.1 if number % 2 else 0.9), 0.0] for number in range(20)]
    by_time = {"span_s": 1, "sums": {"pose": sums}}
    return {**dict.fromkeys(OBJECTIVES), "nis": nis, BY_TIME: by_time, **figures}


def test_figures_that_one_has_stand_beside_those_of_the_other() -> None:
    found = merits(row(1.0, rms_pose=0.1, ate_m=0.2), row(2.0, rms_pose=0.3))
    assert found == [("rms_pose", 0.1, 0.3), ("nis", 1.0, 2.0), ("ate_m", 0.2, None)]


def test_change_is_told_with_its_deviation() -> None:
    (line,) = merit_lines(row(1.0), row(2.0))
    assert line.startswith("innovations (nis) change by +100.0%, with a deviation of ")
    assert line.endswith("beyond 2 of these")
    (line,) = merit_lines(row(1.0), row(1.0))
    assert line.endswith("+0.0%, with a deviation of 0.0%: may be chance")
    assert list(merit_lines(row(1.0), {**row(1.0), BY_TIME: None})) == []


def test_machines_are_told_what_may_be_chance() -> None:
    (nis,) = merit_rows(row(1.0), row(2.0))
    assert (nis["name"], nis["before"], nis["after"], nis["chance"]) == ("nis", 1.0, 2.0, False)


def test_table_names_the_truth() -> None:
    console = Console(width=200, file=StringIO())
    console.print(merit_table(row(1.0, ate_m=0.25), row(2.0), "SIM"))
    assert isinstance(console.file, StringIO)
    shown = console.file.getvalue()
    assert "how far its positions are from SIM" in shown
    assert "0.25 m" in shown


# More than chance


def spans(pose: list[float], velocity: list[float] | None = None, span_s: int = 1) -> dict[str, Any]:
    """Return figures of spans of ten samples each, of these mean squares; not normalised they are four times that."""
    kinds = {"pose": pose} | ({"velocity": velocity} if velocity else {})
    sums = {
        kind: [[number, 10, 10 * square, 40 * square] for number, square in enumerate(squares)]
        for kind, squares in kinds.items()
    }
    return {BY_TIME: {"span_s": span_s, "sums": sums}}


NOISE = (1.0 + 0.5 * np.random.default_rng(1).standard_normal(40)).tolist()


def test_what_differs_everywhere_is_no_chance_and_what_differs_once_may_be() -> None:
    everywhere = surplus(spans([1.01 * square + 0.05 for square in NOISE]), spans(NOISE))
    assert everywhere is not None
    assert not everywhere.is_chance
    assert everywhere.value == pytest.approx(0.05 + 0.01 * np.mean(NOISE))
    once = surplus(spans([*NOISE[:-1], NOISE[-1] + 8.0]), spans(NOISE))
    assert once is not None
    assert once.is_chance
    assert once.value == pytest.approx(0.2)


def test_deviation_is_that_of_the_mean() -> None:
    rng = np.random.default_rng(2)
    found = surplus(spans((1.0 + 0.3 * rng.standard_normal(64)).tolist()), spans([1.0] * 64))
    assert found is not None
    assert found.sigma == pytest.approx(0.3 / 8, rel=0.2)


def test_equal_rows_do_not_differ() -> None:
    assert surplus(spans(NOISE), spans(NOISE)) == (0.0, 0.0)


def test_kinds_of_sample_are_judged_alone_or_together() -> None:
    first, second = spans([2.0] * 10, [1.0] * 10), spans([1.0] * 10, [1.0] * 10)
    found = {name: surplus(first, second, name) for name in ("nis", "nis_pose", "nis_velocity", "rms_pose")}
    values = {name: one.value for name, one in found.items() if one is not None}
    assert values == pytest.approx({"nis": 0.5, "nis_pose": 1.0, "nis_velocity": 0.0, "rms_pose": 4.0})


def test_spans_of_different_length_are_put_together() -> None:
    found = surplus(spans([3.0] * 10, span_s=2), spans([1.0] * 20))
    assert found is not None
    assert found.value == pytest.approx(2.0)


@pytest.mark.parametrize(("first", "objective"), [
    (spans([1.0] * 7), "nis"), (spans(NOISE), "fused_share"), (spans(NOISE), "nis_yaw"), ({}, "nis"),
])  # fmt: skip
def test_too_little_or_other_figures_tell_nothing(first: dict[str, Any], objective: str) -> None:
    assert surplus(first, first, objective) is None
