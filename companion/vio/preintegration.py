# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The motion between two instants from inertial data alone, independent of where it began.

Between two samples the mean of both is taken to hold in the body, and that is integrated exactly: with ``phi`` the
rotation vector of the step, the velocity grows by ``R G1(phi) a dt`` and the position by ``v dt + R G2(phi) a dt^2``,
where ``G1`` and ``G2`` are the first and the second integral of ``Exp(s phi)`` over s from 0 to 1 (Hartley et al.,
Contact-Aided Invariant Extended Kalman Filtering, 2020). The propagation of errors follows Forster et al., On-Manifold
Preintegration for Real-Time Visual-Inertial Odometry, 2017.
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from companion.vio.frames import GRAVITY_MSS
from companion.vio.imu_noise import ImuNoise
from companion.vio.imu_window import ImuSteps, steps_between
from companion.vio.se3 import Array, read_only, right_jacobian, skew, so3_exp
from companion.vio.types import ImuBias, ImuSample

if TYPE_CHECKING:
    import gtsam

_IDENTITY: Final = np.eye(3)
_TINY_M2_S: Final = 1e-20  # integrating adds no error of its own


@dataclass(frozen=True, slots=True, eq=False)
class PreintegratedDelta:
    """The motion from the first to the last sample, gravity left in.

    With ``(R, v, p)`` the body's attitude, velocity (m/s) and position (m) in a world with the gravity vector ``g``:
    ``R_j = R_i dR``, ``v_j = v_i + g T + R_i dv``, ``p_j = p_i + v_i T + g T^2 / 2 + R_i dp``.

    Attributes:
        dt_s: the time T between the two in s.
        dR: rotation [3, 3].
        dv: [3] in m/s, in the body at the first sample.
        dp: [3] in m, in the body at the first sample.
        cov: [9, 9] from the white noise of the samples, in the order (rotation, dv, dp); the rotation's error is a
            right perturbation ``dR Exp(e)``. The walk of the bias is not in it.
        jac_bias: [9, 6], derivative of (rotation, dv, dp) with respect to the bias, (gyro, accel).
    """

    dt_s: float
    dR: Array
    dv: Array
    dp: Array
    cov: Array
    jac_bias: Array

    def __post_init__(self) -> None:
        for field, shape in (("dR", (3, 3)), ("dv", (3,)), ("dp", (3,)), ("cov", (9, 9)), ("jac_bias", (9, 6))):
            object.__setattr__(self, field, read_only(getattr(self, field), shape, field))


class ImuPreintegrator:
    """Collects samples; what :meth:`delta` and :meth:`as_gtsam` return goes from the first one to the last."""

    def __init__(self, noise: ImuNoise, bias: ImuBias) -> None:
        """Begin with no sample.

        Args:
            noise: of the IMU.
            bias: taken off every sample.
        """
        self._noise = noise
        self.reset(bias)

    def reset(self, bias: ImuBias) -> None:
        """Forget all samples, and take off this bias from now on."""
        self._bias = bias
        self._samples: list[ImuSample] = []

    def add(self, sample: ImuSample) -> None:
        """Go on to a sample; the first one only starts the time.

        Raises:
            ValueError: if it is not later than the last one.
        """
        if self._samples and sample.t_ns <= self._samples[-1].t_ns:
            raise ValueError("t_ns: not later than the last sample's")
        self._samples.append(sample)

    def delta(self) -> PreintegratedDelta:
        """Return the motion so far, computed anew; none, and certainly so, before the second sample."""
        return preintegrate(steps_between(self._samples), self._noise, self._bias)

    def as_gtsam(self, gravity_mss: float = GRAVITY_MSS) -> "gtsam.PreintegratedCombinedMeasurementsG":
        """Return the same motion for a ``gtsam.GalileanCombinedImuFactor``.

        It is that class because it integrates as we do. The older ``gtsam.PreintegratedCombinedMeasurements`` takes the
        acceleration at the attitude that a step begins with: 0.02 m/s off after a second of turning at 1.5 rad/s.

        Args:
            gravity_mss: magnitude of gravity in m/s^2; the world's z points up.

        Raises:
            ImportError: if gtsam is not installed.
        """
        try:
            import gtsam
        except ImportError as error:
            raise ImportError("gtsam is missing; install it with: pip install 'viso[gtsam]'") from error
        noise, params = self._noise, gtsam.PreintegrationCombinedParams.MakeSharedU(gravity_mss)
        params.setGyroscopeCovariance(noise.gyro**2 * _IDENTITY)
        params.setAccelerometerCovariance(noise.accel**2 * _IDENTITY)
        params.setIntegrationCovariance(_TINY_M2_S * _IDENTITY)
        params.setBiasOmegaCovariance(noise.gyro_walk**2 * _IDENTITY)
        params.setBiasAccCovariance(noise.accel_walk**2 * _IDENTITY)
        bias = gtsam.imuBias.ConstantBias(self._bias.accel, self._bias.gyro)
        measurements = gtsam.PreintegratedCombinedMeasurementsG(params, bias)
        steps = steps_between(self._samples)
        for dt_s, gyro, accel in zip(steps.dt_s.tolist(), steps.gyro, steps.accel, strict=True):
            measurements.integrateMeasurement(accel, gyro, dt_s)
        return measurements


def preintegrate(steps: ImuSteps, noise: ImuNoise, bias: ImuBias) -> PreintegratedDelta:
    """Return the motion over consecutive steps, the bias taken off."""
    rotation, velocity, position = _IDENTITY, np.zeros(3), np.zeros(3)
    cov, jac_bias = np.zeros((9, 9)), np.zeros((9, 6))
    density = np.repeat([noise.gyro**2, noise.accel**2], 3)
    measured = zip(steps.dt_s.tolist(), steps.gyro - bias.gyro, steps.accel - bias.accel, strict=True)
    for dt_s, gyro, accel in measured:
        phi = gyro * dt_s
        turn, first, second = so3_exp(phi), right_jacobian(-phi) * dt_s, _second_integral(phi) * dt_s**2
        transition = _transition(turn, rotation, first.dot(accel), second.dot(accel), dt_s)
        inputs = _inputs(phi, rotation, first, second, accel, dt_s)
        cov = transition.dot(cov).dot(transition.T) + (inputs * (density / dt_s)).dot(inputs.T)
        jac_bias = transition.dot(jac_bias) - inputs
        position = position + velocity * dt_s + rotation.dot(second.dot(accel))
        velocity = velocity + rotation.dot(first.dot(accel))
        rotation = rotation.dot(turn)
    return PreintegratedDelta(float(steps.dt_s.sum()), rotation, velocity, position, cov, jac_bias)


def _transition(turn: Array, rotation: Array, gained_v: Array, gained_p: Array, dt_s: float) -> Array:
    """Return what a step makes of the error [9] before it; the gains are in the body."""
    transition = np.eye(9)
    transition[:3, :3] = turn.T
    transition[3:6, :3], transition[6:, :3] = -rotation.dot(skew(gained_v)), -rotation.dot(skew(gained_p))
    transition[6:, 3:6] = dt_s * _IDENTITY
    return transition


def _inputs(phi: Array, rotation: Array, first: Array, second: Array, accel: Array, dt_s: float) -> Array:
    """Return what a step makes of an error [6] of the rate and the specific force during it."""
    inputs = np.zeros((9, 6))
    inputs[:3, :3] = right_jacobian(phi) * dt_s
    cross = rotation.dot(skew(accel))  # to first order in phi, the integrals hold phi/2 and phi/6
    inputs[3:6, :3], inputs[6:, :3] = cross * (-(dt_s**2) / 2), cross * (-(dt_s**3) / 6)
    inputs[3:6, 3:], inputs[6:, 3:] = rotation.dot(first), rotation.dot(second)
    return inputs


def _second_integral(phi: Array) -> Array:
    square = float(phi.dot(phi))
    angle = math.sqrt(square)
    if angle < 1e-2:  # differences of nearly equal numbers below
        a, b = 1 / 6 - square / 120, 1 / 24 - square / 720
    else:
        a, b = (angle - math.sin(angle)) / (angle * square), (math.cos(angle) - 1 + square / 2) / square**2
    cross = skew(phi)
    integral: Array = 0.5 * _IDENTITY + a * cross + b * cross.dot(cross)
    return integral
