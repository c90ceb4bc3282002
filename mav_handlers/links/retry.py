# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Retry times: the wait doubles until an attempt succeeds."""

import time
from collections.abc import Callable

Monotonic = Callable[[], float]
"""A clock in seconds that never goes back; links read ``time.monotonic`` unless a test passes its own."""


class Backoff:
    """The time of the next attempt; each failure in a row doubles the wait."""

    def __init__(self, monotonic: Monotonic = time.monotonic, first_s: float = 0.25, max_s: float = 4.0) -> None:
        self._monotonic = monotonic
        self._first_s = first_s
        self._max_s = max_s
        self._wait_s = first_s
        self._due_s = monotonic()

    def due(self) -> bool:
        """Return whether to try now."""
        return self._monotonic() >= self._due_s

    def failed(self) -> None:
        """Wait before the next attempt, twice as long as last time."""
        self._due_s = self._monotonic() + self._wait_s
        self._wait_s = min(2.0 * self._wait_s, self._max_s)

    def succeeded(self) -> None:
        """Forget the failures: after a loss, the next attempt waits only the first interval."""
        self._wait_s = self._first_s

    def lost(self) -> None:
        """Wait the first interval after the loss of a connection."""
        self.succeeded()
        self.failed()
