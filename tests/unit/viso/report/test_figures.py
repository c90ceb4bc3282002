# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What figures show of times that are far apart."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from viso.report.figures import per_second


@settings(max_examples=25)
@given(st.lists(st.integers(0, 900), min_size=1).map(sorted))
def test_records_are_counted_in_whole_seconds(tenths: list[int]) -> None:
    time_s = 5.0 + np.array(tenths) / 10
    counts, edges = per_second(time_s, 5.0, 96.0)
    every_s = 5.0 + np.arange(92.0)
    spread = counts[np.searchsorted(edges, every_s[:-1], side="right") - 1]
    assert spread.tolist() == np.histogram(time_s, every_s)[0].tolist()


def test_silence_of_days_takes_no_more_room_than_a_second() -> None:
    counts, edges = per_second(np.array([0.0, 0.5, 1e9]), 0.0, 1e9 + 1.5)
    assert (counts.tolist(), edges.tolist()) == ([2, 0, 1], [0, 1, 1e9, 1e9 + 1])


def test_part_of_a_second_at_the_end_does_not_count() -> None:
    counts, edges = per_second(np.array([0.0, 1.2]), 0.0, 1.2)
    assert (counts.tolist(), edges.tolist()) == ([1], [0, 1])
