# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The flow sensor of the firmware's simulator (AP_OpticalFlow/AP_OpticalFlow_SITL.cpp)."""

import random
from typing import Final

from ap_core.clock import NEVER, Clock
from ap_core.fmath import f32
from ap_core.param import ParamTable
from ekf_stub.core.vectors import add, cross, rotated
from mav_handlers.wire.messages import OPTICAL_FLOW
from viso.vehicle.flow import NO_FLOW, FlowReading, Mounting, turned
from viso.vehicle.sensors.airframe import Airframe
from viso.vehicle.sensors.source import VehicleSource
from viso.vehicle.sensors.vectors import to_body
from viso.vehicle.simulated_ranges import height_above_ground_m

QUALITY: Final = 51
LONGEST_DELAY: Final = 20
LEAST_UPRIGHT: Final = 0.05
NO_GROUND_M: Final = 1e38


class SimulatedFlow:
    """A driver of a sensor that sees the ground below a vehicle that flies.

    SIM_FLOW_DELAY counts measurements, whatever its unit is said to be.

    Args:
        clock: time since boot.
        airframe: what flies.
        source: its sensors, which know where on earth it started.
        params: with the SIM_FLOW_ parameters.
        seed: of its noise.
    """

    def __init__(
        self, clock: Clock, airframe: Airframe, source: VehicleSource, params: ParamTable, seed: int = 0
    ) -> None:
        self._clock = clock
        self._airframe = airframe
        self._source = source
        self._params = params
        self._draw = random.Random(seed)
        self._measured_ms = 0
        self._delay = 0
        self._next = 0
        self._late = [NO_FLOW] * (LONGEST_DELAY + 1)

    def take(self, packet: OPTICAL_FLOW) -> bool:
        """Take no message."""
        return False

    def _due_ms(self) -> int | None:
        """Return when it measures next, ms since boot; None if it is switched off."""
        hertz = self._params.get_int("SIM_FLOW_RATE")
        if not self._params.get_int("SIM_FLOW_ENABLE") or hertz <= 0:
            return None
        return self._measured_ms - (-1000 // hertz)

    def idle_until_us(self) -> int:
        """Return before when ``read`` returns nothing, us since boot."""
        due_ms = self._due_ms()
        return NEVER if due_ms is None else 1000 * due_ms

    def read(self, mounting: Mounting) -> FlowReading | None:
        """Return a measurement if it is time for one, late as asked for; else None."""
        due_ms, now_ms = self._due_ms(), self._clock.millis()
        if due_ms is None or now_ms < due_ms:
            return None
        self._measured_ms = now_ms
        self._late[self._next] = self._measure(mounting)
        self._next = 0 if self._next >= self._delay else self._next + 1
        reading = self._late[self._next]
        delay = min(max(self._params.get_int("SIM_FLOW_DELAY"), 0), LONGEST_DELAY)
        if delay != self._delay:
            self._delay = delay
            self._late[:delay] = [reading] * delay
        return reading._replace(flow=turned(reading.flow, mounting))

    def _measure(self, mounting: Mounting) -> FlowReading:
        airframe, params = self._airframe, self._params
        truth, (_, rates) = airframe.truth(), airframe.felt()
        quat = truth.quat_wxyz
        upright, height_m = rotated(quat, (0.0, 0.0, 1.0))[2], height_above_ground_m(airframe, self._source)
        x, y, z = (float(params.get_float(f"SIM_FLOW_POS_{axis}")) for axis in "XYZ")
        range_m = NO_GROUND_M
        if upright > LEAST_UPRIGHT and height_m > 0:
            range_m = (height_m - rotated(quat, (x, y, z))[2]) / upright or NO_GROUND_M
        ahead, right, _ = add(to_body(quat, truth.vel_ned), cross(rates, (x, y, z)))
        noise = float(params.get_float("SIM_FLOW_RND"))
        flow_x = -right / range_m + rates[0] + noise * self._draw.uniform(-1.0, 1.0)
        flow_y = ahead / range_m + rates[1] + noise * self._draw.uniform(-1.0, 1.0)
        flow = f32(f32(flow_x) * mounting.scale_x), f32(f32(flow_y) * mounting.scale_y)
        return FlowReading(QUALITY, flow, (f32(rates[0]), f32(rates[1])))
