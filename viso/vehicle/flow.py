# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A flow sensor that OPTICAL_FLOW messages feed (AP_OpticalFlow/AP_OpticalFlow.cpp, AP_OpticalFlow_MAV.cpp)."""

from collections.abc import Callable
from typing import Final

import numpy as np

from ap_core.cint import float_of_u64, i32, u8, u16, u32
from ap_core.clock import Clock
from ap_core.fmath import FLT_EPSILON, f32
from ap_core.param import ParamTable
from ap_core.param_cache import FromParams
from ap_core.sinks import RecordSink
from ap_core.vector3 import Vector3f
from mav_handlers.wire.messages import OPTICAL_FLOW
from viso.firmware.log_releases import OF

FLOW_TYPE_NONE: Final = 0
FLOW_TYPE_MAVLINK: Final = 5
FLOW_PERIOD_US: Final = 5000
HEALTHY_MS: Final = 500
MASK_LOG_OPTFLOW: Final = 1 << 11

_TIMEOUT_S: Final = f32(0.5)
_MICRO: Final = f32(1.0e-6)
_GYRO_SAMPLES: Final = 1000
_ZERO: Final = f32(0)

Rates = tuple[np.float32, np.float32]
"""About the body's x and y axis, rad/s."""


class MavlinkFlow:
    """The flow sensor, if FLOW_TYPE was 5 at boot: averages flow between two updates and logs it.

    FIRMWARE PARITY: the estimator is not given the flow, as the stand-in for EKF3 fuses none.

    Args:
        clock: time since boot.
        params: holds FLOW_TYPE and LOG_BITMASK. Scale factors and yaw of the sensor are 0, as by default.
        get_gyro: returns the body rates in rad/s.
        logger: where OF records go.
    """

    def __init__(self, clock: Clock, params: ParamTable, get_gyro: Callable[[], Vector3f], logger: RecordSink) -> None:
        self._clock = clock
        self._params = params
        self._get_gyro = get_gyro
        self._logger = logger
        self._type = FromParams(params, lambda: params.get_int("FLOW_TYPE"))
        self._has_driver = self._type() == FLOW_TYPE_MAVLINK
        self._latest_frame_us = 0
        self._prev_frame_us = 0
        self._last_update_ms = 0
        self._healthy = False
        self._reset_flow()
        self._reset_gyro()

    def _reset_flow(self) -> None:
        self._flow_sum = (0, 0)
        self._quality_sum = 0
        self._count = 0

    def _reset_gyro(self) -> None:
        self._gyro_sum: Rates = (_ZERO, _ZERO)
        self._gyro_count = 0

    def enabled(self) -> bool:
        """Tell whether FLOW_TYPE asks for a sensor (AP_OpticalFlow::enabled)."""
        return self._type() != FLOW_TYPE_NONE

    def healthy(self) -> bool:
        """Tell whether there is a sensor whose last flow was younger than 0.5 s (AP_OpticalFlow::healthy)."""
        return self._has_driver and self._healthy

    def take(self, packet: OPTICAL_FLOW) -> bool:
        """Add flow to the sums; tell whether there is a sensor that takes it.

        Source: AP_OpticalFlow::handle_msg, AP_OpticalFlow_MAV::handle_msg.
        """
        if not self.enabled() or not self._has_driver:
            return False
        self._latest_frame_us = self._clock.micros64()
        x, y = self._flow_sum
        self._flow_sum = i32(x + packet.flow_x), i32(y + packet.flow_y)
        self._quality_sum = u16(self._quality_sum + packet.quality)
        self._count = u16(self._count + 1)
        return True

    def update(self) -> None:
        """Make the flow since the last update known, 200 times a second (AP_OpticalFlow::update)."""
        if self._type() == FLOW_TYPE_NONE:
            return
        if self._has_driver:
            self._update_driver()
        self._healthy = u32(self._clock.millis() - self._last_update_ms) < HEALTHY_MS

    def _update_driver(self) -> None:
        if self._gyro_count < _GYRO_SAMPLES:
            gyro = self._get_gyro()
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

    def _flow_rates(self, dt: np.float32) -> Rates:
        # The firmware multiplies with the time that it should divide by.
        x, y = self._flow_sum
        return f32(f32(x) / f32(self._count) * dt), f32(f32(y) / f32(self._count) * dt)

    def _body_rates(self) -> Rates:
        x, y = self._gyro_sum
        return f32(x / f32(self._gyro_count)), f32(y / f32(self._gyro_count))

    def _publish(self, quality: int, flow: Rates, body: Rates) -> None:
        self._last_update_ms = self._clock.millis()
        if self._params.get_int("LOG_BITMASK") & MASK_LOG_OPTFLOW:
            self._logger.write(OF, (self._clock.micros64(), quality, *flow, *body))
