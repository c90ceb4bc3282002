# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The autopilot's clock against the companion's."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mav_handlers.wire.messages import TIMESYNC
from viso.companion.odometry.clock_sync import MAX_ROUND_TRIP_NS, SAMPLES, ClockSync

MS = 1_000_000
OFFSET_NS = 987_654_321_000


def ask(clock: ClockSync, now_ns: int, there_ns: int = MS, back_ns: int = MS, offset_ns: int = OFFSET_NS) -> None:
    """Ask at a time and take the answer, whose ways take as long as given."""
    request = clock.request(now_ns)
    clock.take(TIMESYNC(now_ns + there_ns - offset_ns, request.ts1), now_ns + there_ns + back_ns)


def test_request_carries_the_companions_time() -> None:
    assert ClockSync().request(123) == TIMESYNC(0, 123)


def test_there_is_no_offset_before_an_answer() -> None:
    clock = ClockSync()
    clock.request(0)
    assert clock.offset_ns is None


def test_offset_turns_the_autopilots_time_into_the_companions() -> None:
    clock = ClockSync()
    ask(clock, 10**12)
    assert clock.offset_ns is not None
    assert clock.to_companion_ns(10**12 - OFFSET_NS, arrival_ns=0, mean_period_ns=0) == 10**12


def test_smallest_round_trip_gives_the_offset() -> None:
    clock = ClockSync()
    for number, (there_ms, back_ms) in enumerate([(9, 1), (1, 1), (1, 9)]):
        ask(clock, 10**12 + number * 200 * MS, there_ms * MS, back_ms * MS)
    assert clock.offset_ns == OFFSET_NS


def test_only_the_last_32_count() -> None:
    clock = ClockSync()
    ask(clock, 0, MS, 0)
    for number in range(1, SAMPLES):
        ask(clock, number * 200 * MS)
    assert clock.offset_ns == OFFSET_NS - MS // 2
    ask(clock, SAMPLES * 200 * MS)
    assert clock.offset_ns == OFFSET_NS


@pytest.mark.parametrize(("back_ns", "taken"), [(MAX_ROUND_TRIP_NS - MS, True), (MAX_ROUND_TRIP_NS - MS + 1, False)])
def test_round_trip_above_20_ms_is_refused(back_ns: int, taken: bool) -> None:
    clock = ClockSync()
    ask(clock, 0, MS, back_ns)
    assert (clock.offset_ns is not None) is taken


def test_answer_that_arrives_before_its_request_is_refused() -> None:
    clock = ClockSync()
    clock.request(100)
    clock.take(TIMESYNC(5, 100), 99)
    assert clock.offset_ns is None


def test_answer_to_another_is_refused() -> None:
    clock = ClockSync()
    clock.request(100)
    clock.take(TIMESYNC(5, 101), 200)
    assert clock.offset_ns is None


def test_answer_counts_once() -> None:
    clock = ClockSync()
    ask(clock, 100)
    offset_ns = clock.offset_ns
    clock.take(TIMESYNC(5, 100), 101)  # a better one
    assert clock.offset_ns == offset_ns


def test_autopilots_request_is_answered_with_our_time_and_its_stamp() -> None:
    clock = ClockSync()
    assert clock.take(TIMESYNC(0, 777), 555) == TIMESYNC(555, 777)


def test_answer_is_never_taken_for_a_request() -> None:
    assert ClockSync().take(TIMESYNC(0, 777), 0) == TIMESYNC(1, 777)


def test_answer_to_our_request_is_not_answered() -> None:
    clock = ClockSync()
    clock.request(100)
    assert clock.take(TIMESYNC(5, 100), 200) is None


def test_without_an_offset_it_is_half_a_period_before_the_arrival() -> None:
    assert ClockSync().to_companion_ns(42, arrival_ns=10_000, mean_period_ns=500) == 9_750


def test_rebooted_autopilots_new_clock_counts_at_once() -> None:
    clock = ClockSync()
    for number in range(5):
        ask(clock, number * 200 * MS, MS // 2, MS // 2)
    ask(clock, 10**9, offset_ns=OFFSET_NS + 10**10)
    assert clock.offset_ns == OFFSET_NS + 10**10


@given(st.lists(st.tuples(st.integers(0, 12 * MS), st.integers(0, 12 * MS)), min_size=1, max_size=40))
def test_uneven_ways_are_no_step_of_the_clock(ways: list[tuple[int, int]]) -> None:
    clock = ClockSync()
    for number, (there_ns, back_ns) in enumerate(ways):
        ask(clock, number * 200 * MS, there_ns, back_ns)
    taken_ns = [there_ns + back_ns for there_ns, back_ns in ways if there_ns + back_ns <= MAX_ROUND_TRIP_NS]
    assert (clock.offset_ns is not None) == bool(taken_ns)
    if clock.offset_ns is not None:  # that of the shortest of the last: none of them was forgotten
        assert abs(clock.offset_ns - OFFSET_NS) <= min(taken_ns[-SAMPLES:]) / 2 + 1
