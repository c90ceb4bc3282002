# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Vectors of a stream beside those of a reference that ought to be the same, but for axes and noise."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from viso.estimators.least_squares import inliers
from viso.estimators.turning import Attitudes, attitudes_of, turns, window_of, windows
from viso.geometry.rotation import Array

Mask = npt.NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class TurnPair:
    """Rotations of a stream, and the vehicle that they are compared with.

    Attributes:
        vehicle: its attitudes.
        start_s: [N], when each rotation starts by the stream's stamps.
        end_s: [N], when it ends.
        stream_rad: rotation vectors [N, 3] in the stream's body axes.
    """

    vehicle: Attitudes
    start_s: Array
    end_s: Array
    stream_rad: Array

    def __len__(self) -> int:
        return len(self.start_s)

    def vehicle_rad(self, delay_s: float) -> tuple[Array, Mask]:
        """Return the vehicle's rotations [N, 3] in its body axes, so much earlier; and which are known."""
        return turns(self.vehicle, self.start_s - delay_s, self.end_s - delay_s)

    @property
    def window_s(self) -> float:
        """The seconds of one rotation."""
        return float(np.median(self.end_s - self.start_s))

    def rate_rad(self, delay_s: float) -> float:
        """Return the vehicle's rate of turn in rad/s: root of the mean square about its mean."""
        turned = centred(self.vehicle_rad(delay_s)[0])
        return math.sqrt(float(np.mean(np.sum(turned**2, axis=1)))) / self.window_s

    def thinned(self) -> "TurnPair":
        """Return so many rotations that each overlaps the next by half: the others say little more."""
        step_s = float(self.start_s[-1] - self.start_s[0]) / max(len(self) - 1, 1)
        every = max(int(0.5 * self.window_s / max(step_s, 1e-9)), 1)
        return self.chosen(np.arange(len(self)) % every == 0)

    def chosen(self, mask: Mask) -> "TurnPair":
        """Return some of the rotations."""
        return TurnPair(self.vehicle, self.start_s[mask], self.end_s[mask], self.stream_rad[mask])

    def without_outliers(self, delay_s: float, rotation: Array) -> "TurnPair":
        """Return the rotations that agree, the stream's turned by ``rotation`` [3, 3], as most of them do."""
        vehicle, known = self.vehicle_rad(delay_s)
        off = centred(self.stream_rad) @ rotation.T - centred(vehicle)
        return self.chosen(known & inliers(np.linalg.norm(off, axis=1)))


def turn_pair(
    stream_time_us: npt.ArrayLike,
    stream_quat_wxyz: npt.ArrayLike,
    vehicle_time_us: npt.ArrayLike,
    vehicle_quat_wxyz: npt.ArrayLike,
) -> TurnPair:
    """Return a stream's rotations beside the vehicle; arguments as of ``estimate_delay``."""
    stream, vehicle = attitudes_of(stream_time_us, stream_quat_wxyz), attitudes_of(vehicle_time_us, vehicle_quat_wxyz)
    start, end = windows(stream.time_s, window_of(stream))
    start_s, end_s = stream.time_s[start], stream.time_s[end]
    return TurnPair(vehicle, start_s, end_s, turns(stream, start_s, end_s)[0])


def centred(values: Array) -> Array:
    """Return vectors [N, 3] less their mean, which a constant bias of a gyro is part of."""
    less_mean: Array = values - values.mean(axis=0)
    return less_mean


def correlation_of(source: Array, target: Array) -> float:
    """Return the correlation of vectors [N, 3] with others as they stand, -1 to 1; 0 where nothing moves."""
    energy = math.sqrt(float(np.sum(source**2)) * float(np.sum(target**2)))
    return float(np.sum(source * target)) / energy if energy > 0 else 0.0
