# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The only use of gtsam: a graph of poses, velocities, biases and landmarks, solved over the last seconds.

It is the incremental smoother of Kaess et al., iSAM2, 2012, without what is older than the lag: that is marginalised.
gtsam's poses err by right perturbations, rotation first, as ours do; its biases have the accelerometer first.
"""

import contextlib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from viso.companion.vio.config import ImuNoise
from viso.companion.vio.frames import GRAVITY_MSS
from viso.companion.vio.imu import steps_between
from viso.companion.vio.types import ImuBias, ImuSample
from viso.extras import pip_install
from viso.geometry.pose import SE3
from viso.geometry.rotation import Array

try:
    import gtsam
    from gtsam.symbol_shorthand import B, L, V, X
except ImportError as error:
    raise ImportError(f"gtsam is missing; install it with: {pip_install('gtsam')}") from error

LAG_S: Final = 3.0
STILL_VELOCITY_SIGMA_M_S: Final = 0.02
LANDMARK_SIGMA_M: Final = 20.0  # largest distance of a landmark from its expected position
MOTION: Final = 15
_HUBER: Final = 1.345  # sigmas up to which an error counts in full
_RELINEARIZE: Final = 0.01  # m, rad, m/s: about a pixel near by
_ANYWHERE_M: Final = 1e4
_TINY_M2_S: Final = 1e-20  # integrating adds no error of its own
_NORMALISED: Final = gtsam.Cal3_S2(1.0, 1.0, 0.0, 0.0, 0.0)


class SmootherError(Exception):
    """The equations could not be solved; the smoother is unusable from now on."""


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """The motion of the body.

    Attributes:
        pose: world_T_body.
        velocity_w: [3] in m/s, in the world.
    """

    pose: SE3
    velocity_w: Array
    bias: ImuBias


@dataclass(frozen=True, slots=True, eq=False)
class LandmarkSighting:
    """A sighting of a landmark.

    Attributes:
        number: of the node that it was seen from.
        normalised: [2], undistorted.
    """

    number: int
    landmark: int
    normalised: Array


class LagSmoother:
    """A smoother over the last seconds.

    Nodes have rising numbers; each has a motion. What is added takes effect with :meth:`solve`.

    Args:
        number, t_s: of the first node.
        motion: there.
        cov: [15, 15], positive, of its pose (right perturbation), velocity (world), accelerometer bias and gyro bias.

    Raises:
        SmootherError: as all methods do, when gtsam cannot do it.
    """

    def __init__(self, B_T_C: SE3, number: int, t_s: float, motion: Motion, cov: Array) -> None:
        self._B_T_C = gtsam.Pose3(B_T_C.matrix())
        params = gtsam.ISAM2Params()
        params.setRelinearizeThreshold(_RELINEARIZE)
        params.relinearizeSkip = 1
        params.findUnusedFactorSlots = True  # otherwise their list grows without limit
        params.setFactorization("QR")  # a bias that hardly walks is too stiff for Cholesky's
        self._smoother = gtsam.IncrementalFixedLagSmoother(LAG_S, params)
        self._clear()
        self._expect(number, t_s, motion)
        whitener = np.linalg.inv(np.linalg.cholesky(cov))
        pose, velocity, bias = whitener[:, :6], whitener[:, 6:9], whitener[:, 9:]
        unit = gtsam.noiseModel.Unit.Create(MOTION)
        prior = gtsam.JacobianFactor(X(number), pose, V(number), velocity, B(number), bias, np.zeros(MOTION), unit)
        self._graph.add(gtsam.LinearContainerFactor(prior, self._values))

    def add_node(self, number: int, t_s: float, motion: Motion, since: Any) -> None:
        """Add a node after the last one.

        Args:
            since: the motion from the last node to this one, as :func:`preintegrated` has it.
        """
        last = self._last
        self._expect(number, t_s, motion)
        keys = X(last), V(last), X(number), V(number), B(last), B(number)
        self._graph.add(gtsam.GalileanCombinedImuFactor(*keys, since))

    def add_stillness(self) -> None:
        """Add that the body does not move at the last node."""
        noise = gtsam.noiseModel.Isotropic.Sigma(3, STILL_VELOCITY_SIGMA_M_S)
        self._graph.add(gtsam.PriorFactorVector(V(self._last), np.zeros(3), noise))

    def add_height(self, up_m: float, sigma_m: float) -> None:
        """Add a height of the body in the world at the last node."""
        east_m, north_m, _ = self._values.atPose3(X(self._last)).translation()
        noise = _robust(gtsam.noiseModel.Diagonal.Sigmas(np.array([_ANYWHERE_M, _ANYWHERE_M, sigma_m])))
        self._graph.add(gtsam.GPSFactor(X(self._last), np.array([east_m, north_m, up_m]), noise))

    def add_landmark(self, landmark: int, position: Array) -> None:
        """Add a landmark, to be seen at least once before the next solution.

        Args:
            landmark: its number; never used before.
            position: [3] in the world, as expected.
        """
        self._values.insert(L(landmark), position)
        noise = gtsam.noiseModel.Isotropic.Sigma(3, LANDMARK_SIGMA_M)
        self._graph.add(gtsam.PriorFactorPoint3(L(landmark), position, noise))

    def add_sightings(self, sightings: Iterable[LandmarkSighting], sigma: float) -> None:
        """Add sightings of landmarks.

        Args:
            sightings: of landmarks, from nodes that are not older than the lag.
            sigma: of a normalised coordinate.
        """
        noise = _robust(gtsam.noiseModel.Isotropic.Sigma(2, sigma))
        for sighting in sightings:
            keys = X(sighting.number), L(sighting.landmark)
            self._graph.add(
                gtsam.GenericProjectionFactorCal3_S2(sighting.normalised, noise, *keys, _NORMALISED, self._B_T_C)
            )
            self._stamps[L(sighting.landmark)] = self._t_s  # a landmark older than the lag takes no more factors

    def solve(self, passes: int = 1, keep: Iterable[int] = ()) -> None:
        """Solve with all added factors, and remove nodes older than the lag.

        Args:
            passes: largest number of relinearisations.
            keep: nodes whose poses are kept for another lag.
        """
        self._stamps |= {X(number): self._t_s for number in keep}
        with _solvable():
            self._smoother.update(self._graph, self._values, self._stamps)
            self._clear()
            for _ in range(passes - 1):
                self._smoother.update()
            self._estimate = self._smoother.calculateEstimate()

    def pose(self, number: int) -> SE3:
        """Return world_T_body at a node."""
        with _solvable():
            pose = self._estimate.atPose3(X(number))
            return SE3(pose.rotation().matrix(), pose.translation())

    def motion(self) -> Motion:
        """Return the motion at the last node."""
        with _solvable():
            bias = self._estimate.atConstantBias(B(self._last))
            velocity_w = self._estimate.atVector(V(self._last))
            return Motion(self.pose(self._last), velocity_w, ImuBias(bias.accelerometer(), bias.gyroscope()))

    def points(self, landmarks: Iterable[int]) -> Array:
        """Return the positions of landmarks in the world, [N, 3]."""
        with _solvable():
            return np.array([self._estimate.atPoint3(L(landmark)) for landmark in landmarks]).reshape(-1, 3)

    def joint_cov(self, *numbers: int) -> Array:
        """Return the covariance of the motion at the last node, as for the first, and of the poses at other nodes."""
        last = self._last
        keys = [X(last), V(last), B(last), *map(X, numbers)]
        with _solvable():
            joint = self._smoother.getISAM2().jointMarginalCovariance(keys)
            return np.block([[joint.at(row, column) for column in keys] for row in keys])

    def _expect(self, number: int, t_s: float, motion: Motion) -> None:
        self._last, self._t_s = number, t_s
        self._values.insert(X(number), gtsam.Pose3(motion.pose.matrix()))
        self._values.insert(V(number), motion.velocity_w)
        self._values.insert(B(number), gtsam.imuBias.ConstantBias(motion.bias.accel, motion.bias.gyro))
        self._stamps |= dict.fromkeys((X(number), V(number), B(number)), t_s)

    def _clear(self) -> None:
        self._graph: Any = gtsam.NonlinearFactorGraph()
        self._values: Any = gtsam.Values()
        self._stamps: dict[Any, Any] = {}  # s, by key


def preintegrated(samples: Sequence[ImuSample], noise: ImuNoise, bias: ImuBias) -> Any:
    """Return the motion from the first sample to the last for a ``gtsam.GalileanCombinedImuFactor``.

    It is that class because it integrates as :func:`~viso.companion.vio.preintegration.preintegrate` does. The older
    ``gtsam.PreintegratedCombinedMeasurements`` takes the acceleration at the attitude that a step begins with: 0.02 m/s
    off after a second of turning at 1.5 rad/s.
    """
    params, unit = gtsam.PreintegrationCombinedParams.MakeSharedU(GRAVITY_MSS), np.eye(3)
    params.setGyroscopeCovariance(noise.gyro**2 * unit)
    params.setAccelerometerCovariance(noise.accel**2 * unit)
    params.setIntegrationCovariance(_TINY_M2_S * unit)
    params.setBiasOmegaCovariance(noise.gyro_walk**2 * unit)
    params.setBiasAccCovariance(noise.accel_walk**2 * unit)
    motion = gtsam.PreintegratedCombinedMeasurementsG(params, gtsam.imuBias.ConstantBias(bias.accel, bias.gyro))
    steps = steps_between(samples)
    for dt_s, gyro, accel in zip(steps.dt_s.tolist(), steps.gyro, steps.accel, strict=True):
        motion.integrateMeasurement(accel, gyro, dt_s)
    return motion


def _robust(noise: Any) -> Any:
    return gtsam.noiseModel.Robust.Create(gtsam.noiseModel.mEstimator.Huber.Create(_HUBER), noise)


@contextlib.contextmanager
def _solvable() -> Iterator[None]:
    # gtsam's own classes of errors do not reach Python; a ValueError may be ours, about what is not finite.
    try:
        yield
    except (RuntimeError, ValueError, IndexError) as error:
        raise SmootherError(str(error).strip().partition("\n")[0]) from error
