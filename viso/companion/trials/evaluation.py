# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How far an estimated trajectory is from the true one.

The measures are those of Sturm et al., A benchmark for the evaluation of RGB-D SLAM systems (2012); the alignment is
Umeyama's, Least-squares estimation of transformation parameters between two point patterns (1991).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from viso.geometry.pose import SE3, read_only
from viso.geometry.rotation import Array, rotation_from_quat_wxyz


class EvaluationError(ValueError):
    """Two trajectories cannot be compared; one line that says why."""


@dataclass(frozen=True, slots=True, eq=False)
class TimedPoses:
    """Where a body was, at N times.

    Attributes:
        t_ns: int64 [N], strictly increasing.
        positions_xyz: [N, 3] in m.
        quats_wxyz: [N, 4], of any length but 0, from the body to the frame of the positions.
    """

    t_ns: npt.NDArray[np.int64]
    positions_xyz: Array
    quats_wxyz: Array

    def __post_init__(self) -> None:
        times = np.array(self.t_ns, dtype=np.int64)
        if times.ndim != 1 or (np.diff(times) <= 0).any():
            raise ValueError("t_ns: not strictly increasing")
        times.flags.writeable = False
        object.__setattr__(self, "t_ns", times)
        object.__setattr__(self, "positions_xyz", read_only(self.positions_xyz, (len(times), 3), "positions_xyz"))
        quats = read_only(self.quats_wxyz, (len(times), 4), "quats_wxyz")
        if not (quats**2).sum(axis=1).all():
            raise ValueError("quats_wxyz: no rotation")
        object.__setattr__(self, "quats_wxyz", quats)

    def __len__(self) -> int:
        return len(self.t_ns)

    def pose(self, index: int) -> SE3:
        """Return one of the poses."""
        return SE3(rotation_from_quat_wxyz(self.quats_wxyz[index]), self.positions_xyz[index])

    @classmethod
    def of(cls, poses: Sequence[tuple[int, SE3]]) -> "TimedPoses":
        """Return poses with their times."""
        return cls(
            np.array([t_ns for t_ns, _ in poses], np.int64),
            np.array([pose.t for _, pose in poses]).reshape(-1, 3),
            np.array([pose.quat_wxyz() for _, pose in poses]).reshape(-1, 4),
        )

    def at(self, t_ns: int) -> SE3 | None:
        """Return the pose at a time, interpolated, or None if it is outside these."""
        if not len(self) or not self.t_ns[0] <= t_ns <= self.t_ns[-1]:
            return None
        return self.interpolated(np.array([t_ns])).pose(0)

    def path_length_m(self) -> float:
        """Return how far the body travelled, along straight lines from pose to pose."""
        return float(np.linalg.norm(np.diff(self.positions_xyz, axis=0), axis=1).sum())

    def within(self, start_ns: int, end_ns: int) -> "TimedPoses":
        """Return the poses from one time to another, both included."""
        chosen = (self.t_ns >= start_ns) & (self.t_ns <= end_ns)
        return TimedPoses(self.t_ns[chosen], self.positions_xyz[chosen], self.quats_wxyz[chosen])

    def interpolated(self, t_ns: npt.NDArray[np.int64]) -> "TimedPoses":
        """Return the poses at other times: positions linear, quaternions linear and normalised.

        Raises EvaluationError if a time is not within these.
        """
        times = np.asarray(t_ns, np.int64)
        if len(self) < 2 or (len(times) and (times.min() < self.t_ns[0] or times.max() > self.t_ns[-1])):
            raise EvaluationError("times outside those of the trajectory to interpolate")
        after = np.clip(np.searchsorted(self.t_ns, times, side="right"), 1, len(self) - 1)
        before = after - 1
        share = ((times - self.t_ns[before]) / (self.t_ns[after] - self.t_ns[before]))[:, None]
        positions = (1 - share) * self.positions_xyz[before] + share * self.positions_xyz[after]
        unit = self.quats_wxyz / np.linalg.norm(self.quats_wxyz, axis=1, keepdims=True)
        first, second = unit[before], unit[after]
        second = np.where(np.sum(first * second, axis=1, keepdims=True) < 0, -second, second)  # the shorter way
        quats = (1 - share) * first + share * second
        return TimedPoses(times, positions, quats / np.linalg.norm(quats, axis=1, keepdims=True))


@dataclass(frozen=True, slots=True)
class AbsoluteError:
    """The absolute trajectory error (ATE), after alignment without scale.

    Attributes:
        count: poses compared.
        rmse_m: of the distances between the positions.
        path_m: length of the true path over the same time.
        alignment: maps the estimate's frame into the truth's.
        scale: what the estimate should be multiplied with, by a similarity; a diagnostic that nothing else uses.
    """

    count: int
    rmse_m: float
    path_m: float
    alignment: SE3
    scale: float


def umeyama(source: Array, target: Array) -> tuple[SE3, float]:
    """Return the rigid motion that brings points [N, 3] onto others best, and the scale of the best similarity.

    Raises EvaluationError for fewer than 3 points, or points on one spot.
    """
    if len(source) < 3:
        raise EvaluationError(f"{len(source)} poses in common, an alignment needs 3")
    source_mean, target_mean = source.mean(axis=0), target.mean(axis=0)
    source_off, target_off = source - source_mean, target - target_mean
    spread = float(np.sum(source_off**2))
    if spread == 0:
        raise EvaluationError("the estimate does not move: no alignment")
    left, values, right = np.linalg.svd(target_off.T @ source_off)
    signs = np.array([1.0, 1.0, math.copysign(1.0, float(np.linalg.det(left) * np.linalg.det(right)))])
    rotation = (left * signs) @ right
    return SE3(rotation, target_mean - rotation @ source_mean), float(values @ signs) / spread


def absolute_error(estimate: TimedPoses, truth: TimedPoses) -> AbsoluteError:
    """Compare the positions of an estimate with the truth, interpolated to its times.

    Raises EvaluationError if fewer than 3 of its poses are within the time of the truth.
    """
    estimate, truth = in_common(estimate, truth)
    alignment, scale = umeyama(estimate.positions_xyz, truth.positions_xyz)
    errors = np.linalg.norm(alignment.map(estimate.positions_xyz) - truth.positions_xyz, axis=1)
    return AbsoluteError(len(errors), rms(errors), truth.path_length_m(), alignment, scale)


def in_common(estimate: TimedPoses, truth: TimedPoses) -> tuple[TimedPoses, TimedPoses]:
    """Return the estimate within the time of the truth, and the truth at the estimate's times."""
    if not len(truth):
        raise EvaluationError("the truth is empty")
    estimate = estimate.within(int(truth.t_ns[0]), int(truth.t_ns[-1]))
    return estimate, truth.interpolated(estimate.t_ns)


def rms(values: Array) -> float:
    """Return the root mean square of numbers, in their unit."""
    return math.sqrt(float(np.mean(values**2)))
