# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The path of a frame from the camera to its result, in order from top to bottom.

:class:`VioPipeline` takes a frame and the inertial data since the last one, gives both to the strategy, and the result
to its listeners; :class:`~viso.companion.odometry.source.OdometrySource` is the one that makes ODOMETRY of it.
:class:`StrategyBase` checks the frame, passes it to the estimator, and judges the result by its health.
"""

import abc
import contextlib
import dataclasses
import logging
import threading
import uuid
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import TypeVar

from viso.companion.vio.config import VioConfig
from viso.companion.vio.errors import VioFatalError
from viso.companion.vio.health import FrameFacts, HealthMachine
from viso.companion.vio.imu import ImuBuffer
from viso.companion.vio.log import StrategyLog, log_event
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
from viso.geometry.pose import SE3

_R = TypeVar("_R", bound=Result)

Listener = Callable[[Result], object]


class VioPipeline:
    """Passes each frame, with its inertial data, to the strategy, and the result to the listeners.

    All but ``request_warm_start`` belongs to one thread.

    Args:
        strategy: owned from now on.
        imu: the newest inertial data.
        listeners: called with each result; what they raise is logged.

    Attributes:
        strategy: for the same thread, but for what may be called from any.
    """

    def __init__(self, strategy: "StrategyBase", imu: ImuBuffer, listeners: Iterable[Listener] = ()) -> None:
        context = strategy.context
        self.strategy, self._imu, self._config, self._logger = strategy, imu, context.config, context.logger
        self._listeners = tuple(listeners)
        self._camera_offset_ns = round(context.calibration.time_offset_s * 1e9)
        self._last_ns: int | None = None  # of the last processed frame
        self._last: Result | None = None
        self._not_later = 0  # in a row
        self._is_halted = False  # no frame is processed before a warm start or auto_reinit_s
        self._warm_starts: deque[WarmStartPose] = deque(maxlen=1)

    def request_warm_start(self, pose: WarmStartPose) -> None:
        """Let the strategy start from a state before its next frame; from any thread, the last request counts."""
        self._warm_starts.append(pose)

    def process(self, frame: NavCameraFrame, dropped: int = 0) -> Result | None:
        """Process a frame, and pass its result to the listeners.

        Args:
            dropped: number of frames dropped for newer ones since the start.

        Returns:
            The result, or None for a frame that is not processed: one that is not later than the one before, or any in
            LOST.
        """
        self._apply_warm_start()
        t_ns = frame.capture_timestamp + self._camera_offset_ns
        if not self._is_later(t_ns) or (self._is_halted and self._config.auto_reinit_s == 0):
            return None
        window = self._imu.window(t_ns if self._last_ns is None else self._last_ns, t_ns)
        result = dataclasses.replace(self.strategy.process(frame, window), dropped=dropped)
        self._last_ns, self._is_halted = t_ns, isinstance(result, Lost)
        self._publish(result)
        return result

    def halt(self, reason: str) -> None:
        """Process no frames before a warm start or ``auto_reinit_s``: something else than the strategy failed."""
        self._is_halted = True
        self.lose(reason)

    def lose(self, reason: str) -> None:
        """Report a loss without a frame to the listeners: the last result, without its output."""
        self._error("vio_lost", f"VIO LOST: {reason}; strategy={self.strategy.name}")
        if self._last is not None:
            self._publish(self._last if isinstance(self._last, Lost) else self._last.lost(reason))

    def _apply_warm_start(self) -> None:
        if not self._warm_starts:
            return
        try:
            self.strategy.reset(self._warm_starts.popleft())
        except VioFatalError as error:
            self._error("warm_start_refused", str(error), error)
            return
        self._is_halted, self._last_ns, self._not_later = False, None, 0

    def _is_later(self, t_ns: int) -> bool:
        if self._last_ns is None or t_ns > self._last_ns:
            self._not_later = 0
            return True
        self._not_later += 1
        if self._not_later == self._config.lost_frames_fatal:  # such a clock does not come back
            self.halt("stamps of frames do not increase")
        return False

    def _publish(self, result: Result) -> None:
        self._last = result
        for listener in self._listeners:
            try:
                listener(result)
            except Exception as error:
                self._error("listener_failed", f"listener failed: {error!r}", error)

    def _error(self, event: str, msg: str, error: BaseException | None = None) -> None:
        log_event(self._logger, logging.ERROR, event, msg, strategy=self.strategy.name, error=error)


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


class StrategyBase(abc.ABC):
    """A strategy turns frames and inertial data into poses relative to keyframes.

    It works in memory and without waiting; there is one instance per flight. A class implements ``_process``, which
    returns what ``_conclude`` returns, and ``_reset``.

    Args:
        context: what it is built from.

    Attributes:
        name: in the registry; given by each class.
        context: the context that it was built from.
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
                except Exception as error:  # also those of libraries, about a state or a picture that they reject
                    self._fail(error)
                    return self._made(Lost)

    def _check(self, frame: NavCameraFrame) -> None:
        calibration = self.context.calibration
        if frame.camera_id != calibration.camera_id:
            raise VioFatalError(f"frame of camera {frame.camera_id!r}, strategy for {calibration.camera_id!r}")
        height, width = frame.pixels.shape[:2]
        if (width, height) != (calibration.width, calibration.height):
            size = f"{calibration.width}x{calibration.height}"
            raise VioFatalError(f"frame of {width}x{height} pixels, calibration of {size}")

    @abc.abstractmethod
    def _process(self, frame: NavCameraFrame, imu_window: ImuWindow) -> Result:
        """Work on a frame that has passed the checks; return what ``_conclude`` returns. Any exception ends in LOST."""

    def _conclude(self, facts: FrameFacts, output: VioOutput | None) -> Result:
        """Judge a frame by its facts; return its result.

        Args:
            facts: what was found out about the frame.
            output: of the estimator, not inflated; None while there is no state. After that, None
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
        return self._made(Initializing, reason, is_warm=self.health.is_warm)

    def _made(self, kind: Callable[..., _R], reason: str | None = None, **more: object) -> _R:
        """Return a result of the frame that is worked on; None for the health's reason."""
        (frame_id, sequence), health = self._ids, self.health.snapshot()
        return kind(
            frame_id=frame_id,
            sequence=sequence,
            t_ns=self._t_ns,
            reason=health.reason if reason is None else reason,
            consecutive_lost=health.consecutive_lost,
            bias_norm=health.bias_norm,
            innovation_ratio=self._innovation_ratio,
            resets=self.health.resets,
            stage_ms=self._stage_ms,
            counters=self.counters(),
            **more,
        )

    def _fail(self, error: Exception) -> str:
        """Go to LOST because of an exception; return the reason."""
        reason = str(error) if isinstance(error, VioFatalError) else f"{type(error).__name__}: {error}"
        self.health.fail(reason, self._t_ns)
        self._log.fatal(reason, error)
        return reason

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

    @abc.abstractmethod
    def _reset(self, start: WarmStartPose | None) -> None:
        """Forget all; take a state that has passed the checks, or wait for stillness, as when new (None)."""

    def add_height(self, t_ns: int, height_m: float, sigma_m: float) -> None:  # noqa: B027  # none has to take it
        """Note a height of the body above the ground, from any thread; not every strategy makes use of it.

        Args:
            t_ns: when, by the IMU's clock.
            height_m: from range finder or barometer, corrected for the tilt.
            sigma_m: its standard deviation.
        """

    def close(self) -> None:  # noqa: B027  # few have something to close
        """Release all system resources; nothing is processed after that."""

    def counters(self) -> Mapping[str, int]:
        """Return counts of other events since the start, for the results."""
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

    @contextlib.contextmanager
    def _alone(self) -> Iterator[None]:
        if not self._busy.acquire(blocking=False):
            raise VioFatalError("concurrent use of a strategy")
        try:
            yield
        finally:
            self._busy.release()

    def _on_transition(self, old: VioState, new: VioState, reason: str) -> None:
        self._log.state_change(old, new, reason, self.health.snapshot().consecutive_lost)


def _checked(pose: WarmStartPose) -> WarmStartPose:
    # Made again: a pose that was changed after it was made is checked like any other.
    motion, bias = pose.body_T_world, pose.bias
    return WarmStartPose(SE3(motion.R, motion.t), pose.velocity_b, ImuBias(bias.accel, bias.gyro), pose.covariance)
