# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs a strategy: over all data of a source as fast as can be, or in two threads.

Of the threads one reads the camera and never waits, one processes frames. ``run_through`` reads no clock: unless one is
given, time is that of the newest data, and the same data give the same results.
"""

import contextlib
import logging
import threading
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator
from typing import Final, Protocol, Self

from viso.companion.vio.config import VioConfig
from viso.companion.vio.imu import ImuBuffer
from viso.companion.vio.log import log_event
from viso.companion.vio.pipeline import Listener, VioPipeline
from viso.companion.vio.registry import build_vio_strategy
from viso.companion.vio.result import Result
from viso.companion.vio.types import CameraCalibration, ImuSample, NavCameraFrame, SensorEvent, WarmStartPose

STALL_S: Final = 3.0  # as long as the frames that are fatal when lost take at 3 Hz
JOIN_S: Final = 1.0  # for each of two threads: both are gone within 2 s
_LOGGER: Final = logging.getLogger(__name__)


class EventSource(Protocol):
    """Sensor data, and the camera's calibration."""

    @property
    def calibration(self) -> CameraCalibration: ...

    def events(self) -> Iterator[SensorEvent]:
        """Yield the data in the order in which they arrive: a frame comes after an IMU sample that is later than it."""


def run_through(
    source: EventSource,
    config: VioConfig,
    warm_start: WarmStartPose | None = None,
    *,
    clock_ns: Callable[[], int] | None = None,
    logger: logging.Logger = _LOGGER,
    listeners: Iterable[Listener] = (),
) -> Iterator[Result]:
    """Run the strategy that a configuration names over all data of a source; yield the result of each frame.

    Without a warm start at the first frame it waits for stillness. The clock is what the strategy and the times of its
    stages see; None for the time of the newest data. Raises ValueError if there is no such strategy, and
    StrategyNotAvailableError if this build does not have it.
    """
    newest_ns = 0
    clock_ns = clock_ns or (lambda: newest_ns)
    buffer = ImuBuffer(wait=lambda *_: None)  # what there will be is there
    strategy = build_vio_strategy(config, source.calibration, clock_ns, logger)
    pipeline = VioPipeline(strategy, buffer, listeners)
    if warm_start is not None:
        pipeline.request_warm_start(warm_start)
    with contextlib.closing(strategy):
        for event in source.events():
            newest_ns = max(newest_ns, event.t_ns)
            if isinstance(event, ImuSample):
                buffer.add(event)
            elif not isinstance(event, NavCameraFrame):
                strategy.add_height(event.t_ns, event.height_m, event.sigma_m)
            elif (result := pipeline.process(event)) is not None:
                yield result


class FrameSource(Protocol):
    """A camera, a folder of images, a video."""

    def read(self) -> NavCameraFrame | None:
        """Wait for the next frame; None when there will be no more.

        Raises:
            Exception: whatever goes wrong; the source is not asked again. Once ``close`` was called, that is no fault.
        """

    def close(self) -> None:
        """Release the device; from any thread, also twice. A ``read`` under way returns or raises."""


class DropOldestQueue:
    """A queue of frames; when it is full, a new frame replaces the oldest.

    Attributes:
        dropped: number of frames dropped for newer ones.
        closed: whether no more frames come.
    """

    def __init__(self, depth: int = 1) -> None:
        if depth < 1:
            raise ValueError("depth: below 1")
        self._frames: deque[NavCameraFrame] = deque()
        self._depth = depth
        self._changed = threading.Condition()
        self.closed = False
        self.failure: str | None = None
        self.dropped = 0

    def put(self, frame: NavCameraFrame) -> None:
        """Append a frame; never waits for room."""
        with self._changed:
            self._drop_all_but(self._depth - 1)
            self._frames.append(frame)
            self._changed.notify()

    def get(self, timeout_s: float | None = None) -> NavCameraFrame | None:
        """Wait for a frame and return the newest; those before it are dropped.

        Returns:
            The frame, or None if there was none in time, or the queue is closed and empty.
        """
        with self._changed:
            self._changed.wait_for(lambda: self._frames or self.closed, timeout_s)
            self._drop_all_but(1)
            return self._frames.popleft() if self._frames else None

    def close(self, failure: str | None = None) -> None:
        """Close the queue: ``get`` returns at once when it is empty."""
        with self._changed:
            self.failure = self.failure or failure
            self.closed = True
            self._changed.notify_all()

    def _drop_all_but(self, count: int) -> None:
        while len(self._frames) > count:
            self._frames.popleft()
            self.dropped += 1


class CameraIngest:
    """A thread that reads frames from a source into a queue until either side ends it.

    Args:
        source: read by this thread alone.
        queue: closed when the source ends.

    Attributes:
        counters: ``frames`` read, ``failed`` and ``ended`` sources.
    """

    def __init__(self, source: FrameSource, queue: DropOldestQueue, logger: logging.Logger) -> None:
        self._source = source
        self._queue = queue
        self._logger = logger
        self._stop = threading.Event()
        self.counters = Counter(frames=0, failed=0, ended=0)
        self._thread = threading.Thread(target=self.run, name="vio-camera", daemon=True)

    def start(self) -> None:
        """Begin to read."""
        self._thread.start()

    def stop(self) -> None:
        """Ask the thread to end and close the source; does not wait."""
        self._stop.set()
        try:
            self._source.close()
        except Exception as error:
            reason = f"{type(error).__name__}: {error}"
            self._camera_event(logging.ERROR, "camera_close_failed", f"the camera could not be closed: {reason}")

    def join(self, timeout_s: float | None) -> bool:
        """Wait for the thread; return whether it has ended."""
        self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def run(self) -> None:
        """Read until the source ends or fails or ``stop`` is called (what the thread does)."""
        while not self._stop.is_set() and self._read_one():
            pass
        self._queue.close()

    def _read_one(self) -> bool:
        # The frame is held by this call alone: no longer when the next one is awaited.
        try:
            frame = self._source.read()
        except Exception as error:
            self._fail(f"{type(error).__name__}: {error}")
            return False
        if frame is None:
            self._end()
            return False
        self.counters["frames"] += 1
        self._queue.put(frame)
        return True

    def _fail(self, reason: str) -> None:
        if not self._stop.is_set():
            self.counters["failed"] += 1
            self._queue.close(f"camera failed: {reason}")
            self._camera_event(logging.ERROR, "camera_failed", f"camera failed: {reason}")

    def _end(self) -> None:
        if not self._stop.is_set():
            self.counters["ended"] += 1
            self._camera_event(logging.INFO, "camera_ended", "the camera has no more frames")

    def _camera_event(self, level: int, event: str, msg: str) -> None:
        log_event(self._logger, level, event, msg, self.counters)


class VioWorker:
    """A thread that takes frames from a queue to a pipeline until the source ends or ``stop`` is called."""

    def __init__(self, pipeline: VioPipeline, queue: DropOldestQueue, logger: logging.Logger) -> None:
        self._pipeline, self._queue, self._logger = pipeline, queue, logger
        self._has_stalled = False  # no frame has come for long
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self.run, name="vio-worker", daemon=True)

    def start(self) -> None:
        """Begin to take frames from the queue."""
        self._thread.start()

    def stop(self) -> None:
        """Ask the thread to end after its present frame; does not wait."""
        self._stop.set()
        self._queue.close()

    def join(self, timeout_s: float | None) -> bool:
        """Wait for the thread; return whether it has ended."""
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
        self._has_stalled = False
        try:
            self._pipeline.process(frame, self._queue.dropped)
        except Exception as error:
            reason = f"{type(error).__name__}: {error}"
            log_event(self._logger, logging.ERROR, "worker_failed", reason, error=error)
            self._pipeline.halt(reason)
        return True

    def _wait_on(self) -> bool:
        """Handle a missing frame; return whether one may still come."""
        if self._queue.closed:
            if self._queue.failure is not None:
                self._pipeline.lose(self._queue.failure)
            return False
        if not self._has_stalled:
            self._has_stalled = True
            self._pipeline.lose(f"no frame for {STALL_S:g} s")
        return True


class VioRuntime:
    """A running visual-inertial odometry in two threads: one reads the camera, one owns the strategy.

    Virtual time does not use it: there the owner of the clock passes the frames to a ``VioPipeline``.

    Args:
        source: of the frames; closed by ``stop``.
        listeners: called, in the worker's thread, with each result.

    Raises:
        ValueError: if there is no such strategy.
        StrategyNotAvailableError: if this build does not have it.
    """

    def __init__(
        self,
        config: VioConfig,
        calibration: CameraCalibration,
        source: FrameSource,
        imu: ImuBuffer,
        *,
        clock_ns: Callable[[], int],
        logger: logging.Logger,
        listeners: Iterable[Listener] = (),
    ) -> None:
        strategy = build_vio_strategy(config, calibration, clock_ns, logger)
        self._logger = logger
        self._queue = DropOldestQueue(config.queue.depth)
        self._ingest = CameraIngest(source, self._queue, logger)
        self.pipeline = VioPipeline(strategy, imu, listeners)
        self._worker = VioWorker(self.pipeline, self._queue, logger)
        self._started = False
        fields = {"config": config.effective(), "digest": config.digest()}
        log_event(logger, logging.INFO, "configuration", "effective configuration", fields, strategy=config.strategy)

    def start(self) -> None:
        """Begin to read the camera and to process frames."""
        self._started = True
        self._worker.start()
        self._ingest.start()

    def wait(self, timeout_s: float | None = None) -> bool:
        """Wait until the source has ended and its last frame is processed; return whether that is so."""
        return self._worker.join(timeout_s)

    def stop(self, join_s: float = JOIN_S) -> bool:
        """End both threads, within 2 s; frames that still wait are not processed.

        Args:
            join_s: the longest wait in s for each of them.

        Returns:
            Whether both have ended: a camera that ignores ``close``, or a strategy that does not return, keeps its own.
        """
        self._worker.stop()
        self._ingest.stop()
        if not self._started:
            self.pipeline.strategy.close()
            return True
        ended = {"worker": self._worker.join(join_s), "camera": self._ingest.join(join_s)}
        if ended["worker"]:
            self.pipeline.strategy.close()
        for name in (name for name, has_ended in ended.items() if not has_ended):
            log_event(self._logger, logging.ERROR, "thread_hangs", f"the {name}'s thread does not end")
        return all(ended.values())

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()
