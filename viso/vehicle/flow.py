# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A flow sensor that OPTICAL_FLOW messages feed (AP_OpticalFlow/AP_OpticalFlow.cpp, AP_OpticalFlow_MAV.cpp)."""

from collections.abc import Callable
from typing import Final, NamedTuple

import numpy as np

from ap_core.cint import float_of_u64, i32, u8, u16, u32
from ap_core.clock import NEVER, Clock
from ap_core.fmath import FLT_EPSILON, M_PI, cosf, f32, ieee754, is_zero, sinf
from ap_core.param import FromParams, ParamTable
from ap_core.sinks import RecordSink
from ekf_stub.ahrs.ahrs_base import AhrsBase
from ekf_stub.inputs.measurements import FlowMeasurement
from mav_handlers.wire.messages import OPTICAL_FLOW
from viso.firmware.log_releases import OF

FLOW_TYPE_NONE: Final = 0
FLOW_TYPE_MAVLINK: Final = 5
FLOW_PERIOD_US: Final = 5000
HEALTHY_MS: Final = 500
MASK_LOG_OPTFLOW: Final = 1 << 11
STABILISED: Final = 1 << 0
"""Of FLOW_OPTIONS: the sensor does not roll and pitch with the vehicle."""

_TIMEOUT_S: Final = f32(0.5)
_MICRO: Final = f32(1.0e-6)
_GYRO_SAMPLES: Final = 1000
_ZERO: Final = f32(0)
_ONE: Final = f32(1)
_PER_MILLE: Final = f32(0.001)
_CDEG: Final = M_PI / f32(18000)  # rad


class Mounting(NamedTuple):
    """How a flow sensor sits: scale of its axes, how it is turned about down, rad, place in m, body (FRD)."""

    scale_x: np.float32
    scale_y: np.float32
    yaw_rad: np.float32
    place_frd: tuple[float, float, float]


Rates = tuple[np.float32, np.float32]
"""About the body's x and y axis, rad/s."""


def _plus_integer(total: float, value: float) -> float:
    return i32(int(total) + int(value))


@ieee754
def _plus_float(total: float, value: float) -> float:
    return float(f32(total) + f32(value))


class MavlinkFlow:
    """The flow sensor, if FLOW_TYPE was 5 at boot: averages flow between two updates, hands it over and logs it.

    ``newest`` is what was measured last; nothing has a quality of 0. ``on_measured`` is called with each measurement.

    Args:
        clock, params, ahrs, logger: the vehicle's.
        reads_rates: whether the release reads ``flow_rate_x`` and ``flow_rate_y``, and has FLOW_OPTIONS.
    """

    def __init__(
        self, clock: Clock, params: ParamTable, ahrs: AhrsBase, logger: RecordSink, *, reads_rates: bool = False
    ) -> None:
        self._reads_rates = reads_rates
        self._plus: Callable[[float, float], float] = _plus_float if reads_rates else _plus_integer
        self._is_in_rad_s = False
        self._is_stabilised = FromParams(
            params, lambda: reads_rates and params.get_int("FLOW_OPTIONS") & STABILISED != 0
        )
        self._clock = clock
        self._params = params
        self._ahrs = ahrs
        self._logger = logger
        self._mounting = FromParams(params, self._find_mounting)
        self.newest = FlowMeasurement(0, (0.0, 0.0), (0.0, 0.0))
        self.on_measured: Callable[[FlowMeasurement], None] = lambda _measured: None
        self._type = FromParams(params, lambda: params.get_int("FLOW_TYPE"))
        self._has_driver = self._type() == FLOW_TYPE_MAVLINK
        self._latest_frame_us = 0
        self._prev_frame_us = 0
        self._last_update_ms = 0
        self._healthy = False
        self._reset_flow()
        self._reset_gyro()

    def _reset_flow(self) -> None:
        self._flow_sum = (0.0, 0.0)
        self._quality_sum = 0
        self._count = 0

    def _reset_gyro(self) -> None:
        self._gyro_sum: Rates = (_ZERO, _ZERO)
        self._gyro_count = 0

    def enabled(self) -> bool:
        """Return whether FLOW_TYPE asks for a sensor (AP_OpticalFlow::enabled)."""
        return self._type() != FLOW_TYPE_NONE

    def healthy(self) -> bool:
        """Return whether there is a sensor whose last flow was younger than 0.5 s (AP_OpticalFlow::healthy)."""
        return self._has_driver and self._healthy

    def take(self, packet: OPTICAL_FLOW) -> bool:
        """Add flow to the sums; return whether there is a sensor that takes it.

        Source: AP_OpticalFlow::handle_msg, AP_OpticalFlow_MAV::handle_msg.
        """
        if not self.enabled() or not self._has_driver:
            return False
        self._latest_frame_us = self._clock.micros64()
        rates = packet.flow_rate_x, packet.flow_rate_y
        if self._reads_rates and not self._is_in_rad_s and not all(is_zero(f32(rate)) for rate in rates):
            self._is_in_rad_s = True
            self._reset_flow()
        (x, y), (more_x, more_y) = self._flow_sum, rates if self._is_in_rad_s else (packet.flow_x, packet.flow_y)
        self._flow_sum = self._plus(x, more_x), self._plus(y, more_y)
        self._quality_sum = u16(self._quality_sum + packet.quality)
        self._count = u16(self._count + 1)
        return True

    def idle_until_us(self) -> int:
        """Return before when ``update`` has nothing to do; 0 if the next one may."""
        return NEVER if not self._has_driver else 0

    def update(self) -> None:
        """Make the flow since the last update known, 200 times per second (AP_OpticalFlow::update)."""
        if self._type() == FLOW_TYPE_NONE:
            return
        if self._has_driver:
            self._update_driver()
        self._healthy = u32(self._clock.millis() - self._last_update_ms) < HEALTHY_MS

    def _update_driver(self) -> None:
        if self._gyro_count < _GYRO_SAMPLES:
            gyro = self._ahrs.get_gyro()
            self._gyro_sum = f32(self._gyro_sum[0] + gyro.x), f32(self._gyro_sum[1] + gyro.y)
            self._gyro_count += 1
        if self._count == 0:
            return
        quality = u8(self._quality_sum // self._count)
        dt = f32(float_of_u64(self._latest_frame_us - self._prev_frame_us) * _MICRO)
        self._prev_frame_us = self._latest_frame_us
        # The first flow after a silence has no time to be spread over.
        regular = FLT_EPSILON <= dt < _TIMEOUT_S
        flow = self._flow_rates(dt) if regular else (_ZERO, _ZERO)
        self._publish(quality, flow, self._body_rates() if regular else (_ZERO, _ZERO))
        self._reset_flow()
        self._reset_gyro()

    def _find_mounting(self) -> Mounting:
        scale_x, scale_y = (_ONE + _PER_MILLE * f32(self._params.get_int(f"FLOW_F{axis}SCALER")) for axis in "XY")
        x, y, z = (float(self._params.get_float(f"FLOW_POS_{axis}")) for axis in "XYZ")
        yaw_rad = f32(self._params.get_int("FLOW_ORIENT_YAW")) * _CDEG
        return Mounting(scale_x, scale_y, yaw_rad, (x, y, z))

    @ieee754
    def _flow_rates(self, dt: np.float32) -> Rates:
        # The firmware multiplies flow_x and flow_y with the time that it should divide by.
        (x, y), mounting, factor = self._flow_sum, self._mounting(), _ONE if self._is_in_rad_s else dt
        flow_x = f32(x) / f32(self._count) * mounting.scale_x * factor
        flow_y = f32(y) / f32(self._count) * mounting.scale_y * factor
        if abs(mounting.yaw_rad) < FLT_EPSILON:
            return flow_x, flow_y
        cos, sin = cosf(mounting.yaw_rad), sinf(mounting.yaw_rad)
        return flow_x * cos - flow_y * sin, flow_x * sin + flow_y * cos

    def _body_rates(self) -> Rates:
        if self._is_stabilised():
            return _ZERO, _ZERO
        x, y = self._gyro_sum
        return f32(x / f32(self._gyro_count)), f32(y / f32(self._gyro_count))

    def _publish(self, quality: int, flow: Rates, body: Rates) -> None:
        self._last_update_ms = self._clock.millis()
        (flow_x, flow_y), (body_x, body_y) = map(float, flow), map(float, body)
        self.newest = FlowMeasurement(quality, (flow_x, flow_y), (body_x, body_y), self._mounting().place_frd)
        self._ahrs.write_flow(self.newest, self._last_update_ms)
        self.on_measured(self.newest)
        if self._params.get_int("LOG_BITMASK") & MASK_LOG_OPTFLOW:
            self._logger.write(OF, (self._clock.micros64(), quality, *flow, *body))
