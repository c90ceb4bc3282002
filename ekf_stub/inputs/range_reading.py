# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the estimator takes from range finders that look down (AP_NavEKF3_Measurements.cpp, readRangeFinder)."""

from typing import Final, NamedTuple

import numpy as np

from ap_core.cint import u32
from ekf_stub.filter.inertial import Array
from ekf_stub.inputs.obs_ring import ObsRing
from ekf_stub.inputs.range_state import FinderState, RangeState
from ekf_stub.reports.core_report import Three

LEAST_ON_GROUND_M: Final = 0.05
INTERVAL_MS: Final = 50
SAMPLES: Final = 3
FRESH_SAMPLE_MS: Final = 500
SUBSTITUTE_AFTER_MS: Final = 200
FRESH_MS: Final = 500
MOST_FINDERS: Final = 2
_HALF_INTERVAL_MS: Final = 25


class RangeSample(NamedTuple):
    """A range, m, measured at a place from the IMU, m, body (FRD)."""

    time_ms: int
    distance: float
    offset: Three


class _Slots:
    """The last samples of a range finder, each in its slot, by which the median of equal ones is chosen."""

    def __init__(self) -> None:
        self._samples = [RangeSample(-FRESH_SAMPLE_MS, 0.0, (0.0, 0.0, 0.0))] * SAMPLES
        self._index = 0

    def add(self, sample: RangeSample) -> None:
        """Put a sample into the next slot; the first goes into the second."""
        self._index = (self._index + 1) % SAMPLES
        self._samples[self._index] = sample

    def are_fresh(self, now_ms: int) -> bool:
        """Return whether all samples are."""
        return all(now_ms - sample.time_ms < FRESH_SAMPLE_MS for sample in self._samples)

    def median(self) -> RangeSample:
        """Return the sample in the middle; of equal ones that of the third slot."""
        first, second, third = self._samples
        least, most = (second, first) if first.distance > second.distance else (first, second)
        if third.distance > most.distance:
            return most
        return least if third.distance < least.distance else third


class RangeReading:
    """Reads the range finders once a step, and takes the median of three samples of each.

    Attributes:
        newest: the range read last, m; 0 before the first.
        on_ground: what is measured on the ground, m.
        max_distance: how far the range finder sees, m.
        valid_ms: when a range was read last.
        is_due: whether a range came due in this step.
        distance: the last range that came due, at the place of the IMU, m.
    """

    def __init__(self, ring_size: int) -> None:
        self._ring: ObsRing[RangeSample] = ObsRing(ring_size)
        self.reset(0)

    def reset(self, now_ms: int) -> None:
        """Forget everything, as the estimator restarts."""
        self._ring.clear()
        self._newest = RangeSample(0, 0.0, (0.0, 0.0, 0.0))
        self._slots = [_Slots() for _ in range(MOST_FINDERS)]
        self._read_ms = 0
        self.on_ground = LEAST_ON_GROUND_M
        self.max_distance = 0.0
        self.valid_ms = now_ms
        self.is_due = False
        self.distance = 0.0

    @property
    def newest(self) -> float:
        """The range read last, m."""
        return self._newest.distance

    def is_fresh(self, now_ms: int) -> bool:
        """Return whether a range was read not long ago."""
        return now_ms - self.valid_ms < FRESH_MS

    def read(self, state: RangeState, now_ms: int, *, on_ground: bool) -> None:
        """Read the range finders; a range that is missing is known while the vehicle stands."""
        self.on_ground = max(state.ground_clearance, LEAST_ON_GROUND_M)
        self.max_distance = state.max_distance
        if now_ms - self._read_ms <= INTERVAL_MS:
            return
        self._read_ms = now_ms
        for finder, slots in zip(state.finders, self._slots, strict=False):
            if finder.is_usable:
                self._take(finder, slots, now_ms, on_ground=on_ground)

    def _take(self, finder: FinderState, slots: _Slots, now_ms: int, *, on_ground: bool) -> None:
        slots.add(RangeSample(now_ms - _HALF_INTERVAL_MS, finder.distance, finder.place_frd))
        if slots.are_fresh(now_ms):
            median = slots.median()
            time_ms = max(median.time_ms, self._newest.time_ms)
            self._push(RangeSample(time_ms, max(median.distance, self.on_ground), finder.place_frd), now_ms)
        elif on_ground and now_ms - self.valid_ms > SUBSTITUTE_AFTER_MS:
            self._push(RangeSample(now_ms, self.on_ground, self._newest.offset), now_ms)

    def _push(self, sample: RangeSample, now_ms: int) -> None:
        self._newest = sample
        self._ring.push(sample._replace(time_ms=u32(sample.time_ms)))
        self.valid_ms = now_ms

    def recall(self, horizon_ms: int, rotation: Array) -> None:
        """Take out the range that has come due, and move it to the IMU by the rotation from body to earth."""
        sample = self._ring.recall(horizon_ms).sample if self._ring.samples else None
        self.is_due = sample is not None
        if sample is not None:
            self.distance = sample.distance
            if any(sample.offset):
                self.distance += float(rotation[2] @ np.array(sample.offset)) / rotation.item(2, 2)
