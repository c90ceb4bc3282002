# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Estimate of the height of the ground, one state of its own (AP_NavEKF3_OptFlowFusion.cpp, EstimateTerrainOffset)."""

import math
from typing import Final, final

from ekf_stub.core.aiding import RELATIVE, Aiding
from ekf_stub.core.covariance import VEL_D
from ekf_stub.core.gps import Gps
from ekf_stub.core.params import Params, gate
from ekf_stub.core.ranges import RangeFinders
from ekf_stub.core.samples import FlowSample
from ekf_stub.core.state import State
from ekf_stub.core.vectors import Vec2, larger, length2, matrix, smaller, square, to_body

FLOW_FOR_TERRAIN: Final = 2  # of EK3_FLOW_USE
LEAST_FLOW_NOISE: Final = 0.05
LOST_MS: Final = 5000
_INITIAL_VAR: Final = 0.25
_LEAST_SPEED: Final = 5.0
_MAX_DISTANCE: Final = 10.0
_MAX_INTERVAL_S: Final = 1.0
_LEAST_VAR_WITH_FLOW: Final = 1e-6


@final
class Terrain:
    """The ground below the vehicle.

    Attributes:
        ranges: the range finders that measure it.
        down: how far the ground is below the origin, m; never above the vehicle as it stands.
        variance: of that, m^2.
        valid_ms: when it was measured last; 0 counts as just after boot.
        range_innovation, range_ratio: of the last range tested, m, and of its square to the gate.
        flow_innovation: of the last flow by which the ground was measured, rad/s.
    """

    def __init__(
        self, params: Params, state: State, aiding: Aiding, gps: Gps, ranges: RangeFinders, now_ms: int
    ) -> None:
        self._params = params
        self._state = state
        self._aiding = aiding
        self._gps = gps
        self.ranges = ranges
        self.down = 0.0
        self.variance = _INITIAL_VAR
        self.valid_ms = 0
        self.range_innovation = 0.0
        self.range_ratio = 0.0
        self.flow_innovation: Vec2 = (0.0, 0.0)
        self._is_held = False
        self._estimated_ms = now_ms
        self._estimated_at: Vec2 = (0.0, 0.0)
        self._local_origin: Vec2 = (0.0, 0.0)

    @property
    def above(self) -> float:
        """The height of the vehicle above the ground, m."""
        return self.down - self._state.pos[2]

    def constrain(self) -> None:
        """Keep the ground below the vehicle, after a prediction (ConstrainStates)."""
        if not self._is_held:
            self._keep_below()

    def _keep_below(self) -> None:
        self.down = larger(self.down, self._state.pos[2] + self.ranges.on_ground)

    def follow_height(self, on_ground: bool) -> None:
        """Follow a reset of height (ResetHeight)."""
        if on_ground:
            self.down = self._state.pos[2] + self.ranges.on_ground
        self._keep_below()

    def move_origin(self) -> None:
        """Count the way over the ground from here (moveEKFOrigin).

        FIRMWARE PARITY: there the origin itself moves. Of that only this is seen: the way since the last estimate is
        then the one from where that was to where the origin was.
        """
        self._local_origin = self._state.pos[0], self._state.pos[1]

    def estimate(self, now_ms: int, flow: FlowSample, is_datum: bool) -> None:
        """Estimate by what came due in a step; with ``is_datum`` heights count from the ground."""
        by_flow = self._can_use(flow)
        self._is_held = is_datum or not (self.ranges.is_due or by_flow)
        if self._is_held:
            return
        self._grow(now_ms)
        if self.ranges.is_due:
            self._fuse_range(now_ms)
        if by_flow:
            self._fuse_flow(now_ms, flow)

    def _can_use(self, flow: FlowSample) -> bool:
        """Return whether the vehicle is so fast over the ground that flow tells its height."""
        if self._params.FLOW_USE != FLOW_FOR_TERRAIN or self._aiding.mode == RELATIVE:
            return False
        north, east, _ = self._state.vel
        is_fast = north * north + east * east >= _LEAST_SPEED * _LEAST_SPEED
        return self._gps.is_in_use and is_fast and larger(flow.flow[0], flow.flow[1]) <= self._params.FLOW_MAX

    def _grow(self, now_ms: int) -> None:
        """Know less of the ground with the way over it, and with the uncertainty of vertical velocity."""
        north, east = self._state.pos[0] - self._local_origin[0], self._state.pos[1] - self._local_origin[1]
        moved = length2(north - self._estimated_at[0], east - self._estimated_at[1])
        interval_s = smaller(1e-3 * (now_ms - self._estimated_ms), _MAX_INTERVAL_S)
        self._estimated_at, self._estimated_ms = (north, east), now_ms
        self.variance += square(smaller(moved, _MAX_DISTANCE) * self._params.TERR_GRAD)
        self.variance += interval_s * interval_s * self._state.cov.var(VEL_D)

    def _upright(self) -> float:
        """Return the cosine of the tilt, with what was fused in this step."""
        w, x, y, z = self._state.quat
        return w * w - x * x - y * y + z * z

    def predicted_range(self) -> float:
        """Return what a range finder at the IMU would measure, m."""
        return larger(self.above, self.ranges.on_ground) / self._state.rotation[2][2]

    def _fuse_range(self, now_ms: int) -> None:
        ranges, down = self.ranges, self._state.pos[2]
        if now_ms - self.valid_ms > LOST_MS:
            self.down = larger(ranges.distance * self._state.rotation[2][2], ranges.on_ground) + down
        innovation = self.predicted_range() - ranges.distance
        upright = self._upright()
        # FIRMWARE PARITY: the parameter, a standard deviation, counts as a variance.
        innovation_var = self._params.RNG_M_NSE + self.variance / square(upright)
        self._keep_below()
        self.range_innovation = innovation
        self.range_ratio = innovation * innovation / (gate(self._params.RNG_I_GATE) * innovation_var)
        if self.range_ratio < 1:
            self.down -= self.variance / (upright * innovation_var) * innovation
            self._keep_below()
            self.variance = larger(self.variance - square(self.variance) / (square(upright) * innovation_var), 0.0)
            self.valid_ms = now_ms

    def _fuse_flow(self, now_ms: int, flow: FlowSample) -> None:
        state, distance = self._state, self.predicted_range()
        self._keep_below()
        along, aside, _ = to_body(state.rotation, state.vel)
        self.flow_innovation = aside / distance - flow.flow_comp[0], -along / distance - flow.flow_comp[1]
        self.variance = larger(self.variance, _LEAST_VAR_WITH_FLOW)
        along, aside, _ = to_body(matrix(state.quat), state.vel)
        if self._fuse_flow_axis(self.flow_innovation[1], along):
            self.valid_ms = now_ms
        self._fuse_flow_axis(self.flow_innovation[0], -aside)

    def _fuse_flow_axis(self, innovation: float, speed: float) -> bool:
        """Fuse the flow of one axis, given the speed that it shows; say whether it passed its gate."""
        slope = self._upright() * speed / square(self.above)
        innovation_var = slope * self.variance * slope + square(larger(self._params.FLOW_M_NSE, LEAST_FLOW_NOISE))
        if innovation * innovation >= gate(self._params.FLOW_I_GATE) * innovation_var:
            return False
        gain = self.variance * slope / innovation_var
        self.down -= gain * innovation
        self._keep_below()
        self.variance = larger(self.variance - gain * slope * self.variance, _LEAST_VAR_WITH_FLOW)
        return True

    @property
    def sigma(self) -> float:
        """The standard deviation of the ground's height, m."""
        return math.sqrt(self.variance)
