# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""XN3: stamps, and the clock that makes them."""

from collections.abc import Iterator
from typing import Final

import numpy as np

from viso.doctor.checks import limits
from viso.doctor.checks.check import Severity, Sighting, check
from viso.doctor.checks.phrases import at, how_often
from viso.doctor.evidence.evidence import Evidence
from viso.doctor.evidence.lags import LEAST_JUMP_MS, STEP_BACK_US, drift_ppm, minima_of, net_drift_ppm, usable_tracks
from viso.doctor.evidence.sender_clock import (
    FEWEST_MESSAGES,
    Departure,
    SenderClock,
    are_us,
    is_constant,
    lag_ms,
    sender_clock,
    stamp_rate,
)
from viso.doctor.evidence.tracks import Track
from viso.streams.stream_kinds import Aspect

CORRECTION: Final = "AP_RTC/JitterCorrection.cpp, JitterCorrection::correct_offboard_timestamp_usec"
_UNITS: Final = (
    ("s", 1e-6, "seconds", "multiply them by 1000000"),
    ("ms", 1e-3, "milliseconds", "multiply them by 1000"),
    ("ns", 1e3, "nanoseconds", "divide them by 1000"),
)


@check(
    code="XN3-01",
    severity=Severity.ERROR,
    title="Stamps do not advance",
    firmware=(
        "The corrector compares stamps with times of arrival, and allows a lag of at most 500 ms. After half a second "
        "every sample counts as 500 ms old."
    ),
    source=CORRECTION,
    fix=(
        "Put the time of the measurement, in us, into usec or time_usec. Use a clock that runs steadily; its epoch "
        "does not matter."
    ),
)
def constant_stamps(evidence: Evidence) -> Iterator[Sighting]:
    for track in evidence.stream.tracks:
        if is_constant(track):
            value = int(track.first_stamp + np.median(track.stamp_us))
            yield Sighting.in_track(f"{track.sender}: the stamp is always {value}", track)
            continue
        if not are_us(track):
            continue
        runs = np.split(np.arange(len(track)), np.flatnonzero(np.diff(track.stamp_us) != 0) + 1)
        longest = max(runs, key=len, default=np.arange(0))
        if len(longest) >= FEWEST_MESSAGES:
            value, start = int(track.first_stamp + track.stamp_us[longest[0]]), at(track.arrival_us[longest[0]])
            text = f"the stamp stays at {value} for {len(longest)} messages, from {start} on"
            yield Sighting.in_track(f"{track.sender}: {text}", track, longest)


@check(
    code="XN3-02",
    severity=Severity.ERROR,
    title="Stamps are not in microseconds",
    firmware=(
        "Only differences of stamps count, and they are read as us. With stamps that advance too slowly, samples count "
        "as 500 ms old. With stamps that advance too fast, each sample counts as measured on arrival."
    ),
    source=CORRECTION,
    fix="Send the stamp in us.",
)
def stamp_unit(evidence: Evidence) -> Iterator[Sighting]:
    for track in evidence.stream.tracks:
        for unit, factor, name, cure in _UNITS:
            if _counts_unit(track, factor):
                advance = int(track.stamp_us[-1] - track.stamp_us[0])
                if Aspect.ARRIVAL in evidence.stream.lacks:
                    yield _wrong_unit_of_file(track, advance, factor)
                    continue
                text = f"{track.sender}: in {track.span_s:.1f} s the stamps advance by {advance}: they count {name}"
                yield Sighting.in_track(text, track, fix=f"The field is in us; your stamps are {unit}: {cure}.")


def _counts_unit(track: Track, factor: float) -> bool:
    """Return whether stamps count a unit of which ``factor`` make a us."""
    if is_constant(track) or are_us(track):
        return False
    low, high = limits.UNIT_WITHIN
    # Whole seconds show over half of the track alone.
    rates = [rate for rate in (stamp_rate(track), stamp_rate(track, parts=2)) if rate is not None]
    return any(low < rate / factor < high for rate in rates)


def _wrong_unit_of_file(track: Track, advance_us: int, factor: float) -> Sighting:
    """Return the sighting for a file without times of arrival, whose own times look unlikely."""
    period_s = advance_us * 1e-6 / (len(track) - 1)
    cure = f"Divide them by {factor:g}" if factor > 1 else f"Multiply them by {1 / factor:g}"
    return Sighting.in_track(
        f"{track.sender}: by the file's times there is a pose every {period_s:.3g} s; no camera is that "
        f"{'slow' if factor > 1 else 'quick'}: they count another unit than the format has",
        track,
        fix=f"{cure}: TUM's are in s, EuRoC's in ns.",
    )


@check(
    code="XN3-03",
    severity=Severity.WARNING,
    title="Stamps step back",
    firmware=(
        "Samples after the step count as older than they are, by the step but at most 500 ms. This ends with the first "
        "window of 100 samples that lies wholly after the step."
    ),
    source=CORRECTION,
    fix="Stamp with a monotonic clock, not with one that NTP or GPS sets.",
)
def stamps_step_back(evidence: Evidence) -> Iterator[Sighting]:
    for track in usable_tracks(evidence):
        step = np.diff(track.stamp_us)
        in_order = np.diff(track.sequence) % 256 < 192
        back = np.flatnonzero((step < -STEP_BACK_US) & in_order)
        if len(back):
            largest = int(-step[back].min())
            yield Sighting.in_track(
                f"{track.sender}: stamps step back {how_often(len(back))}, by up to {largest / 1000:.0f} ms, the first "
                f"time at {at(track.arrival_us[back[0] + 1])}",
                track,
                back + 1,
            )


@check(
    code="XN3-04",
    severity=Severity.NOTE,
    title="Stamps jump ahead",
    firmware=(
        "The corrector follows at once: the first message after the jump counts as just measured, and all later ones "
        "relative to it."
    ),
    source=CORRECTION,
    fix="Stamp with a monotonic clock, not with one that NTP or GPS sets.",
    needs={Aspect.ARRIVAL},
)
def stamps_jump_ahead(evidence: Evidence) -> Iterator[Sighting]:
    for track in usable_tracks(evidence):
        lag = lag_ms(track)
        least = np.minimum.accumulate(lag)
        ahead = np.flatnonzero(least[:-1] - lag[1:] > LEAST_JUMP_MS)
        if len(ahead):
            by = float((least[:-1] - lag[1:])[ahead].max())
            first = at(track.arrival_us[ahead[0] + 1])
            yield Sighting.in_track(f"{track.sender}: stamps jump ahead by {by:.0f} ms at {first}", track, ahead + 1)


@check(
    code="XN3-05",
    severity=Severity.WARNING,
    title="The clocks drift apart",
    firmware=(
        "A fast clock is followed at once, a slow one only every 100 samples; until then samples count as older than "
        "they are."
    ),
    source=CORRECTION,
    fix=(
        "A quartz clock is accurate to 0.01 %. Check how the stamps are made: perhaps from a frame count and a nominal "
        "rate."
    ),
    needs={Aspect.ARRIVAL},
)
def clock_drift(evidence: Evidence) -> Iterator[Sighting]:
    for track in usable_tracks(evidence):
        minima = minima_of(track)
        steady_ppm = drift_ppm(minima)
        ppm = net_drift_ppm(minima) if steady_ppm is None else steady_ppm
        if ppm is not None and abs(ppm) >= limits.LEAST_DRIFT_PPM:
            speed, how = "slow" if ppm > 0 else "fast", "" if steady_ppm is not None else " in all, not steadily"
            text = f"the sender's clock is {abs(ppm) / 1e4:.2f} % too {speed}{how}, over {track.span_s:.0f} s"
            yield Sighting.in_track(f"{track.sender}: {text}", track)


@check(
    code="XN3-09",
    severity=Severity.ERROR,
    title="Two clocks on one link",
    firmware=(
        "A link has one time corrector: it follows the clock that is ahead, and the samples of the other count as 500 "
        "ms old."
    ),
    source="GCS_Common.cpp, GCS_MAVLINK::correct_offboard_timestamp_usec_to_ms",
    fix="Stamp all messages of a link with one clock.",
    needs={Aspect.LINK},
)
def two_clocks(evidence: Evidence) -> Iterator[Sighting]:
    tracks = [
        track for track in evidence.stream.tracks if len(track) >= FEWEST_MESSAGES and sender_clock(track) is None
    ]
    offsets = [int(np.median(track.arrival_us - track.stamp_us)) - track.first_stamp for track in tracks]
    for index in range(1, len(tracks)):
        earlier, other = tracks[0], tracks[index]
        apart_us = abs(offsets[index] - offsets[0])
        together = earlier.arrival_us[0] < other.arrival_us[-1] and other.arrival_us[0] < earlier.arrival_us[-1]
        if together and apart_us > limits.CLOCKS_APART_US:
            yield Sighting.in_track(
                f"the clocks of {earlier.sender} and {other.sender} are {apart_us * 1e-6:.1f} s apart", other
            )


@check(
    code="XN3-12",
    severity=Severity.ERROR,
    title="The sender's clock runs at another rate than the autopilot's",
    firmware=(
        "Only differences of stamps count. A fast clock is followed at once: each sample counts as just measured, "
        "whatever its stamp. With a slow clock samples count as older and older, by up to 500 ms. This starts again "
        "after each 100 samples."
    ),
    source=CORRECTION,
    fix="Stamp in us, with a monotonic clock that is read when the measurement is made.",
    needs={Aspect.ARRIVAL},
)
def clock_rate(evidence: Evidence) -> Iterator[Sighting]:
    reported = set()
    for track in evidence.stream.tracks:
        clock, whose = sender_clock(track), (track.sender.system_id, track.sender.component_id)
        if clock is None or is_constant(track) or any(_counts_unit(track, factor) for _, factor, _, _ in _UNITS):
            continue
        if (whose, clock.departure) in reported:
            continue
        reported.add((whose, clock.departure))
        cause, fix = _cause_and_fix(clock, is_simulated=evidence.vehicle.is_simulated)
        advance_s = float(track.stamp_us[-1]) * 1e-6
        is_gross = clock.worst >= limits.CLOCK_FAR_OFF or clock.departure is Departure.ALTERNATING
        ratio = advance_s / track.span_s
        much = f", {ratio:.3f} times as much"
        if ratio >= limits.CLOCK_TIMES_TOO_FAST:
            much += f": the sender's clock runs {ratio:.0f} times too fast"
        yield Sighting.in_track(
            f"{track.sender}: in {track.span_s:.1f} s of the autopilot's clock stamps advance by {advance_s:.1f} s"
            f"{much}{cause}",
            track,
            fix=fix,
            severity=None if is_gross else Severity.WARNING,
        )


def _cause_and_fix(clock: SenderClock, *, is_simulated: bool) -> tuple[str, str | None]:
    """Return the likely cause of a clock's departure, and what to do if the check's advice does not fit."""
    if clock.departure is Departure.ALTERNATING:
        apart = f"{clock.step_s:.3g} s apart, with {clock.steps} steps back and forth"
        return (
            f": they come from two clocks in turn, {apart}",
            "Stamp all messages with one clock; look for a second thread.",
        )
    if clock.departure is Departure.STEPS:
        text = f": the clock is set {clock.steps} times, by {clock.step_s:.3g} s in the middle"
        return text, "Stamp with a monotonic clock, not with one that NTP, PTP or GPS sets."
    by_simulation = (
        "Stamp with the simulation's clock (ROS: use_sim_time, or the stamp of the picture), or let it run in real "
        "time; without a simulation, with a monotonic clock that nobody sets."
    )
    if clock.departure is Departure.CHANGING:
        stretches = f"{clock.slowest:.3g} to {clock.quickest:.3g} times in stretches of it"
        return f", {stretches}: as a wall clock does beside a simulation whose speed changes", by_simulation
    if not is_simulated:
        return ", all along: as frames counted at a nominal rate do, or a wall clock beside a slowed simulation", None
    slowed = f"runs at {1 / clock.factor:.2g} times real time" if clock.factor > 0 else "is slowed"
    return f", all along: as a wall clock does beside a simulation that {slowed}", by_simulation
