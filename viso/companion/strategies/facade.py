# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A strategy around a native engine: its records, its health and its failures in the terms of this project."""

import dataclasses
import uuid
from typing import Final

import numpy as np

from viso.companion.klt.working_image import WorkingImages, shrink_factor
from viso.companion.msckf.heights import Heights
from viso.companion.msckf.window_filter import sigma_of
from viso.companion.strategies.at_rest import RestWatch
from viso.companion.strategies.native import NativeEngine, NativeFeatures, NativePose, NativeStatus, load_engine
from viso.companion.vio.calibration import scaled
from viso.companion.vio.config import AglSource, Scene, VioConfig
from viso.companion.vio.errors import VioFatalError
from viso.companion.vio.health import FrameFacts, Growth
from viso.companion.vio.imu_window import median_period_ns, window_fault
from viso.companion.vio.strategy import StrategyBase, StrategyContext
from viso.companion.vio.types import (
    CameraCalibration,
    FeatureQuality,
    ImuBias,
    ImuWindow,
    NavCameraFrame,
    Pixels,
    VioOutput,
    VioState,
    WarmStartPose,
)
from viso.geometry.covariance import sound_covariance
from viso.geometry.se3 import SE3, Array, read_only

USUAL_PERIOD_NS: Final = 5_000_000
ENOUGH_SAMPLES: Final = 10  # for a median that a gap does not move
PATIENCE_NS: Final = 10_000_000_000  # how long an engine may take to begin with what it was told
SCALE_KNOWN: Final = 0.05  # share of the distance that may be uncertain
_LEAST_AGE_S: Final = 0.05  # of a keyframe, for a covariance that is not singular
_LEAST_VELOCITY_S: Final = 0.2  # of a motion that tells how well the velocity is known


@dataclasses.dataclass(frozen=True, slots=True)
class _Keyframe:
    frame_id: uuid.UUID
    t_ns: int


class NativeFacade(StrategyBase):
    """A native engine as a strategy; a class for each engine gives the names.

    Raises:
        ImportError: if there is no engine.
    """

    module: str

    def __init__(self, context: StrategyContext) -> None:
        super().__init__(context)
        config, full = context.config, context.calibration
        divisor = shrink_factor(full.width, config.working_width_px)
        self._images = WorkingImages(divisor, clahe=config.clahe)
        self._calibration = scaled(full, divisor)
        self._engine = self._make_engine(self._calibration, config)
        self._heights = Heights(config.agl_sigma_m)
        self._period_ns = round(1e9 / full.imu_rate_hz) if full.imu_rate_hz else USUAL_PERIOD_NS
        self._forget(initialising=True)

    def add_height(self, t_ns: int, height_m: float, sigma_m: float) -> None:
        """Note a height of the body above the ground, from any thread."""
        self._heights.add(t_ns, height_m, sigma_m)

    def _make_engine(self, calibration: CameraCalibration, config: VioConfig) -> NativeEngine:
        """Return a new engine for working images of a calibration. Raises ImportError if there is none."""
        return load_engine(self.module, calibration, config)

    def _forget(self, *, initialising: bool) -> None:
        self._initialising = initialising  # whether a state would be the engine's own finding
        self._told_ns = None if initialising else self._t_ns  # when the engine was told a state
        self._rest = RestWatch(self._calibration, self.context.config)
        self._keyframe: _Keyframe | None = None
        self._covariance: Array | None = None  # the last sound one
        self._tells_covariance = False
        self._velocity_w = np.zeros(3)
        self._last_sample_ns: int | None = None
        self._leaves_scale_open = True

    def _warm_start(self, pose: WarmStartPose) -> None:
        self._engine.reset(pose)
        self._forget(initialising=False)

    def _start_over(self) -> None:
        self._engine.reset(None)
        self._forget(initialising=True)

    def _process(self, frame: NavCameraFrame, imu_window: ImuWindow, calibration: CameraCalibration) -> VioOutput:
        t_ns = imu_window.end_t_ns
        with self.stage("grey"):
            image = self._images.make(frame.pixels)
        self._start_at_rest(image, imu_window)
        self._add_imu(imu_window)
        height = self._heights.take(t_ns, 0.0, self._velocity_w) if self._has_height else None
        if height is not None:
            self._engine.add_height(t_ns, *height)
        with self.stage("engine"):
            status = self._engine.add_image(t_ns, image)
        if status is NativeStatus.INITIALISING and self.health.state is VioState.INIT:
            self._initialising = True
            return self._conclude(FrameFacts(0, 0.0, 0.0, has_model=False), None)
        if status not in (NativeStatus.TRACKING, NativeStatus.LOST):
            raise VioFatalError(f"{self.name}: the engine has no state any more ({status.value})")
        features, pose = self._engine.features(), self._engine.pose()
        this = _Keyframe(frame.frame_id, t_ns)
        keyframe = self._keyframe or this  # that the pose refers to
        self._keyframe = this if pose.is_keyframe else keyframe
        age_s = (t_ns - keyframe.t_ns) * 1e-9
        is_sound = self._take_covariance(imu_window, age_s, pose)
        output = self._output(frame, keyframe, pose, features)
        self._judge_scale(output)
        facts = self._facts(output, age_s, features, status, is_sound, self._imu_fault(imu_window))
        return self._conclude(facts, output)

    def _start_at_rest(self, image: Pixels, window: ImuWindow) -> None:
        """Tell an engine that needs motion its state as soon as the body has stood still."""
        if self._engine.starts_at_rest or self._keyframe is not None:
            return
        with self.stage("rest"):
            start = self._rest.see(image, window)
        if start is not None and (self._told_ns is None or window.end_t_ns - self._told_ns > PATIENCE_NS):
            self._engine.reset(start)
            self._told_ns, self._last_sample_ns = window.end_t_ns, None

    def _add_imu(self, window: ImuWindow) -> None:
        last_ns = self._last_sample_ns
        for sample in window.samples:
            if last_ns is None or sample.t_ns > last_ns:  # windows overlap at their ends
                self._engine.add_imu(sample.t_ns, sample.accel, sample.gyro)
                self._last_sample_ns = sample.t_ns

    @property
    def _has_height(self) -> bool:
        return self._engine.takes_height and self.context.config.agl_source is not AglSource.NONE

    def _imu_fault(self, window: ImuWindow) -> str | None:
        if window.start_t_ns == window.end_t_ns:  # there was no frame before
            return None
        if len(window.samples) >= ENOUGH_SAMPLES:
            self._period_ns = median_period_ns(window) or self._period_ns
        return window_fault(window, self._period_ns)

    def _take_covariance(self, window: ImuWindow, age_s: float, pose: NativePose) -> bool:
        """Keep the engine's covariance if it is sound, else let the last one grow; tell which."""
        covariance = self._engine.covariance()
        self._tells_covariance = covariance is not None
        if covariance is None:
            self._covariance = self._drifted(age_s, pose)
            return True
        told = np.array(covariance, dtype=np.float64)
        if told.shape != (6, 6):
            raise VioFatalError(f"{self.name}: covariance of shape {told.shape}")
        sound = sound_covariance(self.context.config.engine.covariance_scale * told)
        if sound is None and self._covariance is None:
            raise VioFatalError(f"{self.name}: covariance not sound")
        self._covariance = self._grown(window) if sound is None else sound
        return sound is not None

    def _drifted(self, age_s: float, pose: NativePose) -> Array:
        """Return the covariance that the configuration states for an engine that states none."""
        drift, age_s = self.context.config.engine, max(age_s, _LEAST_AGE_S)
        distance_m = float(np.linalg.norm(pose.keyframe_T_body[:3, 3]))
        position = drift.drift_m**2 * age_s + (drift.drift_share * distance_m) ** 2
        return np.diag([drift.drift_rad**2 * age_s] * 3 + [position] * 3)

    def _grown(self, window: ImuWindow) -> Array:
        assert self._covariance is not None
        noise, dt_s = self.context.config.imu_noise, (window.end_t_ns - window.start_t_ns) * 1e-9
        rotation, translation = noise.gyro**2 * dt_s, noise.accel**2 * dt_s**3 / 3
        grown: Array = self._covariance + np.diag([rotation] * 3 + [translation] * 3)
        return grown

    def _output(
        self, frame: NavCameraFrame, keyframe: _Keyframe, pose: NativePose, features: NativeFeatures
    ) -> VioOutput:
        assert self._covariance is not None
        bias = self._engine.bias()
        world_T_body = SE3.from_matrix(pose.world_T_body)
        updates = {update.t_ns: update.world_T_keyframe for update in self._engine.keyframe_updates()}
        refined = updates.get(keyframe.t_ns)
        self._velocity_w = read_only(pose.velocity_world, (3,), "velocity_world")
        return VioOutput(
            frame_id=frame.frame_id,
            relative_pose_T=SE3.from_matrix(pose.keyframe_T_body),
            pose_covariance_6x6=self._covariance,
            imu_bias=ImuBias(bias.accel, bias.gyro),
            feature_quality=_quality(features),
            keyframe_id=keyframe.frame_id,
            is_keyframe=bool(pose.is_keyframe),
            velocity_b=world_T_body.R.T.dot(self._velocity_w),
            world_T_body=world_T_body,
            world_T_keyframe=None if refined is None else SE3.from_matrix(refined),
        )

    def _judge_scale(self, output: VioOutput) -> None:
        """Learn, where a keyframe ends, whether the engine knows how far it was from the one before."""
        way = output.relative_pose_T.R.T.dot(output.relative_pose_T.t)
        distance2 = float(way.dot(way))
        if self._tells_covariance and output.is_keyframe and distance2 > 0:
            along = way.dot(output.pose_covariance_6x6[3:, 3:]).dot(way)
            self._leaves_scale_open = not along <= (SCALE_KNOWN * distance2) ** 2

    def _facts(
        self,
        output: VioOutput,
        age_s: float,
        features: NativeFeatures,
        status: NativeStatus,
        is_sound: bool,
        imu_fault: str | None,
    ) -> FrameFacts:
        tracks = status is NativeStatus.TRACKING
        moved = output.pose_covariance_6x6[3:, 3:]
        growth = Growth(float(moved.trace()), age_s) if self._tells_covariance and age_s > 0 else None
        scale_is_open = self.context.config.scene is Scene.PLANAR and not self._has_height and self._leaves_scale_open
        sigma_m = sigma_of(moved)  # what comes before the keyframe is not known here
        return FrameFacts(
            inliers=features.inliers,
            coverage=features.coverage,
            mre_px=features.mre_px,
            growth=growth,
            innovation_ratio=features.innovation_ratio,
            bias_norm=output.imu_bias.norm(),
            imu_fault=imu_fault,
            has_model=tracks,
            is_finite=is_sound,
            position_sigma_m=sigma_m,
            velocity_sigma_m_s=sigma_m / max(age_s, _LEAST_VELOCITY_S),
            scale_unobserved=scale_is_open,
            initialised=tracks and self._initialising,
        )


def _quality(features: NativeFeatures) -> FeatureQuality:
    return FeatureQuality(**{field.name: getattr(features, field.name) for field in dataclasses.fields(FeatureQuality)})
