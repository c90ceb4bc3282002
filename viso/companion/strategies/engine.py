# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""An engine as a strategy: a program of its own, or a module of Python.

A program that ends, hangs or says what cannot be takes nothing with it: the strategy is in INIT, the program is started
again with a later frame, and goes on from the last good state, carried on by the IMU. After some failures in a row
without a pose the strategy is LOST, as any other.
"""

import dataclasses
import logging
from collections import Counter
from dataclasses import dataclass
from typing import Final

import numpy as np

from viso.companion.engine.child import EXIT_S, EngineFailure
from viso.companion.engine.protocol import Capability, CovarianceKind, Estimate, KeyframeUpdate, Status
from viso.companion.engine.session import EngineSession, relative_covariance
from viso.companion.strategies.facade import USUAL_PERIOD_NS, NativeFacade
from viso.companion.strategies.native import (
    NativeBias,
    NativeEngine,
    NativeFeatures,
    NativeKeyframeUpdate,
    NativePose,
    NativeStatus,
)
from viso.companion.vio.config import ImuNoise, VioConfig
from viso.companion.vio.errors import VioDegradedError, VioFatalError, VioInitializingError
from viso.companion.vio.frames import GRAVITY_MSS
from viso.companion.vio.imu_window import IMU_EMPTY, steps_of, window_fault
from viso.companion.vio.json_log import log_event
from viso.companion.vio.preintegration import preintegrate
from viso.companion.vio.strategy import FrameReport, StrategyContext
from viso.companion.vio.types import (
    CameraCalibration,
    ImuWindow,
    NavCameraFrame,
    Pixels,
    VioOutput,
    WarmStartPose,
)
from viso.geometry.se3 import SE3, Array

BACKOFF_S: Final = (0.0, 0.5, 1.0, 2.0, 4.0)
"""From a failure to the next start, for the first failure in a row, the second and so on, in time of the frames."""
MOST_FAILURES: Final = len(BACKOFF_S)
LONGEST_COAST_S: Final = 3.0
"""How long the IMU alone carries a state on that an engine is started from."""
_GRAVITY: Final = np.array([0.0, 0.0, -GRAVITY_MSS])


class ProgramEngine:
    """A program as a native engine.

    Attributes:
        counters: of restarts, answers that took longer than from image to image, and failures by their kinds.
        session: with the program; None while it is down.

    Raises:
        EngineFailure: if it does not start; so does each method that speaks with it.
    """

    def __init__(self, context: StrategyContext, name: str, calibration: CameraCalibration) -> None:
        self._context, self._name, self._calibration = context, name, calibration
        self.counters = Counter[str](restarts=0, late_answers=0, lines_dropped=0)
        self._last_image_ns: int | None = None
        self.session: EngineSession | None = None
        self.start()

    def start(self) -> None:
        """Start the program."""
        config = self._context.config
        self.session = session = EngineSession(config.engine.command, self._calibration, config, self._on_line)
        self._hello = session.hello
        self._estimate: Estimate  # of the last image
        self._updates: list[KeyframeUpdate] = []
        fields = {
            "pid": session.child.pid,
            "name": session.name,
            "capabilities": [one.name for one in Capability if one & session.hello.capabilities],
            "shared_memory": session.shares,
        }
        log_event(
            self._context.logger,
            logging.INFO,
            "engine_started",
            f"{session.name}: started",
            fields,
            strategy=self._name,
        )

        if 0 < self._calibration.imu_rate_hz < session.hello.imu_rate_hz:
            self._on_line(logging.WARNING, f"wants an IMU of {session.hello.imu_rate_hz:g} Hz or more")

    def _on_line(self, level: int | None, text: str) -> None:
        event = "engine_stderr" if level is None else "engine_log"
        level = logging.INFO if level not in (logging.DEBUG, logging.WARNING, logging.ERROR) else level
        log_event(self._context.logger, level, event, text, strategy=self._name)

    def stop(self, *, grace_s: float = EXIT_S) -> None:
        """End the program."""
        if self.session is not None:
            self.counters["lines_dropped"] += self.session.child.dropped_lines
            self.session.close(grace_s=grace_s)
            self.session = None

    def counts(self) -> dict[str, int]:
        """Return the counters as they are now."""
        dropped = 0 if self.session is None else self.session.child.dropped_lines
        return {**self.counters, "lines_dropped": self.counters["lines_dropped"] + dropped}

    @property
    def starts_at_rest(self) -> bool:
        """Whether it finds its state while the body stands still."""
        return bool(self._hello.capabilities & Capability.STARTS_AT_REST)

    @property
    def takes_height(self) -> bool:
        """Whether it makes use of heights."""
        return bool(self._hello.capabilities & Capability.TAKES_HEIGHT)

    def _running(self) -> EngineSession:
        if self.session is None:
            raise EngineFailure("exits", "not running")
        return self.session

    def add_imu(self, t_ns: int, accel: Array, gyro: Array) -> None:
        """Take a sample."""
        self._running().add_imu(t_ns, accel, gyro)

    def add_height(self, t_ns: int, height_m: float, sigma_m: float) -> None:
        """Take a height, from any thread."""
        if (session := self.session) is not None and self.takes_height:
            session.add_height(t_ns, height_m, sigma_m)

    def add_image(self, t_ns: int, pixels: Pixels) -> NativeStatus:
        """Work on an image."""
        begin_ns = self._context.clock_ns()
        self._updates, self._estimate = self._running().add_image(t_ns, pixels)
        took_ns = self._context.clock_ns() - begin_ns
        if self._last_image_ns is not None and took_ns > t_ns - self._last_image_ns:
            self.counters["late_answers"] += 1  # it does not keep up
        self._last_image_ns = t_ns
        return NativeStatus[Status(self._estimate.status).name]

    def pose(self) -> NativePose:
        """Return where the body was."""
        told = self._estimate
        return NativePose(
            told.world_T_body.reshape(4, 4),
            told.keyframe_T_body.reshape(4, 4),
            told.velocity_world,
            bool(told.is_keyframe),
        )

    def covariance(self) -> Array | None:
        """Return the covariance of the pose relative to the keyframe; None if it tells none."""
        told = self._estimate
        if told.covariance_kind == CovarianceKind.NONE:
            return None
        if told.covariance_kind == CovarianceKind.RELATIVE:
            return told.covariance[:36].reshape(6, 6)
        relative = SE3.from_matrix(told.keyframe_T_body.reshape(4, 4))
        keyframe_R = told.world_T_body.reshape(4, 4)[:3, :3] @ relative.R.T
        return relative_covariance(told.covariance.reshape(12, 12), relative, keyframe_R)

    def keyframe_updates(self) -> list[NativeKeyframeUpdate]:
        """Return the keyframes of the last session whose poses have changed with the last image."""
        return [
            NativeKeyframeUpdate(t_ns, update.world_T_keyframe.reshape(4, 4))
            for update in self._updates
            if (t_ns := self._running().keyframes_ns.get(update.keyframe_id)) is not None
        ]

    def bias(self) -> NativeBias:
        """Return the IMU's bias."""
        return NativeBias(self._estimate.accel_bias, self._estimate.gyro_bias)

    def features(self) -> NativeFeatures:
        """Return what the front end made of the image."""
        told = self._estimate
        return NativeFeatures(
            told.tracked,
            told.lost,
            told.fresh,
            told.inliers,
            told.mean_parallax_px,
            told.mre_px,
            told.coverage,
            told.innovation_ratio,
        )

    def reset(self, start: WarmStartPose | None) -> None:
        """Let it forget all."""
        self._running().reset(start)


@dataclass(frozen=True, slots=True, eq=False)
class _Good:
    """The last good state, when that was, and the inertial data since."""

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


class EngineStrategy(NativeFacade):
    """An engine as a strategy; ``vio.engine.command`` is its program, or there is a module of Python.

    Raises:
        ImportError: if there is no engine.
    """

    name = "engine"
    module = ""

    def __init__(self, context: StrategyContext) -> None:
        self._program: ProgramEngine | None = None
        self._good: _Good | None = None
        self._failures, self._retry_ns = 0, 0
        super().__init__(context)

    def _make_engine(self, calibration: CameraCalibration, config: VioConfig) -> NativeEngine:
        if not config.engine.command:
            if not self.module:
                raise ImportError("vio.engine.command, or --engine, has to name its program")
            return super()._make_engine(calibration, config)
        try:
            self._program = ProgramEngine(self.context, self.name, calibration)
        except EngineFailure as error:
            raise ImportError(f"{config.engine.command}: {error}") from error
        return self._program

    def close(self) -> None:
        """End the program, if there is one."""
        if self._program is not None:
            self._program.stop()

    def frame_report(self) -> FrameReport:
        """Return what there is to say about the last frame."""
        report = super().frame_report()
        return report if self._program is None else dataclasses.replace(report, counters=self._program.counts())

    def _process(self, frame: NavCameraFrame, imu_window: ImuWindow, calibration: CameraCalibration) -> VioOutput:
        if self._program is None:
            return super()._process(frame, imu_window, calibration)
        try:
            self._note(imu_window)
            if self._program.session is None:
                self._restart(imu_window)
            return self._kept(super()._process(frame, imu_window, calibration), imu_window)
        except VioDegradedError as error:
            self._kept(error.output, imu_window)
            raise
        except EngineFailure as error:
            self._fail(error, imu_window.end_t_ns)
            raise VioInitializingError(f"engine: {error}") from error

    def _note(self, window: ImuWindow) -> None:
        """Note inertial data, as long as they may be of use."""
        if self._good is not None:
            self._good.windows.append(window)
            if window.end_t_ns - self._good.t_ns > LONGEST_COAST_S * 1e9:
                self._good = None

    def _kept(self, output: VioOutput, window: ImuWindow) -> VioOutput:
        """Note a good state."""
        self._failures = 0
        state = WarmStartPose(output.world_T_body.inverse(), output.velocity_b, output.imu_bias)
        self._good = _Good(state, window.end_t_ns, [])
        return output

    def _fail(self, error: EngineFailure, t_ns: int) -> None:
        program = self._program
        assert program is not None
        program.stop(grace_s=0)
        program.counters[error.kind] += 1
        self._failures += 1
        fields = {"kind": error.kind, "in_a_row": self._failures, "counters": program.counts()}
        log_event(self.context.logger, logging.WARNING, "engine_failed", str(error), fields, strategy=self.name)
        if self._failures > MOST_FAILURES:
            raise VioFatalError(f"engine failed {self._failures} times in a row: {error}") from error
        self._retry_ns = t_ns + round(BACKOFF_S[self._failures - 1] * 1e9)
        self.health.warm_start()

    def _restart(self, window: ImuWindow) -> None:
        """Start the program again if that is due, from what is known of the state."""
        assert self._program is not None
        if window.end_t_ns < self._retry_ns:
            raise VioInitializingError("engine: waiting before it is started again")
        self._program.counters["restarts"] += 1
        self._program.start()
        start = None if self._good is None else self._good.carried_on(self.context.config.imu_noise)
        if start is None:
            self.health.start_over()
            super()._start_over()
        else:
            super()._warm_start(start)

    def _warm_start(self, pose: WarmStartPose) -> None:
        self._revive()
        super()._warm_start(pose)

    def _start_over(self) -> None:
        self._revive()
        super()._start_over()

    def _revive(self) -> None:
        """Start the program if it is down, because somebody wants it to restart."""
        self._good, self._failures, self._retry_ns = None, 0, 0
        if self._program is not None and self._program.session is None:
            self._program.counters["restarts"] += 1
            try:
                self._program.start()
            except EngineFailure as error:
                raise VioFatalError(f"engine: {error}") from error


class Okvis2(EngineStrategy):
    """OKVIS2: the engine of a program, or of the module ``viso_okvis2_native``."""

    name = "okvis2"
    module = "viso_okvis2_native"


class VinsMono(EngineStrategy):
    """VINS-Mono: the engine of a program, or of the module ``viso_vins_mono_native``."""

    name = "vins_mono"
    module = "viso_vins_mono_native"
