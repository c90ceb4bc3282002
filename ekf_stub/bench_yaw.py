# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the bench's yaw comes from, and when it counts as aligned (AP_NavEKF3/AP_NavEKF3_MagFusion.cpp)."""

import math
from collections.abc import Callable
from typing import Final

import numpy as np

from ap_core.cint import u32
from ap_core.clock import Clock
from ap_core.fmath import f32
from ap_core.quaternion import Quaternion
from ekf_stub.ext_nav_ingest import YawSample
from ekf_stub.gps_sample import GpsSample
from ekf_stub.sources import EkfSources, SourceYaw

SYNTHETIC_PERIOD_MS: Final = 140
YAW_IN_USE_MS: Final = 5000
COMPASS_ALIGNED_AFTER_MS: Final = 85  # after tilt, in the recording of bench_odometry

_COMPASS_SOURCES: Final = (SourceYaw.COMPASS, SourceYaw.GPS_COMPASS_FALLBACK)


class BenchYaw:
    """The yaw of a level vehicle: its true heading, or what external navigation or GPS say once they are in use.

    Args:
        clock: time since boot.
        sources: the source sets.
        heading_rad: the true yaw.
        has_compass: tells whether a compass is in use.

    Attributes:
        aligned: whether yaw is known (yawAlignComplete).
        yaw: in rad.
    """

    def __init__(
        self, clock: Clock, sources: EkfSources, heading_rad: np.float32, has_compass: Callable[[], bool]
    ) -> None:
        self._clock = clock
        self._sources = sources
        self._has_compass = has_compass
        self._source: int | None = None
        self._reset_pending = False
        self._tilt_ms: int | None = None
        self._last_sample_ms = 0
        self._last_synthetic_ms = 0
        self.aligned = False
        self.set(heading_rad)

    def set(self, yaw: np.float32) -> None:
        """Turn to a yaw."""
        self.yaw = yaw
        self._quat = Quaternion.from_euler(f32(0), f32(0), yaw)

    def quaternion(self) -> Quaternion:
        """Return the attitude."""
        return self._quat

    def source(self) -> int:
        """Return the source; a compass that is not there is none (AP_NavEKF_Source::getYawSource)."""
        source = self._sources.yaw()
        return SourceYaw.NONE if source == SourceYaw.COMPASS and not self._has_compass() else source

    def uses_compass(self) -> bool:
        """Tell whether yaw is taken from a compass (NavEKF3_core::use_compass)."""
        return self.source() in _COMPASS_SOURCES and self._has_compass()

    def check_source(self) -> None:
        """Note a change of source, which aligns yaw anew (NavEKF3_core::setYawSource)."""
        source = self.source()
        if self._source is not None and source != self._source:
            self._reset_pending = True
        self._source = source

    def aligned_text(self) -> str:
        """Return what a core says of the alignment, after its name."""
        return "MAG0 initial yaw alignment complete" if self.uses_compass() else "yaw aligned"

    def step(self, sample: YawSample | None, fix: GpsSample | None, tilt_aligned: bool) -> bool:
        """Take in what there is; tell whether yaw was aligned by it.

        A yaw of external navigation counts as seen even before it can be used.
        """
        now_ms = self._clock.millis()
        if self.source() == SourceYaw.EXTNAV:
            return self._step_ext_nav(sample, now_ms, tilt_aligned)
        if not tilt_aligned:
            return False
        if self._tilt_ms is None:
            self._tilt_ms = now_ms
        if self.uses_compass():
            return not self.aligned and u32(now_ms - self._tilt_ms) >= COMPASS_ALIGNED_AFTER_MS and self._align()
        if self.source() == SourceYaw.GPS and fix is not None and fix.yaw_deg is not None:
            self.set(f32(math.remainder(math.radians(fix.yaw_deg), 2 * math.pi)))
            return (not self.aligned or self._reset_pending) and self._align()
        return False

    def _step_ext_nav(self, sample: YawSample | None, now_ms: int, tilt_aligned: bool) -> bool:
        if sample is None:
            self._use_synthetic(now_ms, tilt_aligned)
            return False
        self._last_sample_ms = now_ms
        if not tilt_aligned or not math.isfinite(sample.yaw):
            return False
        self.set(sample.yaw)
        return (not self.aligned or self._reset_pending) and self._align()

    def _use_synthetic(self, now_ms: int, tilt_aligned: bool) -> None:
        if tilt_aligned and not self.aligned and u32(now_ms - self._last_synthetic_ms) > SYNTHETIC_PERIOD_MS:
            self._last_synthetic_ms = now_ms

    def _align(self) -> bool:
        self.aligned = True
        self._reset_pending = False
        return True

    def uses_ext_nav(self) -> bool:
        """Tell whether yaw comes from external navigation, or would if there were any (using_extnav_for_yaw)."""
        now_ms = self._clock.millis()
        recent = (u32(now_ms - then_ms) < YAW_IN_USE_MS for then_ms in (self._last_sample_ms, self._last_synthetic_ms))
        return self.source() == SourceYaw.EXTNAV and any(recent)
