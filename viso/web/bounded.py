# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A queue between two threads that never makes the one that fills it wait for the other."""

import threading
from collections import deque
from typing import Generic, TypeVar

T = TypeVar("T")


class BoundedQueue(Generic[T]):
    """Holds the newest things that nobody has taken yet; over a limit the oldest go, and are counted as lost."""

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._waiting: deque[T] = deque()
        self._lock = threading.Lock()
        self.lost = 0

    def __len__(self) -> int:
        """Return how many wait."""
        return len(self._waiting)

    def put(self, thing: T) -> None:
        """Add something."""
        with self._lock:  # held by the other side for as long as two assignments take
            if len(self._waiting) >= self._limit:
                self._waiting.popleft()
                self.lost += 1
            self._waiting.append(thing)

    def put_if_room(self, thing: T) -> bool:
        """Add something unless there is no room; say whether it was added."""
        with self._lock:
            if len(self._waiting) >= self._limit:
                return False
            self._waiting.append(thing)
            return True

    def take_all(self) -> deque[T]:
        """Return all that waits, oldest first."""
        with self._lock:
            taken, self._waiting = self._waiting, deque()
        return taken
