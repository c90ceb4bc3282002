# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How late messages are, by a clock that may step: compared with the least lag of each half second."""

from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np

from viso.doctor.evidence.evidence import Evidence
from viso.doctor.evidence.sender_clock import FEWEST_MESSAGES, are_us, is_constant, lag_ms, sender_clock
from viso.doctor.evidence.tracks import Floats, Ints, Track

STEP_BACK_US: Final = 1000
"""Smaller steps back may come from the rounding of stamps."""
LEAST_JUMP_MS: Final = 100.0
"""Smaller steps ahead may come from messages that were late until then."""
LEAST_STEP_MS: Final = 20.0
"""A smaller change of the lag does not show beside the jitter of a link."""
LEAST_NET_MS: Final = 300.0
"""A drift that is no straight line counts from here on."""
STEADY_WINDOWS: Final = 4
"""A change of the lag has to last for so many windows."""
_WINDOW_US: Final = 500_000
_MOST_IN_PAIRS: Final = 300


def usable_tracks(evidence: Evidence) -> Iterator[Track]:
    """Yield the tracks whose stamps are us of a clock that runs as the autopilot's; others show no lag."""
    for track in evidence.stream.tracks:
        if len(track) >= FEWEST_MESSAGES and shows_lags(track):
            yield track


def shows_lags(track: Track) -> bool:
    """Return whether the stamps of a track show how late its messages are."""
    return not is_constant(track) and are_us(track) and sender_clock(track) is None


class Minima(NamedTuple):
    """The least lag in each window, with the window's start and first message.

    No window contains a step of the clock; ``segment`` counts the steps before it.
    """

    time_s: Floats
    lag_ms: Floats
    first: Ints
    segment: Ints


def _segments(track: Track) -> Ints:
    """Return the number of steps of the sender's clock before each message."""
    step = np.diff(track.stamp_us)
    lag = lag_ms(track)
    ahead = np.minimum.accumulate(lag)[:-1] - lag[1:] > LEAST_JUMP_MS
    back = (step < -STEP_BACK_US) & (np.diff(track.sequence) % 256 < 192)
    return np.concatenate([[0], np.cumsum(ahead | back)]).astype(np.int64)


def minima_of(track: Track) -> Minima:
    """Return the least lag of each half second."""
    window = (track.arrival_us - track.arrival_us[0]) // _WINDOW_US
    segment = _segments(track)
    is_first = np.concatenate([[True], (np.diff(window) != 0) | (np.diff(segment) != 0)])
    first = np.flatnonzero(is_first)
    lag = np.minimum.reduceat(lag_ms(track), first)
    return Minima(window[first] * (_WINDOW_US * 1e-6), lag, first, segment[first])


def _slope(minima: Minima) -> float:
    """Return the median of the slopes in ms/s between all pairs of one segment (Theil and Sen); 0 without any."""
    i, j = np.triu_indices(len(minima.lag_ms), 1)
    apart_s = minima.time_s[j] - minima.time_s[i]
    usable = (apart_s > 0) & (minima.segment[i] == minima.segment[j])
    if not usable.any():
        return 0.0
    rise = minima.lag_ms[j[usable]] - minima.lag_ms[i[usable]]
    return float(np.median(rise / apart_s[usable]))


def drift_ppm(minima: Minima) -> float | None:
    """Return the steady drift of the clocks, positive if messages seem later and later; None if it is not steady."""
    if len(minima.lag_ms) < 2 * STEADY_WINDOWS:
        return None
    every = max(1, len(minima.lag_ms) // _MOST_IN_PAIRS)
    minima = Minima(minima.time_s[::every], minima.lag_ms[::every], minima.first[::every], minima.segment[::every])
    slope = _slope(minima)
    off = minima.lag_ms - slope * minima.time_s
    change = abs(slope) * float(minima.time_s[-1] - minima.time_s[0])
    is_line = float(np.median(np.abs(off - np.median(off)))) < 0.1 * change
    return slope * 1000 if is_line and change > LEAST_STEP_MS else None


def net_drift_ppm(minima: Minima) -> float | None:
    """Return the total drift of the clocks, steady or not; None if it turns back, is a step, or is small."""
    if len(minima.lag_ms) < 2 * STEADY_WINDOWS or minima.segment[-1] != minima.segment[0]:
        return None
    steady = np.lib.stride_tricks.sliding_window_view(minima.lag_ms, STEADY_WINDOWS).min(axis=1)
    change = float(steady[-1] - steady[0])
    step = float(np.abs(steady[STEADY_WINDOWS:] - steady[:-STEADY_WINDOWS]).max(initial=0.0))
    if abs(change) < LEAST_NET_MS or abs(change) < 0.6 * float(np.ptp(steady)) or step > 0.5 * abs(change):
        return None
    return change / float(minima.time_s[-1] - minima.time_s[0]) * 1000


def lateness_ms(track: Track) -> Floats:
    """Return how much later messages are than the quickest around them."""
    minima = minima_of(track)
    least = minima.lag_ms.copy()
    same = minima.segment[1:] == minima.segment[:-1]
    least[1:] = np.where(same, np.minimum(least[1:], minima.lag_ms[:-1]), least[1:])
    least[:-1] = np.where(same, np.minimum(least[:-1], minima.lag_ms[1:]), least[:-1])
    window = np.searchsorted(minima.first, np.arange(len(track)), side="right") - 1
    return np.asarray(lag_ms(track) - least[window], dtype=np.float64)
