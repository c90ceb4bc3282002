# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A flight for the bench of the baseline strategy. Needs the extra vio."""

import logging
import time
from dataclasses import replace
from typing import Any, Final

import cv2

from viso.companion.strategies.klt_ransac import KltRansac
from viso.companion.vio.calibration import scaled
from viso.companion.vio.config import AglSource, Scene, VioConfig
from viso.companion.vio.imu import ImuBuffer
from viso.companion.vio.pipeline import StrategyContext
from viso.companion.vio.types import HeightMeasurement, ImuSample, NavCameraFrame, SensorEvent
from viso.companion.world.flight import SyntheticFlight, nadir_calibration
from viso.companion.world.texture import GroundTexture

HOUR_S: Final = 3600.0
WARM_UP_FRAMES: Final = 3
_FOCAL_SHARE: Final = 500 / 640


class FlownStrategy:
    """A strategy on a flight that does not end.

    Args:
        texture: of the ground.
        width, height: of the picture.
        enlargement: of what is rendered; large pictures take longer to render than to look at.

    Attributes:
        strategy: it tracks.
    """

    def __init__(self, texture: GroundTexture, width: int, height: int, enlargement: int) -> None:
        calibration = nadir_calibration(width, height, _FOCAL_SHARE * width)
        self._enlargement, self._calibration = enlargement, calibration
        flight = SyntheticFlight(texture=texture, calibration=scaled(calibration, enlargement), duration_s=HOUR_S)
        self._events = flight.events()
        self._imu = ImuBuffer()
        self._last_ns: int | None = None
        config = VioConfig(scene=Scene.PLANAR, agl_source=AglSource.RANGEFINDER)
        self.strategy = KltRansac(StrategyContext(config, calibration, lambda: 0, logging.getLogger(__name__)))
        self.strategy.reset(flight.warm_start())
        for _ in range(WARM_UP_FRAMES):
            self.run()

    def run(self) -> float:
        """Process the next frame; return the seconds that this took."""
        frame = self._next_frame()
        stamp_ns = frame.capture_timestamp
        window = self._imu.window(stamp_ns if self._last_ns is None else self._last_ns, stamp_ns, 0.0)
        self._last_ns = stamp_ns
        begin_s = time.process_time()
        self.strategy.process(frame, window)
        return time.process_time() - begin_s

    def _next_frame(self) -> NavCameraFrame:
        while not isinstance(event := next(self._events), NavCameraFrame):
            self._take(event)
        return self._enlarged(event)

    def _take(self, event: SensorEvent) -> None:
        if isinstance(event, ImuSample):
            self._imu.add(event)
        elif isinstance(event, HeightMeasurement):
            self.strategy.add_height(event.t_ns, event.height_m, event.sigma_m)

    def _enlarged(self, frame: NavCameraFrame) -> NavCameraFrame:
        if self._enlargement == 1:
            return frame
        pixels: Any = cv2.cvtColor(frame.pixels, cv2.COLOR_GRAY2BGR)
        size = self._calibration.width, self._calibration.height
        pixels = cv2.resize(pixels, size, interpolation=cv2.INTER_NEAREST)
        return replace(frame, pixels=pixels)
