# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Correction of time stamps: bounds, epochs, and what jumps of the sender's clock do."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mav_handlers.jitter_correction import JitterCorrection

MAX_LAG_US = 500_000
LOOPS = 100
PERIOD_US = 33_000

U64 = st.integers(0, (1 << 64) - 1)
# From the maximum lag on: an earlier sample could be from before boot.
LOCAL_TIMES = st.lists(st.integers(MAX_LAG_US, 1 << 40), min_size=1, max_size=250).map(sorted)


@st.composite
def streams(draw: st.DrawFn) -> list[tuple[int, int]]:
    """Draw (sender's time, arrival) pairs: arrivals in order, senders of any disposition."""
    arrivals = draw(LOCAL_TIMES)
    remote = draw(st.lists(st.integers(0, 1 << 50), min_size=len(arrivals), max_size=len(arrivals)))
    return list(zip(remote, arrivals, strict=True))


def corrected(samples: list[tuple[int, int]]) -> list[int]:
    corrector = JitterCorrection()
    return [corrector.correct_offboard_timestamp_usec(remote_us, local_us) for remote_us, local_us in samples]


def lags(samples: list[tuple[int, int]]) -> list[int]:
    return [local_us - time_us for (_, local_us), time_us in zip(samples, corrected(samples), strict=True)]


def steady(count: int, first: int = 0, remote_offset_us: int = 0, latency_us: int = 4_000) -> list[tuple[int, int]]:
    """Return samples of a steady stream, numbered from ``first``."""
    times = [1_000_000 + number * PERIOD_US for number in range(first, first + count)]
    return [(time_us + remote_offset_us, time_us + latency_us) for time_us in times]


@given(samples=streams())
def test_time_is_never_after_arrival_nor_more_than_500_ms_before(samples: list[tuple[int, int]]) -> None:
    assert all(0 <= lag <= MAX_LAG_US for lag in lags(samples))


def test_time_before_boot_wraps_to_64_bits() -> None:
    assert corrected([(1_000, 0), (0, 0)]) == [0, (1 << 64) - 1_000]


@given(remote_us=U64, local_us=U64)
def test_first_sample_is_taken_at_its_arrival(remote_us: int, local_us: int) -> None:
    assert JitterCorrection().correct_offboard_timestamp_usec(remote_us, local_us) == local_us


@given(samples=streams(), epoch_us=st.integers(0, 1 << 60))
def test_epoch_of_the_sender_does_not_matter(samples: list[tuple[int, int]], epoch_us: int) -> None:
    shifted = [(remote_us + epoch_us, local_us) for remote_us, local_us in samples]
    assert corrected(shifted) == corrected(samples)


@given(samples=st.lists(st.tuples(U64, U64), max_size=250))
def test_no_pair_of_times_raises_or_leaves_64_bits(samples: list[tuple[int, int]]) -> None:
    assert all(0 <= time_us < 1 << 64 for time_us in corrected(samples))


@given(samples=st.lists(st.tuples(U64, U64), max_size=50), loops=st.integers(0, 3), max_lag_ms=st.integers(0, 65535))
def test_same_input_gives_same_output(samples: list[tuple[int, int]], loops: int, max_lag_ms: int) -> None:
    first, second = (JitterCorrection(max_lag_ms, loops) for _ in range(2))
    for sample in samples:
        assert first.correct_offboard_timestamp_usec(*sample) == second.correct_offboard_timestamp_usec(*sample)


def test_steady_stream_has_no_lag() -> None:
    assert set(lags(steady(250))) == {0}


@given(delays=st.lists(st.integers(0, MAX_LAG_US), min_size=1, max_size=LOOPS - 1))
def test_lag_over_the_quickest_sample_is_taken_off(delays: list[int]) -> None:
    samples = [(remote, local + delay) for (remote, local), delay in zip(steady(LOOPS, 1), [0, *delays], strict=False)]
    assert lags(samples) == [0, *delays]


def test_later_than_500_ms_counts_as_500_ms() -> None:
    [(remote_us, local_us)] = steady(1, 1)
    assert lags([*steady(1), (remote_us, local_us + 2_000_000)])[-1] == MAX_LAG_US


def test_sample_late_by_exactly_500_ms_is_not_clamped() -> None:
    corrector = JitterCorrection()
    corrector.correct_offboard_timestamp_usec(0, 1_000_000)
    assert corrector.correct_offboard_timestamp_usec(0, 1_500_000) == 1_000_000
    # Nor has the offset moved: the next sample is corrected as before.
    assert corrector.correct_offboard_timestamp_usec(PERIOD_US, 1_500_000) == 1_000_000 + PERIOD_US


@given(jump_us=st.integers(1, 1 << 50), before=st.integers(1, 150))
def test_forward_jump_of_the_sender_causes_no_lag(jump_us: int, before: int) -> None:
    samples = steady(before) + steady(150, before, jump_us)
    assert set(lags(samples)) == {0}


@given(jump_us=st.integers(1, 1 << 50), before=st.integers(1, 150))
def test_backward_jump_causes_its_lag_up_to_500_ms_until_a_window_is_full(jump_us: int, before: int) -> None:
    rest_of_window = LOOPS - before % LOOPS if before % LOOPS else 0
    samples = steady(before, 0, jump_us) + steady(2 * LOOPS + 1, before)
    after = lags(samples)[before:]
    # The window in which the jump fell still holds the old offset; the first one that is all new clears the lag.
    until = rest_of_window + LOOPS
    assert after[until:] == [0] * (len(after) - until)
    if jump_us <= MAX_LAG_US:
        assert after[:until] == [jump_us] * until


@given(jump_us=st.integers(1, 1 << 50))
def test_backward_jump_at_a_window_s_start_lags_for_exactly_one_window(jump_us: int) -> None:
    samples = steady(LOOPS, 0, jump_us) + steady(LOOPS + 1, LOOPS)
    assert lags(samples)[LOOPS:] == [min(jump_us, MAX_LAG_US)] * LOOPS + [0]


def test_slow_drift_of_the_sender_is_followed_window_by_window() -> None:
    samples = [(remote - number * 10, local) for number, (remote, local) in enumerate(steady(3 * LOOPS))]
    # Within a window the drift adds up; the least of the window, its first sample, is the next one's offset.
    assert [lags(samples)[number] for number in (99, 100, 199, 200, 299)] == [990, 1000, 1990, 1000, 1990]


@pytest.mark.parametrize(("loops", "expected"), [(1, [0, 700, 0]), (2, [0, 700, 700])])
def test_window_has_the_length_asked_for(loops: int, expected: list[int]) -> None:
    corrector = JitterCorrection(500, loops)
    samples = [(1000, 1000), (1300, 2000), (2300, 3000)]
    assert [local - corrector.correct_offboard_timestamp_usec(remote, local) for remote, local in samples] == expected


def test_maximum_lag_is_the_one_asked_for() -> None:
    corrector = JitterCorrection(20, LOOPS)
    corrector.correct_offboard_timestamp_usec(0, 1_000_000)
    assert corrector.correct_offboard_timestamp_usec(0, 2_000_000) == 1_980_000


def test_senders_with_different_clocks_on_one_link_disturb_each_other() -> None:
    # The slower clock's sample implies a longer lag than there is.
    ahead, behind = steady(1, 0, 200_000), steady(1, 1)
    assert lags(ahead + behind) == [0, 200_000]
