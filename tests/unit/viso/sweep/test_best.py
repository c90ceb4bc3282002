# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where an objective is best."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from viso.replay.figures import BY_TIME
from viso.sweep.best import Best, best_along, best_rows

GROUP = {"stream": "s", "firmware": "f", "faults": "none", "seed": None}


def rows(points: Mapping[float, float | None], objective: str = "nis", **group: Any) -> list[dict[str, Any]]:
    return [
        {**GROUP, **group, "point": number, "X": x, objective: value}
        for number, (x, value) in enumerate(points.items())
    ]


def best(points: Mapping[float, float | None], objective: str = "nis") -> Best:
    (found,) = best_along(rows(points, objective), "X", objective)
    return found


@pytest.mark.slow
@given(
    vertex=st.floats(-50, 50),
    curve=st.floats(0.01, 100),
    steps=st.lists(st.floats(0.5, 10), min_size=4, max_size=12),
)
def test_vertex_of_a_parabola_is_found_whatever_the_steps(vertex: float, curve: float, steps: list[float]) -> None:
    places = [-20 + sum(steps[:count]) for count in range(len(steps) + 1)]
    found = best({x: curve * (x - vertex) ** 2 + 3 for x in places})
    assume(not found.at_edge)
    assert found.vertex == pytest.approx(vertex, abs=1e-3)
    assert abs(found.at - vertex) == min(abs(x - vertex) for x in places)


@pytest.mark.parametrize(("values", "first"), [((1.0, 2.0, 3.0), True), ((3.0, 2.0, 1.0), False)])
def test_edge_has_no_vertex(values: tuple[float, ...], first: bool) -> None:
    found = best(dict(enumerate(values)))
    assert (found.at_edge, found.is_first, found.vertex) == (True, first, None)


def test_plateau_begins_at_its_first_point() -> None:
    found = best({0: 4.0, 1: 1.0, 2: 1.0, 3: 1.0, 4: 5.0})
    assert (found.at, found.same_until) == (1, 3)
    assert (best({0: 4.0, 1: 1.0, 2: 2.0}).same_until) == 1


def test_points_without_a_figure_are_passed_over() -> None:
    assert best({0: 4.0, 1: None, 2: 2.0, 3: 5.0}).at == 2
    assert best_along(rows({0: None}), "X", "nis") == []


def test_order_of_the_rows_is_of_no_importance() -> None:
    made = rows({0: 4.0, 1: 1.0, 2: 2.0})
    assert best_along(made[::-1], "X", "nis")[0].vertex == best_along(made, "X", "nis")[0].vertex


def test_shares_are_best_where_they_are_greatest() -> None:
    assert best({0: 0.1, 1: 0.9, 2: 0.3}, "fused_share").at == 1


def test_groups_have_their_own_best() -> None:
    both = rows({0: 1.0, 1: 2.0}, seed=1) + rows({0: 2.0, 1: 1.0}, seed=2)
    assert [(found.row["seed"], found.at) for found in best_along(both, "X", "nis")] == [(1, 0), (2, 1)]


def judged(points: Mapping[float, float], noise: float) -> Best:
    """Return the best of rows whose innovations are made of 40 spans, with noise that each row has of its own."""
    made = rows(points)
    for row in made:
        of_spans = row["nis"] + noise * np.random.default_rng(row["point"]).standard_normal(40)
        sums = [[number, 10, 10 * square, 0.0] for number, square in enumerate(of_spans)]
        row[BY_TIME] = {"span_s": 1, "sums": {"pose": sums}}
    (found,) = best_along(made, "X", "nis")
    return found


VALUES = {0.0: 4.0, 1.0: 1.1, 2.0: 1.0, 3.0: 1.2, 4.0: 4.0}


@pytest.mark.parametrize(("noise", "alike", "stands_out"), [
    (0.0, (2, 2), True), (0.5, (1, 3), True), (50.0, (0, 4), False),
])  # fmt: skip
def test_values_that_are_worse_by_chance_alone_are_alike(noise: float, alike: object, stands_out: bool) -> None:
    found = judged(VALUES, noise)
    assert (found.alike, found.stands_out) == (alike, stands_out)


def test_without_figures_over_time_chance_is_unknown() -> None:
    found = best(VALUES)
    assert (found.alike, found.stands_out) == (None, None)


def test_best_rows_come_first_and_equal_ones_in_order() -> None:
    found = best_rows(rows({0: 3.0, 1: 1.0, 2: 1.0, 3: 2.0}), "nis", 3)
    assert [row["point"] for row in found] == [1, 2, 3]
