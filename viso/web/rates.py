# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How many messages of each kind come in a second, how many are accepted, and how many does the filter use."""

from collections import Counter, deque
from collections.abc import Iterable
from typing import Any, Final

from ap_core.verdict import VerdictKind
from mav_handlers.endpoint import BAD_DATA_NAME, MessageEvent
from viso.vehicle.outcomes import OUTCOME_WAIT_US, HandedSample, OutcomeKind, SampleOutcomes, SampleTest, outcome_kind

WINDOW_US: Final = 2_000_000
OFFERED: Final = "offered"
FUSED: Final = "fused"
_USED: Final = (OutcomeKind.FUSED, OutcomeKind.RESET)


class Rates:
    """Counts messages by name over the last seconds, and in all.

    A message counts as fused once the filter has used a sample of it, which is a tenth of a second later or more.
    """

    def __init__(self) -> None:
        self._outcomes = SampleOutcomes()
        self._waiting: deque[tuple[int, str, tuple[HandedSample, ...]]] = deque()
        self._marks: deque[tuple[int, str, str]] = deque()
        self._recent: Counter[tuple[str, str]] = Counter()
        self._total: Counter[tuple[str, str]] = Counter()
        self._start_us = 0

    def take_sample(self, test: SampleTest) -> None:
        """Note what the filter did with a sample."""
        self._outcomes.take(test)

    def take_message(self, event: MessageEvent) -> None:
        """Note a message, after the filter has taken or refused its samples."""
        handed = self._outcomes.take_handed()
        if event.name == BAD_DATA_NAME:
            return
        self._mark(event.now_us, event.name, OFFERED)
        self._mark(event.now_us, event.name, event.verdict.kind.value)
        if handed:
            self._waiting.append((event.now_us, event.name, handed))

    def _mark(self, time_us: int, name: str, what: str) -> None:
        self._marks.append((time_us, name, what))
        self._recent[name, what] += 1
        self._total[name, what] += 1

    def restart(self) -> None:
        """Restart, as time does; what was counted in all stays."""
        self._outcomes = SampleOutcomes()
        self._waiting.clear()
        self._marks.clear()
        self._recent.clear()
        self._start_us = 0

    def _settle(self, now_us: int) -> None:
        still: deque[tuple[int, str, tuple[HandedSample, ...]]] = deque()
        for time_us, name, samples in self._waiting:
            if _is_used(samples):
                self._mark(now_us, name, FUSED)
            elif now_us - time_us < OUTCOME_WAIT_US and not all(sample.is_settled for sample in samples):
                still.append((time_us, name, samples))
                continue
            self._outcomes.forget(samples)
        self._waiting = still

    def rows(self, now_us: int) -> list[dict[str, Any]]:
        """Return a row for each name that has come, with messages per second and in all, as JSON has it."""
        self._settle(now_us)
        while self._marks and now_us - self._marks[0][0] > WINDOW_US:
            _, name, what = self._marks.popleft()
            self._recent[name, what] -= 1
        span_s = max(min(now_us, WINDOW_US), 100_000) / 1e6
        kinds = (OFFERED, *(outcome.value for outcome in VerdictKind), FUSED)
        names = sorted({name for name, _ in self._total})
        return [
            {
                "name": name,
                "per_s": {kind: round(self._recent[name, kind] / span_s, 1) for kind in kinds},
                "total": {kind: self._total[name, kind] for kind in kinds},
            }
            for name in names
        ]


def _is_used(samples: Iterable[HandedSample]) -> bool:
    return any(outcome_kind(test.outcome.rule) in _USED for sample in samples for test in sample.outcomes)
