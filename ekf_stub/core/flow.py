# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Optical flow: which measurements are taken, and their fusion.

Source: AP_NavEKF3/AP_NavEKF3_Measurements.cpp (writeOptFlowMeas), AP_NavEKF3_OptFlowFusion.cpp (SelectFlowFusion,
FuseOptFlow).
"""

from typing import Final, final

from ekf_stub.core import events as ev
from ekf_stub.core.aiding import Aiding
from ekf_stub.core.events import Events
from ekf_stub.core.inertial import Inertial
from ekf_stub.core.params import OPTFLOW, EkfSources, Params, gate
from ekf_stub.core.samples import HALF_FILTER_STEP_MS, SENSOR_INTERVAL_MIN_MS, FlowSample, ObsRing
from ekf_stub.core.state import State
from ekf_stub.core.terrain import FLOW_FOR_TERRAIN, LEAST_FLOW_NOISE, LOST_MS, Terrain
from ekf_stub.core.vectors import (
    U32,
    ZERO,
    Vec2,
    Vec3,
    add,
    cross,
    dot,
    is_finite,
    is_zero,
    larger,
    later_ms,
    length2,
    limited,
    square,
    to_body,
)

_MAX_RATE: Final = 4.2
_HALF_INTERVAL_MS: Final = 50
_LEAST_S: Final = 0.01
_LEAST_Z_S: Final = 0.001
_BIAS_GAIN: Final = 0.01
_MAX_BIAS_STEP: Final = 0.1


@final
class FlowReading:
    """Takes measurements or refuses them, and keeps what waits for the horizon.

    Args:
        ring_size: how many may wait; 0 if there was no flow sensor as the filter was set up.

    Attributes:
        received_ms: when one came in last, good or not; -1 before the first.
        valid_ms: when a good one came in last, or was taken for having come in.
    """

    def __init__(self, ring_size: int) -> None:
        self._ring: ObsRing[FlowSample] = ObsRing(ring_size)
        self.reset(0)

    def reset(self, now_ms: int) -> None:
        """Forget everything, as the filter restarts."""
        self._ring.clear()
        self.received_ms = -1
        self.valid_ms = now_ms
        self._gyro_bias: Vec2 = (0.0, 0.0)
        self._turned: Vec3 = ZERO
        self._turned_s = 0.0

    def note_turn(self, del_ang: Vec3, del_ang_dt: float) -> None:
        """Note by how much the vehicle turned in a step, rad, without the gyro's bias, and in which time, s."""
        self._turned = add(self._turned, del_ang)
        self._turned_s += del_ang_dt

    def write(
        self,
        quality: int,
        flow: Vec2,
        gyro: Vec2,
        offset: Vec3,
        delta: Inertial,
        now_ms: int,
        horizon_ms: int,
        delay_ms: int,
    ) -> bool:
        """Take a measurement; say whether it did not come too soon after the last.

        Args:
            quality: 0..255; 0 is unusable.
            flow, gyro: rates about x and y by what the sensor sees and by its own gyro, rad/s.
            offset: its place from the IMU, m, body (FRD).
            delta, now_ms: the newest inertial data, and their time.
            delay_ms: EK3_FLOW_DELAY.
        """
        if self.received_ms >= 0 and now_ms - self.received_ms < SENSOR_INTERVAL_MIN_MS:
            return False
        self.received_ms = now_ms
        self._learn_gyro_bias(gyro)
        is_slow = length2(flow[0], flow[1]) < _MAX_RATE and length2(gyro[0], gyro[1]) < _MAX_RATE
        if quality > 0 and is_slow and is_finite(offset):
            self.valid_ms = now_ms
            time_ms = later_ms((now_ms - delay_ms - _HALF_INTERVAL_MS - HALF_FILTER_STEP_MS) & U32, horizon_ms)
            rate_x, rate_y = gyro[0] - self._gyro_bias[0], gyro[1] - self._gyro_bias[1]
            flow_comp = rate_x - flow[0], rate_y - flow[1]
            body_rate = rate_x, rate_y, self._yaw_rate(delta)
            self._ring.push(FlowSample(time_ms, (-flow[0], -flow[1]), flow_comp, body_rate, offset))
        return True

    def _learn_gyro_bias(self, gyro: Vec2) -> None:
        if self._turned_s <= _LEAST_S:
            return
        self._gyro_bias = (
            self._learned(self._gyro_bias[0], gyro[0], self._turned[0]),
            self._learned(self._gyro_bias[1], gyro[1], self._turned[1]),
        )
        self._turned, self._turned_s = ZERO, 0.0

    def _learned(self, bias: float, rate: float, turned: float) -> float:
        difference = limited(rate - turned / self._turned_s, -_MAX_BIAS_STEP, _MAX_BIAS_STEP)
        return (1 - _BIAS_GAIN) * bias + _BIAS_GAIN * difference

    def _yaw_rate(self, delta: Inertial) -> float:
        if self._turned_s > _LEAST_Z_S:
            return self._turned[2] / self._turned_s
        return delta.del_ang[2] / delta.del_ang_dt if delta.del_ang_dt > _LEAST_Z_S else 0.0

    def recall(self, horizon_ms: int) -> FlowSample | None:
        """Take out the measurement that has come due."""
        return self._ring.recall(horizon_ms)


_FLOW_FOR_NAVIGATION: Final = 1  # of EK3_FLOW_USE
_VALID_MS: Final = 1000
_LEAST_UPRIGHT: Final = 0.71
_FOCUS_M: Final = 0.5
_MAX_RANGE_M: Final = 1000.0


@final
class FlowFusion:
    """Tests and fuses optical flow, axis after axis, and lets the ground be measured before.

    Attributes:
        takeoff_detected: the vehicle has left the ground, as far as flow is concerned.
        is_valid: flow has come in not long ago, or the vehicle stands, where it is known to be zero.
        ground_is_valid: the height above the ground is known.
        is_fused: a flow was fused since aiding ended last.
        innovations, ratios: of the two axes, rad/s, prediction less measurement; and of their squares to the gates.
    """

    def __init__(
        self,
        params: Params,
        state: State,
        aiding: Aiding,
        sources: EkfSources,
        events: Events,
        reading: FlowReading,
        terrain: Terrain,
    ) -> None:
        self._params = params
        self._state = state
        self._aiding = aiding
        self._sources = sources
        self._events = events
        self._reading = reading
        self._terrain = terrain
        self.takeoff_detected = False
        self.is_valid = False
        self.ground_is_valid = False
        self.is_fused = False
        self.innovations: Vec2 = (0.0, 0.0)
        self.ratios: Vec2 = (0.0, 0.0)

    def step(self, now_ms: int, horizon_ms: int, ground_is_datum: bool) -> None:
        """Fuse what came due in a step; with ``ground_is_datum`` heights are a range finder's, from the ground."""
        flow = self._reading.recall(horizon_ms)
        terrain = self._terrain
        self.ground_is_valid = now_ms - terrain.valid_ms < LOST_MS or ground_is_datum
        # So that it can be carried, a vehicle too near the ground to see it sharply counts as standing.
        stands = not self.takeoff_detected and terrain.above < _FOCUS_M
        self.is_valid = stands or now_ms - self._reading.valid_ms < _VALID_MS
        if (flow is None and not terrain.ranges.is_due) or self._state.rotation[2][2] <= _LEAST_UPRIGHT:
            return
        seen = FlowSample(0, (0.0, 0.0), (0.0, 0.0), ZERO, ZERO) if flow is None else flow
        if stands:
            seen = FlowSample(seen.time_ms, (0.0, 0.0), (0.0, 0.0), seen.body_rate, seen.offset)
        if terrain.ranges.is_due or self._params.FLOW_USE == FLOW_FOR_TERRAIN:
            terrain.estimate(now_ms, seen, ground_is_datum)
        if flow is not None:
            self._fuse(seen, now_ms)

    def is_used(self) -> bool:
        """Return whether the filter navigates by flow."""
        return self._params.FLOW_USE == _FLOW_FOR_NAVIGATION and self._sources.uses_vel_xy(OPTFLOW)

    def _fuse(self, flow: FlowSample, now_ms: int) -> None:
        """Fuse the axes one after the other, both with how they depend on the errors that were found before."""
        state, params = self._state, self._params
        distance = limited(self._terrain.predicted_range(), self._terrain.ranges.on_ground, _MAX_RANGE_M)
        by_turning = ZERO
        if not is_zero(flow.offset):
            distance -= dot(state.rotation[2], flow.offset) / state.rotation[2][2]
            by_turning = cross(flow.body_rate, flow.offset)
        if distance == 0.0:
            return  # where the sensor is said to be on the ground
        is_slow = self.is_used() and larger(flow.flow[0], flow.flow[1]) < params.FLOW_MAX
        noise_var = square(larger(params.FLOW_M_NSE, LEAST_FLOW_NOISE))
        quat, vel = state.quat, state.vel
        for axis in range(2):
            along, aside, _ = add(to_body(state.rotation, state.vel), by_turning)
            predicted = aside / distance if axis == 0 else -along / distance
            scale = 1.0 / distance if axis == 0 else -1.0 / distance
            expected = state.look_along_body_velocity(1 - axis, scale, quat, vel)
            if expected <= 0.0:
                return
            innovation = predicted - flow.flow_comp[axis]
            ratio = innovation * innovation / (gate(params.FLOW_I_GATE) * (expected + noise_var))
            self.innovations = (innovation, self.innovations[1]) if axis == 0 else (self.innovations[0], innovation)
            self.ratios = (ratio, self.ratios[1]) if axis == 0 else (self.ratios[0], ratio)
            if is_slow and ratio < 1:
                self._aiding.flow_ms = now_ms
                if not self.is_fused:
                    self.is_fused = True
                    self._events.say(ev.FUSING_FLOW)
                state.fuse(expected, innovation, noise_var, state.unlearned)
