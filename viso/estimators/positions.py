# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A stream's positions against a reference path: their scale, and whether their axes are the reference's.

Displacements over a second or two are compared, so that neither drift nor another origin matters.
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from viso.estimators.axis_rotations import EARTH_WORDS, MIRRORED, PROPER
from viso.estimators.least_squares import blocks_of, fit, inliers
from viso.estimators.orientation import UNDECIDED, ChosenAxes, choose_axes
from viso.estimators.turning import centred, correlation_of, newest, windows
from viso.geometry.rotation import Array, rotations_from_euler

WINDOW_S: Final = 2.0
LEAST_CORRELATION: Final = 0.8
LEAST_DISPLACEMENT_M: Final = 0.2
LARGEST_RELATIVE_SIGMA: Final = 0.05

_POSITION: Final = ("position {} is earth", EARTH_WORDS)
_FEWEST_SAMPLES: Final = 30
_LONGEST_GAP_S: Final = 1.0
_PASSES: Final = 3


@dataclass(frozen=True, slots=True)
class Scale:
    """The factor for a stream's positions.

    Attributes:
        scale: reference over stream, what VISO_SCALE should be for a stream as it was sent. NaN if unknown.
        sigma: one standard deviation; infinite if unknown.
        correlation: of the displacements, 0 to 1, with the stream's axes rotated or mirrored to fit.
        sufficient: whether the vehicle moved enough.
    """

    scale: float
    sigma: float
    correlation: float
    sufficient: bool


@dataclass(frozen=True, slots=True, eq=False)
class Moves:
    """Displacements [N, 3] of a stream and of the reference, and when they start."""

    start_s: Array
    stream_m: Array
    reference_m: Array

    def chosen(self, mask: npt.NDArray[np.bool_]) -> "Moves":
        return Moves(self.start_s[mask], self.stream_m[mask], self.reference_m[mask])


def estimate_scale(
    stream_time_us: npt.ArrayLike,
    stream_pos_m: npt.ArrayLike,
    reference_time_us: npt.ArrayLike,
    reference_pos_m: npt.ArrayLike,
    *,
    delay_ms: float = 0.0,
) -> Scale:
    """Find the scale of a stream's positions, whatever their axes.

    Both sides are taken to be equally noisy (total least squares), because a plain fit makes a noisy stream's scale
    too small. A reference that was made from the stream, as by an EKF without GPS, agrees with it and proves nothing.

    Args:
        stream_time_us: [N], on the reference's clock.
        stream_pos_m: [N, 3], in any axes that do not turn.
        reference_time_us: [M].
        reference_pos_m: [M, 3].
        delay_ms: age of the stream's data at its stamps.

    Raises:
        ValueError: if shapes do not fit.
    """
    moves = moves_of(stream_time_us, stream_pos_m, reference_time_us, reference_pos_m, delay_ms)
    if len(moves.start_s) < _FEWEST_SAMPLES:
        return Scale(math.nan, math.inf, 0.0, False)
    kept = moves
    for _ in range(_PASSES):
        stream, reference = centred(kept.stream_m), centred(kept.reference_m)
        axes = best_turn(stream, reference)
        scale = _total_scale(stream @ axes.T, reference)
        off = centred(moves.stream_m) @ axes.T * scale - centred(moves.reference_m)
        used, kept = kept, moves.chosen(inliers(np.linalg.norm(off, axis=1)))
    stream, reference = centred(used.stream_m) @ axes.T, centred(used.reference_m)
    _, covariance = fit(stream[:, :, None], reference - scale * stream, blocks_of(used.start_s, WINDOW_S))
    sigma = math.sqrt(covariance[0, 0])
    correlation = correlation_of(stream, reference)
    if correlation >= LEAST_CORRELATION and _moves_enough(reference) and sigma <= LARGEST_RELATIVE_SIGMA * scale:
        return Scale(scale, sigma, correlation, True)
    return Scale(math.nan, math.inf, correlation, False)


def _moves_enough(displacements_m: Array) -> bool:
    return math.sqrt(float(np.mean(np.sum(displacements_m**2, axis=1)))) >= LEAST_DISPLACEMENT_M


def estimate_position_axes(
    stream_time_us: npt.ArrayLike,
    stream_pos_m: npt.ArrayLike,
    reference_time_us: npt.ArrayLike,
    reference_pos_ned_m: npt.ArrayLike,
    *,
    heading_deg: float = 0.0,
    delay_ms: float = 0.0,
) -> ChosenAxes:
    """Find the directions of the axes of a stream's positions, also mirrored ones.

    ``heading_deg`` is the compass direction that counts as north: that of the stream's x, where its heading is
    arbitrary. Other arguments are as of ``estimate_scale``.
    """
    moves = moves_of(stream_time_us, stream_pos_m, reference_time_us, reference_pos_ned_m, delay_ms)
    if len(moves.start_s) < _FEWEST_SAMPLES:
        return ChosenAxes(UNDECIDED, False, *_POSITION)
    stream = centred(moves.stream_m)
    reference = centred(moves.reference_m) @ rotations_from_euler((0.0, 0.0, math.radians(heading_deg)))
    choice = choose_axes(stream, reference, (*PROPER, *MIRRORED), blocks_of(moves.start_s, WINDOW_S))
    return ChosenAxes(choice, choice.is_clear and _moves_enough(reference), *_POSITION)


def clean(time_us: npt.ArrayLike, pos_m: npt.ArrayLike) -> tuple[Array, Array]:
    """Return times in s [N] and positions [N, D] that are finite and later than all before."""
    times, positions = np.asarray(time_us, np.float64), np.asarray(pos_m, np.float64)
    if times.ndim != 1 or positions.ndim != 2 or positions.shape[1] not in (2, 3) or len(positions) != len(times):
        raise ValueError(f"times of shape {times.shape} and positions of shape {positions.shape}: not [N] and [N, 3]")
    usable = np.isfinite(times) & np.isfinite(positions).all(axis=1)
    newer = newest(times[usable])
    return times[usable][newer] * 1e-6, positions[usable][newer]


def moves_of(
    stream_time_us: npt.ArrayLike,
    stream_pos_m: npt.ArrayLike,
    reference_time_us: npt.ArrayLike,
    reference_pos_m: npt.ArrayLike,
    delay_ms: float,
    longest_gap_s: float = _LONGEST_GAP_S,
) -> Moves:
    """Return the displacements of a stream and of the reference over about 2 s, where both are known."""
    stream_s, stream_m = clean(stream_time_us, stream_pos_m)
    reference_s, reference_m = clean(reference_time_us, reference_pos_m)
    if len(reference_s) < 2:
        return Moves(np.zeros(0), np.zeros((0, stream_m.shape[1])), np.zeros((0, reference_m.shape[1])))
    start, end = windows(stream_s, WINDOW_S)
    first, first_known = interpolated(reference_s, reference_m, stream_s[start] - delay_ms * 1e-3, longest_gap_s)
    last, last_known = interpolated(reference_s, reference_m, stream_s[end] - delay_ms * 1e-3, longest_gap_s)
    return Moves(stream_s[start], stream_m[end] - stream_m[start], last - first).chosen(first_known & last_known)


def interpolated(
    time_s: Array, values: Array, at_s: Array, longest_gap_s: float
) -> tuple[Array, npt.NDArray[np.bool_]]:
    """Return values [M, D] interpolated at times [K], and which are known: those in no gap and within the recording."""
    after = np.clip(np.searchsorted(time_s, at_s, side="right"), 1, len(time_s) - 1)
    known = (at_s >= time_s[0]) & (at_s <= time_s[-1]) & (time_s[after] - time_s[after - 1] <= longest_gap_s)
    return np.column_stack([np.interp(at_s, time_s, column) for column in values.T]), known


def best_turn(source: Array, target: Array) -> Array:
    """Return the rotation or mirroring that brings vectors [N, 3] nearest to others [N, 2 or 3]."""
    left, _, right = np.linalg.svd(target.T @ source, full_matrices=False)
    turn: Array = left @ right
    return turn


def _total_scale(source: Array, target: Array) -> float:
    """Return the slope of the line through 0 from which both coordinates are off by equal noise."""
    own, other, common = float(np.sum(source**2)), float(np.sum(target**2)), float(np.sum(source * target))
    if common <= 0:
        return 0.0
    return (other - own + math.hypot(other - own, 2 * common)) / (2 * common)
