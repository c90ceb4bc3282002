# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Samples wait until the horizon has passed them."""

from dataclasses import dataclass

import pytest

from ekf_stub.inputs.obs_ring import ObsRing, ring_sizes


@dataclass(frozen=True)
class Sample:
    time_ms: int


def ring_of(*times_ms: int, size: int = 5) -> ObsRing[Sample]:
    ring: ObsRing[Sample] = ObsRing(size)
    for time_ms in times_ms:
        ring.push(Sample(time_ms))
    return ring


def test_nothing_is_recalled_from_an_empty_ring() -> None:
    assert ring_of().recall(1000) == (None, 0, 0)


@pytest.mark.parametrize(("horizon_ms", "sample"), [(999, None), (1000, 1000), (1099, 1000), (1100, None)])
def test_sample_is_recalled_within_100_ms_of_its_time(horizon_ms: int, sample: int | None) -> None:
    found = ring_of(1000).recall(horizon_ms).sample
    assert (None if found is None else found.time_ms) == sample


def test_sample_is_recalled_once() -> None:
    ring = ring_of(1000)
    ring.recall(1000)
    assert ring.recall(1001).sample is None


def test_newest_due_sample_supersedes_the_others() -> None:
    ring = ring_of(1000, 1010, 1020)
    assert ring.recall(1015) == (Sample(1010), 1, 0)
    assert ring.recall(1020).sample == Sample(1020)


def test_samples_too_old_are_lost() -> None:
    assert ring_of(1000, 1050).recall(1120) == (Sample(1050), 0, 1)


def test_sample_from_the_future_blocks_those_behind_it() -> None:
    ring = ring_of(2000, 1000)
    assert ring.recall(1000) == (None, 0, 0)
    assert ring.recall(2000) == (Sample(2000), 0, 1)


def test_age_is_taken_across_the_wrap_of_milliseconds() -> None:
    assert ring_of((1 << 32) - 10).recall(20).sample == Sample((1 << 32) - 10)


def test_oldest_gives_way_in_a_full_ring() -> None:
    ring = ring_of(1000, 1001, size=2)
    assert ring.push(Sample(1002))
    assert ring.recall(1000).sample is None


def test_push_into_a_ring_with_room_overwrites_nothing() -> None:
    assert not ring_of(1000, size=2).push(Sample(1001))


def test_cleared_ring_is_empty() -> None:
    ring = ring_of(1000)
    ring.clear()
    assert ring.recall(1000).sample is None


@pytest.mark.parametrize(("delay_ms", "sizes"), [(60, (6, 5, 2)), (250, (21, 19, 8))])
def test_sizes_follow_from_the_longest_delay(delay_ms: int, sizes: tuple[int, int, int]) -> None:
    assert ring_sizes(delay_ms) == (*sizes, 0)
