# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The baseline strategy on a flight that does not end."""

import logging
from dataclasses import replace
from typing import Any

import cv2

from viso.companion.strategies.klt_ransac import KltRansac
from viso.companion.vio.calibration import scaled
from viso.companion.vio.config import AglSource, Scene, VioConfig
from viso.companion.vio.imu import ImuBuffer
from viso.companion.vio.pipeline import StrategyContext
from viso.companion.vio.types import HeightMeasurement, ImuSample, NavCameraFrame
from viso.companion.world.flight import SyntheticFlight, nadir_calibration
from viso.companion.world.texture import GroundTexture

HOUR_S = 3600.0
FOCAL_SHARE = 500 / 640


class FlownStrategy:
    """The baseline and its pictures, which are rendered smaller where an enlargement says so."""

    def __init__(self, texture: GroundTexture, width: int, height: int, enlargement: int) -> None:
        self._calibration, self._enlargement = nadir_calibration(width, height, FOCAL_SHARE * width), enlargement
        rendered = scaled(self._calibration, enlargement)
        flight = SyntheticFlight(texture=texture, calibration=rendered, duration_s=HOUR_S)
        self._events, self._imu = flight.events(), ImuBuffer()
        self._last_ns: int | None = None
        config = VioConfig(scene=Scene.PLANAR, agl_source=AglSource.RANGEFINDER)
        context = StrategyContext(config, self._calibration, lambda: 0, logging.getLogger(__name__))
        self.strategy = KltRansac(context)
        self.strategy.reset(flight.warm_start())

    def run(self) -> None:
        """Process the next frame."""
        while not isinstance(event := next(self._events), NavCameraFrame):
            if isinstance(event, ImuSample):
                self._imu.add(event)
            elif isinstance(event, HeightMeasurement):
                self.strategy.add_height(event.t_ns, event.height_m, event.sigma_m)
        stamp_ns = event.capture_timestamp
        window = self._imu.window(stamp_ns if self._last_ns is None else self._last_ns, stamp_ns, 0.0)
        self._last_ns = stamp_ns
        self.strategy.process(self._enlarged(event), window)

    def _enlarged(self, frame: NavCameraFrame) -> NavCameraFrame:
        if self._enlargement == 1:
            return frame
        pixels: Any = cv2.cvtColor(frame.pixels, cv2.COLOR_GRAY2BGR)
        size = self._calibration.width, self._calibration.height
        return replace(frame, pixels=cv2.resize(pixels, size, interpolation=cv2.INTER_NEAREST))
