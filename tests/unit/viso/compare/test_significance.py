# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether innovations are larger by more than chance."""

from typing import Any

import numpy as np
import pytest

from viso.compare.significance import surplus


def row(pose: list[float], velocity: list[float] | None = None, span_s: int = 1) -> dict[str, Any]:
    """Return figures of spans of ten samples each, of these mean squares; not normalised they are four times that."""
    kinds = {"pose": pose} | ({"velocity": velocity} if velocity else {})
    sums = {
        kind: [[number, 10, 10 * square, 40 * square] for number, square in enumerate(squares)]
        for kind, squares in kinds.items()
    }
    return {"by_time": {"span_s": span_s, "sums": sums}}


NOISE = (1.0 + 0.5 * np.random.default_rng(1).standard_normal(40)).tolist()


def test_what_differs_everywhere_is_no_chance_and_what_differs_once_may_be() -> None:
    everywhere = surplus(row([1.01 * square + 0.05 for square in NOISE]), row(NOISE))
    assert everywhere is not None
    assert not everywhere.is_chance
    assert everywhere.value == pytest.approx(0.05 + 0.01 * np.mean(NOISE))
    once = surplus(row([*NOISE[:-1], NOISE[-1] + 8.0]), row(NOISE))
    assert once is not None
    assert once.is_chance
    assert once.value == pytest.approx(0.2)


def test_deviation_is_that_of_the_mean() -> None:
    rng = np.random.default_rng(2)
    found = surplus(row((1.0 + 0.3 * rng.standard_normal(64)).tolist()), row([1.0] * 64))
    assert found is not None
    assert found.sigma == pytest.approx(0.3 / 8, rel=0.2)


def test_equal_rows_do_not_differ() -> None:
    assert surplus(row(NOISE), row(NOISE)) == (0.0, 0.0)


def test_kinds_of_sample_are_judged_alone_or_together() -> None:
    first, second = row([2.0] * 10, [1.0] * 10), row([1.0] * 10, [1.0] * 10)
    found = {name: surplus(first, second, name) for name in ("nis", "nis_pose", "nis_velocity", "rms_pose")}
    values = {name: one.value for name, one in found.items() if one is not None}
    assert values == pytest.approx({"nis": 0.5, "nis_pose": 1.0, "nis_velocity": 0.0, "rms_pose": 4.0})


def test_spans_of_different_length_are_put_together() -> None:
    found = surplus(row([3.0] * 10, span_s=2), row([1.0] * 20))
    assert found is not None
    assert found.value == pytest.approx(2.0)


@pytest.mark.parametrize(("first", "objective"), [
    (row([1.0] * 7), "nis"), (row(NOISE), "fused_share"), (row(NOISE), "nis_yaw"), ({}, "nis"),
])  # fmt: skip
def test_too_little_or_other_figures_tell_nothing(first: dict[str, Any], objective: str) -> None:
    assert surplus(first, first, objective) is None
