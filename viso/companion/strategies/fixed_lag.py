# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tracked corners, checked by E and H, in a smoother over the last seconds. Needs the extras vio and gtsam."""

from typing import Final

from viso.companion.msckf.window_filter import WindowFilter
from viso.companion.smoother.estimator import FEWEST_LANDMARKS, Node, NodeFacts, SmootherEstimator
from viso.companion.strategies.tracking import TrackedFrame, TrackingStrategy
from viso.companion.vio.config import AglSource
from viso.companion.vio.result import Result
from viso.companion.vio.types import VioState, WarmStartPose

PIXEL_SIGMA: Final = 1.0  # points wander while they are landmarks
MIN_NODE_INTERVAL_NS: Final = 150_000_000
FEWEST_REFUSED: Final = 5  # landmarks that must have been elsewhere, and all of them, to say that something is wrong


class FixedLag(TrackingStrategy):
    """The strategy ``fixed_lag``."""

    name = "fixed_lag"
    _estimator: SmootherEstimator | None

    def _reset(self, start: WarmStartPose | None) -> None:
        self._node_ns = 0
        self._node = NodeFacts()  # the last one
        self._is_at_rest = False  # the body, at the last node
        super()._reset(start)

    def _make_estimator(self, state: WindowFilter) -> SmootherEstimator:
        noise = self.context.config.imu_noise
        return SmootherEstimator(state, noise, self._B_T_C, PIXEL_SIGMA / self._front.focal_px)

    def _update(self, tracked: TrackedFrame) -> Result:
        assert self._estimator is not None
        estimator, state, last = self._estimator, self._estimator.state, self._keyframe
        node: NodeFacts | None = None
        is_keyframe, since = False, None
        with self.stage("filter"):
            if last is None or tracked.window.end_t_ns - self._node_ns >= MIN_NODE_INTERVAL_NS:
                node = self._add_node(estimator, tracked)
                may_change = not (node.failed or self._is_at_rest)
                last, is_keyframe = self._keyframe_of(tracked, state, must=node.begins, may=may_change)
                if is_keyframe:
                    estimator.set_keyframe(self._number)
                if self.health.state is VioState.INIT:
                    estimator.begin_chain(last.number)
            if estimator.chain is not None:
                since = estimator.chain.covariance(state, last.number, self._number if is_keyframe else None)
        floats = self._node.agreeing < FEWEST_LANDMARKS and not (self._node.is_filtered or self._is_at_rest)
        return self._answer(
            tracked,
            state,
            last,
            is_keyframe=is_keyframe,
            mre_px=PIXEL_SIGMA * self._node.mre_sigmas,
            innovation_ratio=estimator.innovation_ratio,
            depth_m=self._node.depth_m if node is not None and not self._is_at_rest else None,
            is_refused=node is not None and node.landmarks >= FEWEST_REFUSED and node.agreeing == 0,
            has_failed=node is not None and node.failed,
            leaves_scale_open=floats or self._ground.leaves_scale_open(state),
            start_covariance_6x6=since,
        )

    def _add_node(self, estimator: SmootherEstimator, tracked: TrackedFrame) -> NodeFacts:
        state, t_ns = estimator.state, tracked.window.end_t_ns
        self._is_at_rest = self._update_at_rest(state, t_ns - self._node_ns)
        plane, height = self._ground_below(state, t_ns), self._height(state, t_ns)
        depth_m = self._ground.depth_guess_m(state)
        self._number, self._node_ns = self._number + 1, t_ns
        self._node = estimator.add_node(
            Node(self._number, t_ns, tracked.sighting, self._is_at_rest, plane, height, depth_m)
        )
        self._watch_ground(plane, estimator.relief_share)
        return self._node

    def _height(self, state: WindowFilter, t_ns: int) -> tuple[float, float] | None:
        """Return how high the body is above ground that is where the configuration says, with the sigma."""
        ground = self._ground
        if ground.is_rough or self.context.config.agl_source is AglSource.NONE:
            return None
        height = self.heights.take(t_ns, ground.z_m, state.v)
        if height is None:
            return None
        off = self.heights.off(state, height, ground.z_m)
        ground.note_relief(off)
        return height if off is None else None
