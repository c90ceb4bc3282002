# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""XN3: stamps, and how late messages come."""

from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np

from emulator.doctor.evidence import Evidence
from emulator.doctor.findings import Rule, Severity, Sighting
from emulator.doctor.stamps import FEWEST, are_us, is_constant, lag_ms, stamp_rate
from emulator.doctor.tracks import Floats, Ints, Track
from emulator.doctor.words import at, share

_CORRECTION: Final = "AP_RTC/JitterCorrection.cpp, JitterCorrection::correct_offboard_timestamp_usec"
_WINDOW_US: Final = 500_000
_STEP_BACK_US: Final = 1000
_LEAST_JUMP_MS: Final = 100.0
_LEAST_STEP_MS: Final = 20.0
_STEADY_WINDOWS: Final = 4
_LEAST_DRIFT_PPM: Final = 2000.0
_MAX_LAG_MS: Final = 500.0
_FILTER_STEP_MS: Final = 12
_MARGIN_MS: Final = 10.0
_DELAY_TOLERANCE_MS: Final = 15.0
_BURST_US: Final = 5000
_BURST_SPREAD_US: Final = 50_000
_BURST_SIZE: Final = 3
_UNITS: Final = (
    ("s", 1e-6, "seconds", "multiply them by 1000000"),
    ("ms", 1e-3, "milliseconds", "multiply them by 1000"),
    ("ns", 1e3, "nanoseconds", "divide them by 1000"),
)


def _usable(evidence: Evidence) -> Iterator[Track]:
    """Yield the tracks whose stamps are us of some clock."""
    for track in evidence.tracks:
        if len(track) >= FEWEST and not is_constant(track) and are_us(track):
            yield track


def _whole(text: str, track: Track, fix: str | None = None) -> Sighting:
    return Sighting(text, track.numbers.tolist(), int(track.arrival_us[0]), int(track.arrival_us[-1]), fix)


def _constant(evidence: Evidence) -> Iterator[Sighting]:
    for track in evidence.tracks:
        if is_constant(track):
            yield _whole(
                f"{track.sender}: the stamp is always {int(track.first_stamp + np.median(track.stamp_us))}", track
            )
            continue
        if not are_us(track):
            continue
        runs = np.split(np.arange(len(track)), np.flatnonzero(np.diff(track.stamp_us) != 0) + 1)
        longest = max(runs, key=len, default=np.arange(0))
        if len(longest) >= FEWEST:
            value, start = int(track.first_stamp + track.stamp_us[longest[0]]), int(track.arrival_us[longest[0]])
            yield Sighting(
                f"{track.sender}: the stamp stays at {value} for {len(longest)} messages, from {at(start)} on",
                track.numbers[longest].tolist(),
                start,
                int(track.arrival_us[longest[-1]]),
            )


def _wrong_unit(evidence: Evidence) -> Iterator[Sighting]:
    for track in evidence.tracks:
        if is_constant(track) or are_us(track):
            continue
        # Whole seconds show over half of the track alone.
        rates = [rate for rate in (stamp_rate(track), stamp_rate(track, parts=2)) if rate is not None]
        for unit, factor, name, cure in _UNITS:
            if any(0.8 < rate / factor < 1.25 for rate in rates):
                advance = int(track.stamp_us[-1] - track.stamp_us[0])
                text = f"{track.sender}: in {track.span_s:.1f} s the stamps advance by {advance}: they count {name}"
                yield _whole(text, track, f"The field is in us; your stamps are {unit}: {cure}.")


def _steps_back(evidence: Evidence) -> Iterator[Sighting]:
    for track in _usable(evidence):
        step = np.diff(track.stamp_us)
        in_order = np.diff(track.sequence) % 256 < 192
        back = np.flatnonzero((step < -_STEP_BACK_US) & in_order)
        if len(back):
            largest = int(-step[back].min())
            times = "once" if len(back) == 1 else f"{len(back)} times"
            yield Sighting(
                f"{track.sender}: stamps step back {times}, by up to {largest / 1000:.0f} ms, the first time at "
                f"{at(int(track.arrival_us[back[0] + 1]))}",
                track.numbers[back + 1].tolist(),
                int(track.arrival_us[back[0] + 1]),
                int(track.arrival_us[back[-1] + 1]),
            )


def _steps_forward(evidence: Evidence) -> Iterator[Sighting]:
    for track in _usable(evidence):
        lag = lag_ms(track)
        least = np.minimum.accumulate(lag)
        ahead = np.flatnonzero(least[:-1] - lag[1:] > _LEAST_JUMP_MS)
        if len(ahead):
            by = float((least[:-1] - lag[1:])[ahead].max())
            yield Sighting(
                f"{track.sender}: stamps leap ahead by {by:.0f} ms at {at(int(track.arrival_us[ahead[0] + 1]))}",
                track.numbers[ahead + 1].tolist(),
                int(track.arrival_us[ahead[0] + 1]),
                int(track.arrival_us[ahead[-1] + 1]),
            )


class _Minima(NamedTuple):
    """The least lag in each of some windows, none of which goes over a step of the clock.

    Attributes:
        time_s: when the window begins.
        lag_ms: the least in it.
        first: its first message.
        segment: how many steps of the clock there were before.
    """

    time_s: Floats
    lag_ms: Floats
    first: Ints
    segment: Ints


def _segments(track: Track) -> Ints:
    """Return for each message how many steps of the sender's clock there were before it."""
    step = np.diff(track.stamp_us)
    lag = lag_ms(track)
    ahead = np.minimum.accumulate(lag)[:-1] - lag[1:] > _LEAST_JUMP_MS
    back = (step < -_STEP_BACK_US) & (np.diff(track.sequence) % 256 < 192)
    return np.concatenate([[0], np.cumsum(ahead | back)]).astype(np.int64)


def _minima(track: Track) -> _Minima:
    window = (track.arrival_us - track.arrival_us[0]) // _WINDOW_US
    segment = _segments(track)
    is_first = np.concatenate([[True], (np.diff(window) != 0) | (np.diff(segment) != 0)])
    first = np.flatnonzero(is_first)
    lag = np.minimum.reduceat(lag_ms(track), first)
    return _Minima(window[first] * (_WINDOW_US * 1e-6), lag, first, segment[first])


def _slope(minima: _Minima) -> float:
    """Return the median of the slopes in ms/s between all pairs of one segment (Theil and Sen); 0 without any."""
    i, j = np.triu_indices(len(minima.lag_ms), 1)
    apart_s = minima.time_s[j] - minima.time_s[i]
    usable = (apart_s > 0) & (minima.segment[i] == minima.segment[j])
    if not usable.any():
        return 0.0
    rise = minima.lag_ms[j[usable]] - minima.lag_ms[i[usable]]
    return float(np.median(rise / apart_s[usable]))


def _thinned(minima: _Minima, most: int = 300) -> _Minima:
    every = max(1, len(minima.lag_ms) // most)
    return _Minima(minima.time_s[::every], minima.lag_ms[::every], minima.first[::every], minima.segment[::every])


def _drift_ppm(minima: _Minima) -> float | None:
    """Return the steady drift of the clocks; None where the lag does not follow a line."""
    if len(minima.lag_ms) < 2 * _STEADY_WINDOWS:
        return None
    minima = _thinned(minima)
    slope = _slope(minima)
    off = minima.lag_ms - slope * minima.time_s
    change = abs(slope) * float(minima.time_s[-1] - minima.time_s[0])
    is_line = float(np.median(np.abs(off - np.median(off)))) < 0.1 * change
    return slope * 1000 if is_line and change > _LEAST_STEP_MS else None


def _drift(evidence: Evidence) -> Iterator[Sighting]:
    for track in _usable(evidence):
        ppm = _drift_ppm(_minima(track))
        if ppm is not None and abs(ppm) >= _LEAST_DRIFT_PPM:
            way = "slow" if ppm > 0 else "fast"
            yield _whole(f"{track.sender}: the sender's clock is {abs(ppm) / 1e4:.2f} % too {way}", track)


def _grows_later(evidence: Evidence) -> Iterator[Sighting]:
    for track in _usable(evidence):
        minima = _minima(track)
        ppm = _drift_ppm(minima)
        lag = minima.lag_ms - (0.0 if ppm is None else ppm * 1e-3 * minima.time_s)
        if len(lag) < 2 * _STEADY_WINDOWS:
            continue
        windows = np.lib.stride_tricks.sliding_window_view(lag, _STEADY_WINDOWS)
        before, after = windows[:-_STEADY_WINDOWS], windows[_STEADY_WINDOWS:]
        on_one_clock = minima.segment[: len(before)] == minima.segment[len(minima.segment) - len(before) :]
        rise = np.where(on_one_clock, after.min(axis=1) - before.max(axis=1), 0.0)
        best = int(np.argmax(rise))
        if rise[best] > _LEAST_STEP_MS:
            number = int(minima.first[best + _STEADY_WINDOWS])
            by = float(np.median(after[best]) - np.median(before[best]))
            yield Sighting(
                f"{track.sender}: from {at(int(track.arrival_us[number]))} on messages come {by:.0f} ms later by their "
                "stamps than before, and this stays: the sender's clock was set back, or something delays them",
                [int(track.numbers[number])],
                int(track.arrival_us[number]),
                int(track.arrival_us[-1]),
            )


def _lateness_ms(track: Track) -> Floats:
    """Return how much later messages are than the quickest around them."""
    minima = _minima(track)
    least = minima.lag_ms.copy()
    same = minima.segment[1:] == minima.segment[:-1]
    least[1:] = np.where(same, np.minimum(least[1:], minima.lag_ms[:-1]), least[1:])
    least[:-1] = np.where(same, np.minimum(least[:-1], minima.lag_ms[1:]), least[:-1])
    window = np.searchsorted(minima.first, np.arange(len(track)), side="right") - 1
    return np.asarray(lag_ms(track) - least[window], dtype=np.float64)


def _horizon_ms(evidence: Evidence) -> float:
    """Return how late a message may be before the filter takes it for younger than it is."""
    delay = min(max(evidence.param("VISO_DELAY_MS"), 0.0), 250.0)
    longest = max(60.0, evidence.param("EK3_HGT_DELAY"), delay)
    steps = int(longest // _FILTER_STEP_MS)
    return max(steps * 12.5 - delay - 6.0, 0.0)


def _late(evidence: Evidence) -> Iterator[Sighting]:
    allowed = _horizon_ms(evidence) + _MARGIN_MS
    for track in _usable(evidence):
        lateness = _lateness_ms(track)
        late = np.flatnonzero(lateness > allowed)
        if len(late) > max(2, 0.02 * len(track)):
            middle, most = np.quantile(lateness, [0.5, 0.99])
            yield Sighting(
                f"{track.sender}: {share(len(late), len(track))} messages come more than {allowed:.0f} ms later than "
                f"the quickest (median {middle:.0f} ms, one in a hundred {most:.0f} ms or more)",
                track.numbers[late].tolist(),
                int(track.arrival_us[late[0]]),
                int(track.arrival_us[late[-1]]),
            )


def _beyond_limit(evidence: Evidence) -> Iterator[Sighting]:
    for track in _usable(evidence):
        late = np.flatnonzero(_lateness_ms(track) > _MAX_LAG_MS)
        if len(late):
            yield Sighting(
                f"{track.sender}: {share(len(late), len(track))} messages come more than 500 ms late, the first at "
                f"{at(int(track.arrival_us[late[0]]))}",
                track.numbers[late].tolist(),
                int(track.arrival_us[late[0]]),
                int(track.arrival_us[late[-1]]),
            )


def _bursts(evidence: Evidence) -> Iterator[Sighting]:
    for track in _usable(evidence):
        breaks = np.flatnonzero(np.diff(track.arrival_us) > _BURST_US) + 1
        groups = np.split(np.arange(len(track)), breaks)
        bursts = [
            group for group in groups if len(group) >= _BURST_SIZE and np.ptp(track.stamp_us[group]) > _BURST_SPREAD_US
        ]
        if len(bursts) < 2:
            continue
        members = np.concatenate(bursts)
        if len(members) > 0.05 * len(track):
            largest = max(map(len, bursts))
            yield Sighting(
                f"{track.sender}: {len(bursts)} bursts of {_BURST_SIZE} to {largest} messages that were stamped more "
                f"than {_BURST_SPREAD_US // 1000} ms apart, {share(len(members), len(track))} of all",
                track.numbers[members].tolist(),
                int(track.arrival_us[members[0]]),
                int(track.arrival_us[members[-1]]),
            )


def _two_clocks(evidence: Evidence) -> Iterator[Sighting]:
    tracks = [track for track in evidence.tracks if len(track) >= FEWEST]
    offsets = [int(np.median(track.arrival_us - track.stamp_us)) - track.first_stamp for track in tracks]
    for index in range(1, len(tracks)):
        one, other = tracks[0], tracks[index]
        apart_us = abs(offsets[index] - offsets[0])
        together = one.arrival_us[0] < other.arrival_us[-1] and other.arrival_us[0] < one.arrival_us[-1]
        if together and apart_us > _MAX_LAG_MS * 1000:
            yield _whole(f"the clocks of {one.sender} and {other.sender} are {apart_us * 1e-6:.1f} s apart", other)


def _delay(evidence: Evidence) -> Iterator[Sighting]:
    setting = min(max(evidence.param("VISO_DELAY_MS"), 0.0), 250.0)
    for compared in evidence.comparisons:
        delay, arrival = compared.delay, compared.since_arrival
        if not delay.enough_motion or not arrival.enough_motion:
            continue
        # What a port's rate says that bytes take may be true or not: the truth lies between the two.
        tolerance = _DELAY_TOLERANCE_MS + 3 * delay.sigma_ms
        if delay.delay_ms - tolerance <= setting <= max(delay.delay_ms, arrival.delay_ms) + tolerance:
            continue
        track = compared.poses.track
        value = delay.viso_delay_ms
        yield _whole(
            f"{track.sender}: against the vehicle's own attitude, poses are {delay.delay_ms:.0f} +- "
            f"{delay.sigma_ms:.1f} ms older than their corrected stamps, {arrival.delay_ms:.0f} ms when they arrive "
            f"(correlation {delay.correlation:.2f}); VISO_DELAY_MS is {setting:.0f}",
            track,
            f"Set VISO_DELAY_MS to {value}, and reboot." if value else "Set VISO_DELAY_MS to 0, and reboot.",
        )


RULES: Final = (
    Rule(
        "XN3-01",
        Severity.ERROR,
        "Stamps do not advance",
        "The corrector ties the stamp to the time of arrival and lets it lag by 500 ms at most: after half a second "
        "every sample counts as 500 ms old.",
        _CORRECTION,
        "Put the time of the measurement in us into usec or time_usec, of a clock that runs steadily; its epoch does "
        "not matter.",
        _constant,
    ),
    Rule(
        "XN3-02",
        Severity.ERROR,
        "Stamps are not in microseconds",
        "Only differences of stamps count, and they are taken for us: stamps that advance too slowly end up 500 ms "
        "old, stamps that advance too fast lose all meaning and count as the time of arrival.",
        _CORRECTION,
        "The field is in us.",
        _wrong_unit,
    ),
    Rule(
        "XN3-03",
        Severity.WARNING,
        "Stamps step back",
        "Samples behind the step count as older than they are, by the step but 500 ms at most, until a window of 100 "
        "samples has passed that lies wholly behind it.",
        _CORRECTION,
        "Stamp with a monotonic clock, not with one that NTP or GPS sets.",
        _steps_back,
    ),
    Rule(
        "XN3-04",
        Severity.NOTE,
        "Stamps leap ahead",
        "The corrector follows at once: the first message behind the leap counts as just measured, and all later ones "
        "relative to it.",
        _CORRECTION,
        "Stamp with a monotonic clock, not with one that NTP or GPS sets.",
        _steps_forward,
    ),
    Rule(
        "XN3-05",
        Severity.WARNING,
        "The clocks drift apart",
        "A fast clock is followed at once, a slow one only every 100 samples; until then samples count as older than "
        "they are.",
        _CORRECTION,
        "A quartz is good to 0.01 %: look how the stamps are made, for instance from a frame count and a nominal rate.",
        _drift,
    ),
    Rule(
        "XN3-06",
        Severity.WARNING,
        "Messages come late",
        "The filter keeps little more than its horizon of inertial data: a sample from before that is not dropped but "
        "counts as just that old, and pulls the estimate back in time.",
        "AP_NavEKF3_Measurements.cpp, NavEKF3_core::writeExtNavData",
        "Send each message as soon as it is made, from a thread of its own; raise the baud rate. If all are late by "
        "the same time, raise VISO_DELAY_MS, which lengthens the horizon at the next boot.",
        _late,
    ),
    Rule(
        "XN3-07",
        Severity.WARNING,
        "Messages come more than half a second late",
        "The corrector lets a sample lag by 500 ms at most: these count as younger than they are, and shift the time "
        "of the next ones.",
        _CORRECTION,
        "Drop measurements that have waited too long; do not send what has piled up.",
        _beyond_limit,
    ),
    Rule(
        "XN3-08",
        Severity.WARNING,
        "Messages come in bursts",
        "Each keeps the time of its stamp, but of those that come due in one step of the filter only the last is used, "
        "and its buffer holds some five.",
        "EKF_Buffer.cpp, ekf_ring_buffer::recall",
        "Flush the port after each message; look for buffering in a bridge, a USB adapter or a Wi-Fi link.",
        _bursts,
    ),
    Rule(
        "XN3-09",
        Severity.ERROR,
        "Two clocks on one link",
        "A link has one time corrector: it follows the clock that is ahead, and the samples of the other count as "
        "500 ms old.",
        "GCS_Common.cpp, GCS_MAVLINK::correct_offboard_timestamp_usec_to_ms",
        "Stamp all messages of a link with one clock.",
        _two_clocks,
    ),
    Rule(
        "XN3-10",
        Severity.WARNING,
        "Messages come later than they did",
        "What was in time for the corrector's window of 100 samples now counts as older, by as much as the step, for "
        "up to 200 samples; then the new lag is taken for none.",
        _CORRECTION,
        "Stamp with a monotonic clock; look for a queue that fills up between camera and autopilot.",
        _grows_later,
    ),
    Rule(
        "XN3-11",
        Severity.WARNING,
        "VISO_DELAY_MS does not fit",
        "The filter takes samples for younger or older than they are: in motion it pulls the estimate back or ahead.",
        "AP_NavEKF3_Measurements.cpp, NavEKF3_core::writeExtNavData",
        "Set VISO_DELAY_MS to the measured delay.",
        _delay,
    ),
)
