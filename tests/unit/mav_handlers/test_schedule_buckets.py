# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The ten buckets: which message is at which interval, and which burst is due when."""

from collections.abc import Iterable

import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from mav_handlers.schedule import BUCKET_COUNT, IntervalBuckets, next_sent_ms

NAMES = tuple("abcdefghijklmnopqrst")


@pytest.fixture
def buckets() -> IntervalBuckets:
    return IntervalBuckets(lambda interval_ms: interval_ms)


def send(buckets: IntervalBuckets, now_ms: int) -> str:
    """Send everything that is due, and return the names in order of the alphabet, burst by burst."""
    sent = ""
    while due := buckets.due(now_ms):
        name = min(due)
        buckets.note_sent(name, now_ms)
        sent += name
    return sent


def sent_at(buckets: IntervalBuckets, times_ms: Iterable[int]) -> list[tuple[int, str]]:
    return [(now_ms, sent) for now_ms in times_ms if (sent := send(buckets, now_ms))]


def fill(buckets: IntervalBuckets) -> None:
    for number, name in enumerate(NAMES[:BUCKET_COUNT], start=1):
        buckets.set_interval(name, 100 * number, 0)


class TestIntervals:
    """Which bucket a message is put into."""

    def test_new_interval_takes_a_free_bucket(self, buckets: IntervalBuckets) -> None:
        fill(buckets)
        assert buckets.intervals_ms() == {name: 100 * n for n, name in enumerate(NAMES[:BUCKET_COUNT], start=1)}

    @pytest.mark.parametrize(
        ("wanted_ms", "given_ms"), [(101, 100), (149, 100), (150, 100), (151, 200), (3, 100), (60_000, 1000)]
    )
    def test_eleventh_interval_becomes_the_nearest_one(
        self, buckets: IntervalBuckets, wanted_ms: int, given_ms: int
    ) -> None:
        fill(buckets)
        buckets.set_interval("z", wanted_ms, 0)
        assert buckets.intervals_ms()["z"] == given_ms

    def test_of_two_nearest_buckets_the_one_taken_first_wins(self, buckets: IntervalBuckets) -> None:
        for number, name in enumerate(NAMES[:BUCKET_COUNT]):
            buckets.set_interval(name, 1000 - 100 * number, 0)
        buckets.set_interval("z", 150, 0)
        assert buckets.intervals_ms()["z"] == 200

    def test_message_moves_to_its_new_interval(self, buckets: IntervalBuckets) -> None:
        buckets.set_interval("a", 100, 0)
        buckets.set_interval("b", 100, 0)
        buckets.set_interval("a", 50, 0)
        assert buckets.intervals_ms() == {"a": 50, "b": 100}

    def test_message_alone_in_its_bucket_moves_though_all_are_taken(self, buckets: IntervalBuckets) -> None:
        fill(buckets)
        buckets.set_interval("a", 5000, 0)
        assert buckets.intervals_ms()["a"] == 5000

    def test_message_with_company_stays_when_its_bucket_is_the_nearest(self, buckets: IntervalBuckets) -> None:
        fill(buckets)
        buckets.set_interval("z", 1000, 0)
        buckets.set_interval("z", 5000, 0)
        assert buckets.intervals_ms()["z"] == 1000

    def test_zero_takes_a_message_out(self, buckets: IntervalBuckets) -> None:
        buckets.set_interval("a", 100, 0)
        buckets.set_interval("a", 0, 0)
        buckets.set_interval("b", 0, 0)
        assert buckets.intervals_ms() == {}
        assert buckets.is_empty

    def test_bucket_of_the_last_message_is_free_again(self, buckets: IntervalBuckets) -> None:
        fill(buckets)
        buckets.set_interval("a", 0, 0)
        buckets.set_interval("z", 7, 0)
        assert buckets.intervals_ms()["z"] == 7


class TestBursts:
    """What is due when."""

    def test_nothing_is_due_without_a_message(self, buckets: IntervalBuckets) -> None:
        assert send(buckets, 10_000) == ""

    def test_message_is_due_at_every_interval(self, buckets: IntervalBuckets) -> None:
        buckets.set_interval("a", 100, 0)
        assert sent_at(buckets, range(351)) == [(100, "a"), (200, "a"), (300, "a")]

    def test_phase_is_kept_when_the_loop_is_late(self, buckets: IntervalBuckets) -> None:
        buckets.set_interval("a", 100, 0)
        assert sent_at(buckets, range(0, 501, 70)) == [(140, "a"), (210, "a"), (350, "a"), (420, "a")]

    def test_missed_turns_are_not_made_up_for(self, buckets: IntervalBuckets) -> None:
        buckets.set_interval("a", 100, 0)
        assert sent_at(buckets, (350, 449, 450)) == [(350, "a"), (450, "a")]

    def test_messages_of_one_interval_come_in_one_burst(self, buckets: IntervalBuckets) -> None:
        for name in "cab":
            buckets.set_interval(name, 100, 0)
        assert sent_at(buckets, range(350))[1:] == [(200, "abc"), (300, "abc")]

    def test_first_burst_holds_the_message_that_was_the_first_of_all(self, buckets: IntervalBuckets) -> None:
        for name in "cab":
            buckets.set_interval(name, 100, 0)
        assert send(buckets, 100) == "c"

    def test_bucket_that_would_be_due_earlier_waits_for_the_chosen_one(self, buckets: IntervalBuckets) -> None:
        buckets.set_interval("a", 1000, 0)
        buckets.set_interval("b", 100, 0)
        assert sent_at(buckets, range(1200)) == [(1000, "ab"), (1100, "b")]

    def test_message_taken_out_is_left_out_of_a_running_burst(self, buckets: IntervalBuckets) -> None:
        for name in "ab":
            buckets.set_interval(name, 100, 0)
        assert send(buckets, 100) == "a"
        buckets.note_sent(min(buckets.due(200)), 200)
        buckets.set_interval("b", 0, 200)
        assert sent_at(buckets, range(200, 310)) == [(200, "a"), (300, "a")]

    def test_what_is_left_of_a_burst_comes_next_time(self, buckets: IntervalBuckets) -> None:
        for name in "abc":
            buckets.set_interval(name, 100, 0)
        send(buckets, 100)
        buckets.note_sent("a", 200)
        assert sent_at(buckets, (205, 299, 300)) == [(205, "bc"), (300, "abc")]

    def test_interval_is_stretched_when_the_time_comes(self) -> None:
        factor = 4
        buckets = IntervalBuckets(lambda interval_ms: interval_ms * factor)
        buckets.set_interval("a", 250, 0)
        assert sent_at(buckets, range(1000)) == []
        factor = 1
        assert sent_at(buckets, range(1000, 1300)) == [(1000, "a"), (1250, "a")]

    def test_clock_of_16_bits_wraps(self, buckets: IntervalBuckets) -> None:
        buckets.set_interval("a", 100, 65_500)
        assert sent_at(buckets, range(65_500, 65_750)) == [(65_600, "a"), (65_700, "a")]


@given(last=st.integers(0, 65535), interval=st.integers(1, 60_000), late=st.integers(0, 65535))
def test_next_turn_is_at_most_one_interval_ago(last: int, interval: int, late: int) -> None:
    now_ms = last + interval + late
    noted = next_sent_ms(last, interval, now_ms)
    assert (now_ms - noted) % 65536 <= interval
    assert (noted - last) % 65536 == interval or noted == now_ms % 65536


class AnyCalls(RuleBasedStateMachine):
    """Any sequence of calls, against a plain table of who asked for what."""

    def __init__(self) -> None:
        super().__init__()
        self.slowdown_ms = 0
        self.buckets = IntervalBuckets(lambda interval_ms: min(interval_ms + self.slowdown_ms, 60_000))
        self.wanted: dict[str, int] = {}
        self.now_ms = 0

    @rule(name=st.sampled_from(NAMES), interval_ms=st.one_of(st.just(0), st.integers(3, 40), st.integers(3, 60_000)))
    def set_interval(self, name: str, interval_ms: int) -> None:
        """Somebody asks for a message, or wants no more of it."""
        taken = set(self.buckets.intervals_ms().values())
        alone = list(self.buckets.intervals_ms().values()).count(self.buckets.intervals_ms().get(name, 0)) == 1
        self.buckets.set_interval(name, interval_ms, self.now_ms)
        self.wanted.pop(name, None)
        if interval_ms:
            self.wanted[name] = interval_ms
            given_ms = self.buckets.intervals_ms()[name]
            if len(taken) < BUCKET_COUNT or alone or interval_ms in taken:
                assert given_ms == interval_ms
            else:
                assert abs(given_ms - interval_ms) == min(abs(other - interval_ms) for other in taken)

    @rule(step_ms=st.integers(0, 5000), room=st.integers(0, 30), slowdown_ms=st.sampled_from((0, 60)))
    def send(self, step_ms: int, room: int, slowdown_ms: int) -> None:
        """Time passes, and the link takes so many messages."""
        self.now_ms += step_ms
        self.slowdown_ms = slowdown_ms
        burst: list[str] = []
        while (due := self.buckets.due(self.now_ms)) and len(burst) < room:
            assert due <= set(self.wanted)
            burst.append(min(due))
            self.buckets.note_sent(burst[-1], self.now_ms)
        # Two turns at most, when the loop is late by exactly one interval.
        assert all(burst.count(name) <= 2 for name in burst)

    @invariant()
    def every_message_is_in_one_bucket(self) -> None:
        """Who asked has an interval, nobody else does, and there are no more than ten."""
        intervals = self.buckets.intervals_ms()
        assert set(intervals) == set(self.wanted)
        assert len(set(intervals.values())) <= BUCKET_COUNT
        held = [name for bucket in self.buckets._buckets for name in bucket.names]
        assert len(held) == len(set(held))
        assert self.buckets.is_empty == (not self.wanted)


TestAnyCalls = AnyCalls.TestCase
