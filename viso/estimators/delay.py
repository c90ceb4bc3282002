# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The delay of a stream of attitudes behind the vehicle's motion, which is the right VISO_DELAY_MS."""

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt

from viso.estimators.least_squares import blocks_of, fit
from viso.estimators.turning import TurnPair, centred, correlation_of, turn_pair
from viso.geometry.rotation import Array, best_rotation, skews

SEARCH_MS: Final = (-100.0, 400.0)
"""The search range of the delay."""

LEAST_CORRELATION: Final = 0.6
LARGEST_SIGMA_MS: Final = 10.0
LEAST_RATE_RAD: Final = 0.01  # a second
DELAY_RANGE_MS: Final = (0, 250)  # of VISO_DELAY_MS

_GRID_MS: Final = 10.0  # rotations over a window agree over a delay many times as long
_FEWEST_SAMPLES: Final = 30
_SHORTEST_BLOCK_S: Final = 1.0
_APART_MS: Final = 50.0
_CLEARER: Final = 6.0  # difference of log likelihoods from the next best delay
PIECE_S: Final = 8.0
_MOST_PIECES: Final = 16
_SEARCH_OVER_TIME_MS: Final = (-100.0, 1500.0)
_PIECE_GRID_MS: Final = 40.0
_LEAST_OF_PIECE: Final = 0.8
_LARGEST_OF_PIECE_MS: Final = 100.0  # a delay that changes within the piece counts in
_REFINEMENTS: Final = 4
_SLOPE_STEP_S: Final = 2e-3


@dataclass(frozen=True, slots=True)
class Delay:
    """The age of a stream's attitudes at their stamps.

    Attributes:
        delay_ms: the vehicle had the attitude at stamp - delay_ms; negative if stamps are too old. NaN without motion.
        sigma_ms: one standard deviation; infinite without motion.
        correlation: of the rotations at that delay, 0 to 1, with the stream's axes rotated to fit.
        enough_motion: whether the motion determines the delay.
        rate_rad: the vehicle's rate of turn in rad/s, root of the mean square about its mean.
    """

    delay_ms: float
    sigma_ms: float
    correlation: float
    enough_motion: bool
    rate_rad: float

    @property
    def viso_delay_ms(self) -> int | None:
        """The best value of VISO_DELAY_MS, within its range; None without enough motion."""
        if not self.enough_motion:
            return None
        return min(max(round(self.delay_ms), DELAY_RANGE_MS[0]), DELAY_RANGE_MS[1])


def estimate_delay(
    stream_time_us: npt.ArrayLike,
    stream_quat_wxyz: npt.ArrayLike,
    vehicle_time_us: npt.ArrayLike,
    vehicle_quat_wxyz: npt.ArrayLike,
) -> Delay:
    """Find the delay at which the stream's rotations agree with the vehicle's.

    Rotations over a fifth of a second are compared in body axes; neither the camera's mounting nor the stream's heading
    matters. The EKF subtracts VISO_DELAY_MS from the corrected stamp (CTimeMS of VISP), so with
    those times the result is what VISO_DELAY_MS should be; with times of arrival the transport's lag is part of it.

    Args:
        stream_time_us: [N], on the vehicle's clock.
        stream_quat_wxyz: [N, 4] from the stream's body to its world.
        vehicle_time_us: [M], of the same clock.
        vehicle_quat_wxyz: the vehicle's attitudes, from body (FRD) to earth (NED), [M, 4].

    Raises:
        ValueError: if shapes do not fit.
    """
    pair = turn_pair(stream_time_us, stream_quat_wxyz, vehicle_time_us, vehicle_quat_wxyz).spread()
    grid_ms = np.arange(SEARCH_MS[0], SEARCH_MS[1] + _GRID_MS / 2, _GRID_MS)
    for delay_ms in (grid_ms[0], grid_ms[-1]):
        pair = pair.chosen(pair.vehicle_rad(delay_ms * 1e-3)[1])
    if len(pair) < _FEWEST_SAMPLES:
        return Delay(math.nan, math.inf, 0.0, False, 0.0)
    sparse = pair.thinned()
    correlations = _correlations(sparse, grid_ms)
    best = int(np.argmax(correlations))
    found = _refined(pair, float(grid_ms[best]))
    inside = SEARCH_MS[0] < found.delay_ms < SEARCH_MS[1]
    if found.enough_motion and inside and _stands_out(correlations, best, pair):
        return found
    return replace(found, delay_ms=math.nan, sigma_ms=math.inf, enough_motion=False)


def delays_over_time(
    stream_time_us: npt.ArrayLike,
    stream_quat_wxyz: npt.ArrayLike,
    vehicle_time_us: npt.ArrayLike,
    vehicle_quat_wxyz: npt.ArrayLike,
) -> tuple[Array, Array]:
    """Return the delay in up to 16 pieces of a stream [K] in ms, and the middle of each in s [K].

    Pieces whose motion does not determine it are left out. Arguments are as of ``estimate_delay``.
    """
    pair = turn_pair(stream_time_us, stream_quat_wxyz, vehicle_time_us, vehicle_quat_wxyz)
    if len(pair) < _FEWEST_SAMPLES:
        return np.zeros(0), np.zeros(0)
    begin_s, end_s = float(pair.start_s[0]), float(pair.start_s[-1])
    count = min(_MOST_PIECES, int((end_s - begin_s) / (PIECE_S / 2)) - 1)
    grid_ms = np.arange(*_SEARCH_OVER_TIME_MS, _PIECE_GRID_MS)
    delays_ms, middles_s = [], []
    for start_s in np.linspace(begin_s, end_s - PIECE_S, max(count, 1)).tolist():
        piece = pair.chosen((pair.start_s >= start_s) & (pair.start_s < start_s + PIECE_S))
        for delay_ms in (grid_ms[0], grid_ms[-1]):
            piece = piece.chosen(piece.vehicle_rad(delay_ms * 1e-3)[1])
        if len(piece) < _FEWEST_SAMPLES:
            continue
        sparse = piece.thinned()
        correlations = _correlations(sparse, grid_ms)
        best = int(np.argmax(correlations))
        found = _refined(piece, float(grid_ms[best]))
        is_sure = correlations[best] >= _LEAST_OF_PIECE and found.sigma_ms <= _LARGEST_OF_PIECE_MS
        if is_sure and found.rate_rad >= LEAST_RATE_RAD and _stands_out(correlations, best, piece, _PIECE_GRID_MS):
            delays_ms.append(_peak(grid_ms, correlations, best))
            middles_s.append(start_s + PIECE_S / 2)
    return np.array(delays_ms), np.array(middles_s)


def _correlations(pair: TurnPair, delays_ms: Array) -> Array:
    """Return the correlation [K] at each delay [K], with the stream's axes rotated to fit."""
    stream, vehicle = centred(pair.stream_rad), centred(pair.vehicle_rad(delays_ms * 1e-3)[0])
    rotated = stream @ np.swapaxes(best_rotation(stream, vehicle), -1, -2)
    return np.array([correlation_of(*both) for both in zip(rotated, vehicle, strict=True)])


def _peak(grid_ms: Array, correlations: Array, best: int) -> float:
    """Return where the parabola through the best value of a grid and its neighbours is highest."""
    if not 0 < best < len(grid_ms) - 1:
        return float(grid_ms[best])
    before, there, after = correlations[best - 1 : best + 2].tolist()
    bend = before - 2 * there + after
    return float(grid_ms[best]) + (0.5 * (before - after) / bend if bend < 0 else 0.0) * _PIECE_GRID_MS


def _stands_out(correlations: Array, best: int, pair: TurnPair, step_ms: float = _GRID_MS) -> bool:
    """Return whether no distant delay fits nearly as well, as happens with periodic motion."""
    peak = np.ones(len(correlations), bool)
    peak[1:] &= correlations[1:] >= correlations[:-1]
    peak[:-1] &= correlations[:-1] >= correlations[1:]
    apart = np.abs(np.arange(len(correlations)) - best) * step_ms > _APART_MS
    rivals = correlations[peak & apart]
    if not len(rivals):
        return True
    independent = 3 * float(pair.start_s[-1] - pair.start_s[0]) / pair.window_s
    unexplained, of_rival = 1 - correlations[best] ** 2, 1 - float(rivals.max()) ** 2
    return 0.5 * independent * math.log(of_rival / max(unexplained, 1e-12)) > _CLEARER


def _refined(pair: TurnPair, delay_ms: float) -> Delay:
    """Refine a delay of the grid by Gauss-Newton steps."""
    chosen, sigma_ms = pair, math.inf
    for _ in range(_REFINEMENTS):
        delay_s = delay_ms * 1e-3
        vehicle = centred(chosen.vehicle_rad(delay_s)[0])
        rotation = best_rotation(centred(chosen.stream_rad), vehicle)
        stream = centred(chosen.stream_rad) @ rotation.T
        later, earlier = (chosen.vehicle_rad(delay_s + step_s)[0] for step_s in (_SLOPE_STEP_S, -_SLOPE_STEP_S))
        slope = centred(later - earlier) / (2 * _SLOPE_STEP_S)
        design = np.concatenate([slope[:, :, None], skews(stream)], axis=2)
        step, covariance = fit(design, stream - vehicle, blocks_of(chosen.start_s, _SHORTEST_BLOCK_S))
        sigma_ms = math.sqrt(covariance[0, 0]) * 1e3
        delay_ms += float(np.clip(step[0] * 1e3, -_GRID_MS, _GRID_MS))
        chosen = pair.without_outliers(delay_ms * 1e-3, rotation)
    (correlation,) = _correlations(chosen, np.array([delay_ms])).tolist()
    rate = chosen.rate_rad(delay_ms * 1e-3)
    settled = correlation >= LEAST_CORRELATION and sigma_ms <= LARGEST_SIGMA_MS and rate >= LEAST_RATE_RAD
    return Delay(delay_ms, sigma_ms, correlation, settled, rate)
