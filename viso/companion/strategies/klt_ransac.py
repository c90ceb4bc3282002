# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The baseline: tracked corners, checked by E and H, in an error-state filter with a window of poses."""

from typing import Final

from viso.companion.msckf.chain import Chain
from viso.companion.msckf.estimator import WindowEstimator
from viso.companion.msckf.multi_state import TracksUsed
from viso.companion.msckf.window_filter import WindowFilter
from viso.companion.strategies.tracking import TrackedFrame, TrackingStrategy
from viso.companion.vio.config import AglSource, Scene
from viso.companion.vio.result import Result
from viso.companion.vio.types import VioState, WarmStartPose

PIXEL_SIGMA: Final = 0.5
MIN_CLONE_INTERVAL_NS: Final = 80_000_000
FEWEST_REFUSED: Final = 5  # tracks that must have been refused, and all of them, to say that something is wrong


class KltRansac(TrackingStrategy):
    """The strategy ``klt_ransac``."""

    name = "klt_ransac"
    _estimator: WindowEstimator | None

    def _reset(self, start: WarmStartPose | None) -> None:
        self._cloned_ns = 0
        self._used = TracksUsed()  # by the last frame that used some
        super()._reset(start)

    def _make_estimator(self, state: WindowFilter) -> WindowEstimator:
        config = self.context.config
        return WindowEstimator(
            state,
            self._B_T_C,
            PIXEL_SIGMA / self._front.focal_px,
            config.window_clones,
            2 if config.scene is Scene.PLANAR else 3,
        )

    def _update(self, tracked: TrackedFrame) -> Result:
        assert self._estimator is not None
        estimator, state = self._estimator, self._estimator.state
        keyframe, t_ns, since = self._keyframe, tracked.window.end_t_ns, None
        with self.stage("filter"):
            self._number += 1
            is_at_rest = keyframe is not None and self._update_at_rest(state, t_ns - tracked.window.start_t_ns)
            is_due = tracked.sighting.model is not None and t_ns - self._cloned_ns >= MIN_CLONE_INTERVAL_NS
            is_cloned = keyframe is None or (is_due and not is_at_rest)
            if not is_at_rest:
                estimator.compare(tracked.sighting)
            used = self._add_frame(estimator, tracked) if is_cloned else TracksUsed()
            if self.context.config.agl_source is not AglSource.NONE and not self._ground.is_rough:
                self._ground.note_relief(self.heights.use(state, t_ns, self._ground.z_m))
            reference, is_keyframe = self._keyframe_of(tracked, state, must=False, may=is_cloned)
            if self.health.state is VioState.INIT:
                estimator.chain = Chain(state, state.clones[-1].number, reference.number)
            if estimator.chain is not None:
                since = estimator.chain.covariance(state, reference.number, self._number if is_keyframe else None)
        return self._answer(
            tracked,
            state,
            reference,
            is_keyframe=is_keyframe,
            mre_px=PIXEL_SIGMA * self._used.mre_sigmas,
            innovation_ratio=estimator.innovation_ratio,
            depth_m=self._used.depth_m if is_cloned else None,
            is_refused=used.offered >= FEWEST_REFUSED and used.used == 0,
            leaves_scale_open=self._ground.leaves_scale_open(state),
            start_covariance_6x6=since,
        )

    def _add_frame(self, estimator: WindowEstimator, tracked: TrackedFrame) -> TracksUsed:
        plane = self._ground_below(estimator.state, tracked.window.end_t_ns)
        keep = None if self._keyframe is None else self._keyframe.number
        depth_m = self._ground.depth_guess_m(estimator.state)
        used = estimator.add_frame(self._number, tracked.sighting, plane, keep, depth_m)
        self._cloned_ns = tracked.window.end_t_ns
        self._watch_ground(plane, estimator.relief_share)
        if used.used:
            self._used = used
        return used
