# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""XN3: how late messages come."""

from collections.abc import Iterator
from typing import Final

import numpy as np

from viso.doctor.checks import limits
from viso.doctor.checks.check import Severity, Sighting, check
from viso.doctor.checks.clocks import CORRECTION
from viso.doctor.checks.phrases import at, share
from viso.doctor.evidence.compare import Comparison
from viso.doctor.evidence.evidence import Evidence
from viso.doctor.evidence.lags import LEAST_STEP_MS, STEADY_WINDOWS, drift_ppm, lateness_ms, minima_of, usable_tracks
from viso.doctor.evidence.own_filter import Witness
from viso.doctor.evidence.sender_clock import sender_clock
from viso.streams.stream_kinds import Aspect

_FILTER_STEP_MS: Final = 12
_STAMPS: Final = "docs/stamps.md says which time to stamp."


@check(
    code="XN3-10",
    severity=Severity.WARNING,
    title="Messages come later than before",
    firmware=(
        "What was in time for the corrector's window of 100 samples now counts as older, by as much as the step, for "
        "up to 200 samples; then the new lag counts as none."
    ),
    source=CORRECTION,
    fix="Stamp with a monotonic clock; look for a queue that fills up between camera and autopilot.",
    needs={Aspect.ARRIVAL},
)
def later_than_before(evidence: Evidence) -> Iterator[Sighting]:
    for track in usable_tracks(evidence):
        minima = minima_of(track)
        ppm = drift_ppm(minima)
        lag = minima.lag_ms - (0.0 if ppm is None else ppm * 1e-3 * minima.time_s)
        if len(lag) < 2 * STEADY_WINDOWS:
            continue
        windows = np.lib.stride_tricks.sliding_window_view(lag, STEADY_WINDOWS)
        before, after = windows[:-STEADY_WINDOWS], windows[STEADY_WINDOWS:]
        on_one_clock = minima.segment[: len(before)] == minima.segment[len(minima.segment) - len(before) :]
        rise = np.where(on_one_clock, after.min(axis=1) - before.max(axis=1), 0.0)
        best = int(np.argmax(rise))
        if rise[best] > LEAST_STEP_MS:
            number = int(minima.first[best + STEADY_WINDOWS])
            by = float(np.median(after[best]) - np.median(before[best]))
            yield Sighting(
                f"{track.sender}: from {at(int(track.arrival_us[number]))} on messages come {by:.0f} ms later by their "
                "stamps than before, and this stays: the sender's clock was set back, or something delays them",
                [int(track.numbers[number])],
                int(track.arrival_us[number]),
                int(track.arrival_us[-1]),
            )


def _horizon_ms(evidence: Evidence) -> float:
    """Return how late a message may be before its sample lies behind the filter's horizon."""
    delay = float(np.clip(evidence.param("VISO_DELAY_MS"), *limits.VISO_DELAY_RANGE_MS))
    longest = max(60.0, evidence.param("EK3_HGT_DELAY"), delay)
    steps = int(longest // _FILTER_STEP_MS)
    return max(steps * 12.5 - delay - 6.0, 0.0)


@check(
    code="XN3-06",
    severity=Severity.WARNING,
    title="Messages come late",
    firmware=(
        "The filter keeps inertial data for little more than its horizon. An older sample is not dropped: it counts as "
        "just as old as these data, and pulls the estimate back in time."
    ),
    source="AP_NavEKF3_Measurements.cpp, NavEKF3_core::writeExtNavData",
    fix=(
        "Send each message as soon as it is made, from its own thread; raise the baud rate. If all are late by the "
        "same time, raise VISO_DELAY_MS, which lengthens the horizon at the next boot."
    ),
    needs={Aspect.ARRIVAL},
)
def late_messages(evidence: Evidence) -> Iterator[Sighting]:
    allowed = _horizon_ms(evidence) + limits.LATE_MARGIN_MS
    for track in usable_tracks(evidence):
        lateness = lateness_ms(track)
        late = np.flatnonzero(lateness > allowed)
        if len(late) > max(2, limits.LATE_SHARE * len(track)):
            middle, most = np.quantile(lateness, [0.5, 0.99])
            yield Sighting.in_track(
                f"{track.sender}: {share(len(late), len(track))} messages come more than {allowed:.0f} ms later than "
                f"the quickest around them (median {middle:.0f} ms, one in a hundred {most:.0f} ms or more)",
                track,
                late,
            )


@check(
    code="XN3-07",
    severity=Severity.WARNING,
    title="Messages come more than half a second late",
    firmware=(
        "The corrector allows a lag of at most 500 ms. These samples count as younger than they are, and shift the "
        "time of the next ones."
    ),
    source=CORRECTION,
    fix="Drop measurements that have waited too long; do not send a backlog.",
    needs={Aspect.ARRIVAL},
)
def half_a_second_late(evidence: Evidence) -> Iterator[Sighting]:
    for track in usable_tracks(evidence):
        late = np.flatnonzero(lateness_ms(track) > limits.MOST_LAG_MS)
        if len(late):
            text = f"messages come more than 500 ms late, the first at {at(track.arrival_us[late[0]])}"
            yield Sighting.in_track(f"{track.sender}: {share(len(late), len(track))} {text}", track, late)


@check(
    code="XN3-08",
    severity=Severity.WARNING,
    title="Messages come in bursts",
    firmware=(
        "Each sample keeps the time of its stamp. Of those that fall due in one step of the filter only the last is "
        "used, and the buffer holds about five."
    ),
    source="EKF_Buffer.cpp, ekf_ring_buffer::recall",
    fix="Flush the port after each message; look for buffering in a bridge, a USB adapter or a Wi-Fi link.",
    needs={Aspect.ARRIVAL},
)
def bursts(evidence: Evidence) -> Iterator[Sighting]:
    for track in usable_tracks(evidence):
        breaks = np.flatnonzero(np.diff(track.arrival_us) > limits.BURST_GAP_US) + 1
        groups = np.split(np.arange(len(track)), breaks)
        bursts = [
            group
            for group in groups
            if len(group) >= limits.FEWEST_IN_BURST and np.ptp(track.stamp_us[group]) > limits.BURST_SPREAD_US
        ]
        if len(bursts) < 2:
            continue
        members = np.concatenate(bursts)
        if len(members) > limits.BURST_SHARE * len(track):
            largest = max(map(len, bursts))
            yield Sighting.in_track(
                f"{track.sender}: {len(bursts)} bursts of {limits.FEWEST_IN_BURST} to {largest} messages that were "
                f"stamped more than {limits.BURST_SPREAD_US // 1000} ms apart, {share(len(members), len(track))} of "
                "all",
                track,
                members,
            )


@check(
    code="XN3-11",
    severity=Severity.WARNING,
    title="VISO_DELAY_MS does not fit",
    firmware=(
        "The filter treats samples as younger or older than they are. In motion that pulls the estimate back or ahead."
    ),
    source="AP_NavEKF3_Measurements.cpp, NavEKF3_core::writeExtNavData",
    fix=f"Set VISO_DELAY_MS to the measured delay. {_STAMPS}",
    witness=Witness.LOG,
    needs={Aspect.ARRIVAL},
)
def viso_delay(evidence: Evidence) -> Iterator[Sighting]:
    setting = float(np.clip(evidence.param("VISO_DELAY_MS"), *limits.VISO_DELAY_RANGE_MS))
    for compared in evidence.comparisons:
        delay, arrival = compared.delay, compared.since_arrival
        if not delay.enough_motion or not arrival.enough_motion or sender_clock(compared.poses.track) is not None:
            continue
        if compared.growth is not None:  # XN3-13
            continue
        # What a port's rate says that bytes take may be true or not: the truth lies between the two.
        tolerance = limits.DELAY_TOLERANCE_MS + 3 * delay.sigma_ms
        if delay.delay_ms - tolerance <= setting <= max(delay.delay_ms, arrival.delay_ms) + tolerance:
            continue
        track = compared.poses.track
        yield Sighting.in_track(
            f"{track.sender}: against the vehicle's own attitude, poses are {_fitting_ms(compared)} ms old when the "
            f"filter uses them ({delay.delay_ms:.0f} +- {delay.sigma_ms:.1f} ms since their corrected stamps, "
            f"{arrival.delay_ms:.0f} ms since they arrived; correlation {delay.correlation:.2f}); VISO_DELAY_MS is "
            f"{setting:.0f}",
            track,
            fix=_advice(compared),
        )


@check(
    code="XN3-13",
    severity=Severity.ERROR,
    title="Poses grow older and older",
    firmware=(
        "The autopilot subtracts VISO_DELAY_MS alone from the stamps. Poses that are older than that pull the estimate "
        "back in time, more and more; the vehicle swings, then flies away."
    ),
    source="AP_NavEKF3_Measurements.cpp, NavEKF3_core::writeExtNavData",
    fix=(
        "Look for a queue that fills because pictures or messages come faster than they are worked off: keep the "
        f"newest alone, lower the rate of the camera, and stamp with the time of the picture. {_STAMPS}"
    ),
    witness=Witness.LOG,
    needs={Aspect.ARRIVAL},
)
def growing_delay(evidence: Evidence) -> Iterator[Sighting]:
    for compared in evidence.comparisons:
        growth, track = compared.growth, compared.poses.track
        if growth is None or sender_clock(track) is not None:
            continue
        since = track.arrival_us >= growth.from_s * 1e6
        yield Sighting.in_track(
            f"{track.sender}: against the vehicle's own turns, poses are {growth.first_ms:.0f} ms old when they arrive "
            f"at first, and {growth.last_ms:.0f} ms in the end: from {at(int(growth.from_s * 1e6))} on the delay grows "
            f"by {growth.ms_a_second:.0f} ms a second",
            track,
            since,
        )


def _fitting_ms(compared: Comparison) -> int:
    """Return the value of VISO_DELAY_MS that fits.

    Corrected stamps are those of the quickest messages; what others lag is less than a step of the filter, or jitter.
    """
    since_stamp, since_arrival = compared.delay.viso_delay_ms or 0, compared.since_arrival.viso_delay_ms or 0
    return min(since_arrival, since_stamp + _FILTER_STEP_MS)


def _advice(compared: Comparison) -> str:
    since_stamp, since_arrival = compared.delay.viso_delay_ms or 0, compared.since_arrival.viso_delay_ms or 0
    if compared.transport_ms > limits.SAME_DELAY_MS:
        return (
            f"Set VISO_DELAY_MS to {since_arrival} if the link is USB, a network or a simulation, to {since_stamp} if "
            f"it is a wire as slow as its baud rate, for whose {compared.transport_ms:.0f} ms the autopilot allows by "
            f"itself. Then reboot. {_STAMPS}"
        )
    return f"Set VISO_DELAY_MS to {_fitting_ms(compared)}, and reboot. {_STAMPS}"
