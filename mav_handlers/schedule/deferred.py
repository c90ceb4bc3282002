# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Messages of a link that have timers of their own and are never slowed down: the heartbeat and the parameter pump.

Source: GCS_MAVLink/GCS_Common.cpp (deferred_message_to_send_index, set_ap_message_interval, update_send).
"""

from dataclasses import dataclass
from typing import Final

from ap_core.cint import u16
from mav_handlers.schedule.buckets import NEVER_MS, next_sent_ms

NEXT_PARAM: Final = "PARAM_VALUE"
"""Stands for the turn of parameter replies and of a parameter list, many messages or none (MSG_NEXT_PARAM)."""

DEFERRED: Final = ("HEARTBEAT", NEXT_PARAM, "HIGH_LATENCY2")


@dataclass(slots=True)
class _Timer:
    interval_ms: int = 0
    last_sent_ms: int = 0

    def wait_ms(self, now_ms: int) -> int:
        return max(self.interval_ms - u16(now_ms - self.last_sent_ms), 0)

    def is_due(self, now_ms: int) -> bool:
        return u16(now_ms - self.last_sent_ms) >= self.interval_ms


class DeferredMessages:
    """The timers, of which the one that is due first is chosen when the one before has gone out, and kept till then."""

    def __init__(self) -> None:
        self._timers = {name: _Timer() for name in DEFERRED}
        self._next: str | None = None

    def intervals_ms(self) -> dict[str, int]:
        """Return the interval of each message that has one."""
        return {name: timer.interval_ms for name, timer in self._timers.items() if timer.interval_ms}

    def set_interval(self, name: str, interval_ms: int, now_ms: int) -> None:
        """Send a message at an interval from now on; 0 stops it, after one more when its turn is next."""
        self._timers[name] = _Timer(interval_ms, u16(now_ms))

    def due(self, now_ms: int) -> str | None:
        """Return the message whose turn it is, or None."""
        if self._next is None:
            running = self.intervals_ms()
            self._next = min(running, key=lambda name: self._timers[name].wait_ms(now_ms), default=None)
        if self._next is None or not self._timers[self._next].is_due(now_ms):
            return None
        return self._next

    def wait_ms(self, now_ms: int) -> int:
        """Return how long it is until one is due, 0 while one is or the next has yet to be chosen."""
        if self._next is not None:
            return self._timers[self._next].wait_ms(now_ms)
        return 0 if self.intervals_ms() else NEVER_MS

    def note_sent(self, name: str, now_ms: int) -> None:
        """Start a message's next interval."""
        timer = self._timers[name]
        timer.last_sent_ms = next_sent_ms(timer.last_sent_ms, timer.interval_ms, now_ms)
        self._next = None
