# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""When a message of a link is due: ten buckets hold periodic messages by interval; some messages have own timers.

Source: GCS_MAVLink/GCS_Common.cpp (set_ap_message_interval, remove_message_from_bucket, find_next_bucket_to_send,
next_deferred_bucket_message_to_send, deferred_message_to_send_index, update_send). Times are milliseconds since boot,
compared in 16 bits.
"""

from collections.abc import Callable, Set
from dataclasses import dataclass, field
from typing import Final

from ap_core.cint import u16

BUCKET_COUNT: Final = 10
NEVER_MS: Final = 1 << 32
"""The wait for an event that does not come."""

_FAR_MS: Final = 65535

NEXT_PARAM: Final = "PARAM_VALUE"
"""The turn of parameter replies and of a parameter list; it sends many messages or none (MSG_NEXT_PARAM)."""

DEFERRED: Final = ("HEARTBEAT", NEXT_PARAM, "HIGH_LATENCY2")


@dataclass(slots=True, eq=False)
class _Bucket:
    """Messages that go out together; free while the interval is 0."""

    interval_ms: int = 0
    last_sent_ms: int = 0
    names: set[str] = field(default_factory=set)

    def free(self) -> None:
        self.interval_ms = 0
        self.last_sent_ms = 0


class IntervalBuckets:
    """The messages sent at intervals, and which of them are due.

    One bucket at a time is chosen as the next, and the messages of its burst are fixed at that moment. Messages added
    later, and any other bucket that becomes due earlier, wait until that burst has been sent.

    Args:
        stretch: returns a bucket's effective interval from its nominal one, both in ms.
    """

    def __init__(self, stretch: Callable[[int], int]) -> None:
        self._stretch = stretch
        self._buckets = tuple(_Bucket() for _ in range(BUCKET_COUNT))
        self._sending: _Bucket | None = None
        self._to_send: set[str] = set()

    @property
    def is_empty(self) -> bool:
        """Return whether no message has an interval (GCS_MAVLINK::is_streaming, negated)."""
        return self._sending is None

    def intervals_ms(self) -> dict[str, int]:
        """Return the interval of each message in a bucket, before any slow-down."""
        return {name: bucket.interval_ms for bucket in self._buckets for name in bucket.names}

    def set_interval(self, name: str, interval_ms: int, now_ms: int) -> None:
        """Put a message into the bucket of its interval, or of the nearest interval when all ten are taken.

        An interval of 0 removes it.
        """
        current = next((bucket for bucket in self._buckets if name in bucket.names), None)
        if interval_ms == 0:
            if current is not None:
                self._remove(current, name, now_ms)
            return
        free = next((bucket for bucket in self._buckets if bucket.interval_ms == 0), None)
        target = min(self._buckets, key=lambda bucket: _distance_ms(bucket, interval_ms))
        fits = target.interval_ms == interval_ms
        if current is not None:
            if fits and current is target:
                return
            self._remove(current, name, now_ms)
            if free is None and not current.names:
                free = current
        if free is not None and not fits:
            target = free
            target.interval_ms = interval_ms
            target.last_sent_ms = u16(now_ms)
        target.names.add(name)
        if self._sending is None:
            self._choose(target)

    def _remove(self, bucket: _Bucket, name: str, now_ms: int) -> None:
        bucket.names.discard(name)
        if not bucket.names:
            bucket.free()
        if bucket is self._sending:
            self._to_send.discard(name)
            if not self._to_send:
                self._find_next(now_ms)

    def _choose(self, bucket: _Bucket | None) -> None:
        self._sending = bucket
        self._to_send = set() if bucket is None else set(bucket.names)

    def _find_next(self, now_ms: int) -> None:
        used = [bucket for bucket in self._buckets if bucket.names]
        self._choose(min(used, key=lambda bucket: self._wait_ms(bucket, now_ms), default=None))

    def _wait_ms(self, bucket: _Bucket, now_ms: int) -> int:
        return max(self._stretch(bucket.interval_ms) - u16(now_ms - bucket.last_sent_ms), 0)

    def due(self, now_ms: int) -> Set[str]:
        """Return the unsent messages of the due burst; none if no burst is due."""
        if self._sending is None or self._wait_ms(self._sending, now_ms) > 0:
            return frozenset()
        return self._to_send

    def wait_ms(self, now_ms: int) -> int:
        """Return the time until a burst is due, 0 while one is."""
        return NEVER_MS if self._sending is None else self._wait_ms(self._sending, now_ms)

    def note_sent(self, name: str, now_ms: int) -> None:
        """Remove a message from the burst; after the last one, the bucket is due again one interval later.

        The phase is kept unless more than one turn was missed.
        """
        bucket = self._sending
        self._to_send.discard(name)
        if bucket is None or self._to_send:
            return
        interval_ms = self._stretch(bucket.interval_ms)
        bucket.last_sent_ms = next_sent_ms(bucket.last_sent_ms, interval_ms, now_ms)
        self._find_next(now_ms)


def _distance_ms(bucket: _Bucket, interval_ms: int) -> int:
    return abs(bucket.interval_ms - interval_ms) if bucket.interval_ms else _FAR_MS


def next_sent_ms(last_sent_ms: int, interval_ms: int, now_ms: int) -> int:
    """Return the new time of sending: one interval after the last, or now if that is too long ago."""
    kept_phase_ms = u16(last_sent_ms + interval_ms)
    return kept_phase_ms if u16(now_ms - kept_phase_ms) <= interval_ms else u16(now_ms)


@dataclass(slots=True)
class _Timer:
    interval_ms: int = 0
    last_sent_ms: int = 0

    def wait_ms(self, now_ms: int) -> int:
        return max(self.interval_ms - u16(now_ms - self.last_sent_ms), 0)

    def is_due(self, now_ms: int) -> bool:
        return u16(now_ms - self.last_sent_ms) >= self.interval_ms


class DeferredMessages:
    """Timers of the heartbeat and of the parameter turn, which are never slowed down.

    When a message has been sent, the one that is due first becomes the next and stays the next.
    """

    def __init__(self) -> None:
        self._timers = {name: _Timer() for name in DEFERRED}
        self._next: str | None = None

    def intervals_ms(self) -> dict[str, int]:
        """Return the interval of each message."""
        return {name: timer.interval_ms for name, timer in self._timers.items() if timer.interval_ms}

    def set_interval(self, name: str, interval_ms: int, now_ms: int) -> None:
        """Send a message at an interval from now on; 0 stops it, after one more if it is already the next."""
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
        """Return the time until a message is due, 0 while one is due or the next is not yet chosen."""
        if self._next is not None:
            return self._timers[self._next].wait_ms(now_ms)
        return 0 if self.intervals_ms() else NEVER_MS

    def note_sent(self, name: str, now_ms: int) -> None:
        """Start a message's next interval."""
        timer = self._timers[name]
        timer.last_sent_ms = next_sent_ms(timer.last_sent_ms, timer.interval_ms, now_ms)
        self._next = None
