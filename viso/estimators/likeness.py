# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether a stream's motion is the vehicle's, after the best rotation, mirroring, scale and time shift.

Displacements over two seconds are compared, as for axes and scale; here the residuals count.
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from viso.estimators.positions import WINDOW_S, Moves, best_turn, clean, interpolated, moves_of
from viso.estimators.turning import correlation_of
from viso.geometry.rotation import Array

LEAST_FLOWN_M: Final = 2.0
LEAST_MOVE_M: Final = 0.3
SHORTEST_REST_S: Final = 8.0
LONGEST_REST_S: Final = 30.0
LONGEST_GAP_S: Final = 2.5
"""Telemetry may send a position only once a second."""

_DELAYS_MS: Final = np.arange(-1000.0, 1501.0, 125.0)
_FEWEST_MOVES: Final = 20
_MOST: Final = 4000
_CLOSE_S: Final = 0.25
_SHORTEST_S: Final = 4.0
_LIKE_M: Final = 0.5
_LIKE_SHARE: Final = 0.5
_FITTING: Final = 0.8
_ALIKE: Final = 0.9
_FARTHEST_M: Final = 200.0  # that a vehicle goes in a window
_OVER_MOVES: Final = 4.0
_WANDER_SHARE: Final = 1 / 3  # of a reference's noise within a window
_LEAP: Final = 3.0
_LEAPING: Final = 0.75
_OUTERMOST: Final = 0.05


@dataclass(frozen=True, slots=True)
class Likeness:
    """The likeness of a stream's moves to those of the vehicle, while it moved.

    Attributes:
        flown_m: distance covered by the vehicle.
        seen_m: distance covered by the stream meanwhile.
        span_s: from the first such move to the last.
        correlation: of the moves, 0 to 1, with the stream's rotated, mirrored and shifted in time to fit; of those over
            the ground where the vertical axis does not fit as well.
        unlike: the share of moves that are off by more than half.
        median_m, worst_m: distances of positions, with the stream's rotated and shifted to fit.
        sufficient: whether the vehicle moved enough.
    """

    flown_m: float
    seen_m: float
    span_s: float
    correlation: float
    unlike: float
    median_m: float
    worst_m: float
    sufficient: bool

    @property
    def ratio(self) -> float:
        """The stream's distance over the vehicle's."""
        return self.seen_m / self.flown_m if self.flown_m > 0 else math.inf


NOTHING: Final = Likeness(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, False)


@dataclass(frozen=True, slots=True)
class Rest:
    """A stretch in which the vehicle stood.

    Attributes:
        start_us, end_us: by the stream's times.
        stream_m: extent of the stream's positions in it, without the outermost.
        reference_m: the same of the vehicle.
    """

    start_us: int
    end_us: int
    stream_m: float
    reference_m: float


def estimate_likeness(
    stream_time_us: npt.ArrayLike,
    stream_pos_m: npt.ArrayLike,
    reference_time_us: npt.ArrayLike,
    reference_pos_m: npt.ArrayLike,
    *,
    noise_m: float,
    breaks_us: npt.ArrayLike = (),
) -> Likeness:
    """Return the likeness of a stream's moves to those of a reference, for any axes of the stream, also mirrored.

    Args:
        stream_time_us: [N], on the reference's clock; a delay in them does not matter.
        stream_pos_m: [N, 3], in axes that do not turn.
        reference_time_us: [M].
        reference_pos_m: [M, 2 or 3]; without heights those of the stream do not matter.
        noise_m: drift of the reference while the vehicle stands.
        breaks_us: times when the stream restarted, perhaps in other axes.

    Raises:
        ValueError: if shapes do not fit.
    """
    stream_s, stream_m = _thinned(*clean(stream_time_us, stream_pos_m))
    reference_s, reference_m = clean(reference_time_us, reference_pos_m)
    parts = np.searchsorted(np.sort(np.asarray(breaks_us, np.float64)) * 1e-6, stream_s, side="right")
    found = []
    for part in np.unique(parts).tolist():
        inside = parts == part
        found.append(_likeness(stream_s[inside], stream_m[inside], reference_s, reference_m, noise_m))
    known = [one for one in found if one.sufficient]
    if not known:
        return _likeness(stream_s, stream_m, reference_s, reference_m, noise_m)
    weights = np.array([one.flown_m for one in known]) / sum(one.flown_m for one in known)

    def mean(values: list[float]) -> float:
        return float(np.sum(weights * values))

    return Likeness(
        sum(one.flown_m for one in known),
        sum(one.seen_m for one in known),
        sum(one.span_s for one in known),
        mean([one.correlation for one in known]),
        mean([one.unlike for one in known]),
        mean([one.median_m for one in known]),
        max(one.worst_m for one in known),
        True,
    )


def _thinned(time_s: Array, positions_m: Array) -> tuple[Array, Array]:
    """Return positions thinned to a useful rate."""
    if len(time_s) < _MOST:
        return time_s, positions_m
    step_s = max(float(np.median(np.diff(time_s))), 1e-3)
    every = int(np.clip(_CLOSE_S / step_s, 1, len(time_s) // _MOST + 1))
    return time_s[::every], positions_m[::every]


def _likeness(stream_s: Array, stream_m: Array, reference_s: Array, reference_m: Array, noise_m: float) -> Likeness:
    whole = _as_it_fits(stream_s, stream_m, reference_s, reference_m, noise_m)
    if not whole.sufficient or whole.correlation >= _ALIKE:
        return whole
    # If axes are not permuted, the vertical one stays vertical.
    level = _as_it_fits(stream_s, stream_m[:, :2], reference_s, reference_m[:, :2], noise_m)
    return level if level.sufficient else whole


def _as_it_fits(stream_s: Array, stream_m: Array, reference_s: Array, reference_m: Array, noise_m: float) -> Likeness:
    best, correlation, delay_ms = None, -1.0, 0.0
    for tried_ms in _DELAYS_MS.tolist():
        paths = stream_s * 1e6, stream_m, reference_s * 1e6, reference_m
        moves = _moving(moves_of(*paths, tried_ms, LONGEST_GAP_S), noise_m)
        if _are_enough(moves, noise_m) and (found := _correlation(_without_jumps(moves))) > correlation:
            best, correlation, delay_ms = moves, found, tried_ms
    if best is None:
        return NOTHING
    kept = _without_jumps(best)
    turn = best_turn(kept.stream_m, kept.reference_m)
    turned = best.stream_m @ turn.T
    scale = _scale(kept.stream_m @ turn.T, kept.reference_m) if correlation >= _FITTING else 1.0
    flown_m = np.linalg.norm(best.reference_m, axis=1)
    off_m = np.linalg.norm(scale * turned - best.reference_m, axis=1)
    there, known = interpolated(reference_s, reference_m, stream_s - delay_ms * 1e-3, LONGEST_GAP_S)
    apart = (stream_m @ turn.T - there)[known]
    apart_m = np.linalg.norm(apart - np.median(apart, axis=0), axis=1)
    # Moves overlap: together they are as long as the time in which they start.
    share = _moving_s(best) / WINDOW_S / len(best.start_s)
    return Likeness(
        float(np.sum(flown_m)) * share,
        float(np.sum(np.linalg.norm(best.stream_m, axis=1))) * share,
        float(best.start_s[-1] - best.start_s[0]) + WINDOW_S,
        correlation,
        float(np.mean(off_m > np.maximum(_LIKE_SHARE * flown_m, _LIKE_M))),
        float(np.median(apart_m)),
        float(np.max(apart_m)),
        True,
    )


def _moving(moves: Moves, noise_m: float) -> Moves:
    length = np.linalg.norm(moves.reference_m, axis=1)
    return moves.chosen((length > max(LEAST_MOVE_M, _OVER_MOVES * _WANDER_SHARE * noise_m)) & (length < _FARTHEST_M))


def _without_jumps(moves: Moves) -> Moves:
    """Return moves without a few jumps of the stream: one or two do not make it another motion."""
    length = np.linalg.norm(moves.stream_m, axis=1)
    leaps = length > max(_LEAP * float(np.quantile(length, _LEAPING)), _LEAP * LEAST_MOVE_M)
    return moves.chosen(~leaps)


def _moving_s(moves: Moves) -> float:
    """Return the time over which moves start, without gaps between stretches."""
    steps = np.diff(moves.start_s)
    return float(np.sum(steps[steps < WINDOW_S])) if len(steps) else 0.0


def _are_enough(moves: Moves, noise_m: float) -> bool:
    if len(moves.start_s) < _FEWEST_MOVES or _moving_s(moves) < _SHORTEST_S:
        return False
    flown_m = float(np.mean(np.linalg.norm(moves.reference_m, axis=1))) * _moving_s(moves) / WINDOW_S
    return flown_m >= max(LEAST_FLOWN_M, _OVER_MOVES * noise_m)


def _correlation(moves: Moves) -> float:
    turn = best_turn(moves.stream_m, moves.reference_m)
    return correlation_of(moves.stream_m @ turn.T, moves.reference_m)


def _scale(source: Array, target: Array) -> float:
    energy = float(np.sum(source**2))
    return float(np.sum(source * target)) / energy if energy > 0 else 1.0


def rests(
    stream_time_us: npt.ArrayLike,
    stream_pos_m: npt.ArrayLike,
    reference_time_us: npt.ArrayLike,
    reference_pos_m: npt.ArrayLike,
    *,
    noise_m: float,
    breaks_us: npt.ArrayLike = (),
) -> list[Rest]:
    """Return the stretches in which the vehicle stood, none longer than half a minute; arguments as above."""
    stream_s, stream_m = clean(stream_time_us, stream_pos_m)
    reference_s, reference_m = clean(reference_time_us, reference_pos_m)
    if len(stream_s) < _FEWEST_MOVES or len(reference_s) < _FEWEST_MOVES:
        return []
    there, known = interpolated(reference_s, reference_m, stream_s, LONGEST_GAP_S)
    stream_s, stream_m, there = stream_s[known], stream_m[known], there[known]
    if len(stream_s) < _FEWEST_MOVES:
        return []
    part = np.searchsorted(np.sort(np.asarray(breaks_us, np.float64)) * 1e-6, stream_s, side="right")
    changes = (np.diff(np.floor(stream_s)) != 0) | (np.diff(part) != 0)
    starts = np.concatenate([[0], np.flatnonzero(changes) + 1, [len(stream_s)]]).tolist()

    def is_rest(first: int, end: int) -> bool:
        inside = slice(starts[first], starts[end])
        seconds = stream_s[inside]
        if part[inside][0] != part[inside][-1] or seconds[-1] - seconds[0] > LONGEST_REST_S:
            return False
        return not np.any(np.diff(seconds) > LONGEST_GAP_S) and _extent(there[inside]) <= max(LEAST_MOVE_M, 2 * noise_m)

    found, first, count = [], 0, len(starts) - 1
    for end in range(1, count + 1):
        # Extended second by second while the vehicle stays in place.
        if end < count and is_rest(first, end + 1):
            continue
        inside = slice(starts[first], starts[end])
        if is_rest(first, end) and np.ptp(stream_s[inside]) >= SHORTEST_REST_S:
            begin_us, end_us = (stream_s[inside][[0, -1]] * 1e6).tolist()
            stream_extent_m = _extent(stream_m[inside], _OUTERMOST)
            found.append(Rest(int(begin_us), int(end_us), stream_extent_m, _extent(there[inside])))
            first = end
        while end < count and first < end and not is_rest(first, end + 1):
            first += 1
    return found


def _extent(positions_m: Array, outermost: float = 0.0) -> float:
    low, high = np.quantile(positions_m, [outermost, 1 - outermost], axis=0)
    return float(np.linalg.norm(high - low))


def departure(stream_m: Array, reference_m: Array, *, least_m: float) -> Array:
    """Return the departure of heights [N] from a reference, for any origin, direction and scale.

    If the reference changes by no more than ``least_m``, the stream's scale is taken to be right.
    """
    factor = 1.0
    if np.ptp(reference_m) > least_m:
        spread = reference_m - np.mean(reference_m)
        factor = float(np.clip(np.sum(spread * stream_m) / np.sum(spread**2), -3.0, 3.0))
    off = stream_m - factor * reference_m
    return np.asarray(off - np.median(off), dtype=np.float64)
