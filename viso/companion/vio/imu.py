# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Inertial data: a ring buffer, the window between two frames, gap detection, and integration steps."""

import itertools
from bisect import bisect_left, bisect_right
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from operator import attrgetter
from threading import Condition
from typing import Final

import numpy as np

from viso.companion.vio.types import ImuSample, ImuWindow
from viso.geometry.rotation import Array

CAPACITY: Final = 2000  # 10 s at 200 Hz
WAIT_S: Final = 0.05

IMU_EMPTY: Final = "imu_empty"
IMU_GAP: Final = "imu_gap"

MAX_GAP_PERIODS: Final = 3
MAX_SHORT_PERIODS: Final = 1
_INTERVALS: Final = 200

_TIME: Final = attrgetter("t_ns")

Wait = Callable[[Condition, Callable[[], bool], float], object]


class ImuBuffer:
    """A ring of inertial samples in the order of their time, for one writer and any number of readers."""

    def __init__(self, capacity: int = CAPACITY, wait: Wait = Condition.wait_for) -> None:
        """Make an empty buffer.

        Args:
            capacity: number of samples; new ones replace the oldest.
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
        """Append a sample; return False, and ignore it, if its time is not later than the last one's."""
        with self._changed:
            if self._samples and sample.t_ns <= self._samples[-1].t_ns:
                return False
            self._samples.append(sample)
            self._changed.notify_all()
            return True

    def window(self, t0_ns: int, t1_ns: int, wait_s: float = WAIT_S) -> ImuWindow:
        """Return the samples from the last one at or before ``t0_ns`` to the first one at or after ``t1_ns``.

        Waits for the latter, then returns the available samples.

        Args:
            t0_ns: stamp of the frame before.
            t1_ns: stamp of this frame.

        Raises:
            ValueError: if ``t1_ns`` is before ``t0_ns``.
        """
        if t1_ns < t0_ns:
            raise ValueError("t1_ns: before t0_ns")
        with self._changed:
            self._wait(self._changed, lambda: bool(self._samples) and self._samples[-1].t_ns >= t1_ns, wait_s)
            samples = list(self._samples)
        first = max(bisect_right(samples, t0_ns, key=_TIME) - 1, 0)
        last = bisect_left(samples, t1_ns, key=_TIME) + 1
        return ImuWindow(t0_ns, t1_ns, tuple(samples[first:last]))


@dataclass(frozen=True, slots=True, eq=False)
class ImuSteps:
    """Consecutive spans of time with what the IMU measured in the middle of each.

    Attributes:
        dt_s: [N], lengths in s, positive.
        gyro: [N, 3] in rad/s, FLU.
        accel: [N, 3] specific force in m/s^2, FLU.
    """

    dt_s: Array
    gyro: Array
    accel: Array


def median_period_ns(window: ImuWindow) -> int | None:
    """Return the median time between neighbouring samples, or None when there are fewer than two."""
    times = [sample.t_ns for sample in window.samples]
    return int(np.median(np.diff(times))) if len(times) > 1 else None


def window_fault(window: ImuWindow, nominal_period_ns: int) -> str | None:
    """Return what is wrong with a window.

    Args:
        nominal_period_ns: between two samples of a healthy IMU.

    Returns:
        ``imu_empty`` if nothing was measured between the two stamps, ``imu_gap`` if samples are more than 3 periods
        apart or stop short of a stamp by more than 1 period, else None.
    """
    if not _measured(window):
        return IMU_EMPTY
    times = [sample.t_ns for sample in window.samples]
    widest = max(_intervals(times), default=0)
    short = max(times[0] - window.start_t_ns, window.end_t_ns - times[-1])
    if widest > MAX_GAP_PERIODS * nominal_period_ns or short > MAX_SHORT_PERIODS * nominal_period_ns:
        return IMU_GAP
    return None


class ImuPeriod:
    """Judges windows of inertial data by the median of the last 200 intervals between samples.

    Stamps that bunch or jitter do not move it, and a stream that has slowed down is one with gaps until half of them
    are long.
    """

    def __init__(self) -> None:
        self._intervals_ns: deque[int] = deque(maxlen=_INTERVALS)
        self._last_ns: int | None = None

    def fault(self, window: ImuWindow) -> str | None:
        """Add the next window; return its fault, as ``window_fault`` does.

        Windows overlap at their ends. One without any duration, as before the first frame, has no faults.
        """
        last_ns = self._last_ns
        times_ns = [sample.t_ns for sample in window.samples if last_ns is None or sample.t_ns >= last_ns]
        self._intervals_ns.extend(_intervals(times_ns))
        if times_ns:
            self._last_ns = times_ns[-1]
        if window.end_t_ns == window.start_t_ns:
            return None
        return window_fault(window, round(np.median(self._intervals_ns))) if self._intervals_ns else IMU_EMPTY


def bracketed(window: ImuWindow) -> tuple[ImuSample, ...]:
    """Return the samples between the stamps of a window, with one interpolated at either stamp.

    Where samples do not reach a stamp, the nearest one is held. The result is empty when the window is (``imu_empty``).
    """
    if not _measured(window):
        return ()
    inside = [sample for sample in window.samples if window.start_t_ns < sample.t_ns < window.end_t_ns]
    return (_sample_at(window.samples, window.start_t_ns), *inside, _sample_at(window.samples, window.end_t_ns))


def steps_of(window: ImuWindow) -> ImuSteps:
    """Return the steps of a window, from stamp to stamp; none when it is empty (``imu_empty``)."""
    return steps_between(bracketed(window))


def steps_between(samples: Sequence[ImuSample]) -> ImuSteps:
    """Return the steps from each sample to the next, each with the mean of both measurements."""
    t_ns = np.array([sample.t_ns for sample in samples], dtype=np.int64)
    gyro = np.array([sample.gyro for sample in samples]).reshape(-1, 3)
    accel = np.array([sample.accel for sample in samples]).reshape(-1, 3)
    return ImuSteps(np.diff(t_ns) * 1e-9, 0.5 * (gyro[:-1] + gyro[1:]), 0.5 * (accel[:-1] + accel[1:]))


def _intervals(times_ns: list[int]) -> list[int]:
    return [later - earlier for earlier, later in itertools.pairwise(times_ns)]


def _measured(window: ImuWindow) -> bool:
    samples = window.samples
    return bool(samples) and samples[0].t_ns < window.end_t_ns and samples[-1].t_ns > window.start_t_ns


def _sample_at(samples: tuple[ImuSample, ...], t_ns: int) -> ImuSample:
    before = samples[max(bisect_right(samples, t_ns, key=_TIME) - 1, 0)]
    after = samples[min(bisect_left(samples, t_ns, key=_TIME), len(samples) - 1)]
    if after.t_ns <= before.t_ns:
        return ImuSample(t_ns, before.accel, before.gyro)
    share = (t_ns - before.t_ns) / (after.t_ns - before.t_ns)
    accel = before.accel + share * (after.accel - before.accel)
    return ImuSample(t_ns, accel, before.gyro + share * (after.gyro - before.gyro))
