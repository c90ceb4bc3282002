# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The base of strategies that track points: everything but the estimator. Needs the extra vio."""

import abc
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Protocol

import cv2
import numpy as np
import threadpoolctl

from viso.companion.klt.front_end import FrontEnd, Keyframe, Sighting, WorkingImages, shrink_factor
from viso.companion.msckf.ground import Ground
from viso.companion.msckf.heights import Heights
from viso.companion.msckf.multi_state import Below, Plane
from viso.companion.msckf.stillness import SPAN_NS, Stillness, stand_still, state_at_rest, turn_of_camera
from viso.companion.msckf.window_filter import (
    POS,
    START_SIGMAS,
    VEL,
    WindowFilter,
    default_cov,
    invariant_cov,
    sigma_of,
)
from viso.companion.vio.calibration import scaled
from viso.companion.vio.config import AglSource, Scene
from viso.companion.vio.health import FrameFacts, Growth
from viso.companion.vio.imu import ImuPeriod
from viso.companion.vio.pipeline import StrategyBase, StrategyContext
from viso.companion.vio.result import Result
from viso.companion.vio.types import (
    FeatureQuality,
    ImuBias,
    ImuWindow,
    NavCameraFrame,
    VioOutput,
    WarmStartPose,
)
from viso.geometry.pose import SE3, sound_covariance
from viso.geometry.rotation import Array

LEAST_VARIANCE_M2: Final = 1e-6  # of the position in an output
_LEAST_COV: Final = np.diag([0.0] * 3 + [LEAST_VARIANCE_M2] * 3)

_UNKNOWN_HEIGHT_M: Final = 100.0


class Estimator(Protocol):
    """The estimator of a strategy.

    Attributes:
        state: the motion; its world has its origin where the estimator began.
    """

    @property
    def state(self) -> WindowFilter: ...

    def propagate(self, window: ImuWindow) -> None:
        """Propagate the state by inertial data or, where there are none, as the body moved last."""


@dataclass(frozen=True, slots=True, eq=False)
class TrackedFrame:
    """A frame for the estimator, with its inertial data and tracked points.

    Attributes:
        window: the inertial data since the frame before.
        imu_fault: what is wrong with the inertial data, or None.
        begins: whether the state was found with this frame, at rest.
    """

    frame: NavCameraFrame
    window: ImuWindow
    sighting: Sighting
    imu_fault: str | None
    begins: bool


class TrackingStrategy(StrategyBase):
    """A strategy with a front end; a class for each estimator gives the rest."""

    _estimator: Estimator | None

    def __init__(self, context: StrategyContext) -> None:
        super().__init__(context)
        config, calibration = context.config, context.calibration
        _limit_threads(config.threads)
        divisor = shrink_factor(calibration.width, config.working_width_px)
        self._images = WorkingImages(divisor, clahe=config.clahe)
        self._front = FrontEnd(scaled(calibration, divisor), config)
        self._B_T_C = calibration.B_T_C
        self.heights = Heights(config.agl_sigma_m)
        self._reset(None)

    def add_height(self, t_ns: int, height_m: float, sigma_m: float) -> None:
        """Note a height of the body above the ground, from any thread."""
        self.heights.add(t_ns, height_m, sigma_m)

    @abc.abstractmethod
    def _make_estimator(self, state: WindowFilter) -> Estimator:
        """Return an estimator that begins with a state."""

    @abc.abstractmethod
    def _update(self, tracked: TrackedFrame) -> Result:
        """Update the estimator, already propagated, with a frame; return the result of ``_answer``."""

    def _reset(self, start: WarmStartPose | None) -> None:
        self._front.forget()
        self._stillness = Stillness(self._front.focal_px)
        self._imu_period = ImuPeriod()
        self._ground = Ground(self.context.config, 0.0)
        self._estimator = None
        self._keyframe: Keyframe | None = None
        self._number = 0  # of the last frame whose pose the estimator may have
        if start is not None:
            world_T_body = start.body_T_world.inverse()
            cov = default_cov(*START_SIGMAS, world_T_body.R) if start.covariance is None else start.covariance
            self._begin(world_T_body, world_T_body.R.dot(start.velocity_b), start.bias, cov)

    def _begin_at_rest(self) -> None:
        start = state_at_rest(self._stillness)
        assert start.covariance is not None
        cov = start.covariance.copy()
        if self.context.config.agl_source is not AglSource.NONE:  # the height comes from there
            cov[5, 5] = _UNKNOWN_HEIGHT_M**2
        self._begin(start.body_T_world.inverse(), start.velocity_b, start.bias, cov)

    def _begin(self, world_T_body: SE3, velocity_w: Array, bias: ImuBias, cov: Array) -> None:
        config, R, here = self.context.config, world_T_body.R, np.zeros(3)
        # The estimator's world has its origin here: its errors are rotations about the origin, which should be near.
        self._origin = world_T_body.t
        self._ground = Ground(config, float(self._origin[2]))
        cov = invariant_cov(cov, R, here, velocity_w)
        self._estimator = self._make_estimator(WindowFilter(config.imu_noise, R, here, velocity_w, bias, cov))

    def _process(self, frame: NavCameraFrame, imu_window: ImuWindow) -> Result:
        with self.stage("grey"):
            image = self._images.make(frame.pixels)
        fault = self._imu_period.fault(imu_window)
        with self.stage("propagate"):
            rotation, prior = self._move(imu_window)
        with self.stage("track"):
            sighting = self._front.track(image, rotation, prior)
        self._stillness.note(imu_window, sighting)
        self._ground.note(sighting.model)
        begins = self._estimator is None and self._stillness.is_start()
        if begins:
            self._begin_at_rest()
        if self._estimator is None:
            return self._conclude(FrameFacts(sighting.inliers, sighting.coverage, 0.0, imu_fault=fault), None)
        state = self._estimator.state
        if self._ground.is_rough and math.sqrt(state.cov[5, 5]) > 0.5 * _UNKNOWN_HEIGHT_M:  # hills are not that high
            self.heights.use(state, imu_window.end_t_ns, self._ground.z_m)
        return self._update(TrackedFrame(frame, imu_window, sighting, fault, begins))

    def _ground_below(self, state: WindowFilter, t_ns: int) -> Plane | Below | None:
        """Return the ground plane or the height above it; None if neither is known."""
        if not self._ground.is_rough:
            return self._ground.plane(state.pose @ self._B_T_C)
        taken = self.heights.take(t_ns, 0.0, state.v)
        if taken is None:
            return None
        self._ground.take_height(state, *taken)
        return Below(*taken)

    def _watch_ground(self, plane: Plane | Below | None, relief_share: Callable[[], float | None]) -> None:
        """Measure the height differences of the points, if needed."""
        if self._ground.is_rough or plane is not None:
            self._ground.note_relief(relief_share())
            self._front.planar = self.context.config.scene is Scene.PLANAR and not self._ground.is_rough

    def _update_at_rest(self, state: WindowFilter, span_ns: int) -> bool:
        """Update the filter with zero velocity after a while without motion; return whether it did."""
        # Inertial data count once, though each frame looks back over the same span.
        share = min(1.0, span_ns / SPAN_NS)
        return self._stillness.is_still() and stand_still(state, self._stillness.means()[0], share)

    def _keyframe_of(
        self, tracked: TrackedFrame, state: WindowFilter, *, must: bool, may: bool
    ) -> tuple[Keyframe, bool]:
        """Return the keyframe that a frame refers to, and whether the frame has become the next one.

        Args:
            must: whether it must become one.
            may: whether it becomes one if the last is outdated.
        """
        last, t_ns, rotation = self._keyframe, tracked.window.end_t_ns, state.R.dot(self._B_T_C.R)
        sighting = tracked.sighting
        is_next = must or last is None or (may and last.is_outdated(t_ns, rotation, sighting, self._front.focal_px))
        if is_next:
            self._keyframe = Keyframe(tracked.frame.frame_id, self._number, t_ns, rotation, sighting)
        reference = last or self._keyframe
        assert reference is not None  # the first frame is one
        return reference, is_next

    def _move(self, window: ImuWindow) -> tuple[Array, Array]:
        """Propagate; return the camera's rotation since the last frame, and the expected map of directions."""
        estimator = self._estimator
        if estimator is None or window.end_t_ns == window.start_t_ns:
            rotation = turn_of_camera(window, self.context.config.imu_noise, self._B_T_C.R)
            return rotation, rotation
        before = estimator.state.pose @ self._B_T_C
        estimator.propagate(window)
        after = estimator.state.pose @ self._B_T_C
        return after.R.T.dot(before.R), self._ground.expected_map(before, after)

    def _answer(
        self,
        tracked: TrackedFrame,
        state: WindowFilter,
        reference: Keyframe,
        *,
        is_keyframe: bool,
        mre_px: float,
        innovation_ratio: float,
        depth_m: float | None,
        is_refused: bool,
        has_failed: bool = False,
        leaves_scale_open: bool,
        start_covariance_6x6: Array | None,
    ) -> Result:
        """Return the result of a frame.

        Args:
            state: the estimator's, after the frame.
            reference: the keyframe that the pose refers to; its pose is in the state.
            is_keyframe: whether the frame is the keyframe of those after it.
            mre_px: mean reprojection error of the last points that were used, outliers left out.
            innovation_ratio: running mean of their normalised innovation squared per degree of freedom.
            depth_m: of the scene; None for a frame that did not measure how the body has moved.
            is_refused: whether nothing that was measured agreed with the state.
            has_failed: whether the estimator could not process the frame.
            leaves_scale_open: whether nothing has fixed the scale yet.
            start_covariance_6x6: of the pose since the start, None if that is not known.
        """
        if not state.is_finite():
            return self._conclude(FrameFacts(0, 0.0, 0.0, bias_norm=math.nan, is_finite=False), None)
        sighting = tracked.sighting
        relative, spread = state.relative_to(reference.number)
        cov = sound_covariance(spread + _LEAST_COV)
        age_s = (tracked.window.end_t_ns - reference.t_ns) * 1e-9
        growth = None
        if depth_m is not None and age_s > 0:
            growth = Growth(float(spread[3:, 3:].trace()), age_s, depth_m)
        facts = FrameFacts(
            sighting.inliers,
            sighting.coverage,
            mre_px,
            growth=growth,
            innovation_ratio=innovation_ratio,
            bias_norm=state.bias.norm(),
            imu_fault=tracked.imu_fault,
            has_model=sighting.model is not None,
            innovation_refused=is_refused,
            is_finite=cov is not None and not has_failed,
            position_sigma_m=sigma_of(state.cov[POS, POS][:2, :2]),
            velocity_sigma_m_s=sigma_of(state.cov[VEL, VEL]),
            scale_unobserved=leaves_scale_open,
            initialised=tracked.begins,
        )
        if cov is None:
            return self._conclude(facts, None)
        quality = FeatureQuality(
            sighting.tracked,
            sighting.lost,
            sighting.new,
            sighting.inliers,
            sighting.disparity_px,
            mre_px,
            sighting.coverage,
        )
        output = VioOutput(
            frame_id=tracked.frame.frame_id,
            relative_pose_T=relative,
            pose_covariance_6x6=cov,
            imu_bias=state.bias,
            feature_quality=quality,
            keyframe_id=reference.frame_id,
            is_keyframe=is_keyframe,
            velocity_b=state.R.T.dot(state.v),
            world_T_body=SE3(state.pose.R, state.p + self._origin),
            start_covariance_6x6=None if start_covariance_6x6 is None else start_covariance_6x6 + _LEAST_COV,
        )
        return self._conclude(facts, output)


def _limit_threads(count: int) -> None:
    """Set the number of threads of the libraries for pictures and linear algebra, in the whole process.

    The matrices of a filter are small: two threads take longer for them than one, and eight times as long where
    another program keeps the second core busy.
    """
    cv2.setNumThreads(count)
    threadpoolctl.threadpool_limits(limits=count, user_api="blas")
