# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The companion's clock has its own epoch and rate."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from viso.companion.sender import OffsetClock


def test_clock_without_offset_and_drift_shows_the_true_time() -> None:
    assert OffsetClock().time_us(123_456) == 123_456


def test_offset_is_what_it_shows_at_the_autopilots_boot() -> None:
    assert OffsetClock(offset_us=1_700_000_000_000_000).time_us(0) == 1_700_000_000_000_000


@pytest.mark.parametrize(("drift_ppm", "gained_us"), [(30.0, 30), (-30.0, -30), (0.5, 0)])
def test_drift_is_in_parts_per_million(drift_ppm: float, gained_us: int) -> None:
    assert OffsetClock(drift_ppm=drift_ppm).time_us(1_000_000) == 1_000_000 + gained_us


@given(st.integers(-(10**12), 10**16), st.floats(-1000, 1000), st.lists(st.integers(0, 10**12), min_size=2))
def test_clock_never_runs_backwards(offset_us: int, drift_ppm: float, times_us: list[int]) -> None:
    clock = OffsetClock(offset_us, drift_ppm)
    shown = [clock.time_us(time_us) for time_us in sorted(times_us)]
    assert shown == sorted(shown)
