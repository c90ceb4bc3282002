# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""XN4: how often messages come, and how often the filter takes one."""

import itertools
from collections.abc import Iterator
from typing import Final

import numpy as np

from ekf_stub.ahrs.sources import EXTNAV
from ekf_stub.inputs.ingest_rules import TOO_SOON
from viso.doctor.checks import limits
from viso.doctor.checks.check import Severity, Sighting, check
from viso.doctor.checks.phrases import at, per_second, share
from viso.doctor.evidence.evidence import Evidence
from viso.doctor.evidence.sender_clock import FEWEST_MESSAGES, sender_clock
from viso.doctor.evidence.tracks import HandledMessage, Track
from viso.estimators.series import overlap_s

_HEALTH: Final = "AP_VisualOdom_Backend.cpp, AP_VisualOdom_Backend::healthy"
_INGEST: Final = "AP_NavEKF3_Measurements.cpp, NavEKF3_core::writeExtNavData"
_SECOND_US: Final = 1_000_000


def _taken(evidence: Evidence) -> list[HandledMessage]:
    return [message for message in evidence.stream.vision if message.is_taken]


def _gaps(evidence: Evidence) -> list[tuple[HandledMessage, HandledMessage, int]]:
    """Return neighbours so far apart that the sensor was unhealthy between them, and their distance in us.

    A stream may stop after the last disarming.
    """
    own = evidence.vehicle.own_filter
    over_us = 1e6 * own.armed[-1][1] if own is not None and own.armed else np.inf
    pairs = itertools.pairwise(_taken(evidence))
    lengths = ((a, b, b.arrival_us - a.arrival_us) for a, b in pairs)
    return [(a, b, length) for a, b, length in lengths if length >= limits.HEALTHY_US and a.arrival_us < over_us]


def _slow_us(evidence: Evidence) -> float:
    """Return the median time between messages if they are too few; else 0."""
    taken = _taken(evidence)
    interval = (
        float(np.median(np.diff([message.arrival_us for message in taken]))) if len(taken) >= FEWEST_MESSAGES else 0.0
    )
    return interval if interval >= limits.SLOW_PERIOD_US else 0.0


@check(
    code="XN4-01",
    severity=Severity.ERROR,
    title="Too few messages",
    firmware=(
        "The sensor is healthy for 300 ms after a message; at less than 4 per second, each message that is a little "
        "late makes it unhealthy. With the vision check on, arming then fails with VisOdom: not healthy, and the "
        "filter has little to correct itself with."
    ),
    source=_HEALTH,
    fix="Send 10 to 40 messages per second.",
)
def too_few_messages(evidence: Evidence) -> Iterator[Sighting]:
    if interval := _slow_us(evidence):
        taken = _taken(evidence)
        text = f"{per_second([message.arrival_us for message in taken])}, {interval / 1000:.0f} ms apart"
        yield Sighting.in_messages(text, taken)


def _silence_at_end(evidence: Evidence, least_us: int, most_us: int) -> Iterator[Sighting]:
    """Yield the time without messages before the recording's end, unless it begins after the last disarming."""
    taken, own = _taken(evidence), evidence.vehicle.own_filter
    if not taken:
        return
    last_us, end_us = taken[-1].arrival_us, evidence.until_us
    armed = None if own is None else own.armed
    is_over = armed is not None and len(armed) > 0 and last_us >= 1e6 * armed[-1][1]
    if not least_us <= end_us - last_us < most_us or is_over:
        return
    steps = [("the sensor is unhealthy", limits.HEALTHY_US)]
    if evidence.source("POSXY") == EXTNAV:
        steps += [("position times out", limits.POSITION_LOST_US), ("aiding stops", limits.AIDING_STOPS_US)]
    if evidence.source("POSZ") == EXTNAV:
        steps.insert(1, ("height comes from the barometer", limits.FRESH_US))
    due = ", ".join(
        f"{what} from {at(last_us + after_us)} on" for what, after_us in steps if last_us + after_us < end_us
    )
    silent_s = 1e-6 * (end_us - last_us)
    if armed is None:
        state, severity = "", Severity.WARNING
    elif (armed_s := overlap_s(armed, [(1e-6 * last_us, 1e-6 * end_us)])) > 0:
        state, severity = f", armed for {armed_s:.1f} s of that", None
    else:
        state, severity = ", disarmed", Severity.NOTE
    if end_us - last_us < limits.END_TOGETHER_US:
        severity = Severity.NOTE
    yield Sighting(
        f"the stream stopped: nothing came in the last {silent_s:.1f} s of the recording, from {at(last_us)} on{state}"
        f"; {due or 'it ends before that matters'}",
        [taken[-1].number],
        last_us,
        end_us,
        severity=severity,
    )


def _gaps_between(evidence: Evidence, least_us: int, most_us: int) -> Iterator[Sighting]:
    yield from _silence_at_end(evidence, least_us, most_us)
    gaps = [gap for gap in _gaps(evidence) if least_us <= gap[2] < most_us]
    if not gaps:
        return
    before, _, _ = gaps[0]
    longest = max(length for _, _, length in gaps)
    count = "a gap" if len(gaps) == 1 else f"{len(gaps)} gaps"
    yield Sighting(
        f"{count}, the longest of {longest / 1000:.0f} ms, the first from {at(before.arrival_us)} on",
        [after.number for _, after, _ in gaps],
        before.arrival_us,
        gaps[-1][1].arrival_us,
    )


@check(
    code="XN4-03",
    severity=Severity.WARNING,
    title="Gaps of more than 300 ms",
    firmware=(
        "The sensor counts as unhealthy until the next message: its bit in SYS_STATUS is cleared, and arming fails if "
        "the vision check is on."
    ),
    source=_HEALTH,
    fix=(
        "Look what stops the sender: a slow frame, a full link, a garbage collector. Keep sending, with quality -1, "
        "while tracking is lost."
    ),
)
def gaps_of_300_ms(evidence: Evidence) -> Iterator[Sighting]:
    if not _slow_us(evidence):
        yield from _gaps_between(evidence, limits.HEALTHY_US, limits.FRESH_US)


@check(
    code="XN4-04",
    severity=Severity.WARNING,
    title="Gaps of more than half a second",
    firmware=(
        "The sensor is unhealthy; with EK3_SRC1_POSZ 6 height falls back to the barometer after 500 ms, and is set to "
        "the first sample afterwards without a test."
    ),
    source="AP_NavEKF3_PosVelFusion.cpp, NavEKF3_core::selectHeightForFusion",
    fix="As for shorter gaps; with EK3_SRC1_POSZ 1 height does not depend on the camera.",
)
def gaps_of_half_a_second(evidence: Evidence) -> Iterator[Sighting]:
    if not _slow_us(evidence):
        yield from _gaps_between(evidence, limits.FRESH_US, limits.POSITION_LOST_US)


@check(
    code="XN4-05",
    severity=Severity.ERROR,
    title="Gaps of more than seven seconds",
    firmware=(
        "After 7 s without a position the filter gives up position (the vehicle's failsafe acts), after 15 s without "
        "anything it stops aiding."
    ),
    source="AP_NavEKF3_Control.cpp, NavEKF3_core::setAidingMode",
    fix="Find out what ended the stream. The sender must recover without help.",
)
def gaps_of_seven_seconds(evidence: Evidence) -> Iterator[Sighting]:
    yield from _gaps_between(evidence, limits.POSITION_LOST_US, 1 << 62)


def _samples(evidence: Evidence, kind: str) -> tuple[list[HandledMessage], list[HandledMessage]]:
    """Return the messages with samples of a kind, and those whose sample was refused because it came too soon."""
    offered, refused = [], []
    for message in evidence.stream.vision:
        of_kind = [sample for sample in message.samples if sample.kind == kind]
        if of_kind:
            offered.append(message)
        if any(test.outcome.rule is TOO_SOON for sample in of_kind for test in sample.outcomes):
            refused.append(message)
    return offered, refused


def _median_interval_us(track: Track) -> float:
    return float(np.median(np.diff(track.arrival_us))) if len(track) > 1 else np.inf


@check(
    code="XN4-02",
    severity=Severity.NOTE,
    title="More messages than the filter uses",
    firmware=(
        "Samples less than 20 ms after the one before, by their corrected times, are dropped: 50 per second is the "
        "most."
    ),
    source=_INGEST,
    fix="Send 30 to 50 messages per second; more only fills the link.",
)
def too_many_messages(evidence: Evidence) -> Iterator[Sighting]:
    for track in evidence.stream.tracks:
        interval = _median_interval_us(track)
        if len(track) < FEWEST_MESSAGES or not 0 < interval < limits.FAST_PERIOD_US:
            continue
        kind = "velocity" if track.sender.name == "VISION_SPEED_ESTIMATE" else "pose"
        offered, refused = _samples(evidence, kind)
        if refused:
            text = f"{track.sender}: {per_second(track.arrival_us)}; {share(len(refused), len(offered))}"
            yield Sighting(f"{text} {kind} samples were refused", [message.number for message in refused])


@check(
    code="XN4-06",
    severity=Severity.WARNING,
    title="Samples come in pairs",
    firmware=(
        "Samples less than 20 ms after the one before, by their corrected times, are dropped, whichever is better."
    ),
    source=_INGEST,
    fix="Space messages evenly, send each measurement in one message only, and keep the rate clear of 50 per second.",
)
def samples_in_pairs(evidence: Evidence) -> Iterator[Sighting]:
    fast = any(0 < _median_interval_us(track) < limits.FAST_PERIOD_US for track in evidence.stream.tracks)
    # By a clock that runs otherwise corrected times say nothing of how evenly messages come.
    odd = any(sender_clock(track) is not None for track in evidence.stream.tracks)
    for kind in () if fast or odd else ("pose", "velocity"):
        offered, refused = _samples(evidence, kind)
        if len(offered) >= FEWEST_MESSAGES and len(refused) > limits.TOO_SOON_SHARE * len(offered):
            text = f"{share(len(refused), len(offered))} {kind} samples came less than 20 ms after the one before"
            yield Sighting.in_messages(text, refused)


@check(
    code="XN4-07",
    severity=Severity.WARNING,
    title="Two messages carry the same measurement",
    firmware="Both count as samples of one sensor. Of two that are less than 20 ms apart, the second is dropped.",
    source=_INGEST,
    fix="Send either ODOMETRY, or VISION_POSITION_ESTIMATE with VISION_SPEED_ESTIMATE.",
)
def same_measurement_twice(evidence: Evidence) -> Iterator[Sighting]:
    for kind, tracks in (
        ("pose", [poses.track for poses in evidence.stream.poses]),
        ("velocity", [velocities.track for velocities in evidence.stream.velocities]),
    ):
        seconds = [set((track.arrival_us // _SECOND_US).tolist()) for track in tracks]
        for index in range(1, len(tracks)):
            both, shorter = seconds[0] & seconds[index], min(len(seconds[0]), len(seconds[index]))
            if len(both) > limits.TWICE_SHARE * shorter and len(both) >= limits.FEWEST_TWICE_S:
                one, other = tracks[0].sender, tracks[index].sender
                yield Sighting(f"{one} and {other} both carry the {kind}", tracks[index].numbers.tolist())


@check(
    code="XN4-08",
    severity=Severity.NOTE,
    title="Few messages",
    firmware="It works, but between samples the filter relies on inertial data alone.",
    source=_INGEST,
    fix="Send 10 to 40 messages per second if the source allows it.",
)
def few_messages(evidence: Evidence) -> Iterator[Sighting]:
    for track in evidence.stream.tracks:
        interval = _median_interval_us(track)
        if len(track) >= FEWEST_MESSAGES and limits.FEW_PERIOD_US < interval < limits.SLOW_PERIOD_US:
            yield Sighting(f"{track.sender}: {per_second(track.arrival_us)}", track.numbers.tolist())
