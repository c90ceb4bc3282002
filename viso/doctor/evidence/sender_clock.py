# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The clock of stamps: its unit, and how it departs from the autopilot's clock, if it does."""

from dataclasses import dataclass
from enum import Enum
from functools import lru_cache
from typing import Final

import numpy as np

from viso.doctor.evidence.tracks import Floats, Ints, Track

FEWEST_MESSAGES: Final = 10
"""Fewer messages of a track show nothing."""

_UNIT_WITHIN: Final = (0.8, 1.25)  # times us: stamps in us, whatever the lateness of messages
_RATE_APART_US: Final = 500_000  # between the messages of a pair whose stamps are compared, at least
_RATE_LEAST_US: Final = 200_000  # of the median distance of such pairs, or they show no rate
_CLOCK_FEWEST: Final = 20  # messages of a track whose clock can be compared
_CLOCK_SHORTEST_S: Final = 2.0  # of such a track, unless its stamps gain more than that
_GAIN_SHORTEST_S: Final = 0.5  # of any
_WINDOW_S: Final = 2.0
_WINDOWS: Final = (6, 60)  # the fewest and the most
_NEAR_S: Final = 0.25  # the quickest message so near to the edge of a window bounds it
_FEWEST_NEAR: Final = 3
_LEAST_DRIFT_S: Final = 0.3  # over the track, or it is no departure
_LEAST_RATE: Final = 0.01  # off 1, likewise
_LEAST_GAIN_S: Final = 0.02  # in a window, or its rate may be jitter
_DEPARTING_SHARE: Final = 0.25  # of the windows
_LEAST_STEP_S: Final = 0.1
_FEWEST_STEPS: Final = 5
_STEPPED_SHARE: Final = 0.05  # of the track's time
_STEP_TIMES_USUAL: Final = 10.0  # times the median change of the lag
_DRIFT_TIMES_LATE: Final = 4.0  # times the lateness of nine of ten messages
_ALTERNATING_SHARE: Final = 0.05  # of the messages, each way
_LEAST_APART_S: Final = 0.2  # of two clocks in turn


class Departure(Enum):
    """How a clock departs from the autopilot's."""

    RATE = "another rate all along"
    CHANGING = "a rate that changes"
    STEPS = "steps"
    ALTERNATING = "two clocks in turn"


@dataclass(frozen=True, slots=True)
class SenderClock:
    """A clock that departs from the autopilot's.

    Attributes:
        departure: how.
        factor: s of the stamps in a s of the autopilot's clock, over the whole track.
        slowest, quickest: the same over stretches of some s, the extreme tenths left out.
        steps: how often the stamps stepped.
        step_s: the median step.
    """

    departure: Departure
    factor: float
    slowest: float
    quickest: float
    steps: int
    step_s: float

    @property
    def worst(self) -> float:
        """The largest departure of the factor from 1."""
        return max(abs(rate - 1) for rate in (self.factor, self.slowest, self.quickest))


@dataclass(frozen=True, slots=True, eq=False)
class _Windows:
    """K stretches of a track, in s of the autopilot's clock.

    Attributes:
        length_s: of each.
        gain_s: what the stamps gain in it.
        messages: how many.
        late_s: how late three quarters and nine tenths of the messages come at most, by the quickest around them.
    """

    length_s: Floats
    gain_s: Floats
    messages: Ints
    late_s: tuple[float, float]

    @property
    def rate(self) -> Floats:
        return 1 + self.gain_s / self.length_s


def _windows(arrival_s: Floats, stamp_s: Floats) -> _Windows | None:
    """Return stretches between quick messages; None if there are too few."""
    count = int(np.clip((arrival_s[-1] - arrival_s[0]) / _WINDOW_S, *_WINDOWS))
    lag = arrival_s - stamp_s
    wanted = np.linspace(arrival_s[0], arrival_s[-1], count + 1)
    near_s = max(_NEAR_S, 2 * float(np.median(np.diff(arrival_s))))
    first, last = (np.searchsorted(arrival_s, wanted + apart) for apart in (-near_s, near_s))
    near = [(a, b) for a, b in zip(first.tolist(), last.tolist(), strict=True) if b - a >= _FEWEST_NEAR]
    chosen = np.unique([a + int(np.argmin(lag[a:b])) for a, b in near])
    if len(chosen) <= _WINDOWS[0] // 2:
        return None
    chosen = chosen[np.diff(arrival_s[chosen], prepend=-np.inf) > 0]
    late = np.abs(lag - np.interp(arrival_s, arrival_s[chosen], lag[chosen]))
    many_s, most_s = (float(value) for value in np.quantile(late[chosen[0] : chosen[-1] + 1], [0.75, 0.9]))
    return _Windows(np.diff(arrival_s[chosen]), -np.diff(lag[chosen]), np.diff(chosen), (many_s, most_s))


def _steps_s(arrival_s: Floats, stamp_s: Floats, late_s: float) -> Floats:
    """Return by how much the clock stepped before each message but the first; 0 where it went on."""
    gain = np.diff(stamp_s) - np.diff(arrival_s)
    off = gain - np.median(gain)
    limit = max(_LEAST_STEP_S, 2 * late_s, _STEP_TIMES_USUAL * float(np.median(np.abs(off))))
    steps, lag = np.zeros(len(gain)), arrival_s - stamp_s
    for index in np.flatnonzero(np.abs(off) > limit).tolist():
        # Behind a late message, or a row of them that had waited, the lag is soon what it was.
        around = np.searchsorted(arrival_s, arrival_s[[index, index + 1]] + np.array([-1.0, 1.0]))
        before, after = lag[around[0] : index + 1], lag[index + 1 : around[1]]
        if len(after) and (before.min() - after.min()) / off[index] > 0.5:
            steps[index] = off[index]
    return steps


def _turns_s(track: Track) -> Floats:
    """Return the steps ahead and back of stamps that come from two clocks in turn, though messages are in order."""
    step_s = np.diff(track.stamp_us)[np.diff(track.sequence) % 256 < 192] * 1e-6
    ahead = step_s > _LEAST_APART_S + 5 * abs(float(track.stamp_us[-1])) * 1e-6 / len(track)
    back = step_s < -_LEAST_APART_S
    alternates = len(step_s) and min(np.mean(ahead), np.mean(back)) > _ALTERNATING_SHARE
    return np.asarray(step_s[ahead | back] if alternates else step_s[:0], dtype=np.float64)


def _is_queue(windows: _Windows, drift_s: float, range_s: float) -> bool:
    """Return whether messages waited in a queue: the rate of their stamps is steady, that of their arrivals is not."""
    if drift_s > 0.5 * range_s or np.any(windows.rate <= 0):
        return False
    by_arrival = windows.messages / windows.length_s
    by_stamp = by_arrival / windows.rate
    uneven = [float(np.std(rate) / np.mean(rate)) for rate in (by_arrival, by_stamp)]
    return uneven[0] > max(2 * uneven[1], 0.02)


@lru_cache(maxsize=32)  # many checks ask
def sender_clock(track: Track) -> SenderClock | None:
    """Return how the clock of a track departs; None if it runs as the autopilot's, or that cannot be known.

    A few steps are no departure, nor is a drift of less than 1 %.
    """
    if len(track) < _CLOCK_FEWEST or track.span_s < _GAIN_SHORTEST_S:
        return None
    # No lateness of messages is as long.
    if track.span_s < _CLOCK_SHORTEST_S and track.stamp_us[-1] * 1e-6 - track.span_s < _CLOCK_SHORTEST_S:
        return None
    arrival_s: Floats = np.asarray(track.arrival_us * 1e-6, dtype=np.float64)
    stamp_s: Floats = np.asarray(track.stamp_us * 1e-6, dtype=np.float64)
    whole = _windows(arrival_s, stamp_s)
    if whole is None:
        return None
    set_s = _steps_s(arrival_s, stamp_s, whole.late_s[0])
    windows = _windows(arrival_s, stamp_s - np.concatenate([[0.0], np.cumsum(set_s)])) or whole
    span_s, gained_s = float(np.sum(whole.length_s)), float(np.sum(whole.gain_s))

    def departing(departure: Departure, rates: Floats, steps_s: Floats) -> SenderClock:
        slowest, quickest = (float(value) for value in np.quantile(rates, [0.1, 0.9]))
        step_s = float(np.median(np.abs(steps_s))) if len(steps_s) else 0.0
        return SenderClock(departure, 1 + gained_s / span_s, slowest, quickest, len(steps_s), step_s)

    turns_s, steps_s = _turns_s(track), set_s[set_s != 0]
    if len(turns_s):
        return departing(Departure.ALTERNATING, whole.rate, turns_s)
    gain_s = np.concatenate([[0.0], np.cumsum(windows.gain_s)])
    range_s, rates = float(np.ptp(gain_s)), windows.rate
    advance = np.diff(stamp_s)
    finest_s = float(np.median(advance[advance > 0])) if np.any(advance > 0) else 0.0
    least_s = max(_LEAST_DRIFT_S, _LEAST_RATE * span_s, 2 * finest_s, _DRIFT_TIMES_LATE * windows.late_s[1])
    is_other = (np.abs(rates - 1) > _LEAST_RATE) & (np.abs(windows.gain_s) > _LEAST_GAIN_S)
    if (
        range_s >= least_s
        and np.mean(is_other) > _DEPARTING_SHARE
        and not _is_queue(windows, float(gain_s[-1]), range_s)
    ):
        is_steady = np.ptp(np.quantile(rates, [0.1, 0.9])) < max(0.05, 0.2 * abs(float(np.median(rates)) - 1))
        return departing(Departure.RATE if is_steady else Departure.CHANGING, rates, steps_s)
    # One large step alone is no rate.
    stepped_s = abs(float(np.sum(set_s))) - float(np.max(np.abs(set_s)))
    if np.count_nonzero(set_s) >= _FEWEST_STEPS and stepped_s >= max(least_s, _STEPPED_SHARE * span_s):
        return departing(Departure.STEPS, whole.rate, steps_s)
    return None


def stamp_rate(track: Track, parts: int = 8) -> float | None:
    """Return by how many us the stamps advance per us of the autopilot's clock; None if that cannot be known.

    The median over pairs that lie a part of the track apart, but half a second at least: a step of the clock or a late
    message does not move it.
    """
    if len(track) < FEWEST_MESSAGES:
        return None
    half_second = int(np.searchsorted(track.arrival_us, track.arrival_us[0] + _RATE_APART_US))
    apart = min(max(len(track) // parts, half_second), len(track) // 2)
    arrived = (track.arrival_us[apart:] - track.arrival_us[:-apart]).astype(np.float64)
    stamped = (track.stamp_us[apart:] - track.stamp_us[:-apart]).astype(np.float64)
    usable = arrived > 0
    if not usable.any() or np.median(arrived[usable]) < _RATE_LEAST_US:
        return None
    return float(np.median(stamped[usable] / arrived[usable]))


def is_constant(track: Track) -> bool:
    """Return whether nearly all stamps are the same; whole seconds are not."""
    if len(track) < FEWEST_MESSAGES or np.mean(np.diff(track.stamp_us) == 0) < 0.9:
        return False
    return len(np.unique(track.stamp_us)) < max(3.0, 0.5 * track.span_s)


def are_us(track: Track) -> bool:
    """Return whether the stamps count us, as far as can be known."""
    rate = stamp_rate(track)
    return rate is not None and _UNIT_WITHIN[0] < rate < _UNIT_WITHIN[1]


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
