# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""When a task has its turns, and that turns which are left out are those that would have been had."""

from functools import partial

from hypothesis import given
from hypothesis import strategies as st

from ap_core.clock import NEVER
from viso.vehicle.tasks import EACH_PASS, Task, next_due_us

PASS_US = 2500


class Noted:
    """A task that notes when it is done."""

    def __init__(self, period_us: int = EACH_PASS, next_us: int = 0) -> None:
        self.ran_us: list[int] = []
        self._now_us = 0
        self.task = Task("noted", lambda: self.ran_us.append(self._now_us), period_us, next_us=next_us)

    def run(self, *times_us: int) -> list[int]:
        """Make passes at times; return in which the task had a turn."""
        for self._now_us in times_us:
            self.task.run_if_due(self._now_us)
        return self.ran_us


def test_task_of_each_pass_has_a_turn_in_each() -> None:
    assert Noted().run(0, 2500, 5000) == [0, 2500, 5000]


def test_task_with_a_period_has_a_turn_in_the_first_pass_after_each() -> None:
    assert Noted(6000).run(0, 2500, 5000, 7500, 10_000, 12_500, 15_000) == [0, 7500, 15_000]


def test_period_counts_from_a_turn_that_came_late() -> None:
    assert Noted(5000).run(0, 12_000, 14_500, 17_000) == [0, 12_000, 17_000]


def test_first_turn_may_be_later() -> None:
    assert Noted(5000, 6000).run(0, 2500, 5000, 7500, 10_000, 12_500) == [7500, 12_500]


def test_task_is_due_when_it_has_its_turn_and_is_not_idle() -> None:
    task = Task("camera", lambda: None, 100, idle_until_us=lambda: 5000)
    task.run_if_due(1000)
    assert next_due_us([task]) == 5000
    task.idle_until_us = lambda: 0
    assert next_due_us([task]) == 1100
    task.idle_until_us = lambda: NEVER
    assert next_due_us([task]) == NEVER


def test_first_task_that_has_something_to_do_counts() -> None:
    tasks = [Task("idle", lambda: None, idle_until_us=partial(int, idle_us)) for idle_us in (9, 3, 5)]
    assert next_due_us(tasks) == 3
    assert next_due_us([]) == NEVER


@given(
    st.sampled_from([EACH_PASS, 2500, 6000, 20_000, 40_000, 100_000]),
    st.integers(0, 60_000),
    st.sampled_from([2500, 3000, 10_000]),
    st.integers(1, 60),
)
def test_turns_left_out_are_those_that_would_have_been_had(period_us: int, next_us: int, step_us: int, n: int) -> None:
    had, left = Noted(period_us, next_us), Noted(period_us, next_us)
    times_us = range(7500, 7500 + n * step_us, step_us)
    had.run(*times_us)
    left.task.leave_out(times_us)
    for later_us in range(times_us.stop, times_us.stop + 200_000, step_us):
        had.run(later_us)
        left.run(later_us)
    assert [time_us for time_us in had.ran_us if time_us >= times_us.stop] == left.ran_us
