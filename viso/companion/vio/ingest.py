# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""From a camera to the worker: a thread that reads, and a queue that never lets it wait."""

import logging
import threading
from collections import Counter, deque
from typing import Final, Protocol

from viso.companion.vio.json_log import log_event
from viso.companion.vio.types import NavCameraFrame

JOIN_S: Final = 1.0  # for each of two threads: both are gone within 2 s


class FrameSource(Protocol):
    """A camera, a folder of images, a video."""

    def read(self) -> NavCameraFrame | None:
        """Wait for the next frame; None when there will be no more.

        Raises:
            Exception: whatever goes wrong; the source is not asked again. Once ``close`` was called, that is no fault.
        """

    def close(self) -> None:
        """Let go of the device; from any thread, also twice. A ``read`` under way returns or raises."""


class DropOldestQueue:
    """Frames on their way; when it is full, the oldest gives way to the new one.

    Attributes:
        dropped: how many frames gave way to newer ones.
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
        """Let ``get`` return at once from now on, when there is nothing left."""
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
        """Ask the thread to end and let go of the source; does not wait."""
        self._stop.set()
        try:
            self._source.close()
        except Exception as error:
            reason = f"{type(error).__name__}: {error}"
            self._camera_event(logging.ERROR, "camera_close_failed", f"the camera could not be closed: {reason}")

    def join(self, timeout_s: float | None) -> bool:
        """Wait for the thread; say whether it has ended."""
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
