# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A sender's clock against the receiver's: offset and drift, from stamps and times of arrival alone.

Transport only ever adds to a time of arrival, so the clocks' relation is the line below all messages and nearest to
them: Moon, Skelly and Towsley, Estimation and removal of clock skew from network delay measurements (1999).
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from viso.estimators.turning import Array

LARGEST_SIGMA_PPM: Final = 500.0
LARGEST_UNEVENNESS_US: Final = 20_000.0

_SEGMENTS: Final = 12
_FEWEST_SAMPLES: Final = 40
_SHORTEST_SPAN_US: Final = 2e6


@dataclass(frozen=True, slots=True)
class TimeOffset:
    """The line arrival = stamp + offset + drift * (stamp - reference), below all messages.

    Attributes:
        reference_us: the stamp in the middle, to which the offset belongs.
        offset_us: receiver's clock less sender's there, the fastest message's transport included. NaN if unknown.
        offset_sigma_us: one standard deviation; infinite if unknown.
        drift_ppm: by how much the receiver's clock is faster, in millionths. NaN if unknown.
        drift_sigma_ppm: one standard deviation; infinite if unknown.
        uneven_us: how far the fastest messages of each part are off the line, root of the mean square; large if the
            clock stepped or the transport changed.
        median_lag_us: of all messages above the line.
        sufficient: whether there are enough messages, over long enough, on one even line.
        samples: messages used.
    """

    reference_us: float
    offset_us: float
    offset_sigma_us: float
    drift_ppm: float
    drift_sigma_ppm: float
    uneven_us: float
    median_lag_us: float
    sufficient: bool
    samples: int

    def lags_us(self, stamp_us: npt.ArrayLike, arrival_us: npt.ArrayLike) -> Array:
        """Return how much later than the line messages arrived."""
        stamps, arrivals = np.asarray(stamp_us, np.float64), np.asarray(arrival_us, np.float64)
        since = stamps - self.reference_us
        lags: Array = arrivals - stamps - self.offset_us - self.drift_ppm * 1e-6 * since
        return lags


def estimate_time_offset(stamp_us: npt.ArrayLike, arrival_us: npt.ArrayLike) -> TimeOffset:
    """Find offset and drift of the clock that stamps messages.

    The order of messages is of no importance. Stamps of another unit than microseconds show as a drift of about
    -1e6 ppm (nanoseconds) or 1e9 ppm (milliseconds).

    Args:
        stamp_us: the sender's stamps [N].
        arrival_us: when each arrived by the receiver's clock [N].

    Raises:
        ValueError: if shapes do not fit.
    """
    stamps, arrivals = np.asarray(stamp_us, np.float64), np.asarray(arrival_us, np.float64)
    if stamps.ndim != 1 or stamps.shape != arrivals.shape:
        raise ValueError(f"stamps of shape {stamps.shape} and arrivals of shape {arrivals.shape}: not [N] and [N]")
    usable = np.isfinite(stamps) & np.isfinite(arrivals)
    stamps, arrivals = stamps[usable], arrivals[usable]
    if len(stamps) < _FEWEST_SAMPLES or np.ptp(arrivals) < _SHORTEST_SPAN_US or np.ptp(stamps) == 0:
        return TimeOffset(math.nan, math.nan, math.inf, math.nan, math.inf, math.nan, math.nan, False, len(stamps))
    order = np.lexsort((arrivals, stamps))
    return _line_below(stamps[order], arrivals[order])


def _line_below(stamps: Array, arrivals: Array) -> TimeOffset:
    middle = 0.5 * float(stamps[0] + stamps[-1])
    first_lag = float(arrivals[0] - stamps[0])
    since, lags = stamps - middle, arrivals - stamps - first_lag
    start, end = _edge_below(since, lags)
    slope = float((lags[end] - lags[start]) / (since[end] - since[start]))
    base = float(lags[start] - slope * since[start])
    above = lags - base - slope * since
    uneven, base_sigma, slope_sigma = _unevenness(since, above)
    sufficient = slope_sigma * 1e6 <= LARGEST_SIGMA_PPM and uneven <= LARGEST_UNEVENNESS_US
    return TimeOffset(
        reference_us=middle,
        offset_us=base + first_lag,
        offset_sigma_us=base_sigma,
        drift_ppm=slope * 1e6,
        drift_sigma_ppm=slope_sigma * 1e6,
        uneven_us=uneven,
        median_lag_us=float(np.median(above)),
        sufficient=sufficient,
        samples=len(stamps),
    )


def _edge_below(x: Array, y: Array) -> tuple[int, int]:
    """Return the ends of the line below all points with the least sum of distances: the hull's edge below their mean.

    Args:
        x: not shrinking; points of the same x by growing y.
        y: the distance is along this axis.
    """
    hull: list[int] = []
    for index in range(len(x)):
        if hull and x[index] == x[hull[-1]]:
            continue
        while len(hull) > 1 and _is_above(x, y, hull[-2], hull[-1], index):
            hull.pop()
        hull.append(index)
    corners = x[hull]
    place = int(np.clip(np.searchsorted(corners, x.mean(), side="right"), 1, len(hull) - 1))
    return hull[place - 1], hull[place]


def _is_above(x: Array, y: Array, start: int, middle: int, end: int) -> bool:
    """Say whether the middle one of three points is on or above the line between the others."""
    return bool((y[middle] - y[start]) * (x[end] - x[start]) >= (y[end] - y[start]) * (x[middle] - x[start]))


def _unevenness(since: Array, above: Array) -> tuple[float, float, float]:
    """Return how far the least of each part is off the line, and what that leaves open of its base and slope."""
    edges = np.linspace(since[0], since[-1], _SEGMENTS + 1)
    part = np.clip(np.searchsorted(edges, since, side="right") - 1, 0, _SEGMENTS - 1)
    taken = np.unique(part)
    if len(taken) < _SEGMENTS // 2:
        return math.inf, math.inf, math.inf
    lowest = np.array([np.flatnonzero(part == number)[np.argmin(above[part == number])] for number in taken])
    uneven = math.sqrt(float(np.mean(above[lowest] ** 2)))
    places = since[lowest] - since[lowest].mean()
    return uneven, uneven / math.sqrt(len(lowest)), uneven / math.sqrt(float(np.sum(places**2)))
