# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the stamps of a track are worth as a clock."""

from typing import Final

import numpy as np

from viso.doctor.measures.sender_clock import Departure, sender_clock
from viso.doctor.measures.tracks import Floats, Ints, Track

FEWEST: Final = 10
_RIGHT_UNIT: Final = (0.8, 1.25)
_SHORTEST_US: Final = 500_000
_LEAST_US: Final = 200_000


def stamp_rate(track: Track, parts: int = 8) -> float | None:
    """Return by how many us the stamps advance in a us of the autopilot's clock; None if that cannot be told.

    The median over pairs that lie a part of the track apart, but half a second at least: a step of the clock or a late
    message does not move it.
    """
    if len(track) < FEWEST:
        return None
    half_second = int(np.searchsorted(track.arrival_us, track.arrival_us[0] + _SHORTEST_US))
    apart = min(max(len(track) // parts, half_second), len(track) // 2)
    arrived = (track.arrival_us[apart:] - track.arrival_us[:-apart]).astype(np.float64)
    stamped = (track.stamp_us[apart:] - track.stamp_us[:-apart]).astype(np.float64)
    usable = arrived > 0
    if not usable.any() or np.median(arrived[usable]) < _LEAST_US:
        return None
    return float(np.median(stamped[usable] / arrived[usable]))


def is_constant(track: Track) -> bool:
    """Return whether nearly all stamps are the same; whole seconds are not."""
    if len(track) < FEWEST or np.mean(np.diff(track.stamp_us) == 0) < 0.9:
        return False
    return len(np.unique(track.stamp_us)) < max(3.0, 0.5 * track.span_s)


def are_us(track: Track) -> bool:
    """Return whether the stamps count us, as far as can be told."""
    rate = stamp_rate(track)
    return rate is not None and _RIGHT_UNIT[0] < rate < _RIGHT_UNIT[1]


def lag_ms(track: Track) -> Floats:
    """Return how much later than the quickest message each arrived, by its stamp, in ms."""
    difference = track.arrival_us - track.stamp_us
    return np.asarray((difference - difference.min()) * 1e-3, dtype=np.float64)


def time_base_us(track: Track) -> Ints:
    """Return times of the messages in us, never decreasing: their stamps if they are a clock, else their arrivals."""
    clock, advance = sender_clock(track), np.diff(track.stamp_us)
    if clock is None and are_us(track) and bool(np.all(advance >= 0)):
        return track.stamp_us
    if clock is not None and clock.departure is Departure.RATE and bool(np.all(advance > 0)):
        return np.asarray(track.stamp_us / clock.factor, dtype=np.int64)
    return np.asarray(track.arrival_us - track.arrival_us[0], dtype=np.int64)
