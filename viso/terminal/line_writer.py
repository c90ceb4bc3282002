# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Lines for a reader who may be slow: written by a thread of its own, so that the vehicle never waits."""

import contextlib
import os
import select
import threading
from collections import deque
from typing import Final

LINES_WAITING: Final = 20_000
PATIENCE_S: Final = 2.0


class LineWriter:
    """Writes lines to a descriptor, which stays open; a line that finds too many waiting is lost, and counted.

    The count is complete after ``close``. An ``error`` has ended the writing, and everything after it is lost.
    """

    def __init__(self, descriptor: int, *, limit: int = LINES_WAITING) -> None:
        self._descriptor = descriptor
        self._limit = limit
        self._waiting: deque[bytes] = deque()
        self._changed = threading.Condition()
        self._closing = False
        self.lost = 0
        self.error: OSError | None = None
        # What blocks for good ends with the process.
        self._thread = threading.Thread(target=self._run, name="lines", daemon=True)
        self._thread.start()

    @property
    def reader_left(self) -> bool:
        """Return whether the other end of a pipe has been closed."""
        return isinstance(self.error, BrokenPipeError)

    def put(self, line: str) -> None:
        """Have a line written, in order, soon; a line feed is added."""
        with self._changed:
            if self.error is not None or self._closing or len(self._waiting) >= self._limit:
                self.lost += 1
                return
            self._waiting.append(f"{line}\n".encode())
            self._changed.notify()

    def close(self, patience_s: float = PATIENCE_S) -> None:
        """Write what is waiting; what a reader has not taken after some seconds is lost."""
        with self._changed:
            self._closing = True
            self._changed.notify()
        self._thread.join(patience_s)
        with self._changed:
            self.lost += len(self._waiting)
            self._waiting.clear()

    def _run(self) -> None:
        while (line := self._next()) is not None:
            try:
                self._write(line)
            except OSError as error:
                self._give_up(error)
                return
            with self._changed, contextlib.suppress(IndexError):  # a closing that lost patience has counted it
                self._waiting.popleft()

    def _next(self) -> bytes | None:
        """Return the oldest line, which goes on waiting until it is written; None at the end."""
        with self._changed:
            self._changed.wait_for(lambda: self._waiting or self._closing)
            return self._waiting[0] if self._waiting else None

    def _write(self, line: bytes) -> None:
        rest = memoryview(line)
        while rest:
            try:
                rest = rest[os.write(self._descriptor, rest) :]
            except BlockingIOError:  # whoever shares the descriptor may have made it so
                select.select([], [self._descriptor], [])

    def _give_up(self, error: OSError) -> None:
        with self._changed:
            self.error = error
            self.lost += len(self._waiting)
            self._waiting.clear()
