# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A queue that never makes anybody wait: what is too much goes, oldest first, and is counted."""

from hypothesis import given
from hypothesis import strategies as st

from viso.web.requests import BoundedQueue


@given(st.lists(st.integers(), max_size=40), st.integers(1, 20))
def test_newest_are_kept_in_order_and_the_rest_is_counted(things: list[int], limit: int) -> None:
    queue: BoundedQueue[int] = BoundedQueue(limit)
    for thing in things:
        queue.put(thing)
    assert list(queue.take_all()) == things[-limit:]
    assert queue.lost == max(len(things) - limit, 0)


def test_nothing_is_taken_twice() -> None:
    queue: BoundedQueue[int] = BoundedQueue(3)
    queue.put(1)
    assert (list(queue.take_all()), list(queue.take_all()), len(queue)) == ([1], [], 0)


def test_what_must_not_be_lost_is_refused_when_there_is_no_room() -> None:
    queue: BoundedQueue[int] = BoundedQueue(1)
    assert queue.put_if_room(1)
    assert not queue.put_if_room(2)
    assert list(queue.take_all()) == [1]
    assert queue.lost == 0
