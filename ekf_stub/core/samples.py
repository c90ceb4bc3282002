# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Measurements, and the buffers in which they wait until the fusion horizon reaches them (AP_NavEKF/EKF_Buffer.cpp).

Times are ms since boot that wrap at 2^32.
"""

from typing import Final, Generic, TypeVar, final

from ekf_stub.core.vectors import Vec2, Vec3, signed_since_ms

RECALL_WINDOW_MS: Final = 100
HALF_FILTER_STEP_MS: Final = 6  # of a main loop of 400 Hz
SENSOR_INTERVAL_MIN_MS: Final = 50


class Sample:
    """A measurement, with the time of its observation."""

    def __init__(self, time_ms: int) -> None:
        self.time_ms = time_ms


@final
class PoseSample(Sample):
    """A position (m, NED) and its error; ``is_reset`` after the camera's frame has jumped."""

    def __init__(self, time_ms: int, pos: Vec3, err: float, is_reset: bool) -> None:
        super().__init__(time_ms)
        self.pos = pos
        self.err = err
        self.is_reset = is_reset


@final
class YawSample(Sample):
    """A yaw and its error, rad."""

    def __init__(self, time_ms: int, yaw: float, err: float) -> None:
        super().__init__(time_ms)
        self.yaw = yaw
        self.err = err


@final
class VelocitySample(Sample):
    """A velocity (m/s, NED) and its error."""

    def __init__(self, time_ms: int, vel: Vec3, err: float) -> None:
        super().__init__(time_ms)
        self.vel = vel
        self.err = err


@final
class OdometrySample(Sample):
    """A velocity (m/s, FRD) and its error, at a place from the IMU (m, FRD)."""

    def __init__(self, time_ms: int, vel: Vec3, err: float, offset: Vec3) -> None:
        super().__init__(time_ms)
        self.vel = vel
        self.err = err
        self.offset = offset


@final
class BaroSample(Sample):
    """A height above the place of calibration, m."""

    def __init__(self, time_ms: int, height: float) -> None:
        super().__init__(time_ms)
        self.height = height


@final
class MagSample(Sample):
    """A magnetic field, Gauss, body."""

    def __init__(self, time_ms: int, field: Vec3) -> None:
        super().__init__(time_ms)
        self.field = field


@final
class RangeSample(Sample):
    """A range, m, measured at a place from the IMU, m, body (FRD)."""

    def __init__(self, time_ms: int, distance: float, offset: Vec3) -> None:
        super().__init__(time_ms)
        self.distance = distance
        self.offset = offset


@final
class FlowSample(Sample):
    """Rates of the line of sight, rad/s, positive as the vehicle moves to the right and backwards.

    Attributes:
        flow: with those of the vehicle's own turning.
        flow_comp: without.
        body_rate: of the vehicle, rad/s, body (FRD).
        offset: the sensor's place from the IMU, m, body (FRD).
    """

    def __init__(self, time_ms: int, flow: Vec2, flow_comp: Vec2, body_rate: Vec3, offset: Vec3) -> None:
        super().__init__(time_ms)
        self.flow = flow
        self.flow_comp = flow_comp
        self.body_rate = body_rate
        self.offset = offset


T = TypeVar("T", bound=Sample)


@final
class ObsRing(Generic[T]):
    """A buffer in order of arrival; the oldest sample gives way when it is full (ekf_ring_buffer).

    It holds ``size`` samples; 0 stands for a buffer that was never allocated.

    Attributes:
        samples: those that wait, the oldest first.
    """

    def __init__(self, size: int) -> None:
        self.size = size
        self.samples: list[T] = []

    def push(self, sample: T) -> T | None:
        """Append a sample; return the oldest if it was overwritten for it, or the sample if there is no buffer."""
        if self.size <= 0:
            return sample
        oldest = self.samples.pop(0) if len(self.samples) >= self.size else None
        self.samples.append(sample)
        return oldest

    def has_due(self, horizon_ms: int) -> bool:
        """Return whether the horizon has reached the oldest sample; one from the future blocks those after it."""
        return len(self.samples) > 0 and signed_since_ms(horizon_ms, self.samples[0].time_ms) >= 0

    def recall(self, horizon_ms: int, lost: list[T] | None = None) -> T | None:
        """Take out what the horizon has passed, and return the last of it that is less than 100 ms behind.

        The others are appended to ``lost``.
        """
        found: T | None = None
        while self.has_due(horizon_ms):
            sample = self.samples.pop(0)
            is_fresh = signed_since_ms(horizon_ms, sample.time_ms) < RECALL_WINDOW_MS
            if lost is not None and not is_fresh:
                lost.append(sample)
            if is_fresh:
                if lost is not None and found is not None:
                    lost.append(found)
                found = sample
        return found

    def clear(self) -> None:
        """Forget everything."""
        self.samples.clear()


_EKF_STEP_MS: Final = 12
_EXT_NAV_INTERVAL_MS: Final = 20


@final
class RingSizes:
    """Lengths of the buffers for the longest delay of all sensors (NavEKF3_core::setup_core).

    Attributes:
        imu: of steps of the filter.
        ext_nav: of external navigation.
        slow: of slower sensors: barometer, compass, GPS, body odometry.
        ranges: of range finders, of which there may be two.
        flow: of optical flow; 0 without a sensor.
    """

    def __init__(self, longest_delay_ms: int, has_flow: bool) -> None:
        imu = longest_delay_ms // _EKF_STEP_MS + 1
        with_jitter_ms = longest_delay_ms + (longest_delay_ms + 1) // 2
        self.imu = imu
        self.ext_nav = min(with_jitter_ms // _EXT_NAV_INTERVAL_MS + 1, imu)
        self.slow = min(with_jitter_ms // SENSOR_INTERVAL_MIN_MS + 1, imu)
        self.ranges = min(2 * self.slow, imu)
        self.flow = self.ext_nav if has_flow else 0
