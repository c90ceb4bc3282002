# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The motion between two instants from inertial data alone, independent of where it began.

Between two samples the mean of both is taken to hold in the body, and that is integrated exactly: with ``phi`` the
rotation vector of the step, the velocity grows by ``R G1(phi) a dt`` and the position by ``v dt + R G2(phi) a dt^2``,
where ``G1`` and ``G2`` are the first and the second integral of ``Exp(s phi)`` over s from 0 to 1 (Hartley et al.,
Contact-Aided Invariant Extended Kalman Filtering, 2020). The propagation of errors follows Forster et al., On-Manifold
Preintegration for Real-Time Visual-Inertial Odometry, 2017.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from viso.companion.vio.config import ImuNoise
from viso.companion.vio.imu import ImuSteps
from viso.companion.vio.types import ImuBias
from viso.geometry.rotation import Array, skews

_IDENTITY: Final = np.eye(3)
_SMALL_SQUARE: Final = 1e-2  # of an angle in rad, below which series are more exact than differences


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


def preintegrate(steps: ImuSteps, noise: ImuNoise, bias: ImuBias) -> PreintegratedDelta:
    """Return the motion over consecutive steps, the bias taken off."""
    dt_s, accel = steps.dt_s, steps.accel - bias.accel
    turn, first, second = _integrals((steps.gyro - bias.gyro) * dt_s[:, None])
    rotations = _products(turn)
    before, after = rotations[:-1], rotations[1:]
    v_by_accel, p_by_accel = before @ first * _column(dt_s), before @ second * _column(dt_s**2)
    velocities = _sums((v_by_accel @ accel[..., None])[..., 0])
    positions = _sums(velocities[:-1] * dt_s[:, None] + (p_by_accel @ accel[..., None])[..., 0])
    # An error of a step's rate and force has an effect [9, 6] at the step's end: the rotation in the body there ...
    turned = after @ np.swapaxes(first, 1, 2) * _column(dt_s)  # the right Jacobian is the left one transposed
    cross = before @ skews(accel)
    v_by_gyro, p_by_gyro = cross * _column(dt_s**2 / -2), cross * _column(dt_s**3 / -6)  # to first order in the angle
    # ... and at the end of all: what is gained after the step is turned as well, and the velocity lasts.
    left_s = dt_s.sum() - np.cumsum(dt_s)
    gained_v = velocities[-1] - velocities[1:]
    gained_p = positions[-1] - positions[1:] - velocities[1:] * left_s[:, None]
    effects = np.zeros((len(dt_s), 9, 6))
    effects[:, :3, :3] = rotations[-1].T @ turned
    effects[:, 3:6, :3] = v_by_gyro - skews(gained_v) @ turned
    effects[:, 6:, :3] = p_by_gyro + v_by_gyro * _column(left_s) - skews(gained_p) @ turned
    effects[:, 3:6, 3:] = v_by_accel
    effects[:, 6:, 3:] = p_by_accel + v_by_accel * _column(left_s)
    sigmas = np.repeat([noise.gyro, noise.accel], 3) / np.sqrt(dt_s)[:, None]
    spread = np.swapaxes(effects * sigmas[:, None], 0, 1).reshape(9, -1)
    return PreintegratedDelta(
        float(dt_s.sum()), rotations[-1], velocities[-1], positions[-1], spread.dot(spread.T), -effects.sum(axis=0)
    )


def _integrals(phi: Array) -> tuple[Array, Array, Array]:
    """Return Exp(phi), G1(phi) and G2(phi), each [N, 3, 3], of rotation vectors [N, 3]."""
    square = np.einsum("ni,ni->n", phi, phi)
    small = square < _SMALL_SQUARE
    large = np.where(small, 1.0, square)
    angle = np.sqrt(large)
    # Each is a sum of 1, the skew matrix and its square; the coefficients of one integral follow from the next one's.
    third = np.where(
        small, 1 / 6 - square * (1 / 120 - square * (1 / 5040 - square / 362880)), (1 - np.sin(angle) / angle) / large
    )
    fourth = np.where(
        small,
        1 / 24 - square * (1 / 720 - square * (1 / 40320 - square / 3628800)),
        (0.5 - 2 * np.sin(0.5 * angle) ** 2 / large) / large,
    )
    cross = skews(phi)
    crossed = cross @ cross
    parts = (
        (1.0, 1 - square * third, 0.5 - square * fourth),
        (1.0, 0.5 - square * fourth, third),
        (0.5, third, fourth),
    )
    turn, first, second = (one * _IDENTITY + _column(a) * cross + _column(b) * crossed for one, a, b in parts)
    return turn, first, second


def _products(turns: Array) -> Array:
    """Return the rotations [N + 1, 3, 3] before, between and after turns [N, 3, 3]."""
    rotations = [_IDENTITY]
    for turn in turns:
        rotations.append(rotations[-1].dot(turn))
    return np.array(rotations)


def _sums(gains: Array) -> Array:
    """Return the vectors [N + 1, 3] before, between and after gains [N, 3]."""
    return np.concatenate([np.zeros((1, 3)), np.cumsum(gains, axis=0)])


def _column(factors: Array) -> Array:
    """Return factors [N] in a shape that multiplies matrices [N, ...]."""
    return factors[:, None, None]
