# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The composition root: a source of frames, a queue, a worker with its strategy, and whoever listens."""

import logging
from collections.abc import Callable, Iterable
from typing import Self

from viso.companion.vio.config import VioConfig
from viso.companion.vio.imu_buffer import ImuBuffer
from viso.companion.vio.ingest import JOIN_S, CameraIngest, DropOldestQueue, FrameSource
from viso.companion.vio.json_log import log_event
from viso.companion.vio.registry import build_vio_strategy
from viso.companion.vio.types import CameraCalibration
from viso.companion.vio.worker import Listener, VioWorker


class VioRuntime:
    """Visual-inertial odometry at work, in two threads: one reads the camera, one owns the strategy.

    In virtual time it is not started: whoever has the clock gives the frames to ``worker.process_one``.

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
        self.worker = VioWorker(strategy, imu, listeners, self._queue)
        self._started = False
        told = {"config": config.effective(), "digest": config.digest()}
        log_event(logger, logging.INFO, "configuration", "effective configuration", told, strategy=config.strategy)

    def start(self) -> None:
        """Begin to read the camera and to process frames."""
        self._started = True
        self.worker.start()
        self._ingest.start()

    def wait(self, timeout_s: float | None = None) -> bool:
        """Wait until the source has ended and its last frame is done with; say whether that is so."""
        return self.worker.join(timeout_s)

    def stop(self, join_s: float = JOIN_S) -> bool:
        """End both threads, within 2 s; frames that still wait are not processed.

        Args:
            join_s: the longest wait in s for each of them.

        Returns:
            Whether both have ended: a camera that ignores ``close``, or a strategy that does not return, keeps its own.
        """
        self.worker.stop()
        self._ingest.stop()
        if not self._started:
            self.worker.strategy.close()
            return True
        ended = {"worker": self.worker.join(join_s), "camera": self._ingest.join(join_s)}
        if ended["worker"]:
            self.worker.strategy.close()
        for name in (name for name, has_ended in ended.items() if not has_ended):
            log_event(self._logger, logging.ERROR, "thread_hangs", f"the {name}'s thread does not end")
        return all(ended.values())

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()
