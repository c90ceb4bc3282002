# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The newest inertial data: written by the thread that reads the link, read by the one that works on frames."""

from bisect import bisect_left, bisect_right
from collections import deque
from collections.abc import Callable
from operator import attrgetter
from threading import Condition
from typing import Final

from viso.companion.vio.types import ImuSample, ImuWindow

CAPACITY: Final = 2000  # 10 s at 200 Hz
WAIT_S: Final = 0.05

_TIME: Final = attrgetter("t_ns")

Wait = Callable[[Condition, Callable[[], bool], float], object]


class ImuBuffer:
    """A ring of inertial samples in the order of their time, for one writer and any number of readers."""

    def __init__(self, capacity: int = CAPACITY, wait: Wait = Condition.wait_for) -> None:
        """Make an empty buffer.

        Args:
            capacity: number of samples; the oldest give way.
            wait: given the condition (held), what is waited for, and the longest time in s.

        Raises:
            ValueError: if the capacity is below 2.
        """
        if capacity < 2:
            raise ValueError("capacity: below 2 samples")
        self._samples: deque[ImuSample] = deque(maxlen=capacity)
        self._changed = Condition()
        self._wait = wait

    def add(self, sample: ImuSample) -> bool:
        """Append a sample; return False, and leave it out, if its time is not later than the last one's."""
        with self._changed:
            if self._samples and sample.t_ns <= self._samples[-1].t_ns:
                return False
            self._samples.append(sample)
            self._changed.notify_all()
            return True

    def window(self, t0_ns: int, t1_ns: int, wait_s: float = WAIT_S) -> ImuWindow:
        """Return the samples from the last one at or before ``t0_ns`` to the first one at or after ``t1_ns``.

        Waits for the latter, and then returns what there is.

        Args:
            t0_ns: stamp of the frame before.
            t1_ns: stamp of this frame.

        Raises:
            ValueError: if ``t1_ns`` is before ``t0_ns``.
        """
        with self._changed:
            self._wait(self._changed, lambda: bool(self._samples) and self._samples[-1].t_ns >= t1_ns, wait_s)
            samples = list(self._samples)
        first = max(bisect_right(samples, t0_ns, key=_TIME) - 1, 0)
        last = bisect_left(samples, t1_ns, key=_TIME) + 1
        return ImuWindow(t0_ns, t1_ns, tuple(samples[first:last]))
