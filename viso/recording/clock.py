# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The autopilot's clock, told by its answers to TIMESYNC."""

from typing import Final

RATE_SPAN_US: Final = 2_000_000
"""Between answers from which the rate is taken."""
_SLACK_US: Final = 500
_REAL_TIME: Final = 0.15
"""A clock whose rate is within this of 1 runs in real time."""


class AutopilotClock:
    """When the autopilot booted, by the recorder's clock, None until an answer has come, and how fast its time runs.

    ``boots`` counts how often its clock has started again.
    """

    def __init__(self) -> None:
        self.boot_us: int | None = None
        self.boots = 0
        self._round_trip_us = 0
        self._shown_us = 0
        self._first: tuple[int, int] | None = None
        self._latest = 0, 0

    def take(self, asked_us: int, now_us: int, shown_us: int) -> None:
        """Take in an answer: when it was asked for, when it came, and what the autopilot's clock showed."""
        if self.boot_us is not None and shown_us < self._shown_us:
            self.boots += 1
            self.boot_us = self._first = None
        self._shown_us = shown_us
        middle_us, round_trip_us = (asked_us + now_us) // 2, now_us - asked_us
        if self._first is None:
            self._first = middle_us, shown_us
        self._latest = middle_us, shown_us
        # The quickest answer tells best; the bound grows, so that a clock that runs otherwise is followed.
        if self.boot_us is None or round_trip_us <= self._round_trip_us + _SLACK_US:
            self.boot_us = middle_us - shown_us
            self._round_trip_us = round_trip_us
        else:
            self._round_trip_us += _SLACK_US

    def time_us(self, now_us: int) -> int | None:
        """Return what the autopilot's clock shows; None while that is not known."""
        return None if self.boot_us is None else max(0, now_us - self.boot_us)

    def take_rate(self) -> float | None:
        """Return how many seconds of the autopilot pass in one of the recorder, once that is known.

        All that was known is then forgotten, as the recorder's clock is to follow.
        """
        if self._first is None or self._latest[0] - self._first[0] < RATE_SPAN_US:
            return None
        rate = (self._latest[1] - self._first[1]) / (self._latest[0] - self._first[0])
        self.boot_us = self._first = None
        return 1.0 if abs(rate - 1) < _REAL_TIME else rate
