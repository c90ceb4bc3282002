# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the main loop does, as a table (AP_Scheduler/AP_Scheduler.cpp).

A task has a turn in each pass of the loop, or in the first one after each of its periods. A turn in which it has
nothing to do may be left out. So the loop runs many passes as one where there is nothing but the filter to run.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Final

from ap_core.clock import NEVER, count_before

EACH_PASS: Final = 0


def never_idle() -> int:
    """Return 0: each turn may have something to do."""
    return 0


def always_idle() -> int:
    """Return that no turn ever has anything to do."""
    return NEVER


@dataclass(slots=True)
class Task:
    """Something that the main loop does.

    Attributes:
        name: what it is called.
        run: does it, in the pass at which the clock stands.
        period_us: from one turn to the next.
        idle_until_us: returns before when a turn has nothing to do, as things are; 0 if the next one may.
        next_us: when its next turn is.
    """

    name: str
    run: Callable[[], object]
    period_us: int = EACH_PASS
    idle_until_us: Callable[[], int] = never_idle
    next_us: int = 0

    def run_if_due(self, now_us: int) -> None:
        """Do it, if it has its turn in the pass at a time."""
        if now_us >= self.next_us:
            self.next_us = now_us + self.period_us
            self.run()

    def leave_out(self, times_us: range) -> None:
        """Note that its turns in some passes, at least one, are over; it had nothing to do in them."""
        last_us, step_us = times_us[-1], times_us.step
        if self.period_us != EACH_PASS and self.next_us <= last_us:
            first_us = times_us.start + count_before(times_us, self.next_us) * step_us
            every_us = -(-self.period_us // step_us) * step_us
            self.next_us = first_us + (last_us - first_us) // every_us * every_us + self.period_us


def next_due_us(tasks: Iterable[Task]) -> int:
    """Return when the first of some tasks is due, as far as is known now."""
    due_us = NEVER
    for task in tasks:
        if task.next_us < due_us and (until_us := task.idle_until_us()) < due_us:
            due_us = max(task.next_us, until_us)
    return due_us
