# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A proxy between two links that puts faults into one direction, in real time."""

import time
from collections.abc import Callable
from typing import Final

from mav_handlers.links import wait_readable
from mav_handlers.links.base import Link
from viso.faults import Injector
from viso.faults.packet import FrameSplitter

LONGEST_WAIT_S: Final = 0.05
"""How long to wait at once, so that a signal is heeded soon."""
MAX_READS: Final = 64


class FaultProxy:
    """Carries all bytes between two links, those from the first to the second with faults.

    Bytes that are no frame are carried as well, and what comes from the second goes back as it is. What a link cannot
    deliver it counts itself. The injector must be fresh, the clock monotonic.
    """

    def __init__(
        self,
        source: Link,
        target: Link,
        injector: Injector,
        *,
        stop: Callable[[], bool],
        now_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self._source = source
        self._target = target
        self._injector = injector
        self._stop = stop
        self._now_s = now_s
        self._start_s = now_s()
        self._splitter = FrameSplitter()
        self.bytes_back = 0

    @property
    def unread_bytes(self) -> int:
        return self._splitter.unread_bytes

    def _now_us(self) -> int:
        return round((self._now_s() - self._start_s) * 1e6)

    def run(self, until_us: int | None = None) -> None:
        """Carry until told to stop, or for so long."""
        while not self._stop() and (until_us is None or self._now_us() < until_us):
            self._wait()
            self.step()

    def _wait(self) -> None:
        due_us = self._injector.next_due_us()
        wait_s = LONGEST_WAIT_S if due_us is None else (due_us - self._now_us()) * 1e-6
        wait_readable((self._source, self._target), min(max(wait_s, 0.0), LONGEST_WAIT_S))

    def step(self) -> None:
        """Carry what has arrived and what is due."""
        # A peer that never stops must not keep the other direction from its turn.
        for _ in range(MAX_READS):
            data = self._source.receive()
            if not data:
                break
            for piece in self._splitter.feed(data):
                self._injector.push(self._now_us(), piece)
        for _ in range(MAX_READS):
            data = self._target.receive()
            if not data:
                break
            self.bytes_back += len(data)
            self._source.send(data)
        for _, frame in self._injector.pop_due(self._now_us()):
            self._target.send(frame)
