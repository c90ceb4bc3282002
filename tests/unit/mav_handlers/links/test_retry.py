# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Waits between attempts, on a clock that the test moves."""

from mav_handlers.links.base import Backoff


class Clock:
    now_s = 10.0

    def __call__(self) -> float:
        return self.now_s


def waits(backoff: Backoff, clock: Clock, count: int) -> list[float]:
    """Fail ``count`` times and return how long each wait was, to 0.25 s."""
    found = []
    for _ in range(count):
        backoff.failed()
        since_s = clock.now_s
        while not backoff.due():
            clock.now_s += 0.25
        found.append(clock.now_s - since_s)
    return found


def test_first_attempt_is_due_at_once() -> None:
    assert Backoff(Clock()).due()


def test_waits_double_up_to_a_limit() -> None:
    clock = Clock()
    assert waits(Backoff(clock), clock, 7) == [0.25, 0.5, 1.0, 2.0, 4.0, 4.0, 4.0]


def test_success_starts_the_waits_over() -> None:
    clock = Clock()
    backoff = Backoff(clock)
    waits(backoff, clock, 5)
    backoff.succeeded()
    assert waits(backoff, clock, 2) == [0.25, 0.5]


def test_loss_waits_the_first_interval_only() -> None:
    clock = Clock()
    backoff = Backoff(clock)
    waits(backoff, clock, 5)
    backoff.lost()
    assert not backoff.due()
    clock.now_s += 0.25
    assert backoff.due()
