# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Errors of an estimated trajectory against the true one.

The measures are those of Sturm et al., A benchmark for the evaluation of RGB-D SLAM systems (2012); the alignment is
Umeyama's, Least-squares estimation of transformation parameters between two point patterns (1991).
"""

import math
from dataclasses import dataclass

import numpy as np

from viso.geometry.pose import SE3
from viso.geometry.rotation import Array, best_rotation
from viso.geometry.trajectory import Trajectory


class EvaluationError(ValueError):
    """Two trajectories cannot be compared; one line that says why."""


@dataclass(frozen=True, slots=True)
class AbsoluteError:
    """The absolute trajectory error (ATE), after alignment without scale.

    Attributes:
        count: poses compared.
        rmse_m: of the distances between the positions.
        path_m: length of the true path over the same time.
        alignment: maps the estimate's frame into the truth's.
        scale: factor for the estimate in the best similarity; a diagnostic only.
    """

    count: int
    rmse_m: float
    path_m: float
    alignment: SE3
    scale: float


def umeyama(source: Array, target: Array) -> tuple[SE3, float]:
    """Return the rigid motion that best maps points [N, 3] onto others, and the scale of the best similarity.

    Raises EvaluationError for fewer than 3 points, or points on one spot.
    """
    if len(source) < 3:
        raise EvaluationError(f"{len(source)} poses in common, an alignment needs 3")
    source_mean, target_mean = source.mean(axis=0), target.mean(axis=0)
    source_off, target_off = source - source_mean, target - target_mean
    spread = float(np.sum(source_off**2))
    if spread == 0:
        raise EvaluationError("the estimate does not move: no alignment")
    rotation = best_rotation(source_off, target_off)
    scale = float(np.sum(target_off * (source_off @ rotation.T))) / spread
    return SE3(rotation, target_mean - rotation @ source_mean), scale


def absolute_error(estimate: Trajectory, truth: Trajectory) -> AbsoluteError:
    """Compare the positions of an estimate with the truth, interpolated to its times.

    Raises EvaluationError if fewer than 3 of its poses are within the time of the truth.
    """
    estimate, truth = in_common(estimate, truth)
    alignment, scale = umeyama(estimate.positions, truth.positions)
    errors = np.linalg.norm(alignment.map(estimate.positions) - truth.positions, axis=1)
    return AbsoluteError(len(errors), rms(errors), truth.path_length_m, alignment, scale)


def in_common(estimate: Trajectory, truth: Trajectory) -> tuple[Trajectory, Trajectory]:
    """Return the estimate within the time of the truth, and the truth at the estimate's times."""
    if not len(truth):
        raise EvaluationError("the truth is empty")
    if len(truth) == 1:
        raise EvaluationError("the truth has one pose alone: times outside it")
    estimate = estimate.within(int(truth.times_ns[0]), int(truth.times_ns[-1]))
    return estimate, truth.interpolated(estimate.times_ns)


def rms(values: Array) -> float:
    """Return the root mean square of numbers, in their unit."""
    return math.sqrt(float(np.mean(values**2)))
