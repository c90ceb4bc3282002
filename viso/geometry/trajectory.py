# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A trajectory: positions and attitudes of a body at increasing times; recorded, estimated, or true."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import MappingProxyType
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from viso.geometry.pose import SE3, read_only
from viso.geometry.rotation import Array, interpolated_quats, rotation_from_quat_wxyz

Integers = npt.NDArray[np.int64]

TIME_END_NS: Final = 1 << 62
"""Times are less than this from 0, in the year 2116 since 1970, so that a difference never overflows."""
_SHORTEST_QUAT: Final = 1e-6


def _frozen_integers(value: Any, shape: tuple[int, ...], name: str) -> Integers:
    array = np.array(value, dtype=np.int64)
    if array.shape != shape:
        raise ValueError(f"{name}: shape {array.shape}, not {shape}")
    array.flags.writeable = False
    return array


@dataclass(frozen=True, slots=True, eq=False)
class Pose:
    """A trajectory at one time.

    Attributes:
        position: in m, in the trajectory's world.
        quat_wxyz: attitude, from body to world.
        velocity: in m/s, in the world.
        covariance: [6, 6] of position in m and rotation in rad about the axes of the world; None when unknown.
        resets: number of earlier losses of the map.
    """

    position: Array
    quat_wxyz: Array
    velocity: Array
    covariance: Array | None
    resets: int


@dataclass(frozen=True, eq=False)
class Trajectory:
    """A trajectory; its arrays cannot be written to.

    Attributes:
        times_ns: [N], strictly increasing; N may be 0.
        positions: [N, 3] in m, in the trajectory's world.
        quats_wxyz: [N, 4], from body to world; made unit when given.
        velocities: [N, 3] in m/s, in the world; None when the recording has none.
        covariances: [N, 6, 6] of position in m and rotation in rad about the axes of the world, NaN where unknown;
            None when the recording has none.
        resets: [N], number of losses of the map before each record; all 0 unless given.
        left_out: number of records of the file that were left out, by reason.

    Raises ValueError, naming the field, if one is invalid.
    """

    times_ns: Integers
    positions: Array
    quats_wxyz: Array
    velocities: Array | None = None
    covariances: Array | None = None
    resets: Integers | None = None
    left_out: Mapping[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        count = len(self.times_ns)
        times_ns = _frozen_integers(self.times_ns, (count,), "times_ns")
        if (np.abs(times_ns) >= TIME_END_NS).any() or (np.diff(times_ns) <= 0).any():
            raise ValueError("times_ns: not strictly increasing, or out of range")
        quats = read_only(self.quats_wxyz, (count, 4), "quats_wxyz")
        lengths = np.linalg.norm(quats, axis=1, keepdims=True)
        if (lengths < _SHORTEST_QUAT).any():
            raise ValueError("quats_wxyz: no rotation")
        values: dict[str, Any] = {
            "times_ns": times_ns,
            "positions": read_only(self.positions, (count, 3), "positions"),
            "quats_wxyz": read_only(quats / lengths, (count, 4), "quats_wxyz"),
            "resets": _frozen_integers(np.zeros(count) if self.resets is None else self.resets, (count,), "resets"),
            "left_out": MappingProxyType(dict(self.left_out)),
        }
        if self.velocities is not None:
            values["velocities"] = read_only(self.velocities, (count, 3), "velocities")
        if self.covariances is not None:
            values["covariances"] = read_only(self.covariances, (count, 6, 6), "covariances", finite=False)
        for name, value in values.items():
            object.__setattr__(self, name, value)

    @classmethod
    def of(cls, poses: Sequence[tuple[int, SE3]]) -> "Trajectory":
        """Return poses with their times in ns."""
        return cls(
            np.array([t_ns for t_ns, _ in poses], np.int64),
            np.array([pose.t for _, pose in poses]).reshape(-1, 3),
            np.array([pose.quat_wxyz() for _, pose in poses]).reshape(-1, 4),
        )

    def __len__(self) -> int:
        return len(self.times_ns)

    @property
    def duration_s(self) -> float:
        """From the first record to the last."""
        return float(self.times_ns[-1] - self.times_ns[0]) * 1e-9 if len(self) else 0.0

    @property
    def path_length_m(self) -> float:
        """The distance travelled, along straight lines from record to record."""
        return float(np.linalg.norm(np.diff(self.positions, axis=0), axis=1).sum())

    @cached_property
    def known_resets(self) -> Integers:
        """The counts of lost maps, which the constructor has filled in."""
        assert self.resets is not None
        return self.resets

    @cached_property
    def world_velocities(self) -> Array:
        """The velocities of the recording, or else the derivatives of the positions, [N, 3] in m/s."""
        if self.velocities is not None:
            return self.velocities
        slopes = np.zeros((len(self), 3))
        times_s = (self.times_ns - self.times_ns[0]) * 1e-9
        # A reset is a step of the map, not of the vehicle.
        edges = np.flatnonzero(np.diff(self.known_resets)) + 1
        for stretch in np.split(np.arange(len(self)), edges):
            if len(stretch) > 1:
                slopes[stretch] = np.gradient(self.positions[stretch], times_s[stretch], axis=0)
        slopes.flags.writeable = False
        return slopes

    def pose(self, index: int) -> Pose:
        """Return a record by its number, from 0."""
        covariance = None if self.covariances is None else self.covariances[index]
        if covariance is not None and np.isnan(covariance).any():
            covariance = None
        return Pose(
            self.positions[index],
            self.quats_wxyz[index],
            self.world_velocities[index],
            covariance,
            int(self.known_resets[index]),
        )

    def se3(self, index: int) -> SE3:
        """Return position and attitude of a record by its number, from 0."""
        return SE3(rotation_from_quat_wxyz(self.quats_wxyz[index]), self.positions[index])

    def at(self, t_ns: int) -> SE3 | None:
        """Return position and attitude at a time, interpolated; None outside the trajectory."""
        if not len(self) or not self.times_ns[0] <= t_ns <= self.times_ns[-1]:
            return None
        return self.interpolated(np.array([t_ns])).se3(0)

    def within(self, start_ns: int, end_ns: int) -> "Trajectory":
        """Return the records from one time to another, both included."""
        part = slice(*np.searchsorted(self.times_ns, (start_ns, end_ns + 1)))
        return Trajectory(
            self.times_ns[part],
            self.positions[part],
            self.quats_wxyz[part],
            None if self.velocities is None else self.velocities[part],
            None if self.covariances is None else self.covariances[part],
            self.known_resets[part],
            self.left_out,
        )

    def without_velocities(self) -> "Trajectory":
        """Return the trajectory with velocities that follow from the positions."""
        return replace(self, velocities=None)

    def with_sigmas(self, sigmas: tuple[float, float] | None) -> "Trajectory":
        """Return the trajectory with one covariance everywhere, or, for None, without any.

        The standard deviations are those of each axis, of position in m and of rotation in rad.
        """
        if sigmas is None:
            return replace(self, covariances=None)
        covariance = np.diag(np.repeat(np.square(sigmas), 3))
        return replace(self, covariances=np.broadcast_to(covariance, (len(self), 6, 6)))

    def with_resets_at_jumps(self, jump_m: float) -> "Trajectory":
        """Return the trajectory with a reset wherever a position is more than ``jump_m`` from the one before."""
        jumps = np.linalg.norm(np.diff(self.positions, axis=0), axis=1) > jump_m
        return replace(self, resets=np.concatenate([[0], np.cumsum(jumps)]))

    def resampled(self, rate_hz: float, max_gap_s: float) -> "Trajectory":
        """Return the trajectory at equal steps from its first record on, but none in gaps of more than ``max_gap_s``.

        Records are interpolated; velocities that the recording does not have follow from the positions.
        """
        moving = replace(self, velocities=self.world_velocities)
        return moving.interpolated(self._grid_ns(1e9 / rate_hz, int(max_gap_s * 1e9)))

    def interpolated(self, times_ns: npt.ArrayLike) -> "Trajectory":
        """Return the trajectory at other times [K], strictly increasing.

        Positions, velocities and covariances are interpolated linearly, quaternions too and then made unit. Between two
        records with a reset in between, the earlier one holds. Raises ValueError for a time outside the trajectory.
        """
        times = np.asarray(times_ns, np.int64)
        if len(times) and (not len(self) or times[0] < self.times_ns[0] or times[-1] > self.times_ns[-1]):
            raise ValueError("times outside those of the trajectory to interpolate")
        before = np.clip(np.searchsorted(self.times_ns, times, side="right") - 1, 0, max(len(self) - 2, 0))
        after = np.minimum(before + 1, len(self) - 1)
        spans = np.maximum(self.times_ns[after] - self.times_ns[before], 1)
        share = (times - self.times_ns[before]) / spans
        share = np.where(self.known_resets[before] == self.known_resets[after], share, np.floor(share))

        def between(values: Array) -> Array:
            weight = share.reshape(-1, *[1] * (values.ndim - 1))
            # Weights of 0 leave a neighbour out altogether, even one that is unknown.
            ahead = np.where(weight > 0, weight * values[after], 0.0)
            mixed: Array = np.where(weight < 1, (1 - weight) * values[before], 0.0) + ahead
            return mixed

        return Trajectory(
            times,
            between(self.positions),
            interpolated_quats(self.quats_wxyz[before], self.quats_wxyz[after], share),
            None if self.velocities is None else between(self.velocities),
            None if self.covariances is None else between(self.covariances),
            self.known_resets[np.where(share < 1, before, after)],
            self.left_out,
        )

    def _grid_ns(self, step_ns: float, max_gap_ns: int) -> Integers:
        start_ns = self.times_ns[0]
        edges = np.flatnonzero(np.diff(self.times_ns) > max_gap_ns) + 1
        grid: list[Integers] = []
        for stretch in np.split(self.times_ns - start_ns, edges):
            first, last = np.ceil(stretch[0] / step_ns), np.floor(stretch[-1] / step_ns)
            grid.append(np.rint(np.arange(first, last + 1) * step_ns).astype(np.int64))
        times_ns: Integers = np.unique(np.concatenate(grid)) + start_ns
        return times_ns
