# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The scenes that strategies are compared in: rendered flights, each hard in its own way."""

import dataclasses
import functools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final, cast

import cv2
import numpy as np

from tests.acceptance.trial import Trial, run_trial
from tests.flights import hover, room_tour
from tests.scenery import Hills, Room
from viso.companion.vio.config import AglSource, EngineConfig, Scene, VioConfig
from viso.companion.vio.frames import MOUNTINGS
from viso.companion.vio.types import CameraCalibration, NavCameraFrame, Pixels, SensorEvent
from viso.companion.world.flight import SyntheticFlight, nadir_calibration
from viso.companion.world.ground import generate_texture
from viso.companion.world.motion import nadir_survey
from viso.companion.world.texture import GroundTexture, to_pixels
from viso.geometry.pose import SE3
from viso.geometry.rotation import so3_exp

Flights = Callable[[int], SyntheticFlight]
"""Returns the flight of a seed."""

PLANAR: Final = VioConfig(scene=Scene.PLANAR, agl_source=AglSource.RANGEFINDER)
GENERAL: Final = VioConfig()
AHEAD_B_T_C: Final = SE3(MOUNTINGS["forward"], np.array([0.1, 0.0, -0.05]))
CONTRAST: Final = 0.1
EXPOSURE: Final = 0.35
FOCAL: Final = 1.01
EXTRINSICS_RAD: Final = math.radians(1.0)
CLOCK_S: Final = 0.01
PATIENCE_S: Final = 30.0  # the machine may be busy; how fast an engine is does not count here


@dataclass(frozen=True, slots=True)
class Altered:
    """A flight of which a strategy is told less than the truth.

    Attributes:
        flight: the flight.
        calibration: what the strategy believes.
        seed: of the exposures.
        exposure: by what share, up or down, each picture is lighter or darker than it should be; 0 for not at all.
        clock_s: by how much the stamps of the pictures are late.
    """

    flight: SyntheticFlight
    calibration: CameraCalibration
    seed: int = 0
    exposure: float = 0.0
    clock_s: float = 0.0

    def events(self) -> Iterator[SensorEvent]:
        """Yield what the sensors tell."""
        rng = np.random.default_rng([self.seed, 11])
        for event in self.flight.events():
            if not isinstance(event, NavCameraFrame):
                yield event
                continue
            pixels = _exposed(event.pixels, 1 + self.exposure * rng.uniform(-1, 1)) if self.exposure else event.pixels
            stamp_ns = event.capture_timestamp + round(self.clock_s * 1e9)
            yield dataclasses.replace(event, pixels=pixels, capture_timestamp=stamp_ns)


@dataclass(frozen=True, slots=True)
class ScenePlan:
    """A scene.

    Attributes:
        name: in the table.
        what: it is, in a few words.
        flight: of a seed.
        config: of the strategy.
        alter: what the strategy is given of a flight, with its seed.
    """

    name: str
    what: str
    flight: Flights
    config: VioConfig = GENERAL
    alter: Callable[[SyntheticFlight, int], Altered] = lambda flight, seed: Altered(flight, flight.calibration)

    def fly(self, strategy: str, seed: int, command: str = "") -> Trial:
        """Return how a strategy does; an engine by the program that a command starts, which may take its time."""
        flight = self.flight(seed)
        told = self.alter(flight, seed)
        told = dataclasses.replace(
            told, calibration=dataclasses.replace(told.calibration, imu_rate_hz=float(flight.imu_rate_hz))
        )
        engine = EngineConfig(command, frame_timeout_s=PATIENCE_S)
        config = dataclasses.replace(self.config, strategy=strategy, engine=engine)
        return run_trial(told, config, flight.warm_start(), truth=flight.truth)


@functools.cache
def _texture() -> GroundTexture:
    return generate_texture()


@functools.cache
def _pale() -> GroundTexture:
    ground = _texture()
    return dataclasses.replace(ground, pixels=_faded(ground.pixels), detail=_faded(ground.detail))


def _faded(pixels: Pixels) -> Pixels:
    return to_pixels(128 + np.float32(CONTRAST) * (pixels.astype(np.float32) - 128))


def _exposed(pixels: Pixels, gain: float) -> Pixels:
    return cast(Pixels, cv2.convertScaleAbs(pixels, alpha=gain))


def _survey(
    speed_m_s: float = 8.0, height_m: float = 40.0, duration_s: float = 40.0, rate_hz: float = 10 / 3
) -> Flights:
    return lambda seed: SyntheticFlight(
        seed=seed,
        trajectory=nadir_survey(speed_m_s, height_m, seed=seed),
        texture=_texture(),
        duration_s=duration_s,
        frame_rate_hz=rate_hz,
    )


def _low_contrast(seed: int) -> SyntheticFlight:
    return dataclasses.replace(_survey()(seed), texture=_pale())


def _spin(seed: int) -> SyntheticFlight:
    flight = _survey()(seed)
    yaw_rad = flight.trajectory.yaw_rad
    trajectory = dataclasses.replace(flight.trajectory, yaw_rad=lambda t_s: yaw_rad(t_s) + t_s)
    return dataclasses.replace(flight, trajectory=trajectory)


def _hills(seed: int) -> SyntheticFlight:
    return dataclasses.replace(_survey()(seed), place=Hills(seed=seed))


def _hover(seed: int) -> SyntheticFlight:
    return SyntheticFlight(
        seed=seed,
        trajectory=hover(seed=seed),
        texture=_texture(),
        duration_s=30.0,
        frame_rate_hz=10.0,
        height_sigma_m=None,
    )


def _room(seed: int) -> SyntheticFlight:
    return SyntheticFlight(
        seed=seed,
        trajectory=room_tour(seed=seed),
        texture=_texture(),
        place=Room(),
        calibration=dataclasses.replace(nadir_calibration(), B_T_C=AHEAD_B_T_C),
        duration_s=25.0,
        frame_rate_hz=10.0,
        height_sigma_m=None,
    )


def _wrong_focal(flight: SyntheticFlight, seed: int) -> Altered:
    true = flight.calibration
    return Altered(flight, dataclasses.replace(true, fx=FOCAL * true.fx, fy=FOCAL * true.fy))


def _wrong_extrinsics(flight: SyntheticFlight, seed: int) -> Altered:
    true, axis = flight.calibration.B_T_C, np.random.default_rng([seed, 12]).normal(size=3)
    turned = SE3(true.R @ so3_exp(EXTRINSICS_RAD * axis / np.linalg.norm(axis)), true.t)
    return Altered(flight, dataclasses.replace(flight.calibration, B_T_C=turned))


SCENES: Final = (
    ScenePlan("survey", "8 m/s at 40 m, 3.3 Hz, height", _survey(), PLANAR),
    ScenePlan("fast", "30 m/s at 60 m, 10 Hz, height", _survey(30.0, 60.0, 20.0, 10.0), PLANAR),
    ScenePlan("high", "20 m/s at 300 m, 3.3 Hz, height", _survey(20.0, 300.0), PLANAR),
    ScenePlan("low contrast", "survey, a tenth of its contrast", _low_contrast, PLANAR),
    ScenePlan("spin", "survey, turning at 1 rad/s", _spin, PLANAR),
    ScenePlan("hills", "survey over hills of 8 m, said to be a plane", _hills, PLANAR),
    ScenePlan("hover", "30 s at 40 m, 10 Hz, no height", _hover),
    ScenePlan("room", "1.2 m/s, 10 Hz, no height", _room),
    ScenePlan(
        "flicker",
        "room, exposures of +-35 %",
        _room,
        alter=lambda flight, seed: Altered(flight, flight.calibration, seed, exposure=EXPOSURE),
    ),
    ScenePlan("focal length", "room, 1 % wrong", _room, alter=_wrong_focal),
    ScenePlan("extrinsics", "room, 1 degree wrong", _room, alter=_wrong_extrinsics),
    ScenePlan(
        "clock",
        "room, pictures stamped 10 ms late",
        _room,
        alter=lambda flight, seed: Altered(flight, flight.calibration, clock_s=CLOCK_S),
    ),
)
