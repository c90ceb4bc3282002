# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The state of the filter: the body's motion, the IMU's bias, a window of past poses, and the covariance of all.

The filter is that of Mourikis and Roumeliotis, A multi-state constraint Kalman filter, 2007, with the errors of an
invariant filter (Barrau and Bonnabel, The invariant extended Kalman filter as a stable observer, 2017; for cameras
Wu et al., An invariant-EKF VINS algorithm for improving consistency, 2017): each pose errs by a rigid motion of the
world, ``T = Exp(e) T_hat``. A camera cannot observe a shift of the whole world or its rotation about gravity. With
these errors the unobservable directions are the same for every estimate, so no update gains false information on them
(other filters need first-estimate Jacobians for that), and a bad first estimate does no lasting harm.
"""

import copy
import math
from collections.abc import Container, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from viso.companion.vio.config import ImuNoise
from viso.companion.vio.frames import GRAVITY_MSS
from viso.companion.vio.imu import ImuSteps, steps_between
from viso.companion.vio.preintegration import preintegrate
from viso.companion.vio.types import ImuBias, ImuSample, ImuWindow
from viso.geometry.pose import SE3
from viso.geometry.rotation import Array, right_jacobian, skew, so3_exp

# Of the error vector: attitude (rad), position (m), velocity (m/s), all in the world, gyro bias (rad/s) and
# accelerometer bias (m/s^2) in the body; then attitude and position of each past pose; then of each held point its
# direction and inverse depth.
ATT: Final = slice(0, 3)
POS: Final = slice(3, 6)
VEL: Final = slice(6, 9)
GYRO: Final = slice(9, 12)
ACCEL: Final = slice(12, 15)
POSE: Final = slice(0, 6)
MOTION: Final = 15
CLONE: Final = 6
POINT: Final = 3

# The motion that a body may make while nothing is measured.
UNNOTICED_RAD_S: Final = 0.5
UNNOTICED_M_S2: Final = 3.0
LONG_STEP_S: Final = 0.1  # between two inertial samples: anything may have happened

GRAVITY_ENU: Final = np.array([0.0, 0.0, -GRAVITY_MSS])
_IDENTITY: Final = np.eye(3)


@dataclass(slots=True, eq=False)
class Clone:
    """A past pose of the body.

    Attributes:
        R: rotation [3, 3] from the body to the world.
        p: position [3] in the world in m.
    """

    number: int
    R: Array
    p: Array


@dataclass(slots=True, eq=False)
class HeldPoint:
    """A point that is estimated with the motion, relative to the camera at a past pose.

    Attributes:
        anchor: number of the past pose.
        at: [3], its normalised coordinates and its inverse depth (1/m) there.
    """

    number: int
    anchor: int
    at: Array


class WindowFilter:
    """The filter.

    Args:
        R, p, v: attitude (body to world), position (m) and velocity (m/s) in the world (ENU).
        cov: [15, 15] of the errors that the module's slices name.
    """

    def __init__(self, noise: ImuNoise, R: Array, p: Array, v: Array, bias: ImuBias, cov: Array) -> None:
        self.R, self.p, self.v = R.copy(), p.copy(), v.copy()
        self.gyro_bias, self.accel_bias = bias.gyro.copy(), bias.accel.copy()
        self.cov = cov.copy()
        self.clones: list[Clone] = []
        self.points: list[HeldPoint] = []
        self._noise = noise

    def copy(self) -> "WindowFilter":
        """Return an independent copy of the filter."""
        return copy.deepcopy(self)

    def go_back(self, past: "WindowFilter") -> None:
        """Restore the state of a copy of this filter."""
        vars(self).update(vars(past.copy()))

    @property
    def bias(self) -> ImuBias:
        """The estimated bias."""
        return ImuBias(self.accel_bias, self.gyro_bias)

    @property
    def pose(self) -> SE3:
        """The body in the world."""
        return SE3(_orthonormal(self.R), self.p)

    def is_finite(self) -> bool:
        """Return whether state and covariance are numbers, and no variance is negative."""
        motion = np.concatenate([self.R.ravel(), self.p, self.v, self.gyro_bias, self.accel_bias])
        return bool(np.isfinite(motion).all() and np.isfinite(self.cov).all() and (self.cov.diagonal() >= 0).all())

    def propagate(self, steps: ImuSteps) -> None:
        """Propagate with inertial data."""
        if not len(steps.dt_s):
            return
        delta = preintegrate(steps, self._noise, self.bias)
        dt_s, before = delta.dt_s, self.R
        self.p = self.p + self.v * dt_s + GRAVITY_ENU * (0.5 * dt_s * dt_s) + before.dot(delta.dp)
        self.v = self.v + GRAVITY_ENU * dt_s + before.dot(delta.dv)
        self.R = before.dot(delta.dR)
        into_world = self._into_world(before)
        transition = np.eye(MOTION)
        transition[VEL, ATT], transition[POS, ATT] = _GRAVITY_CROSS * dt_s, _GRAVITY_CROSS * (0.5 * dt_s * dt_s)
        transition[POS, VEL] = _IDENTITY * dt_s
        transition[:9, 9:] = into_world.dot(delta.jac_bias)
        self._propagate_cov(transition, into_world.dot(delta.cov).dot(into_world.T), dt_s)

    def carry_on(self, window: ImuWindow, samples: Sequence[ImuSample]) -> bool:
        """Propagate over a window; return whether the samples cover all of it.

        Args:
            samples: those in it from stamp to stamp; without any, the last motion continues.
        """
        steps = steps_between(samples)
        self.propagate(steps)
        unmeasured_s = float(steps.dt_s[steps.dt_s > LONG_STEP_S].sum())
        if not samples:
            self.propagate_blind((window.end_t_ns - window.start_t_ns) * 1e-9)
        elif unmeasured_s > 0:
            self.blur(unmeasured_s)
        return bool(samples) and unmeasured_s == 0

    def propagate_blind(self, dt_s: float) -> None:
        """Propagate without inertial data: with the last motion and large process noise."""
        self.p = self.p + self.v * dt_s
        transition = np.eye(MOTION)
        transition[POS, VEL] = _IDENTITY * dt_s
        self._propagate_cov(transition, np.zeros((9, 9)), dt_s)
        self.blur(dt_s)

    def blur(self, dt_s: float) -> None:
        """Add the uncertainty of unmeasured rotation and acceleration over the last ``dt_s``."""
        unnoticed = np.zeros((9, 6))
        unnoticed[:3, :3] = _IDENTITY * (UNNOTICED_RAD_S * dt_s)
        unnoticed[3:6, 3:] = _IDENTITY * (UNNOTICED_M_S2 * dt_s)
        unnoticed[6:, 3:] = _IDENTITY * (UNNOTICED_M_S2 * 0.5 * dt_s * dt_s)
        spread = self._into_world(self.R).dot(unnoticed)
        self.cov[:9, :9] += spread.dot(spread.T)

    def _into_world(self, before: Array) -> Array:
        """Return the matrix from the errors (rotation, dv, dp) of a preintegrated motion to those of the state."""
        into = np.zeros((9, 9))
        into[ATT, :3] = self.R
        into[VEL, :3], into[POS, :3] = skew(self.v).dot(self.R), skew(self.p).dot(self.R)
        into[VEL, 3:6] = into[POS, 6:] = before
        return into

    def _propagate_cov(self, transition: Array, motion_noise: Array, dt_s: float) -> None:
        cov = self.cov
        motion = transition.dot(cov[:MOTION, :MOTION]).dot(transition.T)
        motion[:9, :9] += motion_noise
        motion[GYRO, GYRO] += _IDENTITY * (self._noise.gyro_walk**2 * dt_s)
        motion[ACCEL, ACCEL] += _IDENTITY * (self._noise.accel_walk**2 * dt_s)
        cov[:MOTION, :MOTION] = 0.5 * (motion + motion.T)
        cov[:MOTION, MOTION:] = transition.dot(cov[:MOTION, MOTION:])
        cov[MOTION:, :MOTION] = cov[:MOTION, MOTION:].T

    def clone(self, number: int, *, first: bool = False) -> None:
        """Keep the pose as that of a frame, the last in the window or the first."""
        at = MOTION if first else self.clones_end
        self.clones.insert(0 if first else len(self.clones), Clone(number, self.R.copy(), self.p.copy()))
        self._select(np.concatenate([np.arange(at), np.arange(POSE.stop), np.arange(at, len(self.cov))]))

    def drop(self, number: int) -> None:
        """Remove the pose of a frame, and the points relative to it."""
        self.release({point.number for point in self.points if point.anchor == number})
        index = self.index_of(number)
        del self.clones[index]
        first = MOTION + CLONE * index
        self._select(np.delete(np.arange(len(self.cov)), slice(first, first + CLONE)))

    @property
    def clones_end(self) -> int:
        """The index at which the points begin in the error vector."""
        return MOTION + CLONE * len(self.clones)

    def hold(self, point: HeldPoint, sigma: float, inverse_sigma: float, like: int | None) -> None:
        """Add a point to the state.

        Args:
            point: the point, relative to a pose of the window.
            sigma: of its normalised coordinates.
            inverse_sigma: of its inverse depth, in 1/m.
            like: index of a held point at the same distance, up to ``inverse_sigma``; None if there is none.
        """
        size = len(self.cov)
        cov = np.zeros((size + POINT, size + POINT))
        cov[:size, :size] = self.cov
        if like is not None:
            row = self.clones_end + POINT * like + 2
            cov[-1, :size] = cov[:size, -1] = self.cov[row]
            cov[-1, -1] = self.cov[row, row]
        cov[-3, -3] = cov[-2, -2] = sigma**2
        cov[-1, -1] += inverse_sigma**2
        self.cov = cov
        self.points.append(point)

    def release(self, numbers: Container[int]) -> None:
        """Remove points from the state."""
        gone = np.array([point.number in numbers for point in self.points], np.bool_)
        if gone.any():
            self._select(np.flatnonzero(np.concatenate([np.ones(self.clones_end, np.bool_), np.repeat(~gone, POINT)])))
            self.points = [point for point in self.points if point.number not in numbers]

    def blur_points(self, sigma: float) -> None:
        """Add process noise to the held points, by the sigma of a normalised coordinate."""
        rows = self.clones_end + np.arange(POINT * len(self.points)).reshape(-1, POINT)[:, :2].ravel()
        self.cov[rows, rows] += sigma**2

    def _select(self, rows: npt.NDArray[np.int64]) -> None:
        self.cov = self.cov[np.ix_(rows, rows)]

    def index_of(self, number: int) -> int:
        """Return the index of a frame's clone. Raises KeyError if there is none."""
        for index, clone in enumerate(self.clones):
            if clone.number == number:
                return index
        raise KeyError(number)

    def nis(self, jacobian: Array, residual: Array, sigma: float) -> float:
        """Return the normalised innovation squared of a measurement; arguments as of :meth:`update`."""
        innovation = jacobian.dot(self.cov).dot(jacobian.T)
        innovation[np.diag_indices_from(innovation)] += sigma * sigma
        return float(residual.dot(np.linalg.solve(innovation, residual)))

    def update(self, jacobian: Array, residual: Array, sigma: float) -> Array:
        """Update with a measurement (Joseph form); return the error vector by which the state has moved.

        Args:
            jacobian: [M, size] of the measured with respect to the errors.
            residual: [M], measured minus predicted.
            sigma: of every element of the residual.
        """
        spread = self.cov.dot(jacobian.T)
        innovation = jacobian.dot(spread)
        innovation[np.diag_indices_from(innovation)] += sigma * sigma
        gain = np.linalg.solve(innovation, spread.T).T
        # The distance of held points is considered and never estimated (Schmidt): it scales the motion, and the
        # motion's error would count as information on it.
        gain[self.clones_end + 2 :: POINT] = 0.0
        left = -gain.dot(jacobian)
        left[np.diag_indices_from(left)] += 1.0
        cov = left.dot(self.cov).dot(left.T) + (sigma * sigma) * gain.dot(gain.T)
        self.cov = 0.5 * (cov + cov.T)
        error: Array = gain.dot(residual)
        self._move(error)
        return error

    def _move(self, error: Array) -> None:
        turn = so3_exp(error[ATT])
        left = right_jacobian(-error[ATT])  # the left Jacobian
        self.R = _orthonormal(turn.dot(self.R))
        self.p = turn.dot(self.p) + left.dot(error[POS])
        self.v = turn.dot(self.v) + left.dot(error[VEL])
        self.gyro_bias = self.gyro_bias + error[GYRO]
        self.accel_bias = self.accel_bias + error[ACCEL]
        end = self.clones_end
        for point, part in zip(self.points, error[end:].reshape(-1, POINT), strict=True):
            point.at = point.at + part
        for clone, part in zip(self.clones, error[MOTION:end].reshape(-1, CLONE), strict=True):
            turn = so3_exp(part[ATT])
            clone.R = _orthonormal(turn.dot(clone.R))
            clone.p = turn.dot(clone.p) + right_jacobian(-part[ATT]).dot(part[POS])

    def relative_to(self, number: int) -> tuple[SE3, Array]:
        """Return the body in that of a past frame, ``K_T_B``, and the covariance [6, 6] of its right perturbation."""
        index = self.index_of(number)
        past = self.clones[index]
        relative = SE3(_orthonormal(past.R.T.dot(self.R)), past.R.T.dot(self.p - past.p))
        # T_K^-1 Exp(e_B - e_K) T_B = K_T_B Exp(Ad(T_B^-1) (e_B - e_K))
        jacobian = np.zeros((CLONE, len(self.cov)))
        adjoint = self.pose.inverse().adjoint()
        first = MOTION + CLONE * index
        jacobian[:, POSE], jacobian[:, first : first + CLONE] = adjoint, -adjoint
        cov = jacobian.dot(self.cov).dot(jacobian.T)
        return relative, 0.5 * (cov + cov.T)


_GRAVITY_CROSS: Final = skew(GRAVITY_ENU)


def _orthonormal(rotation: Array) -> Array:
    """Return a rotation [3, 3] without the rounding that products have left in it (one step of Newton's)."""
    nearest: Array = rotation.dot(1.5 * _IDENTITY - 0.5 * rotation.T.dot(rotation))
    return nearest


def invariant_cov(cov: Array, R: Array, p: Array, v: Array) -> Array:
    """Convert the covariance [15, 15] of a warm start to the filter's errors.

    Args:
        cov: of attitude (right perturbation, rad), position (m), velocity (m/s), gyro bias, accelerometer bias.
    """
    jacobian = np.eye(MOTION)
    jacobian[ATT, ATT] = R
    jacobian[POS, ATT], jacobian[VEL, ATT] = skew(p).dot(R), skew(v).dot(R)
    result: Array = jacobian.dot(cov).dot(jacobian.T)
    return result


START_SIGMAS: Final = (0.03, 0.1, 0.3, 0.02, 0.2)
"""Of tilt and yaw in rad, velocity in m/s, gyro bias in rad/s, accelerometer bias in m/s^2: of a given state
without a covariance."""


def default_cov(
    tilt_rad: float, yaw_rad: float, velocity_m_s: float, gyro_bias: float, accel_bias: float, R: Array
) -> Array:
    """Return a covariance [15, 15] as a warm start has it, from sigmas; the position is certain."""
    cov = np.zeros((MOTION, MOTION))
    # Tilt and yaw are about the world's axes.
    cov[ATT, ATT] = R.T.dot(np.diag([tilt_rad**2, tilt_rad**2, yaw_rad**2])).dot(R)
    for part, sigma in ((VEL, velocity_m_s), (GYRO, gyro_bias), (ACCEL, accel_bias)):
        cov[part, part] = _IDENTITY * sigma**2
    return cov


def sigma_of(cov: Array) -> float:
    """Return the root of the largest eigenvalue of a covariance."""
    return math.sqrt(max(float(np.linalg.eigvalsh(cov)[-1]), 0.0))
