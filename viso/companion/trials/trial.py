# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs a strategy over all data of a source, as they would come in flight.

Nothing here reads a clock: unless one is given, time is that of the newest data, and the same data give the same trial.
"""

import contextlib
import logging
from collections.abc import Callable, Iterable, Iterator
from typing import Final, Protocol

from viso.companion.vio.config import VioConfig
from viso.companion.vio.imu import ImuBuffer
from viso.companion.vio.pipeline import Listener, VioPipeline
from viso.companion.vio.registry import build_vio_strategy
from viso.companion.vio.result import Result
from viso.companion.vio.types import CameraCalibration, ImuSample, NavCameraFrame, SensorEvent, WarmStartPose

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
