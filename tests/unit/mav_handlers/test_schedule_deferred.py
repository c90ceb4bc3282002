# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The timers of the heartbeat and of the parameter pump."""

from collections.abc import Iterable

import pytest

from mav_handlers.schedule import NEVER_MS, NEXT_PARAM, DeferredMessages

HEARTBEAT = "HEARTBEAT"


@pytest.fixture
def deferred() -> DeferredMessages:
    timers = DeferredMessages()
    timers.set_interval(HEARTBEAT, 1000, 0)
    timers.set_interval(NEXT_PARAM, 100, 0)
    return timers


def sent_at(deferred: DeferredMessages, times_ms: Iterable[int]) -> list[tuple[int, str]]:
    sent = []
    for now_ms in times_ms:
        while (name := deferred.due(now_ms)) is not None:
            deferred.note_sent(name, now_ms)
            sent.append((now_ms, name))
    return sent


def times_of(name: str, sent: list[tuple[int, str]]) -> list[int]:
    return [now_ms for now_ms, other in sent if other == name]


def test_nothing_is_due_without_an_interval() -> None:
    assert DeferredMessages().due(10_000) is None


def test_each_message_has_its_own_timer(deferred: DeferredMessages) -> None:
    sent = sent_at(deferred, range(2001))
    assert times_of(HEARTBEAT, sent) == [1000, 2000]
    assert times_of(NEXT_PARAM, sent) == list(range(100, 2001, 100))


def test_heartbeat_comes_first(deferred: DeferredMessages) -> None:
    sent_at(deferred, range(999))
    assert sent_at(deferred, (1005,)) == [(1005, HEARTBEAT), (1005, NEXT_PARAM)]


def test_phase_is_kept_unless_a_turn_is_missed(deferred: DeferredMessages) -> None:
    sent = sent_at(deferred, (150, 199, 200, 550, 649, 650))
    assert times_of(NEXT_PARAM, sent) == [150, 200, 550, 650]


def test_new_interval_counts_from_now(deferred: DeferredMessages) -> None:
    deferred.set_interval(NEXT_PARAM, 20, 50)
    assert times_of(NEXT_PARAM, sent_at(deferred, range(50, 100))) == [70, 90]


def test_choice_of_the_next_one_stands_until_it_is_sent(deferred: DeferredMessages) -> None:
    assert deferred.due(0) is None
    deferred.set_interval(HEARTBEAT, 10, 0)
    assert sent_at(deferred, range(111)) == [(100, NEXT_PARAM), (100, HEARTBEAT), (110, HEARTBEAT)]


def test_message_stopped_when_it_is_next_comes_once_more() -> None:
    deferred = DeferredMessages()
    deferred.set_interval(HEARTBEAT, 1000, 0)
    assert deferred.due(0) is None
    deferred.set_interval(HEARTBEAT, 0, 10)
    assert sent_at(deferred, range(10, 3000)) == [(10, HEARTBEAT)]


def test_intervals_are_those_that_run(deferred: DeferredMessages) -> None:
    deferred.set_interval(HEARTBEAT, 0, 0)
    assert deferred.intervals_ms() == {NEXT_PARAM: 100}


def test_wait_is_that_of_the_next_one(deferred: DeferredMessages) -> None:
    assert deferred.due(0) is None
    assert [deferred.wait_ms(now_ms) for now_ms in (0, 1, 99, 100, 150)] == [100, 99, 1, 0, 0]


def test_there_is_no_wait_before_the_next_one_is_chosen(deferred: DeferredMessages) -> None:
    assert deferred.wait_ms(0) == 0


def test_wait_for_nothing_is_long() -> None:
    assert DeferredMessages().wait_ms(0) == NEVER_MS
