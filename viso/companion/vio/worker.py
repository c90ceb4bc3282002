# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The worker: the one thread that owns the strategy, and what it does with each frame."""

import dataclasses
import logging
import threading
from collections import deque
from collections.abc import Callable, Iterable
from typing import Final

from viso.companion.vio.errors import VioFatalError
from viso.companion.vio.imu_buffer import ImuBuffer
from viso.companion.vio.ingest import DropOldestQueue
from viso.companion.vio.json_log import log_event
from viso.companion.vio.result import Lost, Result
from viso.companion.vio.strategy import StrategyBase
from viso.companion.vio.types import NavCameraFrame, WarmStartPose

STALL_S: Final = 3.0  # as long as the frames that are fatal when lost take at 3 Hz

Listener = Callable[[Result], object]


class VioWorker:
    """Gives each frame, with its inertial data, to the strategy, and the result to the listeners.

    All but ``request_warm_start``, ``stop`` and ``join`` belong to one thread.

    Args:
        strategy: owned from now on.
        imu: the newest inertial data.
        listeners: called with each result; what they raise is logged.
        queue: where ``run`` takes frames from; its losses go into the results.

    Attributes:
        strategy: for its thread, but for what may be called from any.
    """

    def __init__(
        self,
        strategy: StrategyBase,
        imu: ImuBuffer,
        listeners: Iterable[Listener] = (),
        queue: DropOldestQueue | None = None,
    ) -> None:
        context = strategy.context
        self.strategy, self._imu, self._config, self._logger = strategy, imu, context.config, context.logger
        self._listeners = tuple(listeners)
        self._queue = queue or DropOldestQueue(self._config.queue.depth)
        self._camera_offset_ns = round(context.calibration.time_offset_s * 1e9)
        self._last_ns: int | None = None  # of the last processed frame
        self._last: Result | None = None
        self._not_later = 0  # in a row
        self._is_halted = False  # no frame is processed before a warm start or auto_reinit_s
        self._has_stalled = False  # no frame has come for long
        self._warm_starts: deque[WarmStartPose] = deque(maxlen=1)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self.run, name="vio-worker", daemon=True)

    def request_warm_start(self, pose: WarmStartPose) -> None:
        """Let the strategy start from a state before its next frame; from any thread, the last request counts."""
        self._warm_starts.append(pose)

    def process(self, frame: NavCameraFrame) -> Result | None:
        """Process a frame, and give its result to the listeners.

        Returns:
            The result, or None for a frame that is not processed: one that is not later than the one before, or any in
            LOST.
        """
        self._has_stalled = False
        self._apply_warm_start()
        t_ns = frame.capture_timestamp + self._camera_offset_ns
        if not self._is_later(t_ns):
            return None
        if self._is_halted and self._config.auto_reinit_s == 0:
            return None
        window = self._imu.window(t_ns if self._last_ns is None else self._last_ns, t_ns)
        result = dataclasses.replace(self.strategy.process(frame, window), dropped=self._queue.dropped)
        self._last_ns = t_ns
        self._is_halted = isinstance(result, Lost)
        self._publish(result)
        return result

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
            self._is_halted = True
            self._tell_lost("stamps of frames do not increase")
        return False

    def _tell_lost(self, reason: str) -> None:
        """Give the listeners a loss that no frame gives: the last result, without its output."""
        self._error("vio_lost", f"VIO LOST: {reason}; strategy={self.strategy.name}")
        if self._last is not None:
            self._publish(self._last if isinstance(self._last, Lost) else self._last.lost(reason))

    def _publish(self, result: Result) -> None:
        self._last = result
        for listener in self._listeners:
            try:
                listener(result)
            except Exception as error:
                self._error("listener_failed", f"listener failed: {error!r}", error)

    def _error(self, event: str, msg: str, error: BaseException | None = None) -> None:
        log_event(self._logger, logging.ERROR, event, msg, strategy=self.strategy.name, error=error)

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
            self.process(frame)
        except Exception as error:
            self._is_halted, reason = True, f"{type(error).__name__}: {error}"
            self._error("worker_failed", reason, error)
            self._tell_lost(reason)
        return True

    def _wait_on(self) -> bool:
        """Find out why there is no frame; say whether one may still come."""
        if self._queue.closed:
            if self._queue.failure is not None:
                self._tell_lost(self._queue.failure)
            return False
        if not self._has_stalled:
            self._has_stalled = True
            self._tell_lost(f"no frame for {STALL_S:g} s")
        return True
