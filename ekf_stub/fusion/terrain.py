# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Estimate of the height of the ground, one state of its own (AP_NavEKF3_OptFlowFusion.cpp, EstimateTerrainOffset)."""

import math
from typing import Final

from ekf_stub.filter.states import VEL
from ekf_stub.fusion.aiding import RELATIVE
from ekf_stub.fusion.parts import FilterParts, Fusion
from ekf_stub.inputs.flow_ingest import FlowSample, Two
from ekf_stub.inputs.range_reading import RangeReading

FLOW_FOR_TERRAIN: Final = 2  # of EK3_FLOW_USE
INITIAL_VAR: Final = 0.25
LOST_MS: Final = 5000
LEAST_SPEED: Final = 5.0
MAX_DISTANCE: Final = 10.0
MAX_INTERVAL_S: Final = 1.0
LEAST_VAR_WITH_FLOW: Final = 1e-6
LEAST_FLOW_NOISE: Final = 0.05
_DOWN_VELOCITY: Final = VEL.stop - 1


class Terrain(Fusion):
    """The ground below the vehicle.

    Attributes:
        down: how far the ground is below the origin, m; never above the vehicle as it stands.
        variance: of that, m^2.
        valid_ms: when it was measured last; 0 counts as just after boot.
        range_innovation, range_ratio: of the last range tested, m, and of its square to the gate.
        flow_innovation: of the last flow by which the ground was measured, rad/s.
    """

    def __init__(self, parts: FilterParts, ranges: RangeReading, now_ms: int) -> None:
        super().__init__(parts)
        self.ranges = ranges
        self.down = 0.0
        self.variance = INITIAL_VAR
        self.valid_ms = 0
        self.range_innovation = self.range_ratio = 0.0
        self.flow_innovation: Two = (0.0, 0.0)
        self._is_held = False
        self._estimated_ms = now_ms
        self._estimated_at: Two = (0.0, 0.0)
        self._local_origin: Two = (0.0, 0.0)

    @property
    def above(self) -> float:
        """The height of the vehicle above the ground, m."""
        return self.down - self._state.down

    def constrain(self) -> None:
        """Keep the ground below the vehicle, after a prediction (ConstrainStates)."""
        if not self._is_held:
            self.down = max(self.down, self._state.down + self.ranges.on_ground)

    def _keep_below(self) -> None:
        self.down = max(self.down, self._state.down + self.ranges.on_ground)

    def follow_height(self, *, on_ground: bool) -> None:
        """Follow a reset of height (ResetHeight)."""
        if on_ground:
            self.down = self._state.down + self.ranges.on_ground
        self._keep_below()

    def move_origin(self) -> None:
        """Count the way over the ground from here (moveEKFOrigin).

        FIRMWARE PARITY: there the origin itself moves. Of that only this is seen: the way since the last estimate is
        then the one from where that was to where the origin was.
        """
        self._local_origin = self._state.pos.item(0), self._state.pos.item(1)

    def estimate(self, now_ms: int, flow: FlowSample, *, is_datum: bool) -> None:
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
        if self._get_float("FLOW_USE") != FLOW_FOR_TERRAIN or self._aiding.mode is RELATIVE:
            return False
        north, east, _ = self._state.vel.tolist()
        is_fast = north * north + east * east >= LEAST_SPEED**2
        return self._gps.is_in_use and is_fast and max(flow.flow) <= self._get_float("MAX_FLOW")

    def _grow(self, now_ms: int) -> None:
        """Know less of the ground with the way over it, and with the uncertainty of vertical velocity."""
        (north, east, _), (origin_north, origin_east) = self._state.pos.tolist(), self._local_origin
        here = north - origin_north, east - origin_east
        distance = min(math.dist(here, self._estimated_at), MAX_DISTANCE)
        interval_s = min(1e-3 * (now_ms - self._estimated_ms), MAX_INTERVAL_S)
        self._estimated_at, self._estimated_ms = here, now_ms
        self.variance += (distance * self._get_float("TERR_GRAD")) ** 2
        self.variance += interval_s * interval_s * self._state.cov.item(_DOWN_VELOCITY, _DOWN_VELOCITY)

    def _upright(self) -> float:
        """Return the cosine of the tilt, with what was fused in this step."""
        w, x, y, z = self._state.quat.w, self._state.quat.x, self._state.quat.y, self._state.quat.z
        return float(w * w - x * x - y * y + z * z)

    def predicted_range(self) -> float:
        """Return what a range finder at the IMU would measure, m."""
        return max(self.above, self.ranges.on_ground) / self._state.rotation.item(2, 2)

    def _fuse_range(self, now_ms: int) -> None:
        ranges, down = self.ranges, self._state.down
        if now_ms - self.valid_ms > LOST_MS:
            self.down = max(ranges.distance * self._state.rotation.item(2, 2), ranges.on_ground) + down
        innovation = self.predicted_range() - ranges.distance
        upright = self._upright()
        # FIRMWARE PARITY: the parameter, a standard deviation, counts as a variance.
        innovation_variance = self._get_float("RNG_M_NSE") + self.variance / upright**2
        self._keep_below()
        gate = max(0.01 * self._get_float("RNG_I_GATE"), 1.0) ** 2
        self.range_innovation, self.range_ratio = innovation, innovation**2 / (gate * innovation_variance)
        if self.range_ratio < 1:
            self.down -= self.variance / (upright * innovation_variance) * innovation
            self._keep_below()
            self.variance = max(self.variance - self.variance**2 / (upright**2 * innovation_variance), 0.0)
            self.valid_ms = now_ms

    def _fuse_flow(self, now_ms: int, flow: FlowSample) -> None:
        state, distance = self._state, self.predicted_range()
        self._keep_below()
        along, aside, _ = (state.vel @ state.rotation).tolist()
        innovations = aside / distance - flow.flow_comp[0], -along / distance - flow.flow_comp[1]
        self.flow_innovation = innovations
        self.variance = max(self.variance, LEAST_VAR_WITH_FLOW)
        now_rotation = state.rotation_now()
        along, aside, _ = (state.vel @ now_rotation).tolist()
        if self._fuse_flow_axis(innovations[1], along):
            self.valid_ms = now_ms
        self._fuse_flow_axis(innovations[0], -aside)

    def _fuse_flow_axis(self, innovation: float, speed: float) -> bool:
        """Fuse the flow of one axis, given the speed that it shows; say whether it passed its gate."""
        slope = self._upright() * speed / self.above**2
        innovation_variance = slope * self.variance * slope + max(self._get_float("FLOW_M_NSE"), LEAST_FLOW_NOISE) ** 2
        gate = max(0.01 * self._get_float("FLOW_I_GATE"), 1.0) ** 2
        if innovation**2 >= gate * innovation_variance:
            return False
        gain = self.variance * slope / innovation_variance
        self.down -= gain * innovation
        self._keep_below()
        self.variance = max(self.variance - gain * slope * self.variance, LEAST_VAR_WITH_FLOW)
        return True
