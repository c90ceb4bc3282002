# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A strategy that runs an engine as a separate program. Needs the extra vio.

A program that exits, hangs or sends impossible data does not end the strategy: it goes to INIT, restarts the program
with a later frame, and continues from the last good state, propagated by the IMU. After some failures in a
row without a pose the strategy is LOST, as any other.
"""

import logging
import uuid
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from viso.companion.engine.child import EXIT_S, EngineFailure
from viso.companion.engine.protocol import Capability, Estimate, KeyframeUpdate, Status
from viso.companion.engine.session import EngineSession, stated_covariance
from viso.companion.klt.front_end import WorkingImages, shrink_factor
from viso.companion.msckf.heights import Heights
from viso.companion.msckf.stillness import RestWatch
from viso.companion.msckf.window_filter import sigma_of
from viso.companion.vio.calibration import scaled
from viso.companion.vio.config import AglSource, ImuNoise, Scene
from viso.companion.vio.errors import VioFatalError
from viso.companion.vio.frames import GRAVITY_MSS
from viso.companion.vio.health import FrameFacts, Growth
from viso.companion.vio.imu import IMU_EMPTY, median_period_ns, steps_of, window_fault
from viso.companion.vio.log import log_event
from viso.companion.vio.pipeline import StrategyBase, StrategyContext
from viso.companion.vio.preintegration import preintegrate
from viso.companion.vio.result import Result
from viso.companion.vio.types import (
    FeatureQuality,
    ImuBias,
    ImuWindow,
    NavCameraFrame,
    Pixels,
    VioOutput,
    VioState,
    WarmStartPose,
)
from viso.geometry.pose import SE3, sound_covariance
from viso.geometry.rotation import Array

BACKOFF_S: Final = (0.0, 0.5, 1.0, 2.0, 4.0)
"""From a failure to the next start, for the first failure in a row, the second and so on, in time of the frames."""
MOST_FAILURES: Final = len(BACKOFF_S)
LONGEST_COAST_S: Final = 3.0
"""The longest propagation by the IMU alone of a state that an engine is started from."""
USUAL_PERIOD_NS: Final = 5_000_000
ENOUGH_SAMPLES: Final = 10  # for a median that a gap does not move
PATIENCE_NS: Final = 10_000_000_000  # how long an engine may take to begin with the state that it got
SCALE_KNOWN: Final = 0.05  # share of the distance that may be uncertain
_LEAST_AGE_S: Final = 0.05  # of a keyframe, for a covariance that is not singular
_LEAST_VELOCITY_S: Final = 0.2  # of a motion that shows how well the velocity is known
_GRAVITY: Final = np.array([0.0, 0.0, -GRAVITY_MSS])


@dataclass(frozen=True, slots=True)
class _Keyframe:
    frame_id: uuid.UUID
    t_ns: int


@dataclass(frozen=True, slots=True, eq=False)
class _Good:
    """The last good state, its time, and the inertial data since."""

    state: WarmStartPose
    t_ns: int
    windows: list[ImuWindow]

    def carried_on(self, noise: ImuNoise) -> WarmStartPose | None:
        """Return the state at the end of the inertial data; None where these lack."""
        if any(window_fault(window, USUAL_PERIOD_NS) == IMU_EMPTY for window in self.windows):
            return None
        pose, bias = self.state.body_T_world.inverse(), self.state.bias
        R, p, v = pose.R, pose.t, pose.R.dot(self.state.velocity_b)
        for window in self.windows:
            delta = preintegrate(steps_of(window), noise, bias)
            p = p + v * delta.dt_s + 0.5 * _GRAVITY * delta.dt_s**2 + R.dot(delta.dp)
            v = v + _GRAVITY * delta.dt_s + R.dot(delta.dv)
            R = R.dot(delta.dR)
        return WarmStartPose(SE3(R, p).inverse(), R.T.dot(v), bias)


class EngineStrategy(StrategyBase):
    """An engine's program as a strategy; ``vio.engine.command`` starts it.

    Attributes:
        session: with the program; None while it is down.

    Raises:
        ImportError: if there is no command, or the program does not start.
    """

    def __init__(self, context: StrategyContext) -> None:
        config, full = context.config, context.calibration
        self.name = config.strategy
        super().__init__(context)
        divisor = shrink_factor(full.width, config.working_width_px)
        self._images = WorkingImages(divisor, clahe=config.clahe)
        self._calibration = scaled(full, divisor)
        self._heights = Heights(config.agl_sigma_m)
        self._period_ns = round(1e9 / full.imu_rate_hz) if full.imu_rate_hz else USUAL_PERIOD_NS
        self._counters = Counter[str](restarts=0, late_answers=0, lines_dropped=0)
        self._last_image_ns: int | None = None
        self._good: _Good | None = None
        self._failures, self._retry_ns = 0, 0
        self.session: EngineSession | None = None
        if not config.engine.command:
            raise ImportError("vio.engine.command, or --engine, has to name its program")
        try:
            self.session = self._started()
        except EngineFailure as error:
            raise ImportError(f"{config.engine.command}: {error}") from error
        self._forget(initialising=True)

    def add_height(self, t_ns: int, height_m: float, sigma_m: float) -> None:
        """Note a height of the body above the ground, from any thread."""
        self._heights.add(t_ns, height_m, sigma_m)

    def close(self) -> None:
        """End the program."""
        self._stop()

    def counters(self) -> Mapping[str, int]:
        """Return restarts, answers that took longer than from image to image, and failures by their kinds."""
        dropped = 0 if self.session is None else self.session.dropped_lines
        return {**self._counters, "lines_dropped": self._counters["lines_dropped"] + dropped}

    def _process(self, frame: NavCameraFrame, imu_window: ImuWindow) -> Result:
        try:
            self._note(imu_window)
            if self.session is None and imu_window.end_t_ns < self._retry_ns:
                return self._initializing("engine: waiting before it is started again")
            result = self._follow(self.session or self._restarted(), frame, imu_window)
        except EngineFailure as error:
            return self._give_up(error, imu_window.end_t_ns)
        if result.output is not None:
            self._failures, output = 0, result.output
            state = WarmStartPose(output.world_T_body.inverse(), output.velocity_b, output.imu_bias)
            self._good = _Good(state, imu_window.end_t_ns, [])
        return result

    def _reset(self, start: WarmStartPose | None) -> None:
        self._good, self._failures, self._retry_ns = None, 0, 0
        if self.session is None:
            self._counters["restarts"] += 1
            try:
                self.session = self._started()
            except EngineFailure as error:
                raise VioFatalError(f"engine: {error}") from error
        self._begin(self.session, start)

    def _started(self) -> EngineSession:
        """Return a session with a new program."""
        config = self.context.config
        session = EngineSession(config.engine.command, self._calibration, config, self._on_line)
        fields = {
            "pid": session.pid,
            "name": session.name,
            "capabilities": [capability.name for capability in Capability if capability & session.capabilities],
            "shared_memory": session.shares,
        }
        msg = f"{session.name}: started"
        log_event(self.context.logger, logging.INFO, "engine_started", msg, fields, strategy=self.name)
        if 0 < self._calibration.imu_rate_hz < session.imu_rate_hz:
            self._on_line(logging.WARNING, f"wants an IMU of {session.imu_rate_hz:g} Hz or more")
        return session

    def _on_line(self, level: int | None, text: str) -> None:
        event = "engine_stderr" if level is None else "engine_log"
        level = logging.INFO if level not in (logging.DEBUG, logging.WARNING, logging.ERROR) else level
        log_event(self.context.logger, level, event, text, strategy=self.name)

    def _stop(self, grace_s: float = EXIT_S) -> None:
        if self.session is not None:
            self._counters["lines_dropped"] += self.session.dropped_lines
            self.session.close(grace_s=grace_s)
            self.session = None

    def _begin(self, session: EngineSession, start: WarmStartPose | None) -> None:
        session.reset(start)
        self._forget(initialising=start is None)

    def _forget(self, *, initialising: bool) -> None:
        self._initialising = initialising  # whether the engine has to find a state by itself
        self._given_ns = None if initialising else self._t_ns  # when the engine got a state
        self._rest = RestWatch(self._calibration, self.context.config)
        self._keyframe: _Keyframe | None = None
        self._covariance: Array | None = None  # the last sound one
        self._has_covariance = False
        self._velocity_w = np.zeros(3)
        self._last_sample_ns: int | None = None
        self._leaves_scale_open = True

    # A program that fails

    def _note(self, window: ImuWindow) -> None:
        """Store inertial data for as long as they may be needed."""
        if self._good is not None:
            self._good.windows.append(window)
            if window.end_t_ns - self._good.t_ns > LONGEST_COAST_S * 1e9:
                self._good = None

    def _restarted(self) -> EngineSession:
        """Restart the program from the known state."""
        self._counters["restarts"] += 1
        session = self.session = self._started()
        start = None if self._good is None else self._good.carried_on(self.context.config.imu_noise)
        if start is None:
            self.health.start_over()
        self._begin(session, start)
        return session

    def _give_up(self, error: EngineFailure, t_ns: int) -> Result:
        """End a program that has failed, and set the time of the next start."""
        self._stop(grace_s=0)
        self._counters[error.kind] += 1
        self._failures += 1
        fields = {"kind": error.kind, "in_a_row": self._failures, "counters": self.counters()}
        log_event(self.context.logger, logging.WARNING, "engine_failed", str(error), fields, strategy=self.name)
        if self._failures > MOST_FAILURES:
            raise VioFatalError(f"engine failed {self._failures} times in a row: {error}") from error
        self._retry_ns = t_ns + round(BACKOFF_S[self._failures - 1] * 1e9)
        self.health.warm_start()
        return self._initializing(f"engine: {error}")

    # A frame

    def _follow(self, session: EngineSession, frame: NavCameraFrame, window: ImuWindow) -> Result:
        """Send a frame to the program; return the result of its answer."""
        t_ns = window.end_t_ns
        with self.stage("grey"):
            image = self._images.make(frame.pixels)
        if not session.capabilities & Capability.STARTS_AT_REST and self._keyframe is None:
            self._start_at_rest(session, image, window)
        for sample in window.samples:
            if self._last_sample_ns is None or sample.t_ns > self._last_sample_ns:  # windows overlap at their ends
                session.add_imu(sample.t_ns, sample.accel, sample.gyro)
                self._last_sample_ns = sample.t_ns
        config = self.context.config
        has_height = bool(session.capabilities & Capability.TAKES_HEIGHT) and config.agl_source is not AglSource.NONE
        if has_height and (height := self._heights.take(t_ns, 0.0, self._velocity_w)) is not None:
            session.add_height(t_ns, *height)
        with self.stage("engine"):
            updates, estimate = self._answer(session, t_ns, image)
        status = Status(estimate.status)
        if status is Status.INITIALISING and self.health.state is VioState.INIT:
            self._initialising = True
            return self._conclude(FrameFacts(0, 0.0, 0.0, has_model=False), None)
        if status not in (Status.TRACKING, Status.LOST):
            raise VioFatalError(f"{self.name}: the engine has no state any more ({status.name})")
        this = _Keyframe(frame.frame_id, t_ns)
        keyframe = self._keyframe or this  # that the pose refers to
        self._keyframe = this if estimate.is_keyframe else keyframe
        age_s = (t_ns - keyframe.t_ns) * 1e-9
        is_sound = self._take_covariance(window, age_s, estimate)
        refined = {session.keyframes_ns.get(update.keyframe_id): update.world_T_keyframe for update in updates}
        output = self._output(frame, keyframe, estimate, refined.get(keyframe.t_ns))
        self._judge_scale(output)
        moved, tracks = output.pose_covariance_6x6[3:, 3:], status is Status.TRACKING
        sigma_m = sigma_of(moved)  # what comes before the keyframe is not known here
        facts = FrameFacts(
            inliers=estimate.inliers,
            coverage=estimate.coverage,
            mre_px=estimate.mre_px,
            growth=Growth(float(moved.trace()), age_s) if self._has_covariance and age_s > 0 else None,
            innovation_ratio=estimate.innovation_ratio,
            bias_norm=output.imu_bias.norm(),
            imu_fault=self._imu_fault(window),
            has_model=tracks,
            is_finite=is_sound,
            position_sigma_m=sigma_m,
            velocity_sigma_m_s=sigma_m / max(age_s, _LEAST_VELOCITY_S),
            scale_unobserved=config.scene is Scene.PLANAR and not has_height and self._leaves_scale_open,
            initialised=tracks and self._initialising,
        )
        return self._conclude(facts, output)

    def _start_at_rest(self, session: EngineSession, image: Pixels, window: ImuWindow) -> None:
        """Send the state at rest to an engine that needs motion, once the body has stood still."""
        with self.stage("rest"):
            start = self._rest.update(image, window)
        if start is not None and (self._given_ns is None or window.end_t_ns - self._given_ns > PATIENCE_NS):
            session.reset(start)
            self._given_ns, self._last_sample_ns = window.end_t_ns, None

    def _answer(self, session: EngineSession, t_ns: int, image: Pixels) -> tuple[list[KeyframeUpdate], Estimate]:
        begin_ns = self.context.clock_ns()
        answer = session.add_image(t_ns, image)
        took_ns = self.context.clock_ns() - begin_ns
        if self._last_image_ns is not None and took_ns > t_ns - self._last_image_ns:
            self._counters["late_answers"] += 1  # it does not keep up
        self._last_image_ns = t_ns
        return answer

    def _imu_fault(self, window: ImuWindow) -> str | None:
        if window.start_t_ns == window.end_t_ns:  # there was no frame before
            return None
        if len(window.samples) >= ENOUGH_SAMPLES:
            self._period_ns = median_period_ns(window) or self._period_ns
        return window_fault(window, self._period_ns)

    def _take_covariance(self, window: ImuWindow, age_s: float, estimate: Estimate) -> bool:
        """Use the engine's covariance if it is sound, else grow the last one; return whether it was sound."""
        covariance = stated_covariance(estimate)
        self._has_covariance = covariance is not None
        if covariance is None:
            self._covariance = self._drifted(age_s, estimate)
            return True
        sound = sound_covariance(self.context.config.engine.covariance_scale * covariance)
        if sound is None and self._covariance is None:
            raise VioFatalError(f"{self.name}: covariance not sound")
        self._covariance = self._grown(window) if sound is None else sound
        return sound is not None

    def _drifted(self, age_s: float, estimate: Estimate) -> Array:
        """Return the covariance that the configuration states for an engine that states none."""
        drift, age_s = self.context.config.engine, max(age_s, _LEAST_AGE_S)
        distance_m = float(np.linalg.norm(estimate.keyframe_T_body.reshape(4, 4)[:3, 3]))
        position = drift.drift_m**2 * age_s + (drift.drift_share * distance_m) ** 2
        return np.diag([drift.drift_rad**2 * age_s] * 3 + [position] * 3)

    def _grown(self, window: ImuWindow) -> Array:
        assert self._covariance is not None
        noise, dt_s = self.context.config.imu_noise, (window.end_t_ns - window.start_t_ns) * 1e-9
        rotation, translation = noise.gyro**2 * dt_s, noise.accel**2 * dt_s**3 / 3
        grown: Array = self._covariance + np.diag([rotation] * 3 + [translation] * 3)
        return grown

    def _output(
        self, frame: NavCameraFrame, keyframe: _Keyframe, estimate: Estimate, refined: Array | None
    ) -> VioOutput:
        assert self._covariance is not None
        world_T_body = SE3.from_matrix(estimate.world_T_body.reshape(4, 4))
        self._velocity_w = estimate.velocity_world
        quality = FeatureQuality(
            estimate.tracked,
            estimate.lost,
            estimate.fresh,
            estimate.inliers,
            estimate.mean_parallax_px,
            estimate.mre_px,
            estimate.coverage,
        )
        return VioOutput(
            frame_id=frame.frame_id,
            relative_pose_T=SE3.from_matrix(estimate.keyframe_T_body.reshape(4, 4)),
            pose_covariance_6x6=self._covariance,
            imu_bias=ImuBias(estimate.accel_bias, estimate.gyro_bias),
            feature_quality=quality,
            keyframe_id=keyframe.frame_id,
            is_keyframe=bool(estimate.is_keyframe),
            velocity_b=world_T_body.R.T.dot(self._velocity_w),
            world_T_body=world_T_body,
            world_T_keyframe=None if refined is None else SE3.from_matrix(refined.reshape(4, 4)),
        )

    def _judge_scale(self, output: VioOutput) -> None:
        """Judge, at the end of a keyframe, whether the engine has observed its distance from the previous one."""
        moved = output.relative_pose_T.R.T.dot(output.relative_pose_T.t)
        distance2 = float(moved.dot(moved))
        if self._has_covariance and output.is_keyframe and distance2 > 0:
            along = moved.dot(output.pose_covariance_6x6[3:, 3:]).dot(moved)
            self._leaves_scale_open = not along <= (SCALE_KNOWN * distance2) ** 2
