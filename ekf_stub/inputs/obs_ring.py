# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Samples that wait until the fusion horizon reaches them (AP_NavEKF/EKF_Buffer.cpp)."""

from collections import deque
from typing import Any, Final, Generic, NamedTuple, Protocol, TypeVar

from ap_core.cint import i32

RECALL_WINDOW_MS: Final = 100
_SIGN: Final = 1 << 31


class Timed(Protocol):
    """A sample with the time of its observation in ms since boot."""

    @property
    def time_ms(self) -> int:
        """Time of the observation."""


T = TypeVar("T", bound=Timed)


class Recalled(NamedTuple, Generic[T]):
    """What came due: the sample to fuse, how many newer ones superseded, and how many were too old."""

    sample: T | None
    superseded: int
    too_old: int


NOTHING_DUE: Final[Recalled[Any]] = Recalled(None, 0, 0)


class ObsRing(Generic[T]):
    """A buffer in order of arrival; the oldest sample gives way when it is full (ekf_ring_buffer).

    It holds ``size`` samples; 0 stands for a buffer that was never allocated.

    Attributes:
        samples: those that wait, the oldest first.
        exists: whether it was allocated.
    """

    def __init__(self, size: int) -> None:
        self._size = size
        self.samples: deque[T] = deque()
        self.exists = size > 0

    def push(self, sample: T) -> bool:
        """Append a sample; say whether the oldest was overwritten for it."""
        overwrites = len(self.samples) >= self._size
        if overwrites:
            self.samples.popleft()
        self.samples.append(sample)
        return overwrites

    def recall(self, horizon_ms: int) -> Recalled[T]:
        """Take out what the horizon has passed, and return the last of it that is less than 100 ms behind.

        A sample from the future blocks those that arrived after it.
        """
        # In most steps nothing comes due; the second is i32(...) < 0 without a call.
        if not self.samples or (horizon_ms - self.samples[0].time_ms) & _SIGN:
            return NOTHING_DUE
        found: T | None = None
        superseded = too_old = 0
        while self.samples:
            age_ms = i32(horizon_ms - self.samples[0].time_ms)
            if age_ms < 0:
                break
            sample = self.samples.popleft()
            if age_ms >= RECALL_WINDOW_MS:
                too_old += 1
                continue
            superseded += found is not None
            found = sample
        return Recalled(found, superseded, too_old)

    def clear(self) -> None:
        """Forget everything."""
        self.samples.clear()


class RingSizes(NamedTuple):
    """Lengths of the buffers: of inertial data, external navigation, slower sensors (body odometry), optical flow."""

    imu: int
    ext_nav: int
    slow: int
    flow: int = 0

    @property
    def ranges(self) -> int:
        """That of range finders, of which there may be two."""
        return min(2 * self.slow, self.imu)


_EKF_STEP_MS: Final = 12
_EXT_NAV_INTERVAL_MS: Final = 20
_SLOW_INTERVAL_MS: Final = 50


def ring_sizes(longest_delay_ms: int) -> RingSizes:
    """Return the lengths for the longest delay of all sensors (NavEKF3_core::setup_core)."""
    imu = longest_delay_ms // _EKF_STEP_MS + 1
    with_jitter_ms = longest_delay_ms + (longest_delay_ms + 1) // 2
    return RingSizes(
        imu,
        min(with_jitter_ms // _EXT_NAV_INTERVAL_MS + 1, imu),
        min(with_jitter_ms // _SLOW_INTERVAL_MS + 1, imu),
    )
