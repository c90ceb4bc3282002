# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How a simulator's messages are timed, and what its barometer says."""

import math
from typing import Final

NEWEST_WEIGHT: Final = 0.02
SHORTEST, LONGEST = 0.25, 4.0
"""Of an interval that is used, in average ones."""

LATE_US: Final = 1_000_000
"""What is older than the newest message by less is late; by more, time has restarted."""

REFERENCE_US: Final = 1_000_000
"""For so long heights are averaged; they count from there."""

_USUAL_US: Final = (1000.0, 100_000.0)
_SEA_LEVEL_HPA: Final = 1013.25
_ISA_SCALE_M: Final = 288.15 / 0.0065
_ISA_EXPONENT: Final = 287.053 * 0.0065 / 9.80665


def isa_height_m(pressure_hpa: float) -> float:
    """Return the height of the standard atmosphere (troposphere) at a pressure above 0."""
    return _ISA_SCALE_M * (1.0 - math.pow(pressure_hpa / _SEA_LEVEL_HPA, _ISA_EXPONENT))


class MessageTime:
    """Intervals of messages by their stamps, us."""

    def __init__(self) -> None:
        self._last_us: int | None = None
        self._average_us = 0.0
        self._intervals = 0

    def refusal(self, time_us: int) -> str | None:
        """Return why a message of that time is of no use, or None."""
        if self._last_us is None or not 0 <= self._last_us - time_us < LATE_US:
            return None
        return "repeated" if time_us == self._last_us else "late"

    def interval_us(self, time_us: int) -> int | None:
        """Return how long after the message before one comes that is not refused; None if time begins with it."""
        last_us, self._last_us = self._last_us, time_us
        return None if last_us is None or time_us < last_us else time_us - last_us

    def restart(self) -> None:
        """Let time begin with the next message."""
        self._last_us = None

    def limited_s(self, interval_us: int) -> float:
        """Return an interval in s, within what is usual, and learn from it what is."""
        low, high = _USUAL_US
        if self._intervals:
            low, high = max(low, 0.5 * self._average_us), min(high, 2.0 * self._average_us)
        self._intervals += 1
        weight = max(1.0 / self._intervals, NEWEST_WEIGHT)
        self._average_us += weight * (max(low, min(float(interval_us), high)) - self._average_us)
        return 1e-6 * max(SHORTEST * self._average_us, min(float(interval_us), LONGEST * self._average_us))


class RelativeHeight:
    """Heights above the average of the first second."""

    def __init__(self) -> None:
        self._first_us: int | None = None
        self._sum = 0.0
        self._count = 0

    def take(self, time_us: int, height_m: float) -> float | None:
        """Return a height above the reference, or None while that is still being found."""
        if self._first_us is None:
            self._first_us = time_us
        if self._count and not 0 <= time_us - self._first_us < REFERENCE_US:
            return height_m - self._sum / self._count
        self._sum += height_m
        self._count += 1
        return None
