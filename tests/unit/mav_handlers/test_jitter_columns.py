# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Columns of time stamps are corrected to the microsecond of one call a stamp."""

import gzip
import json
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from mav_handlers.jitter_columns import correct_column
from mav_handlers.jitter_correction import JitterCorrection
from tests.places import DATA

VECTORS = DATA / "vectors" / "jitter_correction.jsonl.gz"
U64 = st.integers(0, (1 << 64) - 1)
NEAR = st.integers(10_000_000, 12_000_000)


def by_column(corrector: JitterCorrection, pairs: Sequence[tuple[int, int]], cuts: Sequence[int] = ()) -> list[int]:
    """Correct stamps in as many calls as there are pieces between the cuts."""
    edges = [0, *sorted(min(cut, len(pairs)) for cut in cuts), len(pairs)]
    corrected: list[int] = []
    for begin, end in pairwise(edges):
        stamps = (np.array([pair[side] for pair in pairs[begin:end]], np.uint64) for side in (0, 1))
        corrected += correct_column(corrector, *stamps).tolist()
    return corrected


def one_by_one(corrector: JitterCorrection, pairs: Sequence[tuple[int, int]]) -> list[int]:
    return [corrector.correct_offboard_timestamp_usec(*pair) for pair in pairs]


@given(
    pairs=st.lists(st.tuples(NEAR, NEAR) | st.tuples(U64, U64), max_size=60),
    max_lag_ms=st.sampled_from([0, 1, 500]),
    loops=st.sampled_from([0, 1, 2, 7, 100]),
    cuts=st.lists(st.integers(0, 60), max_size=3),
)
@example(pairs=[(5, 10)], max_lag_ms=500, loops=1, cuts=[])
def test_column_is_corrected_as_each_stamp_is(
    pairs: list[tuple[int, int]], max_lag_ms: int, loops: int, cuts: list[int]
) -> None:
    ours, theirs = (JitterCorrection(max_lag_ms, loops) for _ in range(2))
    assert by_column(ours, pairs, cuts) == one_by_one(theirs, pairs)
    # Both go on alike.
    assert by_column(ours, pairs) == one_by_one(theirs, pairs)


def test_recorded_sequences_are_corrected_as_by_the_firmware() -> None:
    with gzip.open(VECTORS, "rt", encoding="utf-8") as file:
        lines = [json.loads(line) for line in file]
    for line in lines:
        corrector = JitterCorrection(line["max_lag_ms"], line["convergence_loops"])
        corrected = by_column(corrector, [tuple(sample[:2]) for sample in line["samples"]], [150])
        assert corrected == [sample[2] for sample in line["samples"]], line.get("name")


@pytest.mark.parametrize("count", [0, 1, 100, 101, 1000])
def test_any_number_of_stamps_is_corrected(count: int) -> None:
    rng = np.random.default_rng(count)
    pairs = [(33_333 * number, 33_333 * number + int(rng.integers(0, 900_000))) for number in range(count)]
    assert by_column(JitterCorrection(), pairs) == one_by_one(JitterCorrection(), pairs)
