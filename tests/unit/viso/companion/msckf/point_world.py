# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A world of points without pictures: what a perfect front end would see on a flight over them, and the truth."""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from viso.companion.klt.front_end import Sighting
from viso.companion.klt.outliers import Model
from viso.companion.msckf.window_filter import WindowFilter, default_cov, invariant_cov
from viso.companion.vio.config import ImuNoise
from viso.companion.vio.frames import MOUNTINGS
from viso.companion.vio.imu import ImuSteps
from viso.companion.vio.types import ImuBias, ImuSample, ImuWindow
from viso.companion.world.flight import SimulatedImu, default_bias
from viso.companion.world.motion import FlightPath, nadir_survey
from viso.geometry.pose import SE3
from viso.geometry.rotation import Array, so3_exp

B_T_C = SE3(MOUNTINGS["nadir"], np.array([0.1, 0.0, -0.05]))
HALF_WIDTH, HALF_HEIGHT = 0.64, 0.48
SIGMA = 1e-3  # half a pixel at a focal length of 500
NOISE = ImuNoise()
_IMU_PERIOD_NS = 5_000_000


def sighting_of(ids: Any, normalised: Any, model: Model | None = Model.HOMOGRAPHY) -> Sighting:
    """Return a sighting of points; all are inliers."""
    ids, normalised = np.array(ids, np.int64), np.array(normalised, np.float64).reshape(-1, 2)
    count = len(ids)
    return Sighting(ids, normalised, count, 0, 0, count, model, 5.0, 1.0)


def filter_at(
    pose: SE3, velocity_w: Array, *, sigmas: tuple[float, ...] = (0.01, 0.01, 0.1, 0.02, 0.15), noise: ImuNoise = NOISE
) -> WindowFilter:
    """Return a filter at a state, with sigmas of tilt, yaw, velocity, gyro bias and accelerometer bias."""
    tilt, yaw, velocity, gyro, accel = sigmas
    cov = default_cov(tilt, yaw, velocity, gyro, accel, pose.R)
    cov = invariant_cov(cov, pose.R, pose.t, velocity_w)
    return WindowFilter(noise, pose.R, pose.t, velocity_w, ImuBias.zero(), cov)


def disturbed(state: WindowFilter, rng: np.random.Generator) -> WindowFilter:
    """Return a filter whose state has the errors that its covariance admits."""
    error = rng.multivariate_normal(np.zeros(15), state.cov, method="eigh")
    turn = so3_exp(error[:3])
    return WindowFilter(
        NOISE,
        turn @ state.R,
        turn @ state.p + error[3:6],
        turn @ state.v + error[6:9],
        ImuBias(state.accel_bias + error[12:], state.gyro_bias + error[9:12]),
        state.cov,
    )


def steps_of_samples(samples: list[ImuSample]) -> ImuSteps:
    pairs = list(itertools.pairwise(samples))
    return ImuSteps(
        np.array([(b.t_ns - a.t_ns) * 1e-9 for a, b in pairs]),
        np.array([0.5 * (a.gyro + b.gyro) for a, b in pairs]).reshape(-1, 3),
        np.array([0.5 * (a.accel + b.accel) for a, b in pairs]).reshape(-1, 3),
    )


@dataclass(frozen=True, eq=False)
class Moment:
    """A frame and the truth.

    Attributes:
        number: from 1.
        window: the inertial data since the frame before; of no length for the first one.
        sighting: what the camera sees.
        pose: world_T_body.
        velocity_w: in m/s.
    """

    number: int
    window: ImuWindow
    sighting: Sighting
    pose: SE3
    velocity_w: Array


class PointWorld:
    """A flight over points on and around a plane at z = 0.

    Args:
        seed: of all noise, and the points.
        trajectory: the flight.
        period_ms: of the camera, a multiple of 5 ms.
        spacing_m: of the points.
        relief_m: by which points are above or below the plane, at most.
    """

    def __init__(
        self,
        seed: int = 0,
        trajectory: FlightPath | None = None,
        period_ms: int = 100,
        spacing_m: float = 5.0,
        relief_m: float = 0.0,
    ) -> None:
        self.trajectory = trajectory or nadir_survey(8.0, 40.0, seed=seed)
        self._period_ns = period_ms * 1_000_000
        self._spacing_m, self._relief_m = spacing_m, relief_m
        self._seed = seed
        self._rng = np.random.default_rng(seed)

    def start(self) -> tuple[SE3, Array]:
        """Return the pose and the velocity at the first frame."""
        return self.trajectory.pose(0.0), self.trajectory.velocity_w(0.0)

    def moments(self, count: int) -> Iterator[Moment]:
        """Yield the first frames."""
        imu = SimulatedImu(self.trajectory, NOISE, default_bias(), 200, self._seed)
        readings = (sample for sample, _ in imu.readings())
        samples = [next(readings)]
        for number in range(1, count + 1):
            t_ns = (number - 1) * self._period_ns
            while samples[-1].t_ns < t_ns:
                samples.append(next(readings))
            window = ImuWindow(samples[0].t_ns, t_ns, tuple(samples))
            samples = samples[-1:]
            pose = self.trajectory.pose(t_ns * 1e-9)
            yield Moment(number, window, self._seen_from(pose), pose, self.trajectory.velocity_w(t_ns * 1e-9))

    def _seen_from(self, pose: SE3) -> Sighting:
        world_T_camera = pose @ B_T_C
        reach = world_T_camera.t[2]
        low = np.floor((world_T_camera.t[:2] - reach) / self._spacing_m).astype(int)
        high = np.ceil((world_T_camera.t[:2] + reach) / self._spacing_m).astype(int)
        column, row = (grid.ravel() for grid in np.meshgrid(np.arange(low[0], high[0]), np.arange(low[1], high[1])))
        ids = (column + 100_000) * 1_000_000 + row + 100_000
        # As scattered as a hash is.
        scatter = np.modf(np.abs(np.sin(ids[:, None] * np.array([1.0, 1.7, 2.3])) * 1e4))[0]
        points = np.stack([column, row, np.zeros_like(row)], axis=1) * self._spacing_m
        points = points + scatter * [self._spacing_m, self._spacing_m, 0] + (scatter - 0.5) * [0, 0, 2 * self._relief_m]
        local = world_T_camera.inverse().map(points)
        normalised = local[:, :2] / local[:, 2:]
        inside = (np.abs(normalised) < [HALF_WIDTH, HALF_HEIGHT]).all(axis=1) & (local[:, 2] > 0)
        noise = self._rng.normal(0, SIGMA, (int(inside.sum()), 2))
        return sighting_of(ids[inside], normalised[inside] + noise)
