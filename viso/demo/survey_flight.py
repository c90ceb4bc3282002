# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A whole flight over synthetic ground: standing, climbing, a survey, landing, standing."""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from viso.companion.vio.config import ImuNoise
from viso.companion.vio.types import ImuBias
from viso.companion.world.flight import SyntheticFlight
from viso.companion.world.ground import generate_texture
from viso.companion.world.motion import FlightPath, nadir_survey
from viso.companion.world.texture import GroundTexture
from viso.geometry.rotation import Array

STAND_M: Final = 0.25  # height of the body's origin above ground while it stands
COMPANION_CLOCK_NS: Final = 300_000_000_000
FRAME_LATENCY_S: Final = 0.06  # from the middle of an exposure to the end of the computations
GYRO_BIAS_RAD_S: Final = (0.0008, -0.0012, 0.0006)  # what calibration while standing has left
ACCEL_BIAS_M_S2: Final = (0.06, -0.04, 0.08)
IMU_NOISE: Final = ImuNoise(gyro=5e-4, accel=5e-3)


@dataclass(frozen=True, kw_only=True)
class SurveyPlan:
    """When what is flown; times in s from the beginning.

    Attributes:
        climb_s, cruise_s: when the climb begins, and the survey at its end.
        descent_s, landed_s: when the landing begins, straight down, and when it is over; never unless finite.
        ramp_s: how long it takes to be on the survey's speed, and to stop.
        height_m: of the survey, above ground.
        speed_m_s: of the survey, on average.
        extent_m: of the survey; None for as long as it takes 15 s to fly.
        seed: of its shape.
    """

    climb_s: float
    cruise_s: float
    descent_s: float = math.inf
    landed_s: float = math.inf
    ramp_s: float = 4.0
    height_m: float = 30.0
    speed_m_s: float = 8.0
    extent_m: float | None = None
    seed: int = 0

    def trajectory(self) -> FlightPath:
        """Return the flight."""
        survey = nadir_survey(self.speed_m_s, self.height_m, self.extent_m, self.seed)

        def flown(t_s: Array) -> Array:
            """Return the survey's own time, which begins and ends at rest."""
            begun, ended = t_s - self.cruise_s, t_s - (self.descent_s - self.ramp_s)
            return self.ramp_s * (_risen(begun / self.ramp_s) - _risen(ended / self.ramp_s))

        def up(t_s: Array) -> Array:
            """Return how much of the height has been gained, 0 to 1."""
            climb = _step((t_s - self.climb_s) / (self.cruise_s - self.climb_s))
            if math.isinf(self.landed_s):
                return climb
            return climb - _step((t_s - self.descent_s) / (self.landed_s - self.descent_s))

        def position(t_s: Array) -> Array:
            place = survey.position_w(flown(t_s))
            place[..., 2] = STAND_M + (place[..., 2] - STAND_M) * up(t_s)
            return place

        return FlightPath(
            position, lambda t_s: survey.yaw_rad(flown(t_s)), lambda t_s: survey.lean(flown(t_s)) * up(t_s)[..., None]
        )


def survey_flight(
    plan: SurveyPlan,
    duration_s: float,
    *,
    seed: int = 0,
    texture: GroundTexture | None = None,
    covered_s: tuple[tuple[float, float], ...] = (),
) -> SyntheticFlight:
    """Return what a companion's sensors say about a flight.

    Args:
        duration_s: how long the sensors work.
        seed: of their errors.
        texture: of the ground; generated unless given.
        covered_s: spans of time, from and to, in which the lens is covered.
    """
    return SyntheticFlight(
        seed=seed,
        trajectory=plan.trajectory(),
        texture=texture or generate_texture(),
        duration_s=duration_s,
        start_ns=COMPANION_CLOCK_NS,
        latency_s=FRAME_LATENCY_S,
        covered_s=covered_s,
        imu_noise=IMU_NOISE,
        imu_bias=ImuBias(accel=np.array(ACCEL_BIAS_M_S2), gyro=np.array(GYRO_BIAS_RAD_S)),
    )


def _step(x: Array) -> Array:
    """Return the smooth rise from 0 to 1 whose first three derivatives vanish at both ends."""
    x = np.clip(x, 0.0, 1.0)
    risen: Array = x**4 * (35 + x * (-84 + x * (70 - 20 * x)))
    return risen


def _risen(x: Array) -> Array:
    """Return the integral of the smooth rise from minus infinity."""
    inside = np.clip(x, 0.0, 1.0)
    area: Array = inside**5 * (7 + inside * (-14 + inside * (10 - 2.5 * inside)))
    return area + np.maximum(x - 1.0, 0.0)
