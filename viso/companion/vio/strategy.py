# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The base of all strategies: one caller at a time, checks, health, log, and the result of each frame."""

import abc
import contextlib
import dataclasses
import logging
import threading
import uuid
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Final, TypeVar

from viso.companion.vio.config import VioConfig
from viso.companion.vio.errors import VioFatalError
from viso.companion.vio.health import FrameFacts, HealthMachine
from viso.companion.vio.json_log import log_event
from viso.companion.vio.result import Degraded, Initializing, Lost, Result, Tracking
from viso.companion.vio.types import (
    CameraCalibration,
    ImuBias,
    ImuWindow,
    NavCameraFrame,
    VioOutput,
    VioState,
    WarmStartPose,
)
from viso.geometry.se3 import SE3

_R = TypeVar("_R", bound=Result)

_DEGRADED_PERIOD_NS: Final = 1_000_000_000


@dataclass(frozen=True, slots=True)
class StrategyContext:
    """What a strategy is built from.

    Attributes:
        config: the configuration.
        calibration: of the camera.
        clock_ns: the companion's monotonic clock.
        logger: for events.
    """

    config: VioConfig
    calibration: CameraCalibration
    clock_ns: Callable[[], int]
    logger: logging.Logger


class StrategyLog:
    """Logs what happens to a strategy."""

    def __init__(self, strategy: str, logger: logging.Logger, clock_ns: Callable[[], int]) -> None:
        self._strategy = strategy
        self._logger = logger
        self._clock_ns = clock_ns
        self._degraded_ns: int | None = None  # when a degraded frame was logged last
        self._suppressed = 0  # since then

    def _event(
        self, level: int, event: str, msg: str, fields: Mapping[str, object], frame: uuid.UUID | None = None
    ) -> None:
        log_event(self._logger, level, event, msg, fields, strategy=self._strategy, frame=frame)

    def state_change(self, old: VioState, new: VioState, reason: str, consecutive_lost: int) -> None:
        """Log a change of state, and LOST as an error, too."""
        states = {"old": old.value, "new": new.value, "reason": reason}
        self._event(logging.INFO, "state_change", f"{old.value} -> {new.value}: {reason}", states)
        if new is VioState.LOST:
            msg = f"VIO LOST after {consecutive_lost} consecutive frames; strategy={self._strategy}"
            self._event(logging.ERROR, "vio_lost", msg, {"consecutive_lost": consecutive_lost, "reason": reason})

    def warm_start_applied(self, pose: WarmStartPose) -> None:
        """Log that a state was given."""
        position = pose.body_T_world.inverse().t
        fields = {"position_enu": position, "velocity_b": pose.velocity_b, "bias_norm": pose.bias.norm()}
        self._event(logging.INFO, "warm_start_applied", "warm start applied", fields)

    def degraded(self, output: VioOutput, reason: str) -> None:
        """Log a degraded frame, at most one a second."""
        now_ns = self._clock_ns()
        if self._degraded_ns is not None and now_ns < self._degraded_ns + _DEGRADED_PERIOD_NS:
            self._suppressed += 1
            return
        suppressed, self._suppressed, self._degraded_ns = self._suppressed, 0, now_ns
        quality = output.feature_quality
        fields = {
            "parallax": quality.mean_parallax_px,
            "mre": quality.mre_px,
            "bias_norm": output.imu_bias.norm(),
            "reason": reason,
            "suppressed": suppressed,
        }
        self._event(logging.WARNING, "vio_degraded", f"VIO degraded: {reason}", fields, output.frame_id)

    def fatal(self, reason: str, error: Exception) -> None:
        """Log what ended in LOST."""
        log_event(self._logger, logging.ERROR, "vio_fatal", reason, strategy=self._strategy, error=error)

    def frame(self, output: VioOutput, stage_ms: Mapping[str, float]) -> None:
        """Log a frame, for debugging."""
        if not self._logger.isEnabledFor(logging.DEBUG):
            return
        quality = output.feature_quality
        fields = {"tracked": quality.tracked, "new": quality.new, "keyframe": output.is_keyframe, "ms": dict(stage_ms)}
        self._event(logging.DEBUG, "frame", "frame", fields, output.frame_id)


class StrategyBase(abc.ABC):
    """A strategy turns frames and inertial data into poses relative to keyframes.

    It works in memory and without waiting; there is one instance per flight. A class implements ``_process``, which
    returns what ``_conclude`` returns, and ``_reset``.

    Args:
        context: what it is built from.

    Attributes:
        name: in the registry; given by each class.
        context: what it was built from.
        health: INIT, TRACKING, DEGRADED or LOST, from what ``_conclude`` gets; its snapshot is for any thread.
    """

    name: str

    def __init__(self, context: StrategyContext) -> None:
        self.context = context
        self.health = HealthMachine(context.config, self._on_transition)
        self._log = StrategyLog(self.name, context.logger, context.clock_ns)
        self._busy = threading.Lock()
        self._ids: tuple[uuid.UUID, int]  # of the frame that is worked on; the frame itself is large, and not kept
        self._t_ns = 0  # of that frame, in the IMU's time
        self._innovation_ratio = 1.0
        self._stage_ms: dict[str, float] = {}

    def process(self, frame: NavCameraFrame, imu_window: ImuWindow) -> Result:
        """Return the pose of the body when the frame was taken, or why there is none.

        Args:
            frame: a picture of the calibrated camera.
            imu_window: the inertial data since the frame processed before; it ends at the frame's stamp.

        Raises:
            VioFatalError: if another call is under way.
        """
        with self._alone():
            self._ids, self._t_ns, self._stage_ms = (frame.frame_id, frame.sequence), imu_window.end_t_ns, {}
            with self.stage("total"):
                try:
                    self._check(frame)
                    if self.health.state is VioState.LOST:
                        if not self.health.auto_reinit(self._t_ns):
                            return self._made(Lost)
                        self._reset(None)
                    return self._process(frame, imu_window)
                except Exception as error:  # also a library's, about a state or a picture that it cannot deal with
                    self._fail(error)
                    return self._made(Lost)

    def reset(self, start: WarmStartPose) -> None:
        """Forget all and start from a given state.

        Raises VioFatalError if the state is not finite or its rotation none; or another call is under way.
        """
        with self._alone():
            try:
                checked = _checked(start)
            except (ValueError, TypeError, AttributeError) as error:
                raise VioFatalError(f"bad warm start: {error}") from error
            try:
                self._reset(checked)
            except Exception as error:
                raise VioFatalError(self._fail(error)) from error
            self.health.warm_start()
            self._log.warm_start_applied(checked)

    def add_height(self, t_ns: int, height_m: float, sigma_m: float) -> None:  # noqa: B027  # none has to take it
        """Note a height of the body above the ground, from any thread; not every strategy makes use of it.

        Args:
            t_ns: when, by the IMU's clock.
            height_m: from range finder or barometer, corrected for the tilt.
            sigma_m: its standard deviation.
        """

    def close(self) -> None:  # noqa: B027  # few have something to close
        """Release all system resources; nothing is processed after that."""

    @abc.abstractmethod
    def _process(self, frame: NavCameraFrame, imu_window: ImuWindow) -> Result:
        """Work on a frame that has passed the checks; return what ``_conclude`` returns. Any exception ends in LOST."""

    @abc.abstractmethod
    def _reset(self, start: WarmStartPose | None) -> None:
        """Forget all; take a state that has passed the checks, or wait for stillness, as when new (None)."""

    def counters(self) -> Mapping[str, int]:
        """Return how often what else has happened since the start, for the results."""
        return {}

    @contextlib.contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Measure how long a stage of ``_process`` takes; several of one name add up."""
        begin_ns = self.context.clock_ns()
        try:
            yield
        finally:
            ms = (self.context.clock_ns() - begin_ns) * 1e-6
            self._stage_ms[name] = self._stage_ms.get(name, 0.0) + ms

    def _conclude(self, facts: FrameFacts, output: VioOutput | None) -> Result:
        """Judge a frame; return its result, as the health then is.

        Args:
            facts: what was found out about the frame.
            output: what the estimator says about it, not inflated; None while there is no state. After that, None
                means that the state is not finite.

        Raises:
            VioFatalError: if the state is not finite.
        """
        if output is None and self.health.state is not VioState.INIT:
            raise VioFatalError("state not finite")
        state, reason = self.health.feed(facts, self._t_ns)
        self._innovation_ratio = facts.innovation_ratio
        if state is VioState.INIT:
            return self._initializing()
        if output is None:
            raise VioFatalError("state not finite as soon as there was one")
        self._log.frame(output, self._stage_ms)
        if state is VioState.LOST:
            return self._made(Lost)
        if state is VioState.DEGRADED:
            factor, since = self.context.config.degraded_inflation, output.start_covariance_6x6
            self._log.degraded(output, reason)
            inflated = dataclasses.replace(
                output,
                pose_covariance_6x6=factor * output.pose_covariance_6x6,
                start_covariance_6x6=None if since is None else factor * since,
            )
            return self._made(Degraded, output=inflated)
        return self._made(Tracking, output=output)

    def _initializing(self, reason: str | None = None) -> Initializing:
        """Return the result of a frame without a state; None for the health's reason."""
        result = self._made(Initializing, is_warm=self.health.is_warm)
        return result if reason is None else dataclasses.replace(result, reason=reason)

    def _made(self, kind: Callable[..., _R], **more: object) -> _R:
        (frame_id, sequence), health = self._ids, self.health.snapshot()
        return kind(
            frame_id=frame_id,
            sequence=sequence,
            t_ns=self._t_ns,
            reason=health.reason,
            consecutive_lost=health.consecutive_lost,
            bias_norm=health.bias_norm,
            innovation_ratio=self._innovation_ratio,
            resets=self.health.resets,
            stage_ms=self._stage_ms,
            counters=self.counters(),
            **more,
        )

    @contextlib.contextmanager
    def _alone(self) -> Iterator[None]:
        if not self._busy.acquire(blocking=False):
            raise VioFatalError("concurrent use of a strategy")
        try:
            yield
        finally:
            self._busy.release()

    def _fail(self, error: Exception) -> str:
        """Go to LOST because of an exception; return the reason."""
        reason = str(error) if isinstance(error, VioFatalError) else f"{type(error).__name__}: {error}"
        self.health.fail(reason, self._t_ns)
        self._log.fatal(reason, error)
        return reason

    def _check(self, frame: NavCameraFrame) -> None:
        calibration = self.context.calibration
        if frame.camera_id != calibration.camera_id:
            raise VioFatalError(f"frame of camera {frame.camera_id!r}, strategy for {calibration.camera_id!r}")
        height, width = frame.pixels.shape[:2]
        if (width, height) != (calibration.width, calibration.height):
            size = f"{calibration.width}x{calibration.height}"
            raise VioFatalError(f"frame of {width}x{height} pixels, calibration of {size}")

    def _on_transition(self, old: VioState, new: VioState, reason: str) -> None:
        self._log.state_change(old, new, reason, self.health.snapshot().consecutive_lost)


def _checked(pose: WarmStartPose) -> WarmStartPose:
    # Made again: a pose that was changed after it was made is checked like any other.
    motion, bias = pose.body_T_world, pose.bias
    return WarmStartPose(SE3(motion.R, motion.t), pose.velocity_b, ImuBias(bias.accel, bias.gyro), pose.covariance)
