# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A short flight with a small camera, rendered once, and a strategy that is taken along."""

import dataclasses
import logging
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from viso.companion.strategies.klt_ransac import KltRansac
from viso.companion.vio.config import AglSource, Scene, VioConfig
from viso.companion.vio.imu import ImuBuffer
from viso.companion.vio.pipeline import StrategyContext
from viso.companion.vio.result import Lost, Result
from viso.companion.vio.types import (
    CameraCalibration,
    ImuSample,
    NavCameraFrame,
    SensorEvent,
    VioHealth,
    VioOutput,
    WarmStartPose,
)
from viso.companion.world.flight import SyntheticFlight, nadir_calibration
from viso.companion.world.ground import generate_texture
from viso.companion.world.motion import nadir_survey
from viso.companion.world.texture import GroundTexture
from viso.geometry.pose import SE3

PERIOD_NS = 200_000_000
PLANAR: dict[str, Any] = {"scene": Scene.PLANAR, "agl_source": AglSource.RANGEFINDER, "max_features": 100}


@lru_cache(maxsize=1)
def texture() -> GroundTexture:
    return generate_texture(size_px=512, metres_per_pixel=0.15)


@dataclass(frozen=True, eq=False)
class Recorded:
    """What the sensors told on a flight; changing it is replacing its ``data``."""

    flight: SyntheticFlight
    data: tuple[SensorEvent, ...]

    @property
    def calibration(self) -> CameraCalibration:
        return self.flight.calibration

    def events(self) -> Iterator[SensorEvent]:
        return iter(self.data)

    def truth(self, t_ns: int) -> SE3:
        return self.flight.truth(t_ns)

    def warm_start(self, t_ns: int | None = None) -> WarmStartPose:
        return self.flight.warm_start(t_ns)

    def changed(self, change: Callable[[SensorEvent], SensorEvent | None]) -> "Recorded":
        """Return the flight with some data changed, or left out where the change is None."""
        return dataclasses.replace(self, data=tuple(new for event in self.data if (new := change(event)) is not None))


def record(**options: Any) -> Recorded:
    """Return 6 s at 5 m/s and 20 m above ground, unless told otherwise: 5 frames of 320x240 a second."""
    fields: dict[str, Any] = {
        "trajectory": nadir_survey(5.0, 20.0, seed=1),
        "texture": texture(),
        "calibration": nadir_calibration(320, 240, 250.0),
        "duration_s": 6.0,
        "frame_rate_hz": 5.0,
    }
    flight = SyntheticFlight(**(fields | options))
    return Recorded(flight, tuple(flight.events()))


@lru_cache(maxsize=1)
def survey() -> Recorded:
    return record()


class Aboard:
    """A strategy on a flight.

    Attributes:
        strategy: it.
        outputs: of each frame, None where there was none.
        healths: after each frame.
        result: of the last frame.
        fatal: the reasons of the frames in LOST.
    """

    def __init__(self, recorded: Recorded, warm_start: WarmStartPose | None = None, **config: Any) -> None:
        context = StrategyContext(
            VioConfig(**(PLANAR | config)), recorded.calibration, lambda: 0, logging.Logger("vio")
        )
        self.strategy = KltRansac(context)
        if warm_start is not None:
            self.strategy.reset(warm_start)
        self.outputs: list[VioOutput | None] = []
        self.healths: list[VioHealth] = []
        self.result: Result
        self.fatal: list[str] = []
        self._recorded = recorded
        self._events = recorded.events()
        self._buffer = ImuBuffer(wait=lambda *_: None)
        self._offset_ns = round(recorded.calibration.time_offset_s * 1e9)
        self._last_ns: int | None = None

    def fly(self, frames: int | None = None, each: Callable[[], object] = lambda: None) -> "Aboard":
        """Give the strategy data, from where it is up to a number of frames since the start, or all."""
        for event in self._events:
            if isinstance(event, ImuSample):
                self._buffer.add(event)
            elif isinstance(event, NavCameraFrame):
                self.see(event)
                each()
                if len(self.outputs) == frames:
                    break
            else:
                self.strategy.add_height(event.t_ns, event.height_m, event.sigma_m)
        return self

    def see(self, frame: NavCameraFrame) -> None:
        t_ns = frame.capture_timestamp + self._offset_ns
        window = self._buffer.window(t_ns if self._last_ns is None else self._last_ns, t_ns)
        self._last_ns = t_ns
        self.result = self.strategy.process(frame, window)
        if isinstance(self.result, Lost):
            self.fatal.append(self.result.reason)
        self.outputs.append(self.result.output)
        self.healths.append(self.strategy.health.snapshot())

    def start_again(self) -> None:
        """Warm start the strategy with the state at its next frame, for which that is then the first one."""
        assert self._last_ns is not None
        self.strategy.reset(self._recorded.warm_start(self._last_ns + PERIOD_NS))
        self._last_ns = None

    def error_m(self) -> float:
        """Return how far the last output is from the truth."""
        assert self._last_ns is not None
        return float(np.linalg.norm(self.last().world_T_body.t - self._recorded.truth(self._last_ns).t))

    def reasons(self) -> list[str]:
        return [health.reason for health in self.healths]

    def last(self) -> VioOutput:
        output = self.outputs[-1]
        assert output is not None
        return output


def aboard(recorded: Recorded, **config: Any) -> Aboard:
    """Return a strategy that was warm started and has flown all of a flight."""
    return Aboard(recorded, recorded.warm_start(), **config).fly()


@lru_cache(maxsize=1)
def flown_survey() -> Aboard:
    """Return a strategy that has flown all of the survey, for tests that only look at it."""
    return aboard(survey())


def begun(frames: int, recorded: Recorded | None = None, **config: Any) -> Aboard:
    """Return a strategy that was warm started and has flown a part of the survey, or of another flight."""
    recorded = recorded or survey()
    return Aboard(recorded, recorded.warm_start(), **config).fly(frames)
