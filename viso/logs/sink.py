# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the bytes of a log go."""

from typing import Protocol

from ap_core.clock import NEVER


class LogSink(Protocol):
    """An open log: a file, or memory in tests.

    Attributes:
        dropped: how many records are lost.
        reason: why, in one line, once the log takes no more.
        flush_due_us: before when, since boot, there is nothing to do for ``flush_if_due``.
    """

    dropped: int
    reason: str | None
    flush_due_us: int

    def write(self, data: bytes) -> bool:
        """Append whole records; False if they are lost."""

    def flush_if_due(self, now_us: int) -> bool:
        """Write out what waits when its time has come; False if the log takes no more."""

    def close(self) -> None:
        """Write out what waits and let go."""


class MemoryLog:
    """A log in memory."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.dropped = 0
        self.reason: str | None = None
        self.flush_due_us = NEVER

    def write(self, data: bytes) -> bool:
        """Append whole records."""
        self.data += data
        return True

    def flush_if_due(self, now_us: int) -> bool:
        """Do nothing: memory is always up to date."""
        return True

    def close(self) -> None:
        """Do nothing: the data stays readable."""
