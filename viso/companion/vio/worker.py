# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The worker: the one thread that owns the strategy, and what it does with each frame."""

import dataclasses
import logging
import threading
import uuid
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Final, Protocol

from viso.companion.vio.config import VioConfig
from viso.companion.vio.errors import VioDegradedError, VioFatalError, VioInitializingError
from viso.companion.vio.ingest import DropOldestQueue
from viso.companion.vio.json_log import log_event
from viso.companion.vio.strategy import FrameReport, StrategyBase
from viso.companion.vio.types import (
    CameraCalibration,
    ImuWindow,
    NavCameraFrame,
    VioHealth,
    VioOutput,
    VioState,
    WarmStartPose,
)

STALL_S: Final = 3.0  # as long as the frames that are fatal when lost take at 3 Hz


@dataclass(frozen=True, slots=True, eq=False)
class VioUpdate:
    """What there is to know about a frame.

    Where frames stop coming, the last one is told again, without its output and with the health LOST.

    Attributes:
        frame_id, sequence: of the frame.
        t_ns: of the frame, in the IMU's time.
        output: to be used with less weight in DEGRADED; None in INIT and LOST.
        dropped: frames that gave way to newer ones, since the start.
    """

    frame_id: uuid.UUID
    sequence: int
    t_ns: int
    output: VioOutput | None
    health: VioHealth
    report: FrameReport
    dropped: int


Listener = Callable[[VioUpdate], None]


class ImuWindows(Protocol):
    """Where inertial data come from."""

    def window(self, t0_ns: int, t1_ns: int) -> ImuWindow:
        """Return the data that bracket two stamps, as far as there are any."""


class VioWorker:
    """Gives each frame, with its inertial data, to the strategy, and hands on what comes out.

    All but ``request_warm_start``, ``health``, ``stop`` and ``join`` belong to one thread.

    Args:
        strategy: owned from now on.
        listeners: called with each update; what they raise is logged.
        queue: where ``run`` takes frames from; its losses go into the updates.

    Attributes:
        strategy: for its thread, but for what may be called from any.
    """

    def __init__(
        self,
        strategy: StrategyBase,
        config: VioConfig,
        calibration: CameraCalibration,
        imu: ImuWindows,
        *,
        clock_ns: Callable[[], int],
        logger: logging.Logger,
        listeners: Iterable[Listener] = (),
        queue: DropOldestQueue | None = None,
    ) -> None:
        self.strategy, self._config, self._calibration, self._imu = strategy, config, calibration, imu
        self._clock_ns, self._logger = clock_ns, logger
        self._listeners = tuple(listeners)
        self._queue = queue or DropOldestQueue(config.queue.depth)
        self._camera_offset_ns = round(calibration.time_offset_s * 1e9)
        self._last_ns: int | None = None  # of the last processed frame
        self._last_update: VioUpdate | None = None
        self._not_later = 0  # in a row
        self._halted: str | None = None  # why no frame is processed before a warm start
        self._no_frames: str | None = None  # why there are none
        self._warm_starts: deque[WarmStartPose] = deque(maxlen=1)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self.run, name="vio-worker", daemon=True)

    def request_warm_start(self, pose: WarmStartPose) -> None:
        """Let the strategy start from a state before its next frame; from any thread, the last request counts."""
        self._warm_starts.append(pose)

    def health(self) -> VioHealth:
        """Return the strategy's health; LOST where frames are not processed or do not come."""
        health = self.strategy.health_snapshot()
        reason = self._halted or self._no_frames
        if reason is None or health.state is VioState.LOST:
            return health
        return dataclasses.replace(health, state=VioState.LOST, reason=reason)

    def process_one(self, frame: NavCameraFrame) -> VioUpdate | None:
        """Process a frame and tell everybody.

        Returns:
            What the listeners were told, or None for a frame that is not processed: one that is not later than the one
            before, or any in LOST.
        """
        self._no_frames = None
        self._apply_warm_start()
        t_ns = frame.capture_timestamp + self._camera_offset_ns
        if not self._is_later(t_ns):
            return None
        if self._halted is not None and self._config.auto_reinit_s == 0:
            return None
        window = self._imu.window(t_ns if self._last_ns is None else self._last_ns, t_ns)
        begin_ns = self._clock_ns()
        output = self._process(frame, window)
        total_ms = (self._clock_ns() - begin_ns) * 1e-6
        self._last_ns = t_ns
        report = self.strategy.frame_report()
        report = dataclasses.replace(report, stage_ms={**report.stage_ms, "total": total_ms})
        update = VioUpdate(frame.frame_id, frame.sequence, t_ns, output, self.health(), report, self._queue.dropped)
        self._publish(update)
        return update

    def _process(self, frame: NavCameraFrame, window: ImuWindow) -> VioOutput | None:
        output: VioOutput | None = None
        try:
            output = self.strategy.process_frame(frame, window, self._calibration)
        except VioInitializingError:
            pass
        except VioDegradedError as error:
            output = error.output
        except VioFatalError as error:
            if self._halted is None:
                self._halted = str(error)
                self._error("vio_fatal", str(error), error, frame.frame_id)
            return None
        self._halted = None
        return output

    def _apply_warm_start(self) -> None:
        if not self._warm_starts:
            return
        try:
            self.strategy.reset_to_warm_start(self._warm_starts.popleft())
        except VioFatalError as error:
            self._error("warm_start_refused", str(error), error)
            return
        self._halted, self._last_ns, self._not_later = None, None, 0

    def _is_later(self, t_ns: int) -> bool:
        if self._last_ns is None or t_ns > self._last_ns:
            self._not_later = 0
            return True
        self._not_later += 1
        if self._not_later == self._config.lost_frames_fatal:  # such a clock does not come back
            self._halted = "stamps of frames do not increase"
            self._tell_lost(self._halted)
        return False

    def _tell_lost(self, reason: str) -> None:
        """Tell everybody what no frame tells."""
        self._error("vio_lost", f"VIO LOST: {reason}; strategy={self.strategy.name}")
        if self._last_update is not None:
            self._publish(dataclasses.replace(self._last_update, output=None, health=self.health()))

    def _publish(self, update: VioUpdate) -> None:
        self._last_update = dataclasses.replace(update, output=None)
        for listener in self._listeners:
            try:
                listener(update)
            except Exception as error:
                self._error("listener_failed", f"listener failed: {error!r}", error)

    def _error(self, event: str, msg: str, error: BaseException | None = None, frame: uuid.UUID | None = None) -> None:
        log_event(self._logger, logging.ERROR, event, msg, strategy=self.strategy.name, frame=frame, error=error)

    def start(self) -> None:
        """Begin to take frames from the queue."""
        self._thread.start()

    def stop(self) -> None:
        """Ask the thread to end after the frame that it is at; does not wait."""
        self._stop.set()
        self._queue.close()

    def join(self, timeout_s: float | None) -> bool:
        """Wait for the thread; say whether it has ended."""
        self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def run(self) -> None:
        """Process frames until the source has ended or ``stop`` is called (what the thread does)."""
        while not self._stop.is_set() and self._take_one():
            pass

    def _take_one(self) -> bool:
        # The frame is held by this call alone: no longer when the next one is awaited.
        frame = self._queue.get(STALL_S)
        if self._stop.is_set():
            return False
        if frame is None:
            return self._wait_on()
        try:
            self.process_one(frame)
        except Exception as error:
            self._halted = f"{type(error).__name__}: {error}"
            self._error("worker_failed", self._halted, error)
            self._tell_lost(self._halted)
        return True

    def _wait_on(self) -> bool:
        """Find out why there is no frame; say whether one may still come."""
        if self._queue.closed:
            if self._queue.failure is not None:
                self._no_frames = self._queue.failure
                self._tell_lost(self._no_frames)
            return False
        if self._no_frames is None:
            self._no_frames = f"no frame for {STALL_S:g} s"
            self._tell_lost(self._no_frames)
        return True
