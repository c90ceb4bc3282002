# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The estimator's door for optical flow (AP_NavEKF3/AP_NavEKF3_Measurements.cpp, writeOptFlowMeas)."""

import math
from typing import Final, NamedTuple

import numpy as np

from ap_core.cint import later_ms, u32
from ekf_stub.filter.inertial import Array, InertialDelta, limited
from ekf_stub.inputs.ext_nav_ingest import HALF_FILTER_STEP_MS, SENSOR_INTERVAL_MIN_MS
from ekf_stub.inputs.obs_ring import ObsRing
from ekf_stub.reports.core_report import Three

MAX_RATE: Final = 4.2
HALF_INTERVAL_MS: Final = 50
_LEAST_S, _LEAST_Z_S = 0.01, 0.001
_BIAS_GAIN: Final = 0.01
_MAX_BIAS_STEP: Final = 0.1

Two = tuple[float, float]


class FlowMeasurement(NamedTuple):
    """What a flow sensor measures: rates about x and y, rad/s, positive as the sensor itself turns.

    Attributes:
        quality: 0..255; 0 is unusable.
        flow: by what it sees.
        gyro: by its own gyro.
        offset: its place from the IMU, m, body (FRD).
    """

    quality: int
    flow: Two
    gyro: Two
    offset: Three = (0.0, 0.0, 0.0)


class FlowSample(NamedTuple):
    """Rates of the line of sight, rad/s, positive as the vehicle moves to the right and backwards.

    Attributes:
        flow: with those of the vehicle's own turning.
        flow_comp: without.
        body_rate: of the vehicle, rad/s, body (FRD).
        offset: the sensor's place from the IMU, m, body (FRD).
    """

    time_ms: int
    flow: Two
    flow_comp: Two
    body_rate: Three
    offset: Three


class FlowIngest:
    """Takes measurements or refuses them, and keeps what waits for the horizon.

    Args:
        ring_size: how many may wait; 0 if there was no flow sensor as the estimator was set up.

    Attributes:
        received_ms: when one came in last, good or not; None before the first.
        valid_ms: when a good one came in last, or was taken for having come in.
    """

    def __init__(self, ring_size: int) -> None:
        self._ring: ObsRing[FlowSample] = ObsRing(ring_size)
        self.reset(0)

    def reset(self, now_ms: int) -> None:
        """Forget everything, as the estimator restarts."""
        self._ring.clear()
        self.received_ms: int | None = None
        self.valid_ms = now_ms
        self._gyro_bias: Two = (0.0, 0.0)
        self._turned: Array = np.zeros(3)
        self._turned_s = 0.0

    def note_turn(self, del_ang: Array, del_ang_dt: float) -> None:
        """Note by how much the vehicle turned in a step, rad, without the gyro's bias, and in which time, s."""
        self._turned = self._turned + del_ang
        self._turned_s += del_ang_dt

    def write(
        self, measured: FlowMeasurement, delta: InertialDelta, now_ms: int, horizon_ms: int, delay_ms: int
    ) -> bool:
        """Take a measurement; say whether it did not come too soon after the last.

        ``now_ms`` is the time of ``delta``, the newest inertial data, ``delay_ms`` EK3_FLOW_DELAY.
        """
        if self.received_ms is not None and now_ms - self.received_ms < SENSOR_INTERVAL_MIN_MS:
            return False
        self.received_ms = now_ms
        self._learn_gyro_bias(measured.gyro)
        is_slow = math.hypot(*measured.flow) < MAX_RATE and math.hypot(*measured.gyro) < MAX_RATE
        if measured.quality > 0 and is_slow and all(map(math.isfinite, measured.offset)):
            time_ms = u32(now_ms - delay_ms - HALF_INTERVAL_MS - HALF_FILTER_STEP_MS)
            self._take(measured, delta, now_ms, later_ms(time_ms, horizon_ms))
        return True

    def _take(self, measured: FlowMeasurement, delta: InertialDelta, now_ms: int, time_ms: int) -> None:
        self.valid_ms = now_ms
        if not self._ring.exists:
            return
        (flow_x, flow_y), (gyro_x, gyro_y), bias = measured.flow, measured.gyro, self._gyro_bias
        rate_x, rate_y = gyro_x - bias[0], gyro_y - bias[1]
        comp = rate_x - flow_x, rate_y - flow_y
        body_rate = rate_x, rate_y, self._yaw_rate(delta)
        self._ring.push(FlowSample(time_ms, (-flow_x, -flow_y), comp, body_rate, measured.offset))

    def _learn_gyro_bias(self, gyro: Two) -> None:
        if self._turned_s <= _LEAST_S:
            return
        x, y = (
            (1 - _BIAS_GAIN) * bias
            + _BIAS_GAIN * limited(rate - turned / self._turned_s, -_MAX_BIAS_STEP, _MAX_BIAS_STEP)
            for bias, rate, turned in zip(self._gyro_bias, gyro, self._turned[:2].tolist(), strict=True)
        )
        self._gyro_bias = x, y
        self._turned, self._turned_s = np.zeros(3), 0.0

    def _yaw_rate(self, delta: InertialDelta) -> float:
        if self._turned_s > _LEAST_Z_S:
            return float(self._turned[2]) / self._turned_s
        return float(delta.del_ang[2]) / delta.del_ang_dt if delta.del_ang_dt > _LEAST_Z_S else 0.0

    def recall(self, horizon_ms: int) -> FlowSample | None:
        """Take out the measurement that has come due."""
        return self._ring.recall(horizon_ms).sample
