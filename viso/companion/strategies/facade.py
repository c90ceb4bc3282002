# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A strategy around a native engine: its records, its health and its failures in the terms of this project."""

import dataclasses
import uuid
from typing import Final

import numpy as np

from viso.companion.strategies.native import NativeFeatures, NativeStatus, load_engine
from viso.companion.vio.covariance import sound_covariance
from viso.companion.vio.errors import VioFatalError
from viso.companion.vio.health import FrameFacts
from viso.companion.vio.imu_window import median_period_ns, window_fault
from viso.companion.vio.se3 import SE3, Array, read_only
from viso.companion.vio.strategy import StrategyBase, StrategyContext
from viso.companion.vio.types import (
    CameraCalibration,
    FeatureQuality,
    ImuBias,
    ImuWindow,
    NavCameraFrame,
    VioOutput,
    VioState,
    WarmStartPose,
)

USUAL_PERIOD_NS: Final = 5_000_000
ENOUGH_SAMPLES: Final = 10  # for a median that a gap does not move


class NativeFacade(StrategyBase):
    """A native engine as a strategy; a class for each engine gives the names.

    Args:
        context: what it is built from.

    Attributes:
        module: the name of the native module.

    Raises:
        ImportError: if there is no engine.
    """

    module: str

    def __init__(self, context: StrategyContext) -> None:
        super().__init__(context)
        self._engine = load_engine(self.module, context.calibration, context.config)
        self._period_ns = USUAL_PERIOD_NS
        self._forget(initialising=True)

    def _forget(self, *, initialising: bool) -> None:
        self._initialising = initialising  # whether a state would be the engine's own finding
        self._keyframe_id: uuid.UUID | None = None
        self._covariance: Array | None = None  # the last sound one
        self._last_sample_ns: int | None = None

    def _warm_start(self, pose: WarmStartPose) -> None:
        self._engine.reset(pose)
        self._forget(initialising=False)

    def _start_over(self) -> None:
        self._engine.reset(None)
        self._forget(initialising=True)

    def _process(self, frame: NavCameraFrame, imu_window: ImuWindow, calibration: CameraCalibration) -> VioOutput:
        self._add_imu(imu_window)
        with self.stage("engine"):
            status = self._engine.add_image(imu_window.end_t_ns, frame.pixels)
        if status is NativeStatus.INITIALISING and self.health.state is VioState.INIT:
            self._initialising = True
            return self._conclude(FrameFacts(0, 0.0, 0.0, has_model=False), None)
        if status not in (NativeStatus.TRACKING, NativeStatus.LOST):
            raise VioFatalError(f"{self.name}: the engine has no state any more ({status.value})")
        features = self._engine.features()
        is_sound = self._take_covariance(imu_window)
        output = self._output(frame, features)
        facts = self._facts(output, features, status, is_sound, self._imu_fault(imu_window))
        return self._conclude(facts, output)

    def _add_imu(self, window: ImuWindow) -> None:
        last_ns = self._last_sample_ns
        for sample in window.samples:
            if last_ns is None or sample.t_ns > last_ns:  # windows overlap at their ends
                self._engine.add_imu(sample.t_ns, sample.accel, sample.gyro)
                self._last_sample_ns = sample.t_ns

    def _imu_fault(self, window: ImuWindow) -> str | None:
        if window.start_t_ns == window.end_t_ns:  # there was no frame before
            return None
        if len(window.samples) >= ENOUGH_SAMPLES:
            self._period_ns = median_period_ns(window) or self._period_ns
        return window_fault(window, self._period_ns)

    def _take_covariance(self, window: ImuWindow) -> bool:
        """Keep the engine's covariance if it is sound, else let the last one grow; tell which."""
        told = np.array(self._engine.covariance(), dtype=np.float64)
        if told.shape != (6, 6):
            raise VioFatalError(f"{self.name}: covariance of shape {told.shape}")
        sound = sound_covariance(told)
        if sound is None and self._covariance is None:
            raise VioFatalError(f"{self.name}: covariance not sound")
        self._covariance = self._grown(window) if sound is None else sound
        return sound is not None

    def _grown(self, window: ImuWindow) -> Array:
        assert self._covariance is not None
        noise, dt_s = self.context.config.imu_noise, (window.end_t_ns - window.start_t_ns) * 1e-9
        rotation, translation = noise.gyro**2 * dt_s, noise.accel**2 * dt_s**3 / 3
        grown: Array = self._covariance + np.diag([rotation] * 3 + [translation] * 3)
        return grown

    def _output(self, frame: NavCameraFrame, features: NativeFeatures) -> VioOutput:
        assert self._covariance is not None
        pose, bias = self._engine.pose(), self._engine.bias()
        world_T_body = SE3.from_matrix(pose.world_T_body)
        keyframe_id = self._keyframe_id or frame.frame_id
        if pose.is_keyframe or self._keyframe_id is None:
            self._keyframe_id = frame.frame_id
        return VioOutput(
            frame_id=frame.frame_id,
            relative_pose_T=SE3.from_matrix(pose.keyframe_T_body),
            pose_covariance_6x6=self._covariance,
            imu_bias=ImuBias(bias.accel, bias.gyro),
            feature_quality=_quality(features),
            keyframe_id=keyframe_id,
            is_keyframe=bool(pose.is_keyframe),
            velocity_b=world_T_body.R.T.dot(read_only(pose.velocity_world, (3,), "velocity_world")),
            world_T_body=world_T_body,
        )

    def _facts(
        self,
        output: VioOutput,
        features: NativeFeatures,
        status: NativeStatus,
        is_sound: bool,
        imu_fault: str | None,
    ) -> FrameFacts:
        tracks = status is NativeStatus.TRACKING
        return FrameFacts(
            inliers=features.inliers,
            coverage=features.coverage,
            mre_px=features.mre_px,
            covariance_trace=float(output.pose_covariance_6x6.trace()),
            innovation_ratio=features.innovation_ratio,
            bias_norm=output.imu_bias.norm(),
            imu_fault=imu_fault,
            has_model=tracks,
            is_finite=is_sound,
            initialised=tracks and self._initialising,
        )


def _quality(features: NativeFeatures) -> FeatureQuality:
    return FeatureQuality(**{field.name: getattr(features, field.name) for field in dataclasses.fields(FeatureQuality)})
