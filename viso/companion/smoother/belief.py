# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The smoother's last result, as the state of a filter that propagates it to the present.

The filter's errors are invariant, ``T = Exp(e) T_hat``; the smoother's are right perturbations.
"""

from collections.abc import Mapping
from typing import Final

import numpy as np

from viso.companion.msckf.window_filter import ACCEL, ATT, CLONE, GYRO, MOTION, POSE, VEL, Clone, WindowFilter
from viso.companion.smoother.lag_smoother import Motion
from viso.geometry.pose import SE3
from viso.geometry.rotation import Array, skew

_LEAST_SIGMA: Final = 1e-3  # m and rad, of a start that claims to know its place exactly
_LEARNT: Final = 0.1  # share of its variance that a direction must have lost to count


def motion_of(state: WindowFilter) -> Motion:
    """Return the present motion of the body."""
    return Motion(state.pose, state.v.copy(), state.bias)


def smoother_cov(state: WindowFilter) -> Array:
    """Return the covariance [15, 15] of the motion now, as a smoother begins with it."""
    into = np.linalg.inv(_into_filter(motion_of(state)))
    cov: Array = into.dot(state.cov[:MOTION, :MOTION]).dot(into.T)
    cov[POSE, POSE] += _LEAST_SIGMA**2 * np.eye(CLONE)
    return 0.5 * (cov + cov.T)


def adopt(state: WindowFilter, motion: Motion, poses: Mapping[int, SE3], cov: Array) -> None:
    """Set a filter's state from a smoother.

    Args:
        state: the filter, whose state is replaced.
        motion: now.
        poses: of past nodes by their numbers, the keyframe's last.
        cov: [15 + 6 N, 15 + 6 N] of all.
    """
    into = np.zeros_like(cov)
    into[:MOTION, :MOTION] = _into_filter(motion)
    for first, pose in zip(range(MOTION, len(cov), CLONE), poses.values(), strict=True):
        into[first : first + CLONE, first : first + CLONE] = pose.adjoint()
    joint = into.dot(cov).dot(into.T)
    state.R, state.p, state.v = motion.pose.R.copy(), motion.pose.t.copy(), motion.velocity_w.copy()
    state.gyro_bias, state.accel_bias = motion.bias.gyro.copy(), motion.bias.accel.copy()
    state.clones = [Clone(number, pose.R.copy(), pose.t.copy()) for number, pose in poses.items()]
    state.cov = 0.5 * (joint + joint.T)


def correction_nis(before: Motion, cov_before: Array, after: Motion, cov_after: Array) -> float | None:
    """Return the normalised square of a correction, per direction that was learnt about; None for none.

    A correction has the covariance of what was expected less that of what is known then, so this is the normalised
    innovation squared of all that was measured, compressed to the motion.

    Args:
        before, after: the correction.
        cov_before, cov_after: of a filter.
    """
    moved = slice(0, VEL.stop)
    error = np.concatenate([(after.pose @ before.pose.inverse()).log(), after.velocity_w - before.velocity_w])
    expected = cov_before[moved, moved]
    whitener = np.linalg.inv(np.linalg.cholesky(expected))
    learnt, directions = np.linalg.eigh(whitener.dot(expected - cov_after[moved, moved]).dot(whitener.T))
    counts = learnt > _LEARNT
    if not counts.any():
        return None
    along = directions.T.dot(whitener).dot(error)[counts]
    return float((along**2 / learnt[counts]).mean())


def _into_filter(motion: Motion) -> Array:
    """Return the matrix [15, 15] that makes a filter's errors of a smoother's."""
    into = np.zeros((MOTION, MOTION))
    into[POSE, POSE] = motion.pose.adjoint()
    into[VEL, ATT], into[VEL, VEL] = skew(motion.velocity_w).dot(motion.pose.R), np.eye(3)
    into[GYRO, 12:15] = into[ACCEL, 9:12] = np.eye(3)
    return into
