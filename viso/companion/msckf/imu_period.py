# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How far apart the samples of an IMU usually are, which tells a gap from a slow stream."""

import itertools
from collections import deque
from typing import Final

import numpy as np

from viso.companion.vio.imu_window import IMU_EMPTY, window_fault
from viso.companion.vio.types import ImuWindow

INTERVALS: Final = 200


class ImuPeriod:
    """Judges windows of inertial data by the median of the last 200 intervals between samples.

    Stamps that bunch or jitter do not move it, and a stream that has slowed down is one with gaps until half of them
    are long.
    """

    def __init__(self) -> None:
        self._intervals_ns: deque[int] = deque(maxlen=INTERVALS)
        self._last_ns: int | None = None

    def fault(self, window: ImuWindow) -> str | None:
        """Take in the next window; return what is wrong with it, as `imu_window.window_fault` does.

        Windows overlap at their ends. One without any duration, as before the first frame, has no faults.
        """
        last_ns = self._last_ns
        times_ns = [sample.t_ns for sample in window.samples if last_ns is None or sample.t_ns >= last_ns]
        self._intervals_ns.extend(later - earlier for earlier, later in itertools.pairwise(times_ns))
        if times_ns:
            self._last_ns = times_ns[-1]
        if window.end_t_ns == window.start_t_ns:
            return None
        return window_fault(window, round(np.median(self._intervals_ns))) if self._intervals_ns else IMU_EMPTY
