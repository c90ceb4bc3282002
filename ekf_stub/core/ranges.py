# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the filter takes from range finders that look down (AP_NavEKF3_Measurements.cpp, readRangeFinder)."""

from typing import Final, final

from ekf_stub.core.samples import ObsRing, RangeSample
from ekf_stub.core.vectors import U32, ZERO, Rotation, dot, is_zero, larger
from ekf_stub.inputs.measurements import DOWNWARD, RangeState, RangeStatus

_LEAST_ON_GROUND_M: Final = 0.05
_INTERVAL_MS: Final = 50
_SAMPLES: Final = 3
_FRESH_SAMPLE_MS: Final = 500
_SUBSTITUTE_AFTER_MS: Final = 200
_FRESH_MS: Final = 500
_MOST_FINDERS: Final = 2
_HALF_INTERVAL_MS: Final = 25
_GOOD: Final = int(RangeStatus.GOOD)


@final
class RangeMedian:
    """The last three samples of a range finder, each in its slot, by which the median of equal ones is chosen."""

    def __init__(self) -> None:
        self._samples = [RangeSample(-_FRESH_SAMPLE_MS, 0.0, ZERO) for _ in range(_SAMPLES)]
        self._index = 0

    def add(self, sample: RangeSample) -> None:
        """Put a sample into the next slot; the first goes into the second."""
        self._index = (self._index + 1) % _SAMPLES
        self._samples[self._index] = sample

    def is_fresh(self, now_ms: int) -> bool:
        """Return whether all samples are."""
        for sample in self._samples:
            if now_ms - sample.time_ms >= _FRESH_SAMPLE_MS:
                return False
        return True

    def median(self) -> RangeSample:
        """Return the sample in the middle; of equal ones that of the third slot."""
        least, most, third = self._samples[0], self._samples[1], self._samples[2]
        if least.distance > most.distance:
            least, most = most, least
        if third.distance > most.distance:
            return most
        return least if third.distance < least.distance else third


@final
class RangeFinders:
    """Reads the range finders once a step, and takes the median of three samples of each.

    Attributes:
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
        """Forget everything, as the filter restarts."""
        self._ring.clear()
        self._newest = RangeSample(0, 0.0, ZERO)
        self._newest_finder = 0
        self._medians = [RangeMedian() for _ in range(_MOST_FINDERS)]
        self._read_ms = 0
        self.on_ground = _LEAST_ON_GROUND_M
        self.max_distance = 0.0
        self.valid_ms = now_ms
        self.is_due = False
        self.distance = 0.0

    @property
    def newest(self) -> float:
        """The range read last, m; 0 before the first."""
        return self._newest.distance

    def is_fresh(self, now_ms: int) -> bool:
        """Return whether a range was read not long ago."""
        return now_ms - self.valid_ms < _FRESH_MS

    def read(self, state: RangeState, now_ms: int, on_ground: bool) -> None:
        """Read the range finders; a range that is missing is known while the vehicle stands."""
        self.on_ground = max(state.ground_clearance, _LEAST_ON_GROUND_M)
        self.max_distance = state.max_distance
        if now_ms - self._read_ms <= _INTERVAL_MS:
            return
        self._read_ms = now_ms
        for number, finder in enumerate(state.finders):
            if number < _MOST_FINDERS and finder.orientation == DOWNWARD and finder.status == _GOOD:
                self._take(state, number, now_ms, on_ground)

    def _take(self, state: RangeState, number: int, now_ms: int, on_ground: bool) -> None:
        finder, last = state.finders[number], self._medians[number]
        last.add(RangeSample(now_ms - _HALF_INTERVAL_MS, finder.distance, finder.place_frd))
        if last.is_fresh(now_ms):
            median = last.median()
            self._newest_finder = number
            time_ms = max(median.time_ms, self._newest.time_ms)
            self._push(RangeSample(time_ms, larger(median.distance, self.on_ground), finder.place_frd), now_ms)
        elif on_ground and now_ms - self.valid_ms > _SUBSTITUTE_AFTER_MS:
            place = state.finders[self._newest_finder].place_frd
            self._push(RangeSample(now_ms, self.on_ground, place), now_ms)

    def _push(self, sample: RangeSample, now_ms: int) -> None:
        self._newest = sample
        self._ring.push(RangeSample(sample.time_ms & U32, sample.distance, sample.offset))
        self.valid_ms = now_ms

    def recall(self, horizon_ms: int, rotation: Rotation) -> None:
        """Take out the range that has come due, and move it to the IMU by the rotation from body to earth."""
        sample = self._ring.recall(horizon_ms)
        self.is_due = sample is not None
        if sample is not None:
            self.distance = sample.distance
            if not is_zero(sample.offset):
                self.distance += dot(rotation[2], sample.offset) / rotation[2][2]
