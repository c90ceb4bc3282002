# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Fusion of optical flow (AP_NavEKF3_OptFlowFusion.cpp, SelectFlowFusion, FuseOptFlow)."""

from typing import Final

import numpy as np

from ekf_stub.filter.inertial import limited
from ekf_stub.fusion.parts import FilterParts, Fusion
from ekf_stub.fusion.terrain import FLOW_FOR_TERRAIN, LEAST_FLOW_NOISE, LOST_MS, Terrain
from ekf_stub.inputs.flow_ingest import FlowIngest, FlowSample, Two
from ekf_stub.inputs.sources import XY_OPTFLOW

FLOW_FOR_NAVIGATION: Final = 1  # of EK3_FLOW_USE
VALID_MS: Final = 1000
LEAST_UPRIGHT: Final = 0.71
FOCUS_M: Final = 0.5
MAX_RANGE_M: Final = 1000.0
_NOTHING: Final = FlowSample(0, (0.0, 0.0), (0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


class FlowFusion(Fusion):
    """Tests and fuses optical flow, axis after axis, and lets the ground be measured before.

    Attributes:
        takeoff_detected: the vehicle has left the ground, as far as flow is concerned.
        is_valid: flow has come in not long ago, or the vehicle stands, where it is known to be zero.
        ground_is_valid: the height above the ground is known.
        is_fused: a flow was fused since aiding ended last.
        innovations, ratios: of the two axes, rad/s, prediction less measurement; and of their squares to the gates.
    """

    def __init__(self, parts: FilterParts, ingest: FlowIngest, terrain: Terrain) -> None:
        super().__init__(parts)
        self._flow = ingest
        self._terrain = terrain
        self.takeoff_detected = self.is_valid = self.ground_is_valid = self.is_fused = False
        self.innovations: list[float] = [0.0, 0.0]
        self.ratios: list[float] = [0.0, 0.0]

    def step(self, now_ms: int, *, ground_is_datum: bool) -> None:
        """Fuse what came due in a step; with ``ground_is_datum`` heights are a range finder's, from the ground."""
        flow = None if self._flow.received_ms is None else self._flow.recall(self._ingest.horizon_ms)
        terrain = self._terrain
        self.is_valid = now_ms - self._flow.valid_ms < VALID_MS
        self.ground_is_valid = now_ms - terrain.valid_ms < LOST_MS or ground_is_datum
        # So that it can be carried, a vehicle too near the ground to see it sharply counts as standing.
        stands = not self.takeoff_detected and terrain.down - self._state.down < FOCUS_M
        self.is_valid |= stands
        if (flow is None and not terrain.ranges.is_due) or self._state.rotation.item(2, 2) <= LEAST_UPRIGHT:
            return
        seen = flow or _NOTHING
        if stands:
            seen = seen._replace(flow=(0.0, 0.0), flow_comp=(0.0, 0.0))
        if terrain.ranges.is_due or self._get_float("FLOW_USE") == FLOW_FOR_TERRAIN:
            terrain.estimate(now_ms, seen, is_datum=ground_is_datum)
        if flow is not None:
            self._fuse(seen, now_ms)

    def is_used(self) -> bool:
        """Return whether the filter navigates by flow."""
        return self._get_float("FLOW_USE") == FLOW_FOR_NAVIGATION and self._sources.uses_vel_xy(XY_OPTFLOW)

    def _fuse(self, flow: FlowSample, now_ms: int) -> None:
        """Fuse the axes one after the other, both with how they depend on the errors that were found before."""
        state = self._state
        distance = limited(self._terrain.predicted_range(), self._terrain.ranges.on_ground, MAX_RANGE_M)
        offset = np.array(flow.offset)
        by_turning = np.zeros(3)
        if any(flow.offset):
            distance -= float(state.rotation[2] @ offset) / state.rotation.item(2, 2)
            by_turning = np.cross(np.array(flow.body_rate), offset)
        if not distance:
            return  # where the sensor is said to be on the ground
        is_slow = max(flow.flow) < self._get_float("MAX_FLOW") if self.is_used() else False
        rows = state.velocity_row(1) / distance, -state.velocity_row(0) / distance
        for axis, row in enumerate(rows):
            along, aside, _ = (state.vel @ state.rotation + by_turning).tolist()
            predicted: Two = aside / distance, -along / distance
            noise = max(self._get_float("FLOW_M_NSE"), LEAST_FLOW_NOISE) ** 2
            spread, expected = state.spread_of(row)
            if expected <= 0.0:
                return
            innovation = self.innovations[axis] = predicted[axis] - flow.flow_comp[axis]
            gate = max(0.01 * self._get_float("FLOW_I_GATE"), 1.0) ** 2
            self.ratios[axis] = innovation**2 / (gate * (expected + noise))
            if is_slow and self.ratios[axis] < 1:
                self._note_fused(now_ms)
                state.fuse_spread(spread, expected, innovation, noise, state.unlearned)

    def _note_fused(self, now_ms: int) -> None:
        self._aiding.times.flow = now_ms
        if not self.is_fused:
            self.is_fused = True
            self._texts.add("fusing optical flow")
