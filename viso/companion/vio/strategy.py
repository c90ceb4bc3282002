# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a strategy is, and what all of them share: one caller at a time, checks, health, errors, log.

A strategy derives from :class:`StrategyBase` and implements three methods. ``_process`` ends with
``return self._conclude(facts, output)``, which feeds the health machine and returns or raises as the state says.
"""

import abc
import contextlib
import dataclasses
import logging
import threading
import uuid
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Final

from viso.companion.vio.config import VioConfig
from viso.companion.vio.errors import VioDegradedError, VioError, VioFatalError, VioInitializingError
from viso.companion.vio.health import FrameFacts, HealthMachine
from viso.companion.vio.json_log import log_event
from viso.companion.vio.types import (
    CameraCalibration,
    ImuBias,
    ImuWindow,
    NavCameraFrame,
    VioHealth,
    VioOutput,
    VioState,
    WarmStartPose,
)
from viso.geometry.se3 import SE3

_DEGRADED_PERIOD_NS: Final = 1_000_000_000


@dataclass(frozen=True, slots=True)
class FrameReport:
    """What there is to say about the last frame besides its output and the health.

    Attributes:
        innovation_ratio: running mean of the inliers' normalised innovation squared per degree of freedom.
        resets: how often the pose has jumped to another origin since the start.
        stage_ms: how long each stage took.
        counters: of what else has happened since the start, such as restarts of an engine.
    """

    innovation_ratio: float = 1.0
    resets: int = 0
    stage_ms: Mapping[str, float] = field(default_factory=dict)
    counters: Mapping[str, int] = field(default_factory=dict)


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

    def frame(self, output: VioOutput, stage_ms: Mapping[str, float]) -> None:
        """Log a frame, for debugging."""
        if not self._logger.isEnabledFor(logging.DEBUG):
            return
        quality = output.feature_quality
        fields = {"tracked": quality.tracked, "new": quality.new, "keyframe": output.is_keyframe, "ms": dict(stage_ms)}
        self._event(logging.DEBUG, "frame", "frame", fields, output.frame_id)


class StrategyBase(abc.ABC):
    """A strategy without its estimator: it turns frames and inertial data into relative poses.

    It is synchronous, in memory, one instance per flight.

    Args:
        context: what it is built from.

    Attributes:
        name: in the registry; given by each class.
        context: what it was built from.
        health: fed by ``_conclude``.
    """

    name: str

    def __init__(self, context: StrategyContext) -> None:
        self.context = context
        self.health = HealthMachine(context.config, self._on_transition)
        self._log = StrategyLog(self.name, context.logger, context.clock_ns)
        self._busy = threading.Lock()
        self._t_ns = 0
        self._innovation_ratio = 1.0
        self._stage_ms: dict[str, float] = {}

    def process_frame(self, frame: NavCameraFrame, imu_window: ImuWindow, calibration: CameraCalibration) -> VioOutput:
        """Return the pose of the body when the frame was taken.

        Args:
            frame: a picture of the calibrated camera.
            imu_window: the inertial data since the frame processed before.
            calibration: of the camera.

        Raises:
            VioInitializingError: there is no state yet.
            VioDegradedError: the output that it carries is to be used with less weight.
            VioFatalError: there is no output; or another call is under way.
        """
        with self._alone():
            self._t_ns, self._stage_ms = frame.capture_timestamp, {}
            with self._fatal_is_lost():
                self._check(frame, calibration)
                if self.health.state is VioState.LOST:
                    if not self.health.auto_reinit(self._t_ns):
                        raise VioFatalError(f"VIO LOST: {self.health.snapshot().reason}")
                    self._start_over()
                return self._process(frame, imu_window, calibration)

    def reset_to_warm_start(self, pose: WarmStartPose) -> None:
        """Forget all and start from a given state.

        Raises VioFatalError if the state is not finite or its rotation none; or another call is under way.
        """
        with self._alone():
            try:
                checked = _checked(pose)
            except (ValueError, TypeError, AttributeError) as error:
                raise VioFatalError(f"bad warm start: {error}") from error
            with self._fatal_is_lost():
                self._warm_start(checked)
            self.health.warm_start()
            self._log.warm_start_applied(checked)

    def health_snapshot(self) -> VioHealth:
        """Return the health; from any thread, without waiting."""
        return self.health.snapshot()

    def frame_report(self) -> FrameReport:
        """Return what there is to say about the last frame; for the thread that calls ``process_frame``."""
        return FrameReport(self._innovation_ratio, self.health.resets, dict(self._stage_ms))

    def add_height(self, t_ns: int, height_m: float, sigma_m: float) -> None:  # noqa: B027  # none has to take it
        """Note a height of the body above the ground, from any thread; not every strategy makes use of it.

        Args:
            t_ns: when, by the IMU's clock.
            height_m: from range finder or barometer, corrected for the tilt.
            sigma_m: its standard deviation.
        """

    def close(self) -> None:  # noqa: B027  # few have something to close
        """Let go of all that the system gave; nothing is processed after that."""

    @abc.abstractmethod
    def _process(self, frame: NavCameraFrame, imu_window: ImuWindow, calibration: CameraCalibration) -> VioOutput:
        """Work on a frame that has passed the checks, and return what ``_conclude`` returns.

        Raises VioError, as ``process_frame``; any other exception ends in LOST.
        """

    @abc.abstractmethod
    def _warm_start(self, pose: WarmStartPose) -> None:
        """Forget all and take a state that has passed the checks."""

    @abc.abstractmethod
    def _start_over(self) -> None:
        """Forget all and wait for stillness, as when new."""

    @contextlib.contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Measure how long a stage of ``_process`` takes; several of one name add up."""
        begin_ns = self.context.clock_ns()
        try:
            yield
        finally:
            ms = (self.context.clock_ns() - begin_ns) * 1e-6
            self._stage_ms[name] = self._stage_ms.get(name, 0.0) + ms

    def _conclude(self, facts: FrameFacts, output: VioOutput | None) -> VioOutput:
        """Judge a frame; return its output or raise, as the health then says.

        Args:
            facts: what was found out about the frame.
            output: what is said about it, not inflated; None while there is no state. After that, None means that the
                state is not finite.

        Raises:
            VioInitializingError: in INIT.
            VioDegradedError: in DEGRADED, with the covariance inflated.
            VioFatalError: in LOST.
        """
        if output is None and self.health.state is not VioState.INIT:
            raise VioFatalError("state not finite")
        state, reason = self.health.feed(facts, self._t_ns)
        self._innovation_ratio = facts.innovation_ratio
        if state is VioState.INIT:
            raise VioInitializingError(reason)
        if output is None:
            raise VioFatalError("state not finite as soon as there was one")
        self._log.frame(output, self._stage_ms)
        if state is VioState.LOST:
            raise VioFatalError(f"VIO LOST: {reason}")
        if state is VioState.DEGRADED:
            factor, since = self.context.config.degraded_inflation, output.start_covariance_6x6
            self._log.degraded(output, reason)
            inflated = dataclasses.replace(
                output,
                pose_covariance_6x6=factor * output.pose_covariance_6x6,
                start_covariance_6x6=None if since is None else factor * since,
            )
            raise VioDegradedError(reason, inflated)
        return output

    @contextlib.contextmanager
    def _alone(self) -> Iterator[None]:
        if not self._busy.acquire(blocking=False):
            raise VioFatalError("concurrent process_frame")
        try:
            yield
        finally:
            self._busy.release()

    @contextlib.contextmanager
    def _fatal_is_lost(self) -> Iterator[None]:
        try:
            yield
        except VioFatalError as error:
            self.health.fail(str(error), self._t_ns)
            raise
        except VioError:
            raise
        except Exception as error:  # a library's, about a state or a picture that it cannot deal with
            reason = f"{type(error).__name__}: {error}"
            self.health.fail(reason, self._t_ns)
            raise VioFatalError(reason) from error

    def _check(self, frame: NavCameraFrame, calibration: CameraCalibration) -> None:
        own = self.context.calibration.camera_id
        for what, camera_id in (("frame", frame.camera_id), ("calibration", calibration.camera_id)):
            if camera_id != own:
                raise VioFatalError(f"{what} of camera {camera_id!r}, strategy for {own!r}")
        height, width = frame.pixels.shape[:2]
        if (width, height) != (calibration.width, calibration.height):
            size = f"{calibration.width}x{calibration.height}"
            raise VioFatalError(f"frame of {width}x{height} pixels, calibration of {size}")

    def _on_transition(self, old: VioState, new: VioState, reason: str) -> None:
        self._log.state_change(old, new, reason, self.health.snapshot().consecutive_lost)


def _checked(pose: WarmStartPose) -> WarmStartPose:
    # Made again: whoever got around the constructors does not get around this.
    motion, bias = pose.body_T_world, pose.bias
    return WarmStartPose(SE3(motion.R, motion.t), pose.velocity_b, ImuBias(bias.accel, bias.gyro), pose.covariance)
