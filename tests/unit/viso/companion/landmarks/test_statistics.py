# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Statistics of innovations."""

import math

import pytest

from viso.companion.landmarks.residuals import Innovation, Residuals
from viso.companion.landmarks.statistics import innovation_statistics, summarise


def off(name: str, du_px: float, dv_px: float) -> Innovation:
    return Innovation(name, 100.0, 200.0, 100.0 + du_px, 200.0 + dv_px, True, 10.0)


def test_mean_median_and_spread() -> None:
    statistics = innovation_statistics([off("1", 1.0, -2.0), off("1", 2.0, -2.0), off("1", 6.0, -2.0)])
    assert statistics.count == 3
    assert statistics.mean == pytest.approx((3.0, -2.0))
    assert statistics.median == pytest.approx((2.0, -2.0))
    assert statistics.spread == pytest.approx((math.sqrt(14 / 3), 0.0))
    assert statistics.robust_spread == pytest.approx((1.4826, 0.0))


def test_one_wrong_match_hardly_moves_median_and_robust_spread() -> None:
    good = [off("1", float(index % 5 - 2), 0.0) for index in range(99)]
    with_wrong = innovation_statistics([*good, off("1", 5000.0, 0.0)])
    assert with_wrong.median[0] == 0.0
    assert with_wrong.robust_spread[0] == pytest.approx(1.4826)
    assert with_wrong.spread[0] > 100


def test_nothing_has_no_mean() -> None:
    statistics = innovation_statistics([])
    assert statistics.count == 0
    assert all(map(math.isnan, (*statistics.mean, *statistics.median, *statistics.spread, *statistics.robust_spread)))


def test_a_summary_is_of_all_and_of_each() -> None:
    summary = summarise(
        [
            Residuals((off("b", 1.0, 0.0), off("a", 3.0, 0.0)), unmatched=("x",), duplicates=("a",)),
            Residuals((off("b", 5.0, 0.0),), unmatched=("x", "y"), not_projected=("c",)),
        ]
    )
    assert summary.pictures == 2
    assert summary.overall.count == 3
    assert summary.overall.mean[0] == pytest.approx(3.0)
    assert {name: (one.count, one.mean[0]) for name, one in summary.per_id.items()} == {"b": (2, 3.0), "a": (1, 3.0)}
    assert list(summary.per_id) == ["b", "a"]
    assert summary.unmatched == {"x": 2, "y": 1}
    assert summary.not_projected == {"c": 1}
    assert summary.duplicates == {"a": 1}


def test_no_pictures_have_an_empty_summary() -> None:
    summary = summarise([])
    assert (summary.pictures, summary.overall.count, dict(summary.per_id)) == (0, 0, {})
