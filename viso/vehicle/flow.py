# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The flow sensor, and the driver of one that messages feed.

Source: AP_OpticalFlow/AP_OpticalFlow.cpp, AP_OpticalFlow_Backend.cpp, AP_OpticalFlow_MAV.cpp.
"""

from collections.abc import Callable
from typing import Final, NamedTuple, Protocol

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
FLOW_TYPE_SIMULATED: Final = 10
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


class FlowReading(NamedTuple):
    """What a driver reads: quality 0..255, and the rates that its camera sees and that its gyro feels."""

    quality: int
    flow: Rates
    body: Rates


NO_FLOW: Final = FlowReading(0, (_ZERO, _ZERO), (_ZERO, _ZERO))


class FlowDriver(Protocol):
    """What reads a flow sensor."""

    def take(self, packet: OPTICAL_FLOW) -> bool:
        """Take a message, and return whether it counts."""

    def read(self, mounting: Mounting) -> FlowReading | None:
        """Return what is new, 200 times per second, scaled and turned as it is mounted; None if nothing is."""

    def idle_until_us(self) -> int:
        """Return before when ``read`` has nothing to do, us since boot; 0 if it may at once."""


@ieee754
def turned(flow: Rates, mounting: Mounting) -> Rates:
    """Return rates of a sensor's axes about the body's (OpticalFlow_backend::_applyYaw)."""
    if abs(mounting.yaw_rad) < FLT_EPSILON:
        return flow
    cos, sin = cosf(mounting.yaw_rad), sinf(mounting.yaw_rad)
    return flow[0] * cos - flow[1] * sin, flow[0] * sin + flow[1] * cos


def _plus_integer(total: float, value: float) -> float:
    return i32(int(total) + int(value))


@ieee754
def _plus_float(total: float, value: float) -> float:
    return float(f32(total) + f32(value))


class MavlinkFlow:
    """A driver that averages the flow of messages between two updates.

    Args:
        clock, ahrs: the vehicle's.
        is_stabilised: says whether the sensor does not roll and pitch with the vehicle.
        reads_rates: whether the release reads ``flow_rate_x`` and ``flow_rate_y``.
    """

    def __init__(
        self, clock: Clock, ahrs: AhrsBase, is_stabilised: Callable[[], bool], *, reads_rates: bool = False
    ) -> None:
        self._clock = clock
        self._ahrs = ahrs
        self._is_stabilised = is_stabilised
        self._reads_rates = reads_rates
        self._plus: Callable[[float, float], float] = _plus_float if reads_rates else _plus_integer
        self._is_in_rad_s = False
        self._latest_frame_us = 0
        self._prev_frame_us = 0
        self._reset_flow()
        self._reset_gyro()

    def _reset_flow(self) -> None:
        self._flow_sum = (0.0, 0.0)
        self._quality_sum = 0
        self._count = 0

    def _reset_gyro(self) -> None:
        self._gyro_sum: Rates = (_ZERO, _ZERO)
        self._gyro_count = 0

    def take(self, packet: OPTICAL_FLOW) -> bool:
        """Add flow to the sums (AP_OpticalFlow_MAV::handle_msg)."""
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
        """Return 0, as each update adds to the averages."""
        return 0

    def read(self, mounting: Mounting) -> FlowReading | None:
        """Return the averages since the last flow, if there is some (AP_OpticalFlow_MAV::update)."""
        if self._gyro_count < _GYRO_SAMPLES:
            gyro = self._ahrs.get_gyro()
            self._gyro_sum = f32(self._gyro_sum[0] + gyro.x), f32(self._gyro_sum[1] + gyro.y)
            self._gyro_count += 1
        if self._count == 0:
            return None
        quality = u8(self._quality_sum // self._count)
        dt = f32(float_of_u64(self._latest_frame_us - self._prev_frame_us) * _MICRO)
        self._prev_frame_us = self._latest_frame_us
        # The first flow after a silence has no time to be spread over.
        regular = FLT_EPSILON <= dt < _TIMEOUT_S
        flow = self._flow_rates(dt, mounting) if regular else (_ZERO, _ZERO)
        reading = FlowReading(quality, flow, self._body_rates() if regular else (_ZERO, _ZERO))
        self._reset_flow()
        self._reset_gyro()
        return reading

    @ieee754
    def _flow_rates(self, dt: np.float32, mounting: Mounting) -> Rates:
        # The firmware multiplies flow_x and flow_y with the time that it should divide by.
        (x, y), factor = self._flow_sum, _ONE if self._is_in_rad_s else dt
        flow_x = f32(x) / f32(self._count) * mounting.scale_x * factor
        flow_y = f32(y) / f32(self._count) * mounting.scale_y * factor
        return turned((flow_x, flow_y), mounting)

    def _body_rates(self) -> Rates:
        if self._is_stabilised():
            return _ZERO, _ZERO
        x, y = self._gyro_sum
        return f32(x / f32(self._gyro_count)), f32(y / f32(self._gyro_count))


class OpticalFlow:
    """The flow sensor: hands what its driver reads to the estimator, and logs it. FLOW_TYPE at boot chose the driver.

    ``newest`` is what was measured last; nothing has a quality of 0. ``on_measured`` is called with each measurement.

    Args:
        clock, params, ahrs, logger: the vehicle's.
        reads_rates: whether the release reads ``flow_rate_x`` and ``flow_rate_y``, and has FLOW_OPTIONS.
        simulated: the driver of the simulator's sensor; None of a vehicle that nobody flies.
    """

    def __init__(
        self,
        clock: Clock,
        params: ParamTable,
        ahrs: AhrsBase,
        logger: RecordSink,
        *,
        reads_rates: bool = False,
        simulated: FlowDriver | None = None,
    ) -> None:
        self._clock = clock
        self._params = params
        self._ahrs = ahrs
        self._logger = logger
        self._mounting = FromParams(params, self._find_mounting)
        self.newest = FlowMeasurement(0, (0.0, 0.0), (0.0, 0.0))
        self.on_measured: Callable[[FlowMeasurement], None] = lambda _measured: None
        self._type = FromParams(params, lambda: params.get_int("FLOW_TYPE"))
        is_stabilised = FromParams(params, lambda: reads_rates and params.get_int("FLOW_OPTIONS") & STABILISED != 0)
        mavlink = MavlinkFlow(clock, ahrs, is_stabilised, reads_rates=reads_rates)
        drivers: dict[int, FlowDriver | None] = {FLOW_TYPE_MAVLINK: mavlink, FLOW_TYPE_SIMULATED: simulated}
        self._driver = drivers.get(self._type())
        self._last_update_ms = 0
        self._healthy = False

    def enabled(self) -> bool:
        """Return whether FLOW_TYPE asks for a sensor (AP_OpticalFlow::enabled)."""
        return self._type() != FLOW_TYPE_NONE

    def healthy(self) -> bool:
        """Return whether there is a sensor whose last flow was younger than 0.5 s (AP_OpticalFlow::healthy)."""
        return self._driver is not None and self._healthy

    def take(self, packet: OPTICAL_FLOW) -> bool:
        """Hand a message to the driver; return whether there is a sensor that takes it (AP_OpticalFlow::handle_msg)."""
        return self.enabled() and self._driver is not None and self._driver.take(packet)

    def idle_until_us(self) -> int:
        """Return before when ``update`` has nothing to do; 0 if the next one may."""
        if self._driver is None:
            return NEVER
        until_us = self._driver.idle_until_us()
        return min(until_us, 1000 * (self._last_update_ms + HEALTHY_MS)) if self._healthy else until_us

    def update(self) -> None:
        """Make the flow since the last update known, 200 times per second (AP_OpticalFlow::update)."""
        if self._type() == FLOW_TYPE_NONE:
            return
        reading = None if self._driver is None else self._driver.read(self._mounting())
        if reading is not None:
            self._publish(reading)
        self._healthy = u32(self._clock.millis() - self._last_update_ms) < HEALTHY_MS

    def _find_mounting(self) -> Mounting:
        scale_x, scale_y = (_ONE + _PER_MILLE * f32(self._params.get_int(f"FLOW_F{axis}SCALER")) for axis in "XY")
        x, y, z = (float(self._params.get_float(f"FLOW_POS_{axis}")) for axis in "XYZ")
        yaw_rad = f32(self._params.get_int("FLOW_ORIENT_YAW")) * _CDEG
        return Mounting(scale_x, scale_y, yaw_rad, (x, y, z))

    def _publish(self, reading: FlowReading) -> None:
        quality, flow, body = reading
        self._last_update_ms = self._clock.millis()
        (flow_x, flow_y), (body_x, body_y) = map(float, flow), map(float, body)
        self.newest = FlowMeasurement(quality, (flow_x, flow_y), (body_x, body_y), self._mounting().place_frd)
        self._ahrs.write_flow(self.newest, self._last_update_ms)
        self.on_measured(self.newest)
        if self._params.get_int("LOG_BITMASK") & MASK_LOG_OPTFLOW:
            self._logger.write(OF, (self._clock.micros64(), quality, *flow, *body))
