# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Rotations of a body between any two times, from its attitudes.

Rotations over a window stand for rates: both sides of a comparison are smoothed alike, a drifting or arbitrary heading
cancels out, and the noise of single attitudes is not divided by a short time.
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from viso.estimators.least_squares import inliers
from viso.geometry.rotation import (
    IDENTITY_QUAT,
    Array,
    inverse,
    product,
    quats_from_rotation_vectors,
    rotation_vectors_from_quats,
)

Mask = npt.NDArray[np.bool_]

SHORTEST_WINDOW_S: Final = 0.2
_LONGEST_GAP_S: Final = 0.5
_MOST_TURNS: Final = 10_000  # of a long stream; more are thinned out
_US: Final = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class Attitudes:
    """Attitudes of a body, any two neighbours less than half a turn apart.

    Attributes:
        time_s: [N], strictly growing.
        quats: [N, 4], unit, w, x, y, z, from the body to a world that does not turn.
        steps_rad: rotation vectors from each to the next, [N - 1, 3].
    """

    time_s: Array
    quats: Array
    steps_rad: Array

    def __len__(self) -> int:
        return len(self.time_s)

    def at(self, time_s: Array) -> tuple[Array, Mask]:
        """Return the attitudes [..., 4] at times [...], and which are known: within the recording, and in no gap."""
        if len(self) < 2:
            return np.full((*time_s.shape, 4), IDENTITY_QUAT), np.zeros(time_s.shape, bool)
        after = np.clip(np.searchsorted(self.time_s, time_s, side="right"), 1, len(self) - 1)
        step_s = self.time_s[after] - self.time_s[after - 1]
        share = (time_s - self.time_s[after - 1]) / step_s
        known = (share >= 0) & (share <= 1) & (step_s <= _LONGEST_GAP_S)
        turned = quats_from_rotation_vectors(self.steps_rad[after - 1] * share[..., None])
        return product(self.quats[after - 1], turned), known


def attitudes_of(time_us: npt.ArrayLike, quat_wxyz: npt.ArrayLike) -> Attitudes:
    """Return the attitudes of times [N] and of quaternions w, x, y, z from body to world [N, 4].

    Attitudes that are not finite, have no direction, or are not later than all before are left out.

    Raises:
        ValueError: if the shapes differ.
    """
    times = np.asarray(time_us, np.float64)
    values = np.asarray(quat_wxyz, np.float64)
    if values.ndim != 2 or values.shape[1] != 4 or times.shape != values.shape[:1]:
        raise ValueError(f"times of shape {times.shape}, quaternions of shape {values.shape}: not [N] and [N, 4]")
    usable = np.isfinite(times) & np.isfinite(values).all(axis=1) & (np.abs(values).max(axis=1, initial=0) > 1e-6)
    times, values = times[usable], values[usable]
    newer = newest(times)
    values = values[newer]
    quats = values / np.linalg.norm(values, axis=1, keepdims=True)
    steps = rotation_vectors_from_quats(product(inverse(quats[:-1]), quats[1:]))
    return Attitudes(times[newer] * _US, quats, steps)


def window_of(track: Attitudes) -> float:
    """Return the window of a stream's rotations in s: several samples, with a lower limit."""
    steps = np.diff(track.time_s)
    return max(SHORTEST_WINDOW_S, float(np.median(steps))) if len(steps) else SHORTEST_WINDOW_S


def windows(time_s: Array, length_s: float) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
    """Return indices of samples, and of those about ``length_s`` later; none across a gap."""
    end = np.searchsorted(time_s, time_s + length_s - 1e-9)
    start = np.flatnonzero(end < len(time_s))
    end = end[start]
    close = time_s[end] - time_s[start] <= 2 * length_s
    return start[close], end[close]


def turns(track: Attitudes, start_s: Array, end_s: Array) -> tuple[Array, Mask]:
    """Return the rotation vectors [..., 3] in rad from times to others, in the first body frame; which are known."""
    first, first_known = track.at(start_s)
    second, second_known = track.at(end_s)
    return rotation_vectors_from_quats(product(inverse(first), second)), first_known & second_known


def newest(times: Array) -> Mask:
    """Return which times [N] are later than all before them."""
    return np.diff(np.maximum.accumulate(times), prepend=-np.inf) > 0


# A stream beside the vehicle


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

    def vehicle_rad(self, delay_s: npt.ArrayLike) -> tuple[Array, Mask]:
        """Return the vehicle's rotations [..., N, 3] in its body axes, delays [...] earlier, and which are known."""
        delay_s = np.asarray(delay_s, np.float64)[..., None]
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
        """Return rotations thinned so that each overlaps the next by half: the others add little."""
        step_s = float(self.start_s[-1] - self.start_s[0]) / max(len(self) - 1, 1)
        every = max(int(0.5 * self.window_s / max(step_s, 1e-9)), 1)
        return self.chosen(np.arange(len(self)) % every == 0)

    def spread(self) -> "TurnPair":
        """Return so many rotations, evenly over the stream, that one delay and one mounting are known well enough."""
        return self.chosen(np.arange(len(self)) % (len(self) // _MOST_TURNS + 1) == 0)

    def chosen(self, mask: Mask) -> "TurnPair":
        """Return some of the rotations."""
        return TurnPair(self.vehicle, self.start_s[mask], self.end_s[mask], self.stream_rad[mask])

    def without_outliers(self, delay_s: float, rotation: Array) -> "TurnPair":
        """Return the rotations without outliers, after the stream's are rotated by ``rotation`` [3, 3]."""
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
    """Return vectors [..., N, 3] less the mean of each N, which includes a constant gyro bias."""
    less_mean: Array = values - values.mean(axis=-2, keepdims=True)
    return less_mean


def correlation_of(source: Array, target: Array) -> float:
    """Return the correlation of vectors [N, 3] with others, -1 to 1; 0 without motion."""
    energy = math.sqrt(float(np.sum(source**2)) * float(np.sum(target**2)))
    return float(np.sum(source * target)) / energy if energy > 0 else 0.0
