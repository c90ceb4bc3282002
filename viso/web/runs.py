# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Verdicts as rows that a person can read at 200 messages per second: the same again is counted, not repeated."""

from collections import deque
from typing import Any, Final, NamedTuple

RUNS_KEPT: Final = 300
GAP_US: Final = 1_500_000
"""After a pause this long, what happened before counts as news; heartbeats, once a second, do not."""


class RunKey(NamedTuple):
    """What is the same in a run.

    ``sender`` is ``system:component``. Of a sample in the filter, the link and the sender are empty.
    """

    link: str
    name: str
    sender: str
    outcome: str
    rule: str


class Run:
    """The same verdict on the same kind of message, or on bytes that are no frame, over and over; numbered from 1."""

    def __init__(self, number: int, key: RunKey, about: dict[str, Any], time_us: int) -> None:
        self.number = number
        self.key = key
        self._about = about
        self.first_us = self.last_us = time_us
        self.count = 0

    def as_dict(self) -> dict[str, Any]:
        """Return the run as JSON has it."""
        return {
            "id": self.number,
            **self.key._asdict(),
            **self._about,
            "count": self.count,
            "first_s": self.first_us / 1e6,
            "last_s": self.last_us / 1e6,
        }


class Runs:
    """The newest runs, no more than the limit if there is one."""

    def __init__(self, limit: int | None = RUNS_KEPT) -> None:
        self._limit = limit
        self._kept: deque[Run] = deque()
        self._open: dict[RunKey, Run] = {}
        self._changed: dict[int, Run] = {}
        self._numbers = 0

    def take(self, key: RunKey, about: dict[str, Any], time_us: int) -> None:
        """Count something that happened, at a time in us since boot; ``about`` is the same whenever ``key`` is."""
        run = self._open.get(key)
        if run is None or not 0 <= time_us - run.last_us < GAP_US:
            run = self._begin(key, about, time_us)
        run.last_us = time_us
        run.count += 1
        self._changed[run.number] = run

    def _begin(self, key: RunKey, about: dict[str, Any], time_us: int) -> Run:
        self._numbers += 1
        run = Run(self._numbers, key, about, time_us)
        self._kept.append(run)
        self._open[key] = run
        if self._limit is not None and len(self._kept) > self._limit:
            gone = self._kept.popleft()
            self._changed.pop(gone.number, None)
            if self._open.get(gone.key) is gone:
                del self._open[gone.key]
        return run

    def close(self) -> None:
        """Let everything that comes begin a run of its own, as after a restart."""
        self._open.clear()

    def take_changed(self) -> list[dict[str, Any]]:
        """Return, once, the runs that have begun or grown, oldest first."""
        changed, self._changed = self._changed, {}
        return [changed[number].as_dict() for number in sorted(changed)]

    def all(self) -> list[dict[str, Any]]:
        """Return all that are kept, oldest first."""
        return [run.as_dict() for run in self._kept]
